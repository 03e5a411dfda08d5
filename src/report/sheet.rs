//! One page that shows a plan: from above, from the side, contacts, forces, convergence.

use super::axes::{Axes, range};
use super::color::foot_color;
use super::ground::{DrawnGround, unknown_sample};
use super::svg::{Font, Svg};
use super::table::{check_counts, number};
use crate::plan::Plan;
use crate::scenario::{self, KeepOutSpec};
use crate::terrain::Surfaces;

/// A motion shorter than this has no direction to be viewed along, m.
const MIN_LENGTH: f64 = 0.05;
/// Histories up to this length are drawn with a dot for each iteration.
const MAX_DOTS: usize = 60;
/// Limits that would have to give, of which the place is shown.
const MOST_SHORTFALLS: usize = 6;
/// Names of failed checks in the heading.
const MAX_NAMES: usize = 3;
/// Style of the base's path.
const BASE: &str = "stroke=\"#111\" stroke-width=\"2.4\"";
/// Style of the surface that feet in the air clear.
const CLEARED: &str = "stroke=\"#555\" stroke-width=\"1.1\" stroke-dasharray=\"4 3\"";
/// Style of the way that the scenario asks for.
const WAY: &str = "stroke=\"#111\" stroke-width=\"1.2\" stroke-dasharray=\"7 4\" stroke-opacity=\"0.7\"";
/// Style of what is kept free of feet.
const KEPT_FREE: &str = "fill=\"#b3261e\" fill-opacity=\"0.18\" stroke=\"#b3261e\" stroke-width=\"1.4\"";
/// Height of the legends, pixels from the top.
const LEGEND: f64 = 80.0;

/// An SVG drawing of a plan and of the surfaces that it was made with.
pub fn sheet(plan: &Plan, surfaces: &Surfaces) -> String {
    let mut svg = Svg::new(1280.0, 1010.0);
    let ground = DrawnGround { grid: &plan.ground, surfaces };
    heading(&mut svg, plan);
    from_above(&mut svg, plan, &ground, [70.0, 110.0, 540.0, 480.0]);
    from_the_side(&mut svg, plan, &ground, [700.0, 110.0, 550.0, 260.0]);
    legend(&mut svg, plan, &ground);
    contacts(&mut svg, plan, [700.0, 450.0, 550.0, 140.0]);
    normal_forces(&mut svg, plan, [70.0, 680.0, 720.0, 270.0]);
    convergence(&mut svg, plan, [880.0, 680.0, 370.0, 270.0]);
    svg.finish()
}

fn heading(svg: &mut Svg, plan: &Plan) {
    let meta = &plan.meta;
    let [first, last] = [plan.t[0], plan.t[plan.t.len() - 1]];
    let title = format!("{}, {} formulation, {} s", meta.robot.name, meta.formulation, number(last - first));
    svg.text([70.0, 32.0], &title, Font { size: 19.0, ..Font::TITLE });
    let failed: Vec<&str> =
        meta.checks.iter().filter(|row| !row.passed).map(|row| row.name.as_str()).collect();
    let names = failed[..failed.len().min(MAX_NAMES)].join(", ");
    let checks = match (meta.checks.len(), failed.len()) {
        (0, _) => "not checked".to_owned(),
        (_, 0) => check_counts(&meta.checks),
        (_, 1..=MAX_NAMES) => format!("{}: {names}", check_counts(&meta.checks)),
        _ => format!("{}: {names}, …", check_counts(&meta.checks)),
    };
    let solver = &meta.solver;
    let text = format!(
        "{}; {} iterations, {} s, largest violation {}; {checks}",
        solver.status,
        solver.iterations,
        number(solver.seconds.total),
        number(solver.max_violation)
    );
    let color = if solver.success && failed.is_empty() { "#1b6e44" } else { "#b3261e" };
    svg.text([70.0, 56.0], &text, Font { size: 13.5, anchor: "start", bold: false, color });
}

