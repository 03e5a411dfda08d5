//! The functions that Ipopt calls during a solve, and their common session.
//!
//! No panic may cross C++, so every call into the problem is caught. After a panic the outputs are zeros and the
//! problem is not called again, until the next iteration's callback stops the solve. (Returning "failed" instead
//! would make Ipopt try shorter and shorter steps.)

use std::any::Any;
use std::ffi::c_void;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice;
use std::time::{Duration, Instant};

use ipopt_sys as ffi;

use super::application::Callbacks;
use super::interrupt::INTERRUPT;
use super::layout::{ProblemLayout, Structure};
use super::plug::Plugged;
use super::problem::{NlpProblem, OnIteration};
use super::solution::{IterationRecord, Mode, Multipliers};

/// Why a solve must stop.
pub enum Stop {
    /// `on_iteration` returned `Break`.
    Callback,
    /// [`INTERRUPT`] was raised.
    Interrupt,
    /// The problem or `on_iteration` panicked, with this payload.
    Panic(Box<dyn Any + Send>),
}

/// One solve, as seen from the callbacks: Ipopt's user data.
pub struct Session<'a, P> {
    problem: &'a mut P,
    on_iteration: &'a mut OnIteration<'a>,
    layout: &'a ProblemLayout,
    started: Instant,
    /// Time inside the problem's functions.
    pub evaluation_time: Duration,
    /// The last point at which the constraints were evaluated. (Ipopt 3.11 does not expose the current iterate.)
    pub last_x: Vec<f64>,
    /// g at that point.
    pub last_constraints: Vec<f64>,
    /// The point of the last iteration.
    shown_x: Vec<f64>,
    /// Iterations before this run of Ipopt.
    pub num_before: usize,
    /// The iterations so far.
    pub history: Vec<IterationRecord>,
    /// Why to stop, once there is a reason.
    pub stop: Option<Stop>,
}

impl<'a, P: NlpProblem> Session<'a, P> {
    /// A solve that begins now, at `x`.
    pub fn new(
        problem: &'a mut P,
        on_iteration: &'a mut OnIteration<'a>,
        layout: &'a ProblemLayout,
        x: &[f64],
    ) -> Self {
        Self {
            problem,
            on_iteration,
            layout,
            started: Instant::now(),
            evaluation_time: Duration::ZERO,
            last_x: x.to_vec(),
            last_constraints: vec![f64::NAN; layout.num_constraints],
            shown_x: x.to_vec(),
            num_before: 0,
            history: Vec::new(),
            stop: None,
        }
    }

    /// Those of the problem.
    pub fn initial_multipliers(&self) -> Option<Multipliers> {
        self.problem.initial_multipliers()
    }

    /// Prepares for another run of Ipopt, from the point of the last iteration, which is returned.
    pub fn continue_anew(&mut self) -> Vec<f64> {
        self.num_before = self.history.last().map_or(0, |record| record.iteration);
        self.shown_x.clone()
    }

    /// Lets the problem fill `out` and measures the time; fills in zeros after a panic.
    fn evaluate(&mut self, out: &mut [f64], fill: impl FnOnce(&mut P, &mut [f64])) {
        if !matches!(self.stop, Some(Stop::Panic(_))) {
            let start = Instant::now();
            let result = catch_unwind(AssertUnwindSafe(|| fill(self.problem, out)));
            self.evaluation_time += start.elapsed();
            match result {
                Ok(()) => return,
                Err(payload) => self.stop = Some(Stop::Panic(payload)),
            }
        }
        out.fill(0.0);
    }

