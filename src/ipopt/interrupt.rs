//! Ctrl-C ends the program at once, or, while work must end in good order, asks it to stop; a second Ctrl-C then ends the program.

use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

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

/// How many [`InGoodOrder`] there are.
static IN_GOOD_ORDER: AtomicUsize = AtomicUsize::new(0);

/// While there is one, the first Ctrl-C only raises [`INTERRUPT`]: for a solve whose iterate is kept, the writing of a file, and a process
/// that has others to end. Whoever holds it polls the flag several times a second.
#[derive(Debug)]
pub struct InGoodOrder(());

impl InGoodOrder {
    /// From now on.
    pub fn begin() -> Self {
        IN_GOOD_ORDER.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for InGoodOrder {
    fn drop(&mut self) {
        IN_GOOD_ORDER.fetch_sub(1, Ordering::SeqCst);
    }
}

/// From now on Ctrl-C ends the program with exit code 130, in whatever stage it is. While there is an [`InGoodOrder`], only the second
/// one does, and the first raises [`INTERRUPT`]. Further calls do nothing.
///
/// # Errors
/// [`IpoptError::CtrlC`] when the operating system refuses, or another part of the program handles Ctrl-C.
pub fn install_ctrl_c() -> Result<(), IpoptError> {
    static INSTALLED: OnceLock<Result<(), IpoptError>> = OnceLock::new();
    let install = || {
        ctrlc::set_handler(|| {
            if INTERRUPT.raise() || IN_GOOD_ORDER.load(Ordering::SeqCst) == 0 {
                // Errors, such as of a closed terminal, change nothing.
                let _ = writeln!(std::io::stderr(), "interrupted");
                std::process::exit(EXIT_CODE);
            }
        })
        .map_err(|error| IpoptError::CtrlC(error.to_string()))
    };
    INSTALLED.get_or_init(install).clone()
}
