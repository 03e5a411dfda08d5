//! Where the way bends around ground that cannot be walked.
//!
//! A foot can stand on some cells of a raster and not on others (what is kept free, slopes beyond `contact.max_slope` or, without it, beyond the
//! friction, unless feet adhere, gaps, ground without data). With `goal.detours = false` nothing is searched. The robot gets over a place if a foot can stand close to it. Where the straight line between two stops leads over a place that it
//! does not get over, a shortest path is searched instead, on a grid with edges between neighbors. An edge costs its length, and more where
//! feet can stand on only a part of the surroundings, so that the path keeps away from what it goes around. The path is then pulled straight.

use petgraph::algo::astar;
use petgraph::graph::{NodeIndex, UnGraph};

use super::contact::ContactGround;
use super::keep_out::KeepOut;
use crate::heightfield::{Grid, Heightfield};
use crate::robot::Robot;
use crate::scenario::{GaitKind, KeepOutSpec, Scenario};
use crate::{Error, Result};

/// Distance of the nodes, m, for a robot of ANYmal's size; more where there would be more than [`MOST_NODES`].
const SPACING: f64 = 0.08;
/// Nodes, at most.
const MOST_NODES: f64 = 60_000.0;
/// The robot gets over a place if a foot can stand within this, as a fraction of the larger half size of its reach boxes …
const WITHIN_REACH: f64 = 0.8;
/// … and the border of the ground is this far, as a fraction of the distance of its feet from its middle.
const FROM_BORDER: f64 = 1.0;
/// If no foot can stand within this, as a fraction of that half size, the robot does not get over a place without a jump: a foot would land
/// beyond it while another one still stands on this side, each in its box.
const OUT_OF_REACH: f64 = 2.0;
/// Half the side of the square around a place that counts as its surroundings, as a fraction of that distance.
const SURROUNDINGS: f64 = 1.0;
/// What an edge costs more where no foot can stand in its surroundings, as a multiple of its length.
const CROWDED: f64 = 4.0;
/// A piece that is pulled straight may cost this much more than the path.
const STRAIGHTER: f64 = 1.02;

/// Places at which the way bends, x and y, m: before each stop of the scenario in turn, and before the goal.
pub type Bends = Vec<Vec<[f64; 2]>>;

/// The raster that is searched.
struct Search {
    grid: Grid,
    /// Whether the robot gets over a node.
    open: Vec<bool>,
    /// Cost of a meter at a node.
    cost: Vec<f64>,
}

/// The bends of a scenario's way; all empty where it can go straight, where nothing leads around either, and for a robot that cannot turn.
///
/// # Errors
/// [`Error::Key`] if what is kept free of feet leaves no way, not even over the border of the ground, to a robot that does not jump.
pub(super) fn bends(
    scenario: &Scenario,
    robot: &Robot,
    ground: &Heightfield,
    contact: Option<&ContactGround>,
    keep_out: Option<&KeepOut>,
) -> Result<Bends> {
    let stops = scenario.stops();
    let places: Vec<[f64; 2]> = std::iter::once(scenario.start.position)
        .chain(stops.iter().map(|stop| stop.position))
        .chain([scenario.goal.position])
        .collect();
    let straight = vec![Vec::new(); places.len() - 1];
    let max_slope = steepest(scenario);
    let everywhere = contact.is_none() && keep_out.is_none() && is_below(ground, max_slope);
    if everywhere {
        return Ok(straight);
    }
    if let Some(keep_out) = keep_out {
        ensure_way(scenario, robot, ground.extent(), keep_out, &places)?;
    }
    if !scenario.goal.detours || robot.is_sagittal() {
        return Ok(straight);
    }
    let stands = |place: [f64; 2]| {
        let [x, y] = ground.gradient(place[0], place[1]);
        contact.map_or_else(|| x.hypot(y) <= max_slope, |c| c.is_steppable(place))
            && keep_out.is_none_or(|keep_out| keep_out.allows(place))
    };
    let Ok(search) = Search::new(robot, ground.extent(), [WITHIN_REACH, FROM_BORDER], stands) else {
        return Ok(straight);
    };
    Ok(places.windows(2).map(|ends| search.around([ends[0], ends[1]])).collect())
}

