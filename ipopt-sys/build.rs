//! Finds Ipopt and generates the bindings from its own header.

use std::env;
use std::path::{Path, PathBuf};
use std::process::exit;

mod bindings;

const HEADER: &str = "IpStdCInterface.h";

const HELP: &str = "\
warpgait needs Ipopt (3.11 or newer, below 4) with its C header, libclang and pkg-config.
  Debian and Ubuntu:  sudo apt install coinor-libipopt-dev libclang-dev pkg-config
  An Ipopt of your own: set IPOPT_INCLUDE_DIR (the folder with IpStdCInterface.h, or the one above it)
  and IPOPT_LIB_DIR (the folder with libipopt.so), both.";

/// Where Ipopt is.
struct Installation {
    header: PathBuf,
    library_dir: PathBuf,
    clang_args: Vec<String>,
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=bindings.rs");
    if let Err(reason) = run() {
        eprintln!("{reason}\n{HELP}");
        exit(1);
    }
}

fn run() -> Result<(), String> {
    let ipopt = match (variable("IPOPT_INCLUDE_DIR"), variable("IPOPT_LIB_DIR")) {
        (Some(include_dir), Some(library_dir)) => from_environment(&include_dir, library_dir)?,
        (None, None) => from_pkg_config()?,
        _ => return Err("Only one of IPOPT_INCLUDE_DIR and IPOPT_LIB_DIR is set.".into()),
    };
    println!("cargo::rerun-if-changed={}", ipopt.header.display());

    let source = bindings::generate(&ipopt.header, &ipopt.clang_args)
        .map_err(|error| format!("No bindings for {}: {error}.", ipopt.header.display()))?;
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set.")?);
    std::fs::write(out_dir.join("bindings.rs"), source).map_err(|error| error.to_string())?;

    // Only Ipopt itself: Debian's ipopt.pc also names -lblas and -llapack, which its package does not depend on
    // and which a shared libipopt does not need from us.
    println!(
        "cargo::rustc-link-search=native={}",
        ipopt.library_dir.display()
    );
    println!("cargo::rustc-link-lib=dylib=ipopt");
    Ok(())
}

fn variable(name: &str) -> Option<PathBuf> {
    println!("cargo::rerun-if-env-changed={name}");
    env::var_os(name)
        .filter(|value| !value.is_empty())
        .map(PathBuf::from)
}

fn from_environment(include_dir: &Path, library_dir: PathBuf) -> Result<Installation, String> {
    if !library_dir.is_dir() {
        return Err(format!(
            "IPOPT_LIB_DIR: there is no folder {}.",
            library_dir.display()
        ));
    }
    let folders = [
        include_dir.into(),
        include_dir.join("coin-or"),
        include_dir.join("coin"),
    ];
    Ok(Installation {
        header: find_header(&folders).map_err(|error| format!("IPOPT_INCLUDE_DIR: {error}"))?,
        library_dir,
        clang_args: Vec::new(),
    })
}

fn from_pkg_config() -> Result<Installation, String> {
    let library = pkg_config::Config::new()
        .range_version("3.11".."4")
        .cargo_metadata(false)
        .env_metadata(true)
        .probe("ipopt")
        .map_err(|error| error.to_string())?;
    let library_dir =
        pkg_config::get_variable("ipopt", "libdir").map_err(|error| error.to_string())?;
    let clang_args = library
        .defines
        .iter()
        .map(|(name, value)| match value {
            Some(value) => format!("-D{name}={value}"),
            None => format!("-D{name}"),
        })
        .collect();
    Ok(Installation {
        header: find_header(&library.include_paths)?,
        library_dir: library_dir.into(),
        clang_args,
    })
}

fn find_header(folders: &[PathBuf]) -> Result<PathBuf, String> {
    folders
        .iter()
        .map(|folder| folder.join(HEADER))
        .find(|path| path.is_file())
        .ok_or_else(|| {
            let searched: Vec<String> = folders
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            format!("there is no {HEADER} in {}.", searched.join(", "))
        })
}