    /// Records the iteration, calls `on_iteration`, and returns whether to continue.
    fn iterate(&mut self, mut record: IterationRecord) -> bool {
        if Plugged::has_failed() {
            return false;
        }
        // The point from which a second run continues already has its record.
        let is_known = record.iteration == 0 && !self.history.is_empty();
        record.iteration += self.num_before;
        if self.stop.is_none() && !is_known {
            self.shown_x.copy_from_slice(&self.last_x);
            let asked = catch_unwind(AssertUnwindSafe(|| (self.on_iteration)(&record, &self.last_x)));
            self.history.push(record);
            self.stop = match asked {
                Err(payload) => Some(Stop::Panic(payload)),
                Ok(ControlFlow::Break(())) => Some(Stop::Callback),
                Ok(ControlFlow::Continue(())) if INTERRUPT.is_raised() => Some(Stop::Interrupt),
                Ok(ControlFlow::Continue(())) => None,
            };
        }
        self.stop.is_none()
    }
}

/// The callbacks for problems of type `P`; their user data is a `Session<P>`.
pub fn callbacks<P: NlpProblem>() -> Callbacks {
    Callbacks {
        objective: Some(objective::<P>),
        gradient: Some(gradient::<P>),
        constraints: Some(constraints::<P>),
        jacobian: Some(jacobian::<P>),
        hessian: Some(hessian::<P>),
        iteration: Some(iteration::<P>),
    }
}

// What all the functions below rely on: Ipopt passes on the user data that `solve` gave it, a `Session<P>` that nothing
// else uses in the meantime; it calls from one thread, one call at a time; its arrays have the lengths that `CreateIpoptProblem`
// was told, which are those in the session's layout; inputs and outputs are different arrays.

/// The session.
///
/// # Safety
/// See above; the result must not outlive the callback.
unsafe fn session<'s, 'a: 's, P>(user_data: *mut c_void) -> &'s mut Session<'a, P> {
    // SAFETY: see above.
    unsafe { &mut *user_data.cast::<Session<'a, P>>() }
}

/// An array that Ipopt has filled. It may be null when it is empty.
///
/// # Safety
/// See above.
unsafe fn input<'s>(start: *const ffi::Number, len: usize) -> &'s [f64] {
    if len == 0 {
        return &[];
    }
    // SAFETY: see above.
    unsafe { slice::from_raw_parts(start, len) }
}

/// An array for results, filled with NaN: Ipopt does not initialize it, and entries that the problem forgets are noticed.
///
/// # Safety
/// See above.
unsafe fn output<'s>(start: *mut ffi::Number, len: usize) -> &'s mut [f64] {
    if len == 0 {
        return &mut [];
    }
    // SAFETY: see above; every number is written before a reference to it exists.
    unsafe {
        for index in 0..len {
            start.add(index).write(f64::NAN);
        }
        slice::from_raw_parts_mut(start, len)
    }
}

/// Writes a sparsity structure into Ipopt's arrays.
///
/// # Safety
/// See above.
unsafe fn write_structure(structure: &Structure, rows: *mut ffi::Index, columns: *mut ffi::Index) {
    for (index, (&row, &column)) in structure.rows.iter().zip(&structure.columns).enumerate() {
        // SAFETY: both arrays are as long as the structure.
        unsafe {
            rows.add(index).write(row);
            columns.add(index).write(column);
        }
    }
}

unsafe extern "C" fn objective<P: NlpProblem>(
    _n: ffi::Index,
    x: *mut ffi::Number,
    new_x: ffi::Bool,
    value: *mut ffi::Number,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above; `value` is one number.
    let (session, x, value) = unsafe {
        let session = session::<P>(user_data);
        let n = session.layout.num_variables;
        (session, input(x, n), output(value, 1))
    };
    session.evaluate(value, |problem, out| out[0] = problem.objective(x, ffi::is_true(new_x)));
    if session.layout.num_constraints == 0 {
        session.last_x.copy_from_slice(x);
    }
    ffi::TRUE
}

unsafe extern "C" fn gradient<P: NlpProblem>(
    _n: ffi::Index,
    x: *mut ffi::Number,
    new_x: ffi::Bool,
    out: *mut ffi::Number,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above.
    let (session, x, out) = unsafe {
        let session = session::<P>(user_data);
        let n = session.layout.num_variables;
        (session, input(x, n), output(out, n))
    };
    session.evaluate(out, |problem, out| problem.gradient(x, ffi::is_true(new_x), out));
    ffi::TRUE
}