/// Names and samples of what is drawn, left for the view from above and right for all panels.
fn legend(svg: &mut Svg, plan: &Plan, ground: &DrawnGround) {
    let edges = ground.surfaces.have_edges();
    let name =
        |svg: &mut Svg, x: f64, name: &str| svg.text([x + 30.0, LEGEND], name, Font::TICK.anchored("start"));
    let line = |svg: &mut Svg, x: f64, style: &str, what: &str| {
        svg.line([x, LEGEND - 4.0], [x + 24.0, LEGEND - 4.0], style);
        name(svg, x, what);
    };
    let mut x = 700.0;
    line(svg, x, BASE, "base");
    for (e, foot) in plan.foot_names.iter().enumerate() {
        x += 74.0;
        line(svg, x, &stroke(e, 2.4), foot);
    }
    if edges {
        line(svg, x + 74.0, CLEARED, "cleared by swinging feet");
    }
    let box_at = |x: f64| [x + 4.0, LEGEND - 11.0, 20.0, 13.0];
    x = 70.0;
    svg.circle([x + 14.0, LEGEND - 4.0], 4.0, "fill=\"#555\" stroke=\"#fff\" stroke-width=\"0.8\"");
    name(svg, x, "foothold");
    if edges {
        x += 100.0;
        svg.rect(box_at(x), &patch_style("#555"));
        name(svg, x, "patch around it");
        x += 140.0;
        DrawnGround::closed_sample(svg, box_at(x));
        name(svg, x, "no foot can stand here");
        x += 60.0;
    }
    if plan.ground.unknown.is_some() {
        x += 110.0;
        unknown_sample(svg, box_at(x));
        name(svg, x, "no data");
    }
}

/// The part of a plane within which a foothold lies.
fn patch_style(color: &str) -> String {
    format!("fill=\"#fff\" fill-opacity=\"0.3\" stroke=\"{color}\" stroke-width=\"1.3\"")
}

fn stroke(foot: usize, width: f64) -> String {
    format!("stroke=\"{}\" stroke-width=\"{width}\"", foot_color(foot))
}

fn from_above(svg: &mut Svg, plan: &Plan, ground: &DrawnGround, frame: [f64; 4]) {
    let visited = |axis: usize| plan.base_position.iter().chain(&plan.foot_position).map(move |p| p[axis]);
    let axes = Axes::equal(frame, range(visited(0), 0.12), range(visited(1), 0.12));
    let conditions = Asked::of(plan, ground.surfaces);
    ground.draw(svg, &axes);
    axes.draw(svg, "From above, ground shaded by height", "x, m", "y, m");
    svg.clipped(frame, |svg| {
        for (e, patches) in plan.patches.iter().enumerate() {
            for corners in patches {
                svg.polygon(corners.map(|[x, y, _]| axes.at(x, y)), &patch_style(foot_color(e)));
            }
        }
        for e in 0..plan.foot_names.len() {
            let path = foot_samples(plan, e).map(|(_, p)| axes.at(p[0], p[1]));
            svg.polyline(path, &format!("{} stroke-opacity=\"0.75\"", stroke(e, 1.1)));
        }
        for e in 0..plan.foot_names.len() {
            for (_, [x, y, _]) in footholds(plan, e) {
                let style = format!("fill=\"{}\" stroke=\"#fff\" stroke-width=\"0.8\"", foot_color(e));
                svg.circle(axes.at(x, y), 4.0, &style);
            }
        }
        for corners in conditions.keep_out.iter().flat_map(KeepOutSpec::loops) {
            svg.polygon(corners.iter().map(|[x, y]| axes.at(*x, *y)), KEPT_FREE);
        }
        if conditions.way.len() > 2 {
            svg.polyline(conditions.way.iter().map(|[x, y]| axes.at(*x, *y)), WAY);
        }
        svg.polyline(plan.base_position.iter().map(|p| axes.at(p[0], p[1])), BASE);
        let [start, end] =
            [plan.base_position[0], plan.base_position[plan.t.len() - 1]].map(|p| axes.at(p[0], p[1]));
        svg.circle(start, 6.0, "fill=\"#fff\" stroke=\"#111\" stroke-width=\"2\"");
        svg.circle(end, 6.0, "fill=\"#111\" stroke=\"#fff\" stroke-width=\"1.5\"");
        for shortfall in plan.meta.explanation.iter().flat_map(|why| &why.shortfalls).take(MOST_SHORTFALLS) {
            let [u, v] = axes.at(shortfall.place[0], shortfall.place[1]);
            svg.circle([u, v], 9.0, "fill=\"none\" stroke=\"#b3261e\" stroke-width=\"2.4\"");
            svg.label(
                [u + 12.0, v + 4.0],
                &shortfall.words,
                Font { color: "#b3261e", ..Font::TICK }.anchored("start"),
            );
        }
        for [x, y] in &conditions.waypoints {
            let [u, v] = axes.at(*x, *y);
            let diamond = [[u - 6.0, v], [u, v - 6.0], [u + 6.0, v], [u, v + 6.0]];
            svg.polygon(diamond, "fill=\"#fff\" stroke=\"#111\" stroke-width=\"1.8\"");
        }
    });
}

