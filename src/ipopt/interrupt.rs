//! Ctrl-C stops a solve at the next iteration; a second Ctrl-C ends the program.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::IpoptError;

/// A program that ends because of SIGINT has this exit code: 128 + 2.
const EXIT_CODE: i32 = 130;

/// A request to stop, raised by anyone and noticed by the running solve at its next iteration.
#[derive(Debug, Default)]
pub struct InterruptFlag(AtomicBool);

/// The flag that [`super::solve`] polls. It stays raised, and stops later solves as well, until it is lowered.
pub static INTERRUPT: InterruptFlag = InterruptFlag(AtomicBool::new(false));

impl InterruptFlag {
    /// Requests a stop; returns whether one had been requested before.
    pub fn raise(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }

    /// Withdraws the request.
    pub fn lower(&self) {
        self.0.store(false, Ordering::SeqCst);
    }

    /// Whether a stop is requested.
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// From now on Ctrl-C raises [`INTERRUPT`]; when it is raised already, Ctrl-C ends the program with exit code 130.
/// Further calls do nothing.
///
/// # Errors
/// [`IpoptError::CtrlC`] when the operating system refuses, or another part of the program handles Ctrl-C.
pub fn install_ctrl_c() -> Result<(), IpoptError> {
    static INSTALLED: OnceLock<Result<(), IpoptError>> = OnceLock::new();
    let install = || {
        ctrlc::set_handler(|| {
            if INTERRUPT.raise() {
                std::process::exit(EXIT_CODE);
            }
        })
        .map_err(|error| IpoptError::CtrlC(error.to_string()))
    };
    INSTALLED.get_or_init(install).clone()
}
