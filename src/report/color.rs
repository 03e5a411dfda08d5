//! Colors: one for each foot, and ramps over a range of values.

/// Colors that color-blind readers can tell apart, also in print; after the last one they repeat.
const FEET: [&str; 6] = ["#c8352c", "#2166ac", "#e08214", "#1b8a5a", "#7b3fa0", "#6b6b6b"];

/// The color of a foot.
pub(crate) fn foot_color(foot: usize) -> &'static str {
    FEET[foot % FEET.len()]
}

/// Linear interpolation between three colors (red, green, blue; 0 to 255) at 0, 1/2 and 1; fractions outside are clamped.
pub(crate) fn ramp(stops: &[[f64; 3]; 3], fraction: f64) -> String {
    let at = 2.0 * fraction.clamp(0.0, 1.0);
    let from = usize::from(at >= 1.0);
    let part = at - from as f64;
    let [r, g, b]: [u8; 3] = std::array::from_fn(|channel| {
        let [low, high] = [stops[from][channel], stops[from + 1][channel]];
        (low + part * (high - low)).round() as u8
    });
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_passes_through_its_stops() {
        let stops = [[150.0, 20.0, 30.0], [245.0, 200.0, 70.0], [30.0, 95.0, 170.0]];
        let colors = [-1.0, 0.25, 0.5, 2.0].map(|fraction| ramp(&stops, fraction));
        assert_eq!(colors, ["#96141e", "#c66e32", "#f5c846", "#1e5faa"]);
    }
}
