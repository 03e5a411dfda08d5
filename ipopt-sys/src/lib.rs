//! Raw bindings to Ipopt's C interface (`IpStdCInterface.h`), generated at build time from the header that is
//! installed. Versions 3.11 to 3.14; the types are called [`Number`], [`Index`], [`Int`] and [`Bool`] in all of them.
//!
//! Ipopt with MUMPS is not re-entrant: one solve at a time per process. The safe layer is `warpgait::ipopt`.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, clippy::all)]

macro_rules! bindings {
    ($file:literal) => {
        include!(concat!(env!("OUT_DIR"), "/", $file));

        /// Ipopt's "yes": C `int` 1 in 3.11, C `bool` true in 3.14.
        pub const TRUE: Bool = true as Bool;

        /// Ipopt's "no".
        pub const FALSE: Bool = false as Bool;

        /// Whether Ipopt said "yes".
        #[must_use]
        pub fn is_true(value: Bool) -> bool {
            value != FALSE
        }
    };
}

bindings!("bindings.rs");

pub mod ma57;

/// The dialects of the header, whichever is installed: the same code compiles against both.
#[cfg(test)]
#[allow(dead_code, clashing_extern_declarations)]
mod tests {
    macro_rules! dialect {
        ($name:ident, $file:literal, $boolean:ty) => {
            mod $name {
                bindings!($file);

                unsafe extern "C" fn objective(
                    _n: Index,
                    x: *mut Number,
                    new_x: Bool,
                    value: *mut Number,
                    _user_data: UserDataPtr,
                ) -> Bool {
                    // SAFETY: the test passes valid numbers.
                    unsafe { *value = if is_true(new_x) { *x } else { 0.0 } };
                    TRUE
                }

                #[test]
                fn the_types_have_one_name() {
                    let _: [$boolean; 2] = [TRUE, FALSE];
                    let _: [f64; 1] = [Number::default()];
                    let _: [i32; 2] = [Index::default(), Int::default()];
                    let callback: Eval_F_CB = Some(objective);
                    let (mut x, mut value) = (2.0, 0.0);
                    // SAFETY: two valid numbers, and no user data, which `objective` does not use.
                    let result =
                        unsafe { callback.unwrap()(1, &mut x, TRUE, &mut value, std::ptr::null_mut()) };
                    assert!(is_true(result) && !is_true(FALSE));
                    assert_eq!(value, 2.0);
                    let _: ApplicationReturnStatus = User_Requested_Stop;
                }
            }
        };
    }

    dialect!(v3_11, "ipopt_3_11.rs", std::ffi::c_int);
    dialect!(v3_14, "ipopt_3_14.rs", bool);
}
