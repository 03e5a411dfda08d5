//! Finds Ipopt and generates the bindings from its own header.

use std::env;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::exit;

const HEADER: &str = "IpStdCInterface.h";

/// The functions of the C interface that exist in every version from 3.11 on.
const FUNCTIONS: &str = "CreateIpoptProblem|FreeIpoptProblem|AddIpopt(Str|Num|Int)Option|\
                         SetIntermediateCallback|IpoptSolve";

/// The names that the safe layer uses, and what stands for them in headers that do without: 3.11 has typedefs of these
/// names (`Bool` is `int`), 3.14 has `ipnumber`, `ipindex` and C's `bool`.
const ALIASES: [(&str, &str); 4] =
    [("Number", "ipnumber"), ("Index", "ipindex"), ("Int", "ipindex"), ("Bool", "bool")];

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
    if let Err(reason) = run() {
        eprintln!("{reason}\n\n{HELP}");
        exit(1);
    }
}

fn run() -> Result<(), String> {
    let ipopt = match (variable("IPOPT_INCLUDE_DIR"), variable("IPOPT_LIB_DIR")) {
        (Some(include_dir), Some(library_dir)) => from_environment(&include_dir, library_dir)?,
        (None, None) => from_pkg_config()?,
        _ => return Err("Only one of IPOPT_INCLUDE_DIR and IPOPT_LIB_DIR is set.".into()),
    };
    generate(&ipopt.header, &ipopt.clang_args, "bindings.rs")?;
    // Headers of both dialects in short, for the tests: they cost a tenth of a second.
    for (header, target) in
        [("headers/ipopt_3_11.h", "ipopt_3_11.rs"), ("headers/ipopt_3_14.h", "ipopt_3_14.rs")]
    {
        generate(Path::new(header), &[], target)?;
    }

    // Only Ipopt itself: Debian's ipopt.pc also names -lblas and -llapack, which its package does not depend on
    // and which a shared libipopt does not need from us.
    println!("cargo::rustc-link-search=native={}", ipopt.library_dir.display());
    println!("cargo::rustc-link-lib=dylib=ipopt");
    Ok(())
}

fn variable(name: &str) -> Option<PathBuf> {
    println!("cargo::rerun-if-env-changed={name}");
    env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

fn from_environment(include_dir: &Path, library_dir: PathBuf) -> Result<Installation, String> {
    if !library_dir.is_dir() {
        return Err(format!("IPOPT_LIB_DIR: there is no folder {}.", library_dir.display()));
    }
    let folders = [include_dir.into(), include_dir.join("coin-or"), include_dir.join("coin")];
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
    let library_dir = pkg_config::get_variable("ipopt", "libdir").map_err(|error| error.to_string())?;
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
    folders.iter().map(|folder| folder.join(HEADER)).find(|path| path.is_file()).ok_or_else(|| {
        let searched: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
        format!("there is no {HEADER} in {}.", searched.join(", "))
    })
}

/// Writes Rust declarations for a header into the file `target`, with the same type names in all of Ipopt's dialects.
fn generate(header: &Path, clang_args: &[String], target: &str) -> Result<(), String> {
    println!("cargo::rerun-if-changed={}", header.display());
    let failed = |reason: String| format!("No bindings for {}: {reason}", header.display());
    let builder = bindgen::Builder::default()
        .header(header.display().to_string())
        .clang_args(clang_args)
        .allowlist_function(FUNCTIONS)
        .prepend_enum_name(false)
        .generate_comments(false)
        .layout_tests(false)
        .rust_target(bindgen::RustTarget::stable(90, 0).map_err(|error| error.to_string())?)
        .rust_edition(bindgen::RustEdition::Edition2024)
        .formatter(bindgen::Formatter::None);
    // The crate that loads libclang panics when there is none.
    let mut source = catch_unwind(AssertUnwindSafe(|| builder.generate()))
        .map_err(|_| failed("libclang could not be loaded.".into()))?
        .map_err(|error| failed(error.to_string()))?
        .to_string();
    for (alias, base) in ALIASES {
        if !declares_type(&source, alias) {
            source.push_str(&format!("\npub type {alias} = {base};\n"));
        }
    }
    let out_dir = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set.")?);
    std::fs::write(out_dir.join(target), source).map_err(|error| failed(error.to_string()))
}

/// Whether the generated source has a type alias of that name, however it is spaced.
fn declares_type(source: &str, name: &str) -> bool {
    let words: Vec<&str> = source.split_whitespace().collect();
    words.windows(4).any(|four| four[..2] == ["pub", "type"] && four[2..] == [name, "="])
}
