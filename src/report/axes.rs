//! A frame with two scales, ticks and labels: from data to pixels.

use super::svg::{Font, Svg};

/// Pixels between two ticks of the x axis, about.
const X_TICK_DISTANCE: f64 = 70.0;
/// Pixels between two ticks of the y axis, about.
const Y_TICK_DISTANCE: f64 = 32.0;
/// Values below this count as this on a logarithmic axis, which would otherwise span rounding errors.
const LEAST_LOGARITHMIC: f64 = 1e-16;

/// Maps data to pixels within a frame.
pub(crate) struct Axes {
    /// Left, top, width and height of the frame, pixels.
    pub frame: [f64; 4],
    /// Data at the left and right edge.
    pub x: [f64; 2],
    /// Data at the bottom and top edge; with `log`, their decimal logarithms.
    pub y: [f64; 2],
    /// Whether y is logarithmic.
    pub log: bool,
}

impl Axes {
    pub fn new(frame: [f64; 4], x: [f64; 2], y: [f64; 2]) -> Self {
        Self { frame, x: widened(x), y: widened(y), log: false }
    }

    /// A logarithmic y axis over whole decades that hold the positive ones of `values`.
    pub fn logarithmic(frame: [f64; 4], x: [f64; 2], values: &[f64]) -> Self {
        let positive = || values.iter().copied().filter(|v| *v > 0.0 && v.is_finite());
        let least = positive().fold(f64::INFINITY, f64::min).max(LEAST_LOGARITHMIC);
        let most = positive().fold(0.0, f64::max).max(LEAST_LOGARITHMIC);
        let y = if least.is_finite() { [least.log10().floor(), most.log10().ceil()] } else { [-6.0, 0.0] };
        Self { frame, x: widened(x), y: widened(y), log: true }
    }

    /// The same scale along x and y: the narrower data range is widened.
    pub fn equal(frame: [f64; 4], x: [f64; 2], y: [f64; 2]) -> Self {
        let (x, y) = (widened(x), widened(y));
        let per_pixel = ((x[1] - x[0]) / frame[2]).max((y[1] - y[0]) / frame[3]);
        let extended = |[a, b]: [f64; 2], pixels: f64| {
            let (middle, half) = (0.5 * (a + b), 0.5 * per_pixel * pixels);
            [middle - half, middle + half]
        };
        Self { frame, x: extended(x, frame[2]), y: extended(y, frame[3]), log: false }
    }

    /// From data to pixels. On a logarithmic axis, values below its range lie at its bottom; zero has no logarithm.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let y = if self.log { y.log10().max(self.y[0]) } else { y };
        let [left, top, width, height] = self.frame;
        [
            left + width * (x - self.x[0]) / (self.x[1] - self.x[0]),
            top + height * (self.y[1] - y) / (self.y[1] - self.y[0]),
        ]
    }

    /// Draws title, ticks, a light grid, and labels, which hold the units.
    pub fn draw(&self, svg: &mut Svg, title: &str, x_label: &str, y_label: &str) {
        let [left, top, width, height] = self.frame;
        self.grid(svg, !y_label.is_empty());
        svg.rect(self.frame, "fill=\"none\" stroke=\"#888\"");
        svg.text([left, top - 10.0], title, Font::TITLE);
        if !x_label.is_empty() {
            svg.text([left + 0.5 * width, top + height + 36.0], x_label, Font::LABEL);
        }
        if !y_label.is_empty() {
            svg.rotated_text([left - 46.0, top + 0.5 * height], y_label, Font::LABEL, -90.0);
        }
    }

    fn grid(&self, svg: &mut Svg, with_y: bool) {
        let [left, top, width, height] = self.frame;
        let faint = "stroke=\"#000\" stroke-opacity=\"0.09\"";
        let (values, decimals) = ticks(self.x, (width / X_TICK_DISTANCE) as usize);
        for x in values {
            let [px, _] = self.at(x, 1.0);
            svg.line([px, top], [px, top + height], faint);
            svg.text([px, top + height + 17.0], &format!("{x:.decimals$}"), Font::TICK);
        }
        if !with_y {
            return;
        }
        let (values, decimals) = ticks(self.y, (height / Y_TICK_DISTANCE) as usize);
        for y in values {
            if self.log && y.fract() != 0.0 {
                continue;
            }
            let py = top + height * (self.y[1] - y) / (self.y[1] - self.y[0]);
            svg.line([left, py], [left + width, py], faint);
            let text = if self.log { format!("1e{y:.0}") } else { format!("{y:.decimals$}") };
            svg.text([left - 7.0, py + 4.0], &text, Font::TICK.anchored("end"));
        }
    }
}

/// The range itself, or one of length 1 where it is empty.
fn widened([a, b]: [f64; 2]) -> [f64; 2] {
    let (a, b) = if a.is_finite() && b.is_finite() { (a, b) } else { (0.0, 1.0) };
    if b - a > 1e-9 * (1.0 + a.abs()) { [a, b] } else { [a - 0.5, a + 0.5] }
}

/// Round numbers within a range, about `count` of them, and the decimals needed to write them.
fn ticks([a, b]: [f64; 2], count: usize) -> (Vec<f64>, usize) {
    let rough = (b - a) / count.max(2) as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(10.0 * power);
    let slack = 1e-9 * (b - a);
    let values = ((a - slack) / step).ceil() as i64..=((b + slack) / step).floor() as i64;
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    (values.map(|i| i as f64 * step).collect(), decimals)
}

/// The range of some values, extended on both sides by `margin` times its length.
pub(crate) fn range(values: impl IntoIterator<Item = f64>, margin: f64) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for value in values {
        range = [range[0].min(value), range[1].max(value)];
    }
    let extra = margin * (range[1] - range[0]).max(0.0);
    [range[0] - extra, range[1] + extra]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks([0.0, 10.0], 5), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 0));
        let (values, decimals) = ticks([-0.12, 0.31], 4);
        assert_eq!((values, decimals), (vec![0.0, 0.2], 1));
    }

    #[test]
    fn empty_ranges_are_widened() {
        let axes = Axes::new([0.0, 0.0, 100.0, 100.0], [1.0, 1.0], range([], 0.1));
        let [x, y] = axes.at(1.0, 0.5);
        assert_eq!([x, y], [50.0, 50.0]);
    }

    #[test]
    fn zero_lies_at_the_bottom_of_a_logarithmic_axis() {
        let axes = Axes::logarithmic([0.0, 0.0, 100.0, 100.0], [0.0, 1.0], &[0.0, 1e-3, 5.0]);
        assert_eq!(axes.y, [-3.0, 1.0]);
        assert_eq!([axes.at(0.0, 0.0)[1], axes.at(0.0, 0.1)[1]], [100.0, 50.0]);
    }
}
