//! ipopt (placeholder).
