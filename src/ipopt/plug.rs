//! The linear solver of the crate `kkt`, plugged into Ipopt as MA57.
//!
//! Ipopt calls five functions without any user data, always from the thread that solves. Their state is therefore thread-local,
//! and exists as long as [`Plugged`].

use std::any::Any;
use std::cell::RefCell;
use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice;

use ipopt_sys::ma57;
use kkt::{Factored, Kkt, Layout};

use super::layout::ProblemLayout;
use super::lock::SolverLock;

/// Values of MA57's `info(1)`.
mod info {
    use std::ffi::c_int;

    pub const DONE: c_int = 0;
    /// Ipopt then perturbs the matrix and tries again.
    pub const SINGULAR: c_int = 4;
    /// Ipopt then gives up on the step.
    pub const FAILED: c_int = -1;
    /// Places in `info`: the outcome, the lengths of two arrays that are not used, negative eigenvalues, rank.
    pub const STATUS: usize = 0;
    pub const LENGTHS: [usize; 2] = [8, 9];
    pub const NEGATIVE: usize = 23;
    pub const RANK: usize = 24;
}

/// A solution that is refined and still has a larger residual, relative to the solution and the right-hand side, counts as failed. (Ipopt's
/// own test demands 1e-10 and accepts what is below 1e-5.)
const LARGEST_RESIDUAL: f64 = 1e-8;

/// A matrix with a fixed pattern, as the plug uses it.
pub trait Matrix {
    /// Factors it with these values, in the order of its entries.
    fn factor(&mut self, values: &[f64]) -> Factored;
    /// Replaces a right-hand side by the solution with the last factors, and returns the relative residual.
    fn solve(&mut self, x: &mut [f64]) -> f64;
}

impl Matrix for Kkt {
    fn factor(&mut self, values: &[f64]) -> Factored {
        self.factor(values)
    }

    fn solve(&mut self, x: &mut [f64]) -> f64 {
        self.solve(x)
    }
}

/// Makes a matrix from its blocks and the rows and columns of its entries, from 0; `None` if it cannot.
pub type Analysis = fn(Layout, &[u32], &[u32]) -> Option<Box<dyn Matrix>>;

/// The analysis of the crate `kkt`.
pub fn by_kkt(layout: Layout, rows: &[u32], columns: &[u32]) -> Option<Box<dyn Matrix>> {
    Some(Box::new(Kkt::new(layout, rows, columns).ok()?))
}

/// The state of the five functions.
struct State {
    layouts: Vec<Layout>,
    analysis: Analysis,
    /// One for each analysis. Ipopt refers to them by their position plus one.
    matrices: Vec<Box<dyn Matrix>>,
    /// See [`Outcome::singular`].
    singular: usize,
    failed: bool,
    panic: Option<Box<dyn Any + Send>>,
}

thread_local! {
    static STATE: RefCell<Option<State>> = const { RefCell::new(None) };
}

/// While this exists, Ipopt's "ma57" is the linear solver of the crate `kkt`. Frees the factors when dropped.
pub struct Plugged<'lock> {
    _lock: &'lock SolverLock,
}

/// How the linear solver fared in a solve.
pub struct Outcome {
    /// An error from which Ipopt cannot recover.
    pub failed: bool,
    /// Matrices that counted as singular.
    pub singular: usize,
    /// Whether Ipopt called it at all.
    pub used: bool,
    /// A panic, to be resumed.
    pub panic: Option<Box<dyn Any + Send>>,
}

impl<'lock> Plugged<'lock> {
    /// Plugs the linear solver in for problems of this layout; `None` if the library cannot use it.
    pub fn new(layout: &ProblemLayout, analysis: Analysis, lock: &'lock SolverLock) -> Option<Self> {
        let set_functions = ma57::set_functions()?;
        STATE.set(Some(State {
            layouts: layouts(layout),
            analysis,
            matrices: Vec::new(),
            singular: 0,
            failed: false,
            panic: None,
        }));
        // SAFETY: the five functions have the signatures that Ipopt's interface to MA57 calls and live as long as the process.
        unsafe { set_functions(analyze, factorize, solve, enlarge, initialize) };
        Some(Self { _lock: lock })
    }

