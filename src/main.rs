//! The `warpgait` program.

fn main() -> std::process::ExitCode {
    warpgait::program::built_from(option_env!("WARPGAIT_COMMIT"));
    warpgait::cli::run()
}
