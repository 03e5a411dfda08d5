//! nlp (placeholder).