/// Refuses polygons between two stops that are too wide to be stepped over and leave no way around.
fn ensure_way(
    scenario: &Scenario,
    robot: &Robot,
    extent: [f64; 4],
    keep_out: &KeepOut,
    places: &[[f64; 2]],
) -> Result<()> {
    if scenario.gait.kind == GaitKind::Custom || scenario.gait.flies() {
        return Ok(());
    }
    let Ok(search) = Search::new(robot, extent, [OUT_OF_REACH, 0.0], |place| keep_out.allows(place)) else {
        return Ok(());
    };
    for ends in places.windows(2).map(|ends| [ends[0], ends[1]]) {
        if search.line(ends).is_some() || search.shortest(ends).is_some() {
            continue;
        }
        let on_line = |k: usize| [0, 1].map(|c| ends[0][c] + k as f64 / 100.0 * (ends[1][c] - ends[0][c]));
        let deepest =
            |spec: &KeepOutSpec| (0..=100).map(|k| spec.distance(on_line(k))).fold(f64::INFINITY, f64::min);
        let depths: Vec<f64> = scenario.keep_out.iter().map(deepest).collect();
        let n = (0..depths.len()).min_by(|&a, &b| depths[a].total_cmp(&depths[b])).unwrap_or(0);
        let [[ax, ay], [bx, by]] = ends;
        let what = format!(
            "leaves no way from [{ax}, {ay}] to [{bx}, {by}]: it is too wide to be stepped over, and reaches from border to border of the ground or around one of them; make it smaller, or choose another start or goal"
        );
        return Err(Error::key(format!("keep_out[{n}].{}", scenario.keep_out[n].key()), what));
    }
    Ok(())
}

/// The steepest ground that counts as walkable.
fn steepest(scenario: &Scenario) -> f64 {
    let contact = &scenario.contact;
    let by_friction = if scenario.robot.adhesive_feet.is_empty() { contact.friction } else { f64::INFINITY };
    contact.max_slope.unwrap_or(by_friction)
}

/// Whether ground is nowhere steeper than a slope, at its samples.
fn is_below(ground: &Heightfield, slope: f64) -> bool {
    let [xs, ys] = ground.grid().lines();
    let mut steepest = 0.0_f64;
    if slope.is_finite() {
        ground.for_each_crossing(&xs, &ys, |_, _, [x, y]| steepest = steepest.max(x * x + y * y));
    }
    steepest.sqrt() <= slope
}

impl Search {
    /// With what is given as [`WITHIN_REACH`] and [`FROM_BORDER`].
    fn new(
        robot: &Robot,
        extent: [f64; 4],
        [within_reach, from_border]: [f64; 2],
        stands: impl Fn([f64; 2]) -> bool,
    ) -> Result<Self> {
        let [x_min, x_max, y_min, y_max] = extent;
        let area = (x_max - x_min) * (y_max - y_min);
        let grid = Grid::fitted(extent, (robot.size() * SPACING).max((area / MOST_NODES).sqrt()))?;
        let feet = robot.feet.iter().map(|f| f.nominal[0].hypot(f.nominal[1])).fold(0.0, f64::max);
        let half_size = robot.feet.iter().flat_map(|f| f.reach.half_size[..2].to_vec()).fold(0.0, f64::max);
        let place = |n: usize| [grid.x(n % grid.columns), grid.y(n / grid.columns)];
        let standable: Vec<bool> = (0..grid.len()).map(|n| stands(place(n))).collect();
        let spacing = grid.spacing[0].max(grid.spacing[1]);
        let within = |n: usize, reach: f64, f: &mut dyn FnMut(usize, f64)| {
            let (column, row) = ((n % grid.columns) as isize, (n / grid.columns) as isize);
            let cells = (reach / spacing).ceil() as isize;
            for v in -cells..=cells {
                for u in -cells..=cells {
                    let (c, r) = (column + u, row + v);
                    let inside =
                        (0..grid.columns as isize).contains(&c) && (0..grid.rows as isize).contains(&r);
                    if inside {
                        let distance = (u as f64 * grid.spacing[0]).hypot(v as f64 * grid.spacing[1]);
                        f(r as usize * grid.columns + c as usize, distance);
                    }
                }
            }
        };
        let (mut open, mut cost) = (Vec::new(), Vec::new());
        for n in 0..grid.len() {
            let [x, y] = place(n);
            let border = (x - x_min).min(x_max - x).min(y - y_min).min(y_max - y);
            let (mut near, mut all, mut closed) = (false, 0.0, 0.0);
            within(n, (SURROUNDINGS * feet).max(within_reach * half_size), &mut |m, distance| {
                near |= standable[m] && distance <= within_reach * half_size;
                all += 1.0;
                closed += f64::from(u8::from(!standable[m]));
            });
            open.push(near && border >= from_border * feet);
            cost.push(1.0 + CROWDED * closed / all);
        }
        Ok(Self { grid, open, cost })
    }

