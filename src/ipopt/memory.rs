//! Keeping the memory that Ipopt and MUMPS free.

/// Makes the C library keep freed memory for this process instead of returning it to the system.
///
/// MUMPS allocates its work arrays for every factorization, so that the system clears the same pages again and again: a tenth of a
/// solve's processor time. Meant for programs, not for libraries, because it affects the whole process. Without glibc it does
/// nothing.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        glibc::mallopt(glibc::M_TRIM_THRESHOLD, glibc::LARGE);
        glibc::mallopt(glibc::M_TOP_PAD, glibc::PAD);
        // Versions differ in the largest threshold that they accept; a refused one changes nothing.
        glibc::mallopt(glibc::M_MMAP_THRESHOLD, glibc::MMAP_MAX);
        glibc::mallopt(glibc::M_MMAP_THRESHOLD, glibc::LARGE);
    }
}

#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod glibc {
    use std::ffi::c_int;

    pub const M_TRIM_THRESHOLD: c_int = -1;
    pub const M_TOP_PAD: c_int = -2;
    pub const M_MMAP_THRESHOLD: c_int = -3;
    /// Bytes: more than any solve takes.
    pub const LARGE: c_int = 1 << 30;
    /// Bytes requested at once.
    pub const PAD: c_int = 1 << 26;
    /// DEFAULT_MMAP_THRESHOLD_MAX, bytes.
    pub const MMAP_MAX: c_int = 1 << 25;

    // SAFETY: the signature is that of mallopt(3), which accepts any numbers and returns 0 for those that it refuses.
    unsafe extern "C" {
        pub safe fn mallopt(parameter: c_int, value: c_int) -> c_int;
    }
}