    /// The outcome so far; takes the panic out, so call it once.
    pub fn outcome(&self) -> Outcome {
        with_state(|state| Outcome {
            failed: state.failed,
            singular: state.singular,
            used: !state.matrices.is_empty(),
            panic: state.panic.take(),
        })
        .expect("plugged in")
    }

    /// Whether the solve must stop because it cannot continue with this linear solver.
    pub fn has_failed() -> bool {
        with_state(|state| state.failed || state.panic.is_some()).unwrap_or(false)
    }
}

impl Drop for Plugged<'_> {
    fn drop(&mut self) {
        STATE.set(None);
    }
}

fn with_state<R>(use_it: impl FnOnce(&mut State) -> R) -> Option<R> {
    STATE.with_borrow_mut(|state| state.as_mut().map(use_it))
}

/// The blocks of the matrix under each of Ipopt's three treatments of fixed variables: taken out (`make_parameter`, the default), left in
/// with relaxed bounds (`relax_bounds`, what the first becomes when there are more equations than free variables), and left in with an
/// equation each (`make_constraint`). The order of the matrix determines which one is in effect.
fn layouts(layout: &ProblemLayout) -> Vec<Layout> {
    let equal = |lower: &[f64], upper: &[f64]| lower.iter().zip(upper).filter(|(a, b)| a == b).count();
    let fixed = equal(&layout.variable_lower, &layout.variable_upper);
    let equations = equal(&layout.constraint_lower, &layout.constraint_upper);
    let (variables, inequalities) = (layout.num_variables, layout.num_constraints - equations);
    vec![
        Layout { variables: variables - fixed, inequalities, equations },
        Layout { variables, inequalities, equations },
        Layout { variables, inequalities, equations: equations + fixed },
    ]
}

/// Runs one of the functions below, and returns the value of `info(1)`. No panic leaves it; after a panic or a failure it does nothing.
fn guarded(work: impl FnOnce(&mut State) -> c_int) -> c_int {
    let done = with_state(|state| {
        if state.failed || state.panic.is_some() {
            return info::FAILED;
        }
        match catch_unwind(AssertUnwindSafe(|| work(state))) {
            Ok(status) => {
                state.failed = status == info::FAILED;
                status
            }
            Err(payload) => {
                state.panic = Some(payload);
                info::FAILED
            }
        }
    });
    done.unwrap_or(info::FAILED)
}

// What all the functions below rely on: Ipopt passes the arrays of MA57's documentation, of which `keep` and `ifact` have at least one
// number, `info` has 40, `cntl` 5 and `icntl` 20; it passes the same `keep` to analysis and factorization, the same `ifact` to factorization
// and solve; nothing else uses the arrays in the meantime.

unsafe extern "C" fn initialize(cntl: *mut f64, icntl: *mut c_int) {
    // SAFETY: see above.
    unsafe {
        cntl.write_bytes(0, 5);
        icntl.write_bytes(0, 20);
    }
}

unsafe extern "C" fn analyze(
    n: *mut c_int,
    num_entries: *mut c_int,
    rows: *const c_int,
    columns: *const c_int,
    _lkeep: *mut c_int,
    keep: *mut c_int,
    _iwork: *mut c_int,
    _icntl: *mut c_int,
    info: *mut c_int,
    _rinfo: *mut f64,
) {
    // SAFETY: see above; `rows` and `columns` have `num_entries` numbers.
    let (n, rows, columns, keep, info) = unsafe {
        let count = *num_entries as usize;
        let rows = slice::from_raw_parts(rows, count);
        let columns = slice::from_raw_parts(columns, count);
        (*n as usize, rows, columns, &mut *keep, slice::from_raw_parts_mut(info, 40))
    };
    info[info::STATUS] = guarded(|state| {
        let Some(&layout) = state.layouts.iter().find(|layout| layout.dimension() == n) else {
            return info::FAILED;
        };
        // Fortran counts from one; an index below that ends up above n.
        let from_zero = |indices: &[c_int]| -> Vec<u32> {
            indices.iter().map(|&index| (index as u32).wrapping_sub(1)).collect()
        };
        match (state.analysis)(layout, &from_zero(rows), &from_zero(columns)) {
            Some(matrix) => {
                state.matrices.push(matrix);
                *keep = state.matrices.len() as c_int;
                info::DONE
            }
            None => info::FAILED,
        }
    });
    for place in info::LENGTHS {
        info[place] = 1;
    }
}