    fn place(&self, n: usize) -> [f64; 2] {
        [self.grid.x(n % self.grid.columns), self.grid.y(n / self.grid.columns)]
    }

    /// What the straight line between two places costs; none if the robot does not get over it. The places themselves are given.
    fn line(&self, [from, to]: [[f64; 2]; 2]) -> Option<f64> {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let steps = (2.0 * length / self.grid.spacing[0]).ceil().max(1.0);
        let mut sum = 0.0;
        for k in 0..=steps as usize {
            let u = k as f64 / steps;
            let n = self.grid.nearest([0, 1].map(|c| from[c] + u * (to[c] - from[c])))?;
            let at_end = [from, to].iter().any(|end| {
                let [x, y] = self.place(n);
                (x - end[0]).hypot(y - end[1]) < 2.0 * self.grid.spacing[0]
            });
            if !self.open[n] && !at_end {
                return None;
            }
            sum += self.cost[n];
        }
        Some(length * sum / (steps + 1.0))
    }

    /// Where the way between two places bends.
    fn around(&self, ends: [[f64; 2]; 2]) -> Vec<[f64; 2]> {
        if self.line(ends).is_some() {
            return Vec::new();
        }
        let Some(path) = self.shortest(ends) else { return Vec::new() };
        self.pulled_straight(&path)
    }

    /// A shortest path on the grid, both ends included.
    fn shortest(&self, ends: [[f64; 2]; 2]) -> Option<Vec<[f64; 2]>> {
        let [first, last] = ends.map(|end| self.grid.nearest(end));
        let (first, last) = (first?, last?);
        let columns = self.grid.columns;
        let open = |n: usize| self.open[n] || n == first || n == last;
        let length = |a: usize, b: usize| {
            let ([ax, ay], [bx, by]) = (self.place(a), self.place(b));
            (bx - ax).hypot(by - ay)
        };
        let mut graph = UnGraph::<(), f64, u32>::with_capacity(self.grid.len(), 4 * self.grid.len());
        for _ in 0..self.grid.len() {
            graph.add_node(());
        }
        for n in (0..self.grid.len()).filter(|&n| open(n)) {
            let (column, row) = (n % columns, n / columns);
            let neighbors = [(1, 0), (0, 1), (1, 1), (-1, 1)];
            for (u, v) in neighbors {
                let (Some(c), r) = (column.checked_add_signed(u), row + v) else { continue };
                let m = r * columns + c;
                if c < columns && r < self.grid.rows && open(m) {
                    let cost = length(n, m) * 0.5 * (self.cost[n] + self.cost[m]);
                    graph.add_edge(NodeIndex::new(n), NodeIndex::new(m), cost);
                }
            }
        }
        let goal = NodeIndex::new(last);
        let ahead = |n: NodeIndex<u32>| length(n.index(), last);
        let (_, nodes) = astar(&graph, NodeIndex::new(first), |n| n == goal, |edge| *edge.weight(), ahead)?;
        let mut path: Vec<[f64; 2]> = nodes.into_iter().map(|n| self.place(n.index())).collect();
        let count = path.len();
        (path[0], path[count - 1]) = (ends[0], ends[1]);
        Some(path)
    }

