//! The ground of a plan: its height as bands of color, where no foot can stand, and its profile along a line.

use super::axes::{Axes, range};
use super::color::ramp;
use super::svg::{Font, Svg};
use crate::plan::GroundGrid;
use crate::terrain::{ContactGround, Surfaces};

/// Bands of height, each of one color.
pub(super) const BANDS: usize = 14;
/// Rows and columns of the shaded ground.
const RASTER: usize = 180;
/// The height scale spans at least this, so that flat ground shows no noise, m.
const MIN_HEIGHT_RANGE: f64 = 0.1;
/// Overlap of neighboring rectangles, which hides the seams between them, pixels.
pub(super) const OVERLAP: f64 = 0.4;
/// Segments of a profile, about as many as pixels.
pub(super) const PROFILE: u32 = 550;
/// Style of ground without data.
const UNKNOWN: &str = "fill=\"#6b7a99\" fill-opacity=\"0.55\"";
/// Style of what cannot be stood on.
const CLOSED: &str = "fill=\"url(#hatching)\"";

/// The ground of a plan, with the surfaces that were made of it.
pub(super) struct DrawnGround<'a> {
    pub grid: &'a GroundGrid,
    pub surfaces: &'a Surfaces,
}

impl DrawnGround<'_> {
    fn contact(&self) -> Option<&ContactGround> {
        self.surfaces.contact.as_deref()
    }

    /// The ground within a frame: bands of height, what has no data, and, hatched, what cannot be stood on.
    pub fn draw(&self, svg: &mut Svg, axes: &Axes) {
        let shades = Shades::over(axes, self.grid);
        svg.clipped(axes.frame, |svg| {
            svg.rect(axes.frame, "fill=\"#f4f4f4\"");
            for band in 0..BANDS {
                svg.rects(
                    runs(axes.frame, OVERLAP, |cell| shades.band(cell) == Some(band)),
                    &band_style(band),
                );
            }
            draw_unknown(svg, axes, self.grid);
            if let Some(contact) = self.contact() {
                let steppable: Vec<bool> = places(axes).map(|[x, y]| contact.is_steppable([x, y])).collect();
                svg.hatching("hatching");
                svg.rects(
                    runs(axes.frame, 0.0, |cell| shades.heights[cell].is_some() && !steppable[cell]),
                    CLOSED,
                );
            }
        });
        shades.scale(svg, axes.frame);
    }

    /// Points (s, height) of the ground along from + s · direction, for s within a range, m.
    pub fn profile(&self, from: [f64; 2], direction: [f64; 2], range: [f64; 2]) -> Vec<[f64; 2]> {
        along(from, direction, range, |x, y| height(self.grid, x, y))
    }

    /// The same of the surface that feet in the air clear, where it is another one.
    pub fn cleared(&self, from: [f64; 2], direction: [f64; 2], range: [f64; 2]) -> Vec<[f64; 2]> {
        along(from, direction, range, |x, y| {
            let inside = self.surfaces.have_edges() && height(self.grid, x, y).is_some();
            inside.then(|| self.surfaces.feet.height(x, y))
        })
    }

    /// A sample of what is hatched, for a legend.
    pub fn closed_sample(svg: &mut Svg, frame: [f64; 4]) {
        svg.rect(frame, "fill=\"#f3eede\"");
        svg.rect(frame, &format!("{CLOSED} stroke=\"#888\" stroke-width=\"0.6\""));
    }
}

fn along(
    from: [f64; 2],
    direction: [f64; 2],
    [first, last]: [f64; 2],
    height: impl Fn(f64, f64) -> Option<f64>,
) -> Vec<[f64; 2]> {
    (0..=PROFILE)
        .map(|i| first + (last - first) * f64::from(i) / f64::from(PROFILE))
        .filter_map(|s| Some([s, height(from[0] + s * direction[0], from[1] + s * direction[1])?]))
        .collect()
}

/// Bilinear interpolation of the ground's height, m; none outside the grid.
pub(super) fn height(ground: &GroundGrid, x: f64, y: f64) -> Option<f64> {
    let (u, v) = ((x - ground.origin[0]) / ground.spacing[0], (y - ground.origin[1]) / ground.spacing[1]);
    let (most_u, most_v) = ((ground.columns - 1) as f64, (ground.rows - 1) as f64);
    if !(0.0..=most_u).contains(&u) || !(0.0..=most_v).contains(&v) {
        return None;
    }
    let (i, j) = ((u as usize).min(ground.columns - 2), (v as usize).min(ground.rows - 2));
    let (a, b) = (u - i as f64, v - j as f64);
    let h = |i: usize, j: usize| ground.height[j * ground.columns + i];
    let low = h(i, j) * (1.0 - a) + h(i + 1, j) * a;
    let high = h(i, j + 1) * (1.0 - a) + h(i + 1, j + 1) * a;
    Some(low * (1.0 - b) + high * b)
}

