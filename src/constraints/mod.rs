//! constraints (placeholder).
