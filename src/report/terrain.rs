//! A picture of a ground: from above with its axes, north, start and goal, and along the way.

use super::axes::{Axes, range};
use super::ground::{
    BANDS, OVERLAP, PROFILE, Shades, band_style, draw_unknown, height, runs, unknown_sample,
};
use super::svg::{Font, Svg};
use crate::plan::GroundGrid;

/// Style of the way.
const WAY: &str = "stroke=\"#111\" stroke-width=\"1.6\" stroke-dasharray=\"7 4\"";
/// Length of the arrows along x and y, pixels.
const ARROW: f64 = 44.0;

/// What is drawn.
pub struct TerrainView<'a> {
    /// The heading.
    pub title: &'a str,
    /// The ground, holes filled.
    pub ground: &'a GroundGrid,
    /// Positions of start and goal, m.
    pub ends: Option<[[f64; 2]; 2]>,
    /// Lines of text beside the drawing.
    pub facts: &'a [String],
}

/// An SVG drawing of a ground.
pub fn terrain_sheet(view: &TerrainView) -> String {
    let mut svg = Svg::new(1180.0, 680.0);
    svg.text([70.0, 32.0], view.title, Font { size: 19.0, ..Font::TITLE });
    from_above(&mut svg, view, [70.0, 76.0, 560.0, 540.0]);
    facts(&mut svg, view, [730.0, 90.0]);
    profile(&mut svg, view, [730.0, 440.0, 420.0, 176.0]);
    svg.finish()
}

/// First and last node along an axis, m.
fn side(ground: &GroundGrid, axis: usize) -> [f64; 2] {
    let count = [ground.columns, ground.rows][axis];
    let first = ground.origin[axis];
    [first, first + ground.spacing[axis] * (count - 1) as f64]
}

fn from_above(svg: &mut Svg, view: &TerrainView, frame: [f64; 4]) {
    let ground = view.ground;
    let axes = Axes::equal(frame, range(side(ground, 0), 0.03), range(side(ground, 1), 0.03));
    let shades = Shades::over(&axes, ground);
    svg.clipped(frame, |svg| {
        svg.rect(frame, "fill=\"#f4f4f4\"");
        for band in 0..BANDS {
            svg.rects(runs(frame, OVERLAP, |cell| shades.band(cell) == Some(band)), &band_style(band));
        }
        draw_unknown(svg, &axes, ground);
    });
    shades.scale(svg, frame);
    axes.draw(svg, "From above, shaded by height", "x, m (forward)", "y, m (left)");
    svg.clipped(frame, |svg| {
        if let Some([start, goal]) = view.ends {
            let [a, b] = [start, goal].map(|[x, y]| axes.at(x, y));
            svg.line(a, b, WAY);
            svg.circle(a, 7.0, "fill=\"#fff\" stroke=\"#111\" stroke-width=\"2\"");
            svg.circle(b, 7.0, "fill=\"#111\" stroke=\"#fff\" stroke-width=\"1.5\"");
            svg.label([a[0] + 11.0, a[1] - 9.0], "start", Font::LABEL.anchored("start"));
            svg.label([b[0] + 11.0, b[1] - 9.0], "goal", Font::LABEL.anchored("start"));
        }
    });
    let corner = [frame[0] + 18.0, frame[1] + frame[3] - 18.0];
    arrow(svg, corner, [1.0, 0.0], "x, east on a map");
    arrow(svg, corner, [0.0, -1.0], "y, north on a map");
}

/// An arrow from a corner, with a name at its tip.
fn arrow(svg: &mut Svg, [x, y]: [f64; 2], [dx, dy]: [f64; 2], name: &str) {
    let tip = [x + ARROW * dx, y + ARROW * dy];
    svg.line([x, y], tip, "stroke=\"#b3261e\" stroke-width=\"2.2\"");
    let at = |along: f64, beside: f64| [tip[0] + along * dx - beside * dy, tip[1] + along * dy + beside * dx];
    svg.polygon([at(8.0, 0.0), at(0.0, 4.5), at(0.0, -4.5)], "fill=\"#b3261e\"");
    let font = Font { color: "#b3261e", ..Font::TICK }.anchored("start");
    let place = if dx > 0.0 { [tip[0] + 12.0, tip[1] + 4.0] } else { [tip[0] - 4.0, tip[1] - 13.0] };
    svg.label(place, name, font);
}

fn facts(svg: &mut Svg, view: &TerrainView, [x, mut y]: [f64; 2]) {
    for line in view.facts {
        for part in wrapped(line) {
            svg.text([x, y], &part, Font::LABEL.anchored("start"));
            y += 19.0;
        }
    }
    if view.ground.unknown.is_some() {
        unknown_sample(svg, [x, y - 11.0, 20.0, 13.0]);
        svg.text([x + 28.0, y], "no data: filled from its surroundings", Font::LABEL.anchored("start"));
    }
}

/// A text in lines of a length that fits beside the drawing.
fn wrapped(text: &str) -> Vec<String> {
    const LENGTH: usize = 58;
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.last_mut();
        match last {
            Some(line) if line.is_empty() => *line = word.to_owned(),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= LENGTH => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The ground on the straight line from start to goal, or along x through the middle.
fn profile(svg: &mut Svg, view: &TerrainView, frame: [f64; 4]) {
    let ground = view.ground;
    let way = view.ends.filter(|[a, b]| a != b);
    let [[x, y], end] = way.unwrap_or_else(|| {
        let [x, y] = [side(ground, 0), side(ground, 1)];
        let middle = 0.5 * (y[0] + y[1]);
        [[x[0], middle], [x[1], middle]]
    });
    let length = (end[0] - x).hypot(end[1] - y);
    let points: Vec<[f64; 2]> = (0..=PROFILE)
        .map(|i| f64::from(i) / f64::from(PROFILE))
        .filter_map(|t| Some([t * length, height(ground, x + t * (end[0] - x), y + t * (end[1] - y))?]))
        .collect();
    let heights = range(points.iter().map(|p| p[1]), 0.15);
    let axes = Axes::new(frame, [0.0, length], heights);
    svg.clipped(frame, |svg| {
        let ends = [points.last(), points.first()].into_iter().flatten().map(|p| [p[0], axes.y[0]]);
        let outline: Vec<[f64; 2]> = points.iter().copied().chain(ends).map(|[s, z]| axes.at(s, z)).collect();
        svg.polygon(outline, "fill=\"#e6dcc6\" stroke=\"#8a7650\" stroke-width=\"1.2\"");
    });
    let title = if way.is_some() { "From start to goal" } else { "Along x, through the middle" };
    axes.draw(svg, title, "distance, m", "z, m");
}
