//! Input files in TOML: parsing, checking against the Rust types, and error messages that point at the line.
//!
//! [`Document`] knows where each key came from. [`read_as`] checks it against the JSON Schema of a Rust type and
//! converts it. Scenarios and robots are both read this way.

mod document;
mod nesting;
mod schema;
mod words;

pub use document::Document;
pub use schema::{json_schema, read_as};
pub use words::closest;
