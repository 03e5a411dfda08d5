//! terrain (placeholder).