unsafe extern "C" fn constraints<P: NlpProblem>(
    _n: ffi::Index,
    x: *mut ffi::Number,
    new_x: ffi::Bool,
    _m: ffi::Index,
    out: *mut ffi::Number,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above.
    let (session, x, out) = unsafe {
        let session = session::<P>(user_data);
        let (n, m) = (session.layout.num_variables, session.layout.num_constraints);
        (session, input(x, n), output(out, m))
    };
    session.evaluate(out, |problem, out| problem.constraints(x, ffi::is_true(new_x), out));
    session.last_x.copy_from_slice(x);
    session.last_constraints.copy_from_slice(out);
    ffi::TRUE
}

unsafe extern "C" fn jacobian<P: NlpProblem>(
    _n: ffi::Index,
    x: *mut ffi::Number,
    new_x: ffi::Bool,
    _m: ffi::Index,
    _entries: ffi::Index,
    rows: *mut ffi::Index,
    columns: *mut ffi::Index,
    values: *mut ffi::Number,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above. Ipopt asks for the structure by passing no array for the values, and then x means nothing.
    let (session, x, out) = unsafe {
        let session = session::<P>(user_data);
        if values.is_null() {
            write_structure(&session.layout.jacobian, rows, columns);
            return ffi::TRUE;
        }
        let (n, entries) = (session.layout.num_variables, session.layout.jacobian.len());
        (session, input(x, n), output(values, entries))
    };
    session.evaluate(out, |problem, out| problem.jacobian_values(x, ffi::is_true(new_x), out));
    ffi::TRUE
}

unsafe extern "C" fn hessian<P: NlpProblem>(
    _n: ffi::Index,
    x: *mut ffi::Number,
    new_x: ffi::Bool,
    objective_factor: ffi::Number,
    _m: ffi::Index,
    multipliers: *mut ffi::Number,
    new_multipliers: ffi::Bool,
    _entries: ffi::Index,
    rows: *mut ffi::Index,
    columns: *mut ffi::Index,
    values: *mut ffi::Number,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above. Ipopt asks for the structure by passing no array for the values, and then x means nothing.
    let (session, x, multipliers, out) = unsafe {
        let session = session::<P>(user_data);
        let Some(structure) = &session.layout.hessian else {
            return ffi::FALSE;
        };
        if values.is_null() {
            write_structure(structure, rows, columns);
            return ffi::TRUE;
        }
        let (n, m) = (session.layout.num_variables, session.layout.num_constraints);
        let entries = structure.len();
        (session, input(x, n), input(multipliers, m), output(values, entries))
    };
    session.evaluate(out, |problem, out| {
        problem.hessian_values(
            x,
            ffi::is_true(new_x),
            objective_factor,
            multipliers,
            ffi::is_true(new_multipliers),
            out,
        );
    });
    ffi::TRUE
}

unsafe extern "C" fn iteration<P: NlpProblem>(
    mode: ffi::Index,
    iteration: ffi::Index,
    objective: ffi::Number,
    _inf_pr: ffi::Number,
    dual_infeasibility: ffi::Number,
    mu: ffi::Number,
    step_norm: ffi::Number,
    regularization: ffi::Number,
    alpha_dual: ffi::Number,
    alpha_primal: ffi::Number,
    line_search_trials: ffi::Index,
    user_data: ffi::UserDataPtr,
) -> ffi::Bool {
    // SAFETY: see above.
    let session = unsafe { session::<P>(user_data) };
    let record = IterationRecord {
        iteration: usize::try_from(iteration).unwrap_or(0),
        mode: if mode == 0 { Mode::Regular } else { Mode::Restoration },
        objective,
        violation: session.layout.violation(&session.last_constraints),
        dual_infeasibility,
        mu,
        step_norm,
        regularization,
        alpha_dual,
        alpha_primal,
        line_search_trials: usize::try_from(line_search_trials).unwrap_or(0),
        seconds: session.started.elapsed().as_secs_f64(),
    };
    if session.iterate(record) { ffi::TRUE } else { ffi::FALSE }
}