unsafe extern "C" fn factorize(
    n: *mut c_int,
    num_entries: *mut c_int,
    values: *mut f64,
    _fact: *mut f64,
    _lfact: *mut c_int,
    ifact: *mut c_int,
    _lifact: *mut c_int,
    _lkeep: *mut c_int,
    keep: *mut c_int,
    _iwork: *mut c_int,
    _icntl: *mut c_int,
    _cntl: *mut f64,
    info: *mut c_int,
    _rinfo: *mut f64,
) {
    // SAFETY: see above; `values` has `num_entries` numbers.
    let (n, values, ifact, keep, info) = unsafe {
        let values = slice::from_raw_parts(values.cast_const(), *num_entries as usize);
        (*n, values, &mut *ifact, *keep, slice::from_raw_parts_mut(info, 40))
    };
    *ifact = keep;
    info[info::STATUS] = guarded(|state| {
        let Some(matrix) = matrix(state, keep) else {
            return info::FAILED;
        };
        match matrix.factor(values) {
            Factored::Regular { negative } => {
                info[info::NEGATIVE] = negative as c_int;
                info[info::RANK] = n;
                info::DONE
            }
            Factored::Singular => {
                state.singular += 1;
                info[info::RANK] = n - 1;
                info::SINGULAR
            }
        }
    });
}

unsafe extern "C" fn solve(
    _job: *mut c_int,
    n: *mut c_int,
    _fact: *mut f64,
    _lfact: *mut c_int,
    ifact: *mut c_int,
    _lifact: *mut c_int,
    num_right_sides: *mut c_int,
    right_sides: *mut f64,
    _lrhs: *mut c_int,
    _work: *mut f64,
    _lwork: *mut c_int,
    _iwork: *mut c_int,
    _icntl: *mut c_int,
    info: *mut c_int,
) {
    // SAFETY: see above; `right_sides` has `num_right_sides` columns of n numbers, one after the other.
    let (n, right_sides, keep, info) = unsafe {
        let n = *n as usize;
        let right_sides = slice::from_raw_parts_mut(right_sides, n * *num_right_sides as usize);
        (n, right_sides, *ifact, slice::from_raw_parts_mut(info, 40))
    };
    info[info::STATUS] = guarded(|state| {
        let Some(matrix) = matrix(state, keep) else {
            return info::FAILED;
        };
        for right_side in right_sides.chunks_exact_mut(n) {
            let residual = matrix.solve(right_side);
            if residual > LARGEST_RESIDUAL || residual.is_nan() {
                return info::FAILED;
            }
        }
        info::DONE
    });
}

/// Never called, because no array is ever too short.
unsafe extern "C" fn enlarge(
    _n: *mut c_int,
    _ic: *mut c_int,
    _keep: *mut c_int,
    _fact: *mut f64,
    _lfact: *mut c_int,
    _newfac: *mut f64,
    _lnew: *mut c_int,
    _ifact: *mut c_int,
    _lifact: *mut c_int,
    _newifc: *mut c_int,
    _linew: *mut c_int,
    _info: *mut c_int,
) {
}

/// The matrix of an analysis, by its position counted from one.
fn matrix(state: &mut State, keep: c_int) -> Option<&mut dyn Matrix> {
    Some(&mut **state.matrices.get_mut(usize::try_from(keep).ok()?.checked_sub(1)?)?)
}
