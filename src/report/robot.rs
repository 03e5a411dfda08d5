//! A picture of a robot: its stance from the side and from above, with torso, reach boxes and where the feet can be.

use std::f64::consts::PI;

use super::axes::{Axes, range};
use super::svg::{Font, Svg};
use crate::robot::{Box3, Foot, Robot};

/// Postures in which the workspace is sampled.
const SAMPLES: usize = 2744;
/// Side of the dot of a sample, pixels.
const DOT: f64 = 1.6;
const COLORS: [&str; 8] =
    ["#2f6fde", "#d9641e", "#1a8a5f", "#9b3fc4", "#b3261e", "#0f8b8d", "#8a7650", "#555555"];

/// A view: the axes of the base that run to the right and up, and their names.
struct View {
    frame: [f64; 4],
    axes: [usize; 2],
    title: &'static str,
    labels: [&'static str; 2],
}

/// An SVG drawing of a robot, in the base frame with its origin at the center of mass.
pub fn robot_sheet(robot: &Robot) -> String {
    let mut svg = Svg::new(1180.0, 560.0);
    svg.text([70.0, 32.0], &robot.name, Font { size: 19.0, ..Font::TITLE });
    let key = "boxes: where the planner lets the contact points be; dots: where the joints' limits do; cross: center of mass";
    svg.text([70.0, 540.0], key, Font::LABEL.anchored("start"));
    for view in [
        View {
            frame: [70.0, 76.0, 500.0, 400.0],
            axes: [0, 2],
            title: "From the right",
            labels: ["x, m (forward)", "z, m"],
        },
        View {
            frame: [650.0, 76.0, 500.0, 400.0],
            axes: [0, 1],
            title: "From above",
            labels: ["x, m (forward)", "y, m (left)"],
        },
    ] {
        view.draw(&mut svg, robot);
    }
    svg.finish()
}

impl View {
    fn draw(&self, svg: &mut Svg, robot: &Robot) {
        let boxes = || robot.feet.iter().map(|foot| &foot.reach).chain([&robot.torso]);
        let span = |c: usize| {
            let axis = self.axes[c];
            let ends = boxes()
                .flat_map(|b| [b.center[axis] - b.half_size[axis], b.center[axis] + b.half_size[axis]]);
            range(ends.chain([0.0]), 0.15)
        };
        let axes = Axes::equal(self.frame, span(0), span(1));
        let at = |p: [f64; 3]| axes.at(p[self.axes[0]], p[self.axes[1]]);
        axes.draw(svg, self.title, self.labels[0], self.labels[1]);
        svg.clipped(self.frame, |svg| {
            for (foot, color) in robot.feet.iter().zip(COLORS.iter().cycle()) {
                let dots = workspace(foot).into_iter().map(at).map(|[x, y]| [x, y, DOT, DOT]);
                svg.rects(dots, &format!("fill=\"{color}\" fill-opacity=\"0.18\""));
            }
            svg.rect(
                self.frame_of(&axes, &robot.torso),
                "fill=\"#c9ced8\" fill-opacity=\"0.7\" stroke=\"#555\"",
            );
            for (foot, color) in robot.feet.iter().zip(COLORS.iter().cycle()) {
                let style = format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"1.6\"");
                svg.rect(self.frame_of(&axes, &foot.reach), &style);
                let links = links(foot);
                svg.polyline(
                    links.into_iter().map(at),
                    &format!("stroke=\"{color}\" stroke-width=\"4\" stroke-opacity=\"0.8\""),
                );
                svg.circle(at(foot.nominal), 4.5, &format!("fill=\"{color}\""));
                let [x, y] = at(foot.nominal);
                svg.label([x, y + 20.0], &foot.name, Font::LABEL);
            }
            let [x, y] = at([0.0; 3]);
            let style = "stroke=\"#111\" stroke-width=\"1.6\"";
            svg.line([x - 7.0, y], [x + 7.0, y], style);
            svg.line([x, y - 7.0], [x, y + 7.0], style);
        });
    }

    /// A box as left, top, width and height, pixels.
    fn frame_of(&self, axes: &Axes, b: &Box3) -> [f64; 4] {
        let [u, v] = self.axes;
        let [left, bottom] = axes.at(b.center[u] - b.half_size[u], b.center[v] - b.half_size[v]);
        let [right, top] = axes.at(b.center[u] + b.half_size[u], b.center[v] + b.half_size[v]);
        [left, top, right - left, bottom - top]
    }
}

/// The joints and the foot of a leg that stands at its nominal place.
fn links(foot: &Foot) -> Vec<[f64; 3]> {
    let Some(leg) = foot.leg() else { return Vec::new() };
    let Some(chain) = &leg.chain else { return Vec::new() };
    let placed = chain.place(&leg.posture::<f64>(foot.nominal).joint_angles());
    let end = placed.point(leg.joints() - 1, &chain.foot);
    placed.origin.into_iter().chain([end]).collect()
}

/// Contact points below the first joint for joint angles within their ranges. Of a leg of more than three joints, those whose posture in a
/// plan has such angles.
fn workspace(foot: &Foot) -> Vec<[f64; 3]> {
    let Some(leg) = foot.leg() else { return Vec::new() };
    let Some(chain) = &leg.chain else { return Vec::new() };
    let joints = chain.joints.len();
    let ranges = || chain.joints.iter().map(|joint| [joint.range[0].max(-PI), joint.range[1].min(PI)]);
    // Multiples of these fractions fill a cube of as many dimensions evenly: powers of 1/x with xⁿ⁺¹ = x + 1.
    let x = (0..30).fold(2.0_f64, |x, _| (1.0 + x).powf(1.0 / (joints as f64 + 1.0)));
    let steps: Vec<f64> = (1..=joints).map(|j| x.powi(-(j as i32))).collect();
    let points = (0..SAMPLES).map(|n| {
        let part = |step: &f64| (0.5 + n as f64 * step).fract();
        let q: Vec<f64> = ranges().zip(&steps).map(|([a, b], step)| a + (b - a) * part(step)).collect();
        let [x, y, z] = chain.foot(&q);
        [x, y, z - leg.foot_radius]
    });
    let kept = |p: &[f64; 3]| {
        let in_range = |p: [f64; 3]| {
            let angles = leg.posture::<f64>(p).joint_angles();
            angles.iter().zip(ranges()).all(|(q, [least, most])| (least..=most).contains(q))
        };
        p[2] < chain.joints[0].position.z - 2.0 * leg.foot_radius && (joints == 3 || in_range(*p))
    };
    points.filter(kept).collect()
}