    /// The inner corners of a path of which each piece is as long as it can be straight at about the same cost.
    fn pulled_straight(&self, path: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut along = vec![0.0];
        for pair in path.windows(2) {
            let piece = self.line([pair[0], pair[1]]).unwrap_or(0.0);
            along.push(along[along.len() - 1] + piece);
        }
        let (mut corners, mut at) = (Vec::new(), 0);
        while at + 1 < path.len() {
            let straight = |&n: &usize| {
                let cost = self.line([path[at], path[n]]);
                cost.is_some_and(|cost| cost <= STRAIGHTER * (along[n] - along[at]))
            };
            at = (at + 2..path.len()).rev().find(straight).unwrap_or(at + 1);
            corners.push(path[at]);
        }
        corners.pop();
        corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::RobotSpec;

    fn bends_of(keep_out: &str) -> Result<Bends> {
        let text = format!(
            "[terrain]\nkind = \"flat\"\nextent = [-2.0, 2.0, -2.0, 2.0]\n[start]\nposition = [-1.2, 0.0]\n[goal]\nposition = [1.2, 0.0]\n\
             [[goal.waypoints]]\nposition = [1.2, -0.4]\n{keep_out}"
        );
        let scenario: Scenario = toml::from_str(&text).expect("a scenario");
        let robot = Robot::load(&RobotSpec::default(), ".".as_ref()).expect("a robot");
        let ground =
            Heightfield::from_function([-2.0, 2.0, -2.0, 2.0], 0.05, |_, _| Ok(0.0)).expect("a ground");
        let keep_out = KeepOut::of(&scenario, ground.extent(), robot.size(), 0.03).expect("polygons");
        bends(&scenario, &robot, &ground, None, keep_out.as_ref())
    }

    #[test]
    fn the_way_bends_around_what_is_wide_and_steps_over_what_is_narrow() {
        let square = |half: f64| {
            format!(
                "[[keep_out]]\npolygon = [[-{half}, -0.6], [{half}, -0.6], [{half}, 0.9], [-{half}, 0.9]]\n"
            )
        };
        let straight = [Vec::<[f64; 2]>::new(), vec![]];
        assert_eq!(bends_of(&square(0.02)).expect("a way"), straight);
        let around = bends_of(&square(0.4)).expect("a way");
        assert!((1..=4).contains(&around[0].len()) && around[1].is_empty(), "{around:?}");
        // Below, where the way is shorter; and not close to it.
        assert!(around[0].iter().all(|[_, y]| *y < -0.6), "{around:?}");
        // A wall from border to border has no way around; a robot that jumps may get over it.
        let wall = "[[keep_out]]\npolygon = [[-0.4, -3.0], [0.4, -3.0], [0.4, 3.0], [-0.4, 3.0]]\n";
        let error = bends_of(wall).expect_err("no way").to_string();
        assert!(
            error.starts_with("keep_out[0].polygon: leaves no way from [-1.2, 0] to [1.2, -0.4]"),
            "{error}"
        );
        assert_eq!(bends_of(&format!("{wall}[gait]\nkind = \"pronk\"\n")).expect("a jump"), straight);
    }

    #[test]
    fn the_way_bends_around_ground_that_is_steeper_than_the_friction() {
        let bends_of = |height: f64, more: &str| {
            let text = format!(
                "[terrain]\nkind = \"flat\"\nextent = [-3.0, 3.0, -3.0, 3.0]\n[start]\nposition = [-1.8, 0.0]\n[goal]\nposition = [1.8, 0.0]\n{more}"
            );
            let scenario: Scenario = toml::from_str(&text).expect("a scenario");
            let robot = Robot::load(&RobotSpec::default(), ".".as_ref()).expect("a robot");
            // A hill with steep flanks, 1.2 m wide.
            let hill = |x: f64, y: f64| Ok(height / (1.0 + ((x * x + y * y) / 0.36).powi(4)));
            let ground = Heightfield::from_function([-3.0, 3.0, -3.0, 3.0], 0.05, hill).expect("a ground");
            bends(&scenario, &robot, &ground, None, None).expect("a way")
        };
        assert!(bends_of(0.1, "") == [Vec::<[f64; 2]>::new()]);
        let around = bends_of(1.5, "");
        assert!(around[0].iter().any(|[_, y]| y.abs() > 0.6), "{around:?}");
        assert_eq!(bends_of(1.5, "detours = false\n"), [Vec::<[f64; 2]>::new()]);
        assert_eq!(bends_of(1.5, "[robot]\nadhesive_feet = [\"LF\"]\n"), [Vec::<[f64; 2]>::new()]);
    }
}
