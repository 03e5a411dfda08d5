//! trajectory (placeholder).
