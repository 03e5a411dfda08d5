//! The ground z = h(x, y) as a C² bicubic B-spline, whatever terrain it came from.

/// h and its derivatives up to the third order at one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeightJet {
    /// h, m.
    pub h: f64,
    /// ∂h/∂x, ∂h/∂y.
    pub d1: [f64; 2],
    /// h_xx, h_xy, h_yy, 1/m.
    pub d2: [f64; 3],
    /// h_xxx, h_xxy, h_xyy, h_yyy, 1/m² (piecewise continuous only).
    pub d3: [f64; 4],
}
