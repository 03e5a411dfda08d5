//! One solve at a time in the whole process.

use std::cell::Cell;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::error::IpoptError;

static ONE_SOLVE: Mutex<()> = Mutex::new(());

thread_local! {
    static SOLVING: Cell<bool> = const { Cell::new(false) };
}

/// The right to use Ipopt, until it is dropped.
pub struct SolverLock {
    _guard: MutexGuard<'static, ()>,
}

impl SolverLock {
    /// Waits until no other thread is solving.
    ///
    /// # Errors
    /// [`IpoptError::Nested`] when this very thread is, for it would wait forever.
    pub fn acquire() -> Result<Self, IpoptError> {
        if SOLVING.get() {
            return Err(IpoptError::Nested);
        }
        // The mutex guards no data, so a panic while it was held has broken nothing.
        let guard = ONE_SOLVE.lock().unwrap_or_else(PoisonError::into_inner);
        SOLVING.set(true);
        Ok(Self { _guard: guard })
    }
}

impl Drop for SolverLock {
    fn drop(&mut self) {
        SOLVING.set(false);
    }
}
