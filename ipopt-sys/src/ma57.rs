//! The functions through which Ipopt takes the place of MA57, a linear solver of the HSL library that is loaded at run time.
//!
//! Ipopt has an interface to MA57 but not MA57 itself, and a function that tells it where MA57's five functions are:
//! `LSL_setMA57` from 3.11 to 3.13 (`HSLLoader.h`), `Ipopt::Ma57TSolverInterface::SetFunctions` in 3.14
//! (`IpMa57TSolverInterface.hpp`). Whoever has these signatures can be called in MA57's stead. Integers are C `int`.

use std::ffi::{CStr, c_int};

/// Analysis: n, ne, irn, jcn, lkeep, keep, iwork, icntl, info, rinfo.
pub type Analyze = unsafe extern "C" fn(
    *mut c_int,
    *mut c_int,
    *const c_int,
    *const c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut f64,
);

/// Factorization: n, ne, a, fact, lfact, ifact, lifact, lkeep, keep, iwork, icntl, cntl, info, rinfo.
pub type Factorize = unsafe extern "C" fn(
    *mut c_int,
    *mut c_int,
    *mut f64,
    *mut f64,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut f64,
);

/// Solve: job, n, fact, lfact, ifact, lifact, nrhs, rhs, lrhs, work, lwork, iwork, icntl, info.
pub type Solve = unsafe extern "C" fn(
    *mut c_int,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
);

/// Larger arrays: n, ic, keep, fact, lfact, newfac, lnew, ifact, lifact, newifc, linew, info.
pub type Enlarge = unsafe extern "C" fn(
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut f64,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
    *mut c_int,
);

/// Defaults: cntl, icntl.
pub type Initialize = unsafe extern "C" fn(*mut f64, *mut c_int);

/// Makes Ipopt call these functions where it would call MA57's, in all of the process and from then on.
pub type SetFunctions = unsafe extern "C" fn(Analyze, Factorize, Solve, Enlarge, Initialize);

/// From 3.11 to 3.13: a C function.
const SETTER_3_11: &CStr = c"LSL_setMA57";

/// In 3.14: a static member function, by its name in the Itanium C++ ABI, which GCC and Clang follow. It takes its arguments as
/// a C function does.
const SETTER_3_14: &CStr = c"_ZN5Ipopt20Ma57TSolverInterface12SetFunctionsEPFvPiS1_PKiS3_S1_S1_S1_S1_S1_PdEPFvS1_S1_S4_S4_S1_S1_S1_S1_S1_S1_S1_S4_S1_S4_EPFvS1_S1_S4_S1_S1_S1_S1_S4_S1_S4_S1_S1_S1_S1_EPFvS1_S1_S1_S4_S1_S4_S1_S1_S1_S1_S1_S1_EPFvS4_S1_E";

/// The function of the library that this process runs with, looked up by name; `None` if it has none.
#[must_use]
pub fn set_functions() -> Option<SetFunctions> {
    [SETTER_3_11, SETTER_3_14].into_iter().find_map(find)
}

#[cfg(unix)]
fn find(name: &CStr) -> Option<SetFunctions> {
    // SAFETY: the name ends with a zero byte. Both names stand for functions that take these five pointers and return nothing, so the
    // address that is found, if any, is that of such a function.
    unsafe {
        let address = libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr());
        std::mem::transmute::<*mut libc::c_void, Option<SetFunctions>>(address)
    }
}

#[cfg(not(unix))]
fn find(_name: &CStr) -> Option<SetFunctions> {
    None
}
