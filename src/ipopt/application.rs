//! The handle of Ipopt's C interface, created, used and freed safely.

use std::ffi::{CString, c_void};
use std::ptr::{NonNull, null_mut};

use ipopt_sys as ffi;

use super::error::IpoptError;
use super::layout::ProblemLayout;
use super::lock::SolverLock;
use super::option_value::OptionValue;
use super::solution::Multipliers;

/// The functions that Ipopt calls, all with the same kind of user data.
pub struct Callbacks {
    pub objective: ffi::Eval_F_CB,
    pub gradient: ffi::Eval_Grad_F_CB,
    pub constraints: ffi::Eval_G_CB,
    pub jacobian: ffi::Eval_Jac_G_CB,
    pub hessian: ffi::Eval_H_CB,
    pub iteration: ffi::Intermediate_CB,
}

/// The numbers that `IpoptSolve` reads and writes.
pub struct Iterate {
    pub x: Vec<f64>,
    pub constraints: Vec<f64>,
    pub objective: f64,
    pub multipliers: Multipliers,
}

/// One problem inside Ipopt. Lives no longer than the lock under which it was made.
pub struct Application<'lock> {
    problem: NonNull<ffi::IpoptProblemInfo>,
    num_variables: usize,
    num_constraints: usize,
    _lock: &'lock SolverLock,
}

impl<'lock> Application<'lock> {
    /// A problem with these sizes and bounds, silent, with Ipopt's default options.
    ///
    /// # Errors
    /// [`IpoptError::Refused`], which the checks of [`ProblemLayout`] should make impossible.
    pub fn new(
        layout: &ProblemLayout,
        callbacks: Callbacks,
        lock: &'lock SolverLock,
    ) -> Result<Self, IpoptError> {
        const INDICES_FROM_ZERO: ffi::Index = 0;
        // SAFETY: the bounds are n and m numbers long; Ipopt copies them and does not write to them. Their counts, and
        // those of the entries, fit into 32 bits (checked by `ProblemLayout`).
        let problem = unsafe {
            ffi::CreateIpoptProblem(
                layout.num_variables as ffi::Index,
                layout.variable_lower.as_ptr().cast_mut(),
                layout.variable_upper.as_ptr().cast_mut(),
                layout.num_constraints as ffi::Index,
                layout.constraint_lower.as_ptr().cast_mut(),
                layout.constraint_upper.as_ptr().cast_mut(),
                layout.jacobian.len() as ffi::Index,
                layout.hessian.as_ref().map_or(0, |hessian| hessian.len()) as ffi::Index,
                INDICES_FROM_ZERO,
                callbacks.objective,
                callbacks.constraints,
                callbacks.gradient,
                callbacks.jacobian,
                callbacks.hessian,
            )
        };
        let mut application = Self {
            problem: NonNull::new(problem).ok_or(IpoptError::Refused)?,
            num_variables: layout.num_variables,
            num_constraints: layout.num_constraints,
            _lock: lock,
        };
        // SAFETY: the problem is valid, and the callback has the type that Ipopt expects.
        let accepted =
            unsafe { ffi::SetIntermediateCallback(application.problem.as_ptr(), callbacks.iteration) };
        if ffi::is_true(accepted) && application.silence() {
            Ok(application)
        } else {
            Err(IpoptError::Refused)
        }
    }

    /// Turns off every output and the option file. Returns whether Ipopt accepted that.
    ///
    /// A fresh Ipopt prints a message about a wrong option, because its print level takes effect only when a solve begins. So a solve
    /// is started here without an initial point, which Ipopt declines after it has read its options.
    fn silence(&mut self) -> bool {
        let accepted = [
            ("print_level", OptionValue::Int(0)),
            ("sb", OptionValue::Str("yes".into())),
            ("option_file_name", OptionValue::Str(String::new())),
        ]
        .iter()
        .all(|(name, value)| self.set_option(name, value));
        if !accepted {
            return false;
        }
        let nothing: *mut ffi::Number = null_mut();
        // SAFETY: the problem is valid. Without a starting point Ipopt returns before it looks at any other argument
        // or calls back; in every version from 3.11 to 3.14.
        let status = unsafe {
            let problem = self.problem.as_ptr();
            ffi::IpoptSolve(problem, nothing, nothing, nothing, nothing, nothing, nothing, null_mut())
        };
        status == ffi::Invalid_Problem_Definition
    }

    /// Sets an option; false if Ipopt does not accept it.
    pub fn set_option(&mut self, name: &str, value: &OptionValue) -> bool {
        // Ipopt 3.11 takes the name for a part of a printf format, so it must not reach it with a `%`.
        let plain = |letter: u8| letter.is_ascii_alphanumeric() || letter == b'_' || letter == b'.';
        if !name.bytes().all(plain) {
            return false;
        }
        let Ok(c_name) = CString::new(name) else {
            return false;
        };
        let (problem, c_name) = (self.problem.as_ptr(), c_name.as_ptr().cast_mut());
        let accepted = match value {
            // SAFETY (all three): the problem is valid; the strings end with a zero byte, live until the call
            // returns, and are copied by Ipopt, not written to.
            OptionValue::Int(value) => unsafe { ffi::AddIpoptIntOption(problem, c_name, *value) },
            OptionValue::Num(value) if !value.is_finite() => return false,
            OptionValue::Num(value) => unsafe { ffi::AddIpoptNumOption(problem, c_name, *value) },
            OptionValue::Str(value) => {
                let Ok(value) = CString::new(value.as_str()) else {
                    return false;
                };
                unsafe { ffi::AddIpoptStrOption(problem, c_name, value.as_ptr().cast_mut()) }
            }
        };
        ffi::is_true(accepted)
    }

    /// Solves, from and into `iterate`.
    ///
    /// # Safety
    /// `user_data` is what the callbacks expect, and nothing else uses it until this returns.
    pub unsafe fn solve(
        &mut self,
        iterate: &mut Iterate,
        user_data: *mut c_void,
    ) -> ffi::ApplicationReturnStatus {
        let multipliers = &mut iterate.multipliers;
        for (values, count) in [
            (&iterate.x, self.num_variables),
            (&iterate.constraints, self.num_constraints),
            (&multipliers.constraint, self.num_constraints),
            (&multipliers.lower, self.num_variables),
            (&multipliers.upper, self.num_variables),
        ] {
            assert_eq!(values.len(), count, "Ipopt writes as many numbers as the problem has");
        }
        // SAFETY: the problem is valid, the arrays have the lengths that Ipopt reads and writes (just asserted), the
        // lock keeps every other thread out of Ipopt, and the caller vouches for the user data.
        unsafe {
            ffi::IpoptSolve(
                self.problem.as_ptr(),
                iterate.x.as_mut_ptr(),
                iterate.constraints.as_mut_ptr(),
                &mut iterate.objective,
                multipliers.constraint.as_mut_ptr(),
                multipliers.lower.as_mut_ptr(),
                multipliers.upper.as_mut_ptr(),
                user_data,
            )
        }
    }
}

impl Drop for Application<'_> {
    fn drop(&mut self) {
        // SAFETY: the problem is valid, and this is its last use.
        unsafe { ffi::FreeIpoptProblem(self.problem.as_ptr()) }
    }
}
