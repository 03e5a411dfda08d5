//! Values of Ipopt's options.

/// The value of an option.
#[derive(Clone, Debug, PartialEq)]
pub enum OptionValue {
    /// For options that count.
    Int(i32),
    /// For tolerances and the like. Ipopt 3.11 keeps six significant digits.
    Num(f64),
    /// For options that choose, and yes or no.
    Str(String),
}
