//! A small writer of SVG.

use std::fmt::{Display, Write};

use crate::visible::visible;

/// Points of a polyline closer than this to the last one drawn are left out, pixels.
const MIN_STEP: f64 = 0.4;
/// Average width of a character, in font sizes.
const CHARACTER_WIDTH: f64 = 0.62;

/// A drawing under construction; lengths are in pixels, y points down.
pub(crate) struct Svg {
    width: f64,
    height: f64,
    body: String,
    clips: usize,
}

/// Size, alignment, weight and color of a text.
#[derive(Clone, Copy)]
pub(crate) struct Font {
    /// Pixels.
    pub size: f64,
    /// `start`, `middle` or `end`.
    pub anchor: &'static str,
    pub bold: bool,
    pub color: &'static str,
}

impl Font {
    pub const TICK: Font = Font { size: 12.0, anchor: "middle", bold: false, color: "#444" };
    pub const LABEL: Font = Font { size: 13.0, anchor: "middle", bold: false, color: "#222" };
    pub const TITLE: Font = Font { size: 14.5, anchor: "start", bold: true, color: "#111" };

    pub const fn anchored(self, anchor: &'static str) -> Font {
        Font { anchor, ..self }
    }
}

impl Svg {
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, body: String::new(), clips: 0 }
    }

    /// The whole file.
    pub fn finish(self) -> String {
        let Self { width, height, body, .. } = self;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"'DejaVu Sans', Verdana, Helvetica, Arial, sans-serif\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }

    /// Adds one element, given its name and attributes.
    fn element(&mut self, element: impl Display) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "<{element}/>");
    }

    pub fn rect(&mut self, [x, y, w, h]: [f64; 4], style: &str) {
        self.element(format_args!(
            "rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" {style}"
        ));
    }

    /// Defines a fill of slanted lines, `url(#NAME)`.
    pub fn hatching(&mut self, name: &str) {
        let _ = writeln!(
            self.body,
            "<pattern id=\"{name}\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\" \
             fill=\"#333\"><rect width=\"6\" height=\"6\" fill-opacity=\"0.12\"/><rect width=\"1.2\" height=\"6\" fill-opacity=\"0.5\"/></pattern>"
        );
    }

    /// Many rectangles of one style, as one element.
    pub fn rects(&mut self, all: impl IntoIterator<Item = [f64; 4]>, style: &str) {
        let mut path = String::new();
        for [x, y, w, h] in all {
            let _ = write!(path, "M{x:.1} {y:.1}h{w:.1}v{h:.1}h{:.1}z", -w);
        }
        self.element(format_args!("path d=\"{path}\" {style}"));
    }

    pub fn circle(&mut self, [x, y]: [f64; 2], radius: f64, style: &str) {
        self.element(format_args!("circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {style}"));
    }

    pub fn line(&mut self, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], style: &str) {
        self.element(format_args!(
            "line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}"
        ));
    }

    /// A line through points; of points too close to tell apart only one is drawn.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let mut text = String::new();
        let mut last: Option<[f64; 2]> = None;
        let mut pending = None;
        for [x, y] in points {
            if last.is_some_and(|[a, b]| (x - a).hypot(y - b) < MIN_STEP) {
                pending = Some([x, y]);
                continue;
            }
            let _ = write!(text, "{x:.1},{y:.1} ");
            last = Some([x, y]);
            pending = None;
        }
        if let Some([x, y]) = pending {
            let _ = write!(text, "{x:.1},{y:.1}");
        }
        self.element(format_args!(
            "polyline points=\"{}\" fill=\"none\" stroke-linejoin=\"round\" {style}",
            text.trim_end()
        ));
    }

    /// A closed area through points.
    pub fn polygon(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let text: Vec<String> = points.into_iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        self.element(format_args!("polygon points=\"{}\" {style}", text.join(" ")));
    }

    /// A text at its anchor.
    pub fn text(&mut self, at: [f64; 2], text: &str, font: Font) {
        self.rotated_text(at, text, font, 0.0);
    }

    /// A text on a pale background, readable on top of other elements.
    pub fn label(&mut self, [x, y]: [f64; 2], text: &str, font: Font) {
        let width = CHARACTER_WIDTH * font.size * text.chars().count() as f64 + 4.0;
        let left = match font.anchor {
            "start" => x - 2.0,
            "end" => x - width + 2.0,
            _ => x - 0.5 * width,
        };
        let back = [left, y - 0.9 * font.size, width, 1.15 * font.size];
        self.rect(back, "rx=\"3\" fill=\"#fff\" fill-opacity=\"0.8\"");
        self.text([x, y], text, font);
    }

    /// A text rotated about its anchor by an angle, degrees clockwise.
    pub fn rotated_text(&mut self, [x, y]: [f64; 2], text: &str, font: Font, angle: f64) {
        let Font { size, anchor, bold, color } = font;
        let weight = if bold { " font-weight=\"bold\"" } else { "" };
        let rotation = if angle == 0.0 {
            String::new()
        } else {
            format!(" transform=\"rotate({angle} {x:.1} {y:.1})\"")
        };
        let text = visible(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(
            self.body,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" fill=\"{color}\"{weight}{rotation}>{text}</text>"
        );
    }

    /// Clips what `draw` draws to a rectangle.
    pub fn clipped(&mut self, [x, y, w, h]: [f64; 4], draw: impl FnOnce(&mut Self)) {
        self.clips += 1;
        let id = self.clips;
        let _ = writeln!(
            self.body,
            "<clipPath id=\"c{id}\"><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\"/></clipPath>\n<g clip-path=\"url(#c{id})\">"
        );
        draw(self);
        self.body.push_str("</g>\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_neither_markup_nor_control_characters() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.text([1.0, 1.0], "<b>&\u{1b}\n", Font::LABEL);
        assert!(svg.finish().contains(">&lt;b&gt;&amp;\\u{1b}\\n</text>"));
    }
}
