//! Reading files within bounds, and writing them whole or not at all.

mod input;
pub mod npy;
pub mod npz;
mod output;
pub mod png;

pub use input::{MAX_FILE, MAX_TEXT, read, read_text};
pub use output::{Pending, ensure_no_inputs, ensure_outputs, open_for_process, write_atomically};
