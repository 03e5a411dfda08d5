//! From Ipopt's C header to Rust declarations. Shared by `build.rs` and the tests.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The functions of the C interface that exist in every version from 3.11 on.
const FUNCTIONS: &str = "CreateIpoptProblem|FreeIpoptProblem|AddIpopt(Str|Num|Int)Option|\
                         SetIntermediateCallback|IpoptSolve";

/// The names that the safe layer uses, and what they are called in headers that spell them differently:
/// 3.11 has its own typedefs (`Bool` is `int`), 3.14 has `ipnumber`, `ipindex` and C's `bool`.
const ALIASES: [(&str, &str); 4] = [
    ("Number", "ipnumber"),
    ("Index", "ipindex"),
    ("Int", "ipindex"),
    ("Bool", "bool"),
];

/// Rust declarations for the header `IpStdCInterface.h` at `header`, with the same type names in all its dialects.
///
/// # Errors
/// What clang or bindgen said.
pub fn generate(header: &Path, clang_args: &[String]) -> Result<String, String> {
    let builder = bindgen::Builder::default()
        .header(header.display().to_string())
        .clang_args(clang_args)
        .allowlist_function(FUNCTIONS)
        .prepend_enum_name(false)
        .generate_comments(false)
        .layout_tests(false)
        .rust_target(bindgen::RustTarget::stable(90, 0).expect("1.90 is a version of Rust"))
        .rust_edition(bindgen::RustEdition::Edition2024)
        .formatter(bindgen::Formatter::None);
    // The library that loads libclang panics when there is none.
    let bindings = catch_unwind(AssertUnwindSafe(|| builder.generate()))
        .map_err(|_| "libclang could not be loaded".to_string())?
        .map_err(|error| error.to_string())?
        .to_string();

    let mut source = bindings;
    for (alias, base) in ALIASES {
        if !declares_type(&source, alias) {
            source.push_str(&format!("\npub type {alias} = {base};\n"));
        }
    }
    Ok(source)
}

/// Whether the generated source has a type alias of that name, however it is spaced.
fn declares_type(source: &str, name: &str) -> bool {
    let words: Vec<&str> = source.split_whitespace().collect();
    words
        .windows(4)
        .any(|four| four[..2] == ["pub", "type"] && four[2..] == [name, "="])
}
