//! The `warpgait` program.

fn main() -> std::process::ExitCode {
    warpgait::cli::run()
}