/// What the scenario of a plan asks for, x and y, m.
#[derive(Default)]
struct Asked {
    /// Where the way goes straight in between.
    way: Vec<[f64; 2]>,
    waypoints: Vec<[f64; 2]>,
    keep_out: Vec<KeepOutSpec>,
}

impl Asked {
    fn of(plan: &Plan, surfaces: &Surfaces) -> Self {
        let Ok(scenario) = scenario::parse("meta.scenario", &plan.meta.scenario) else {
            return Self::default();
        };
        let mut way = vec![scenario.start.position];
        let stops = scenario.stops().into_iter().map(|stop| stop.position).chain([scenario.goal.position]);
        for (n, stop) in stops.enumerate() {
            way.extend(surfaces.bends.get(n).into_iter().flatten());
            way.push(stop);
        }
        let waypoints = scenario.goal.waypoints.iter().map(|w| w.position).collect();
        Self { way, waypoints, keep_out: scenario.keep_out }
    }
}

/// Index and position of each sample of one foot.
fn foot_samples(plan: &Plan, foot: usize) -> impl Iterator<Item = (usize, [f64; 3])> {
    plan.foot_position.iter().skip(foot).step_by(plan.foot_names.len()).copied().enumerate()
}

/// Sample and position of every touch-down of a foot; the first stance counts as one.
fn footholds(plan: &Plan, foot: usize) -> impl Iterator<Item = (usize, [f64; 3])> {
    let feet = plan.foot_names.len();
    let stands = move |n: usize| plan.foot_contact[n * feet + foot];
    foot_samples(plan, foot).filter(move |&(n, _)| stands(n) && (n == 0 || !stands(n - 1)))
}

fn from_the_side(svg: &mut Svg, plan: &Plan, ground: &DrawnGround, frame: [f64; 4]) {
    // The horizontal axis runs from start to goal, or along x when they coincide.
    let [a, b] = [plan.base_position[0], plan.base_position[plan.t.len() - 1]];
    let length = (b[0] - a[0]).hypot(b[1] - a[1]);
    let direction =
        if length > MIN_LENGTH { [(b[0] - a[0]) / length, (b[1] - a[1]) / length] } else { [1.0, 0.0] };
    let along = move |p: &[f64; 3]| (p[0] - a[0]) * direction[0] + (p[1] - a[1]) * direction[1];

    let x = range(plan.base_position.iter().chain(&plan.foot_position).map(along), 0.04);
    // The ground on the straight line from start to goal.
    let profile = ground.profile([a[0], a[1]], direction, x);
    let heights = plan.base_position.iter().chain(&plan.foot_position).map(|p| p[2]);
    let y = range(heights.chain(profile.iter().map(|p| p[1])), 0.08);
    let axes = Axes::equal(frame, x, y);
    svg.clipped(frame, |svg| {
        let floor = axes.y[0];
        let ends = [profile.last(), profile.first()].into_iter().flatten().map(|p| [p[0], floor]);
        let outline: Vec<[f64; 2]> =
            profile.iter().copied().chain(ends).map(|[s, z]| axes.at(s, z)).collect();
        svg.polygon(outline, "fill=\"#e6dcc6\" stroke=\"#8a7650\" stroke-width=\"1.2\"");
        let cleared = ground.cleared([a[0], a[1]], direction, x);
        svg.polyline(cleared.iter().map(|[s, z]| axes.at(*s, *z)), CLEARED);
    });
    axes.draw(
        svg,
        "From the side, ground on the straight line from start to goal",
        "distance from the start, m",
        "z, m",
    );
    svg.clipped(frame, |svg| {
        for e in 0..plan.foot_names.len() {
            let path = foot_samples(plan, e).map(|(_, p)| axes.at(along(&p), p[2]));
            svg.polyline(path, &stroke(e, 1.3));
        }
        svg.polyline(plan.base_position.iter().map(|p| axes.at(along(p), p[2])), BASE);
    });
}