/// Ground without data within a frame.
pub(super) fn draw_unknown(svg: &mut Svg, axes: &Axes, ground: &GroundGrid) {
    if let Some(unknown) = &ground.unknown {
        let grid = ground.grid();
        let is_unknown = |place| grid.nearest(place).is_some_and(|cell| unknown[cell]);
        let cells: Vec<bool> = places(axes).map(is_unknown).collect();
        svg.rects(runs(axes.frame, 0.0, |cell| cells[cell]), UNKNOWN);
    }
}

/// A sample of ground without data, for a legend.
pub(super) fn unknown_sample(svg: &mut Svg, frame: [f64; 4]) {
    svg.rect(frame, "fill=\"#f3eede\"");
    svg.rect(frame, &format!("{UNKNOWN} stroke=\"#888\" stroke-width=\"0.6\""));
}

/// The centers of the `RASTER` × `RASTER` cells of a frame, row by row from the top.
pub(super) fn places(axes: &Axes) -> impl Iterator<Item = [f64; 2]> {
    let at = |[a, b]: [f64; 2], i: usize| a + (b - a) * (i as f64 + 0.5) / RASTER as f64;
    let (x, y) = (axes.x, axes.y);
    (0..RASTER).rev().flat_map(move |j| (0..RASTER).map(move |i| [at(x, i), at(y, j)]))
}

/// The cells of a frame that are `inside`, as few rectangles: runs along a row, and equal rows together.
pub(super) fn runs(
    [left, top, width, height]: [f64; 4],
    overlap: f64,
    inside: impl Fn(usize) -> bool,
) -> Vec<[f64; 4]> {
    let cells: Vec<bool> = (0..RASTER * RASTER).map(inside).collect();
    let (cell_width, cell_height) = (width / RASTER as f64, height / RASTER as f64);
    let (mut rectangles, mut row) = (Vec::new(), 0);
    let rows: Vec<&[bool]> = cells.chunks(RASTER).collect();
    for equal in rows.chunk_by(|a, b| a == b) {
        let mut column = 0;
        for run in equal[0].chunk_by(|a, b| a == b) {
            if run[0] {
                rectangles.push([
                    left + column as f64 * cell_width,
                    top + row as f64 * cell_height,
                    run.len() as f64 * cell_width + overlap,
                    equal.len() as f64 * cell_height + overlap,
                ]);
            }
            column += run.len();
        }
        row += equal.len();
    }
    rectangles
}

/// Heights over a frame, and the range that their colors span.
pub(super) struct Shades {
    heights: Vec<Option<f64>>,
    low: f64,
    high: f64,
}

impl Shades {
    pub fn over(axes: &Axes, ground: &GroundGrid) -> Self {
        let heights: Vec<Option<f64>> = places(axes).map(|[x, y]| height(ground, x, y)).collect();
        let [low, high] = range(heights.iter().flatten().copied(), 0.0);
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).max(MIN_HEIGHT_RANGE));
        Self { heights, low: middle - half, high: middle + half }
    }

    pub fn band(&self, cell: usize) -> Option<usize> {
        let part = |h: f64| (h - self.low) / (self.high - self.low);
        self.heights[cell].map(|h| ((part(h) * BANDS as f64) as usize).min(BANDS - 1))
    }

    /// The scale of heights, right of the frame.
    pub fn scale(&self, svg: &mut Svg, [left, top, width, height]: [f64; 4]) {
        let (x, step) = (left + width + 8.0, height / BANDS as f64);
        for band in 0..BANDS {
            let y = top + height - (band + 1) as f64 * step;
            svg.rect([x, y, 12.0, step + OVERLAP], &band_style(band));
        }
        let font = Font { size: 11.0, ..Font::TICK }.anchored("start");
        svg.text([x, top - 6.0], &format!("{:.2} m", self.high), font);
        svg.text([x, top + height + 15.0], &format!("{:.2} m", self.low), font);
    }
}

/// From pale blue (low) over sand to brown (high), light enough for paths to stand out.
pub(super) fn band_style(band: usize) -> String {
    const STOPS: [[f64; 3]; 3] = [[206.0, 222.0, 234.0], [243.0, 238.0, 222.0], [196.0, 160.0, 118.0]];
    format!("fill=\"{}\"", ramp(&STOPS, (band as f64 + 0.5) / BANDS as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_each_cell_once() {
        // A ring of cells.
        let inside = |cell: usize| {
            let (x, y) = ((cell % RASTER) as f64 - 60.0, (cell / RASTER) as f64 - 90.0);
            (20.0..50.0).contains(&x.hypot(y))
        };
        let side = RASTER as f64;
        let rectangles = runs([0.0, 0.0, side, side], 0.0, inside);
        let mut covered = vec![0; RASTER * RASTER];
        for [x, y, w, h] in rectangles.iter().map(|r| r.map(|v| v.round() as usize)) {
            (y..y + h)
                .flat_map(|j| (x..x + w).map(move |i| j * RASTER + i))
                .for_each(|cell| covered[cell] += 1);
        }
        assert!((0..RASTER * RASTER).all(|cell| covered[cell] == i32::from(inside(cell))));
        assert!(rectangles.len() < 2 * 100, "{} rectangles", rectangles.len());
    }
}
