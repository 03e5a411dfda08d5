//! How a command ends, and its exit code.

use crate::{Error, Result, ipopt};

/// How a command ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// All is well.
    Good,
    /// There is a result, but it is not good enough.
    NotGood,
    /// Ctrl-C.
    Interrupted,
    /// The exit code of the program that ran in its place.
    Code(u8),
}

/// The exit code of an error: bad input or usage, or an internal error.
pub(super) const ERROR_CODE: u8 = 2;

impl Ending {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            Ending::Good => 0,
            Ending::NotGood => 1,
            // 128 + SIGINT, as shells count.
            Ending::Interrupted => 130,
            Ending::Code(code) => code,
        }
    }
}

/// From now on Ctrl-C ends the program, or stops work in good order: see [`ipopt::InGoodOrder`].
///
/// # Errors
/// Internal, when the signal cannot be handled.
pub(super) fn listen_for_ctrl_c() -> Result<()> {
    ipopt::install_ctrl_c().map_err(|e| Error::Internal(e.to_string()))
}