fn time_range(plan: &Plan) -> [f64; 2] {
    [plan.t[0], plan.t[plan.t.len() - 1]]
}

fn contacts(svg: &mut Svg, plan: &Plan, frame: [f64; 4]) {
    let feet = plan.foot_names.len();
    let axes = Axes::new(frame, time_range(plan), [0.0, feet as f64]);
    axes.draw(svg, "Stance", "time, s", "");
    let bar = frame[3] / feet as f64;
    for (e, name) in plan.foot_names.iter().enumerate() {
        let top = frame[1] + e as f64 * bar;
        svg.text([frame[0] - 8.0, top + 0.5 * bar + 4.0], name, Font::TICK.anchored("end"));
        let mut n = 0;
        while n < plan.t.len() {
            let begin = n;
            while n < plan.t.len() && plan.foot_contact[n * feet + e] {
                n += 1;
            }
            if n > begin {
                let [[x1, _], [x2, _]] = [plan.t[begin], plan.t[n - 1]].map(|t| axes.at(t, 0.0));
                svg.rect([x1, top + 0.18 * bar, x2 - x1, 0.64 * bar], &format!("fill=\"{}\"", foot_color(e)));
            }
            n += 1;
        }
    }
}

fn normal_forces(svg: &mut Svg, plan: &Plan, frame: [f64; 4]) {
    let feet = plan.foot_names.len();
    let along: Vec<f64> = plan
        .foot_force
        .iter()
        .zip(&plan.foot_normal)
        .map(|(force, normal)| (0..3).map(|k| force[k] * normal[k]).sum())
        .collect();
    let robot = &plan.meta.robot;
    let weight = robot.mass * robot.gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let [low, high] = range(along.iter().copied().chain([weight]), 0.05);
    let axes = Axes::new(frame, time_range(plan), [low.min(0.0), high]);
    axes.draw(svg, "Normal force of each foot; dashed: the robot's weight", "time, s", "force, N");
    svg.clipped(frame, |svg| {
        let ends = time_range(plan).map(|t| axes.at(t, weight));
        svg.line(ends[0], ends[1], "stroke=\"#555\" stroke-dasharray=\"6 4\"");
        for e in 0..feet {
            let points = (0..plan.t.len()).map(|n| axes.at(plan.t[n], along[n * feet + e]));
            svg.polyline(points, &stroke(e, 1.3));
        }
    });
}

fn convergence(svg: &mut Svg, plan: &Plan, frame: [f64; 4]) {
    let violation = &plan.history_constraint_violation;
    let axes = Axes::logarithmic(frame, [0.0, violation.len().saturating_sub(1).max(1) as f64], violation);
    axes.draw(svg, "Largest violation by iteration", "iteration", "units of the NLP");
    if violation.is_empty() {
        let middle = [frame[0] + 0.5 * frame[2], frame[1] + 0.5 * frame[3]];
        return svg.text(middle, "the plan holds no history", Font::LABEL);
    }
    let points = || violation.iter().enumerate().map(|(i, v)| axes.at(i as f64, *v));
    svg.clipped(frame, |svg| svg.polyline(points(), "stroke=\"#2166ac\" stroke-width=\"1.6\""));
    if violation.len() <= MAX_DOTS {
        points().for_each(|point| svg.circle(point, 2.6, "fill=\"#2166ac\""));
    }
}
