//! Raw bindings to Ipopt (placeholder).
