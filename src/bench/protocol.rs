//! The cases of each bench: the protocol of the paper's Section V, and what goes beyond it.

use super::case::{Case, Work};
use super::kind::Bench;
use super::options::BenchOptions;
use super::routes::{
    HALF_EXTENT, HILL_TOP, RIPPLE_DIAGONAL, Route, cells, has_adhesive_feet, routes, steeper, thinned,
};

/// The four terrains of the paper.
pub const TERRAINS: [&str; 4] = ["rippled", "conic", "hilly", "pit"];
/// Their levels.
pub const LEVELS: [&str; 3] = ["easy", "medium", "hard"];
/// The formulations; where none is selected, only the paper's two are run.
pub const FORMULATIONS: [&str; 3] = ["warped", "direct", "hybrid"];
/// Those of the paper.
const OF_THE_PAPER: usize = 2;
/// Tolerance of the NLP on its largest violation.
pub const TOLERANCE: f64 = 1e-4;

/// Name of a base's knot spacing, in time steps, among the parameters that are varied.
pub(super) const BASE_KNOTS: &str = "base_knots";
/// Name of the length of a motion, s, among the parameters that are varied.
const HORIZON: &str = "horizon";
/// Appended to a formulation whose NLP two threads evaluate.
pub(super) const TWO_THREADS: &str = ", 2 threads";

/// The paper's robot, as TOWR describes it.
const ROBOT: &str = "anymal_towr";
/// Robots with a full model, which replays need.
const FULL_MODELS: [&str; 2] = ["anymal_b", "anymal_c"];
/// Length of a motion, s.
const SECONDS: f64 = 10.0;
/// Lengths of the motions of `speed`, s.
const SPEED_SECONDS: [f64; 4] = [5.0, 10.0, 20.0, 40.0];
/// Knot spacings of the base in the frontier, in time steps.
const KNOTS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
/// Length of the motions of these, s: a multiple of all of them in time steps, so that knots coincide with samples.
const KNOTS_SECONDS: f64 = 9.6;
/// The levels at which plans are replayed.
const TRACK_LEVELS: [&str; 2] = ["easy", "medium"];

/// A method of the map: its name and its keys of `[map]`.
type MapMethodKeys = (&'static str, &'static str);

/// Algorithm 1 of the paper.
const LOCAL_GLOBAL: MapMethodKeys = ("acap-local-global", "method = \"acap-local-global\"");
/// Gauss–Newton on the same energy, with a barrier.
const NEWTON: MapMethodKeys = ("acap-newton", "method = \"acap-newton\"");
/// The default.
pub(super) const MIPS: MapMethodKeys = ("mips", "method = \"mips\"");
/// The cheapest that is good enough.
pub(super) const AUTO: MapMethodKeys = ("auto", "method = \"auto\"");
/// The methods of the map.
const MAP_METHODS: [MapMethodKeys; 8] = [
    ("shear", "method = \"shear\""),
    ("dirichlet", "method = \"dirichlet\""),
    ("arap", "method = \"arap\""),
    ("acap-local-global, as printed", "method = \"acap-local-global\"\nscale = \"determinant\""),
    LOCAL_GLOBAL,
    NEWTON,
    MIPS,
    AUTO,
];
/// The map's cells in a quick run, which shows that every method works, not how good its maps can be.
const QUICK_CELLS: &str = "cells = [24, 24, 8]\n";

/// The cases of a bench, in the order in which they are run.
pub fn cases(bench: Bench, options: &BenchOptions) -> Vec<Case> {
    let robots = robots(bench, options.robot.as_deref());
    robots.iter().flat_map(|robot| Protocol { options, robot }.cases(bench)).collect()
}

fn robots(bench: Bench, selected: Option<&str>) -> Vec<&str> {
    match (bench, selected) {
        (Bench::Track, None) => FULL_MODELS.to_vec(),
        (Bench::Track, Some(robot)) => FULL_MODELS.into_iter().filter(|name| *name == robot).collect(),
        (_, robot) => vec![robot.unwrap_or(ROBOT)],
    }
}

/// What the cases of a bench have in common.
struct Protocol<'a> {
    options: &'a BenchOptions,
    robot: &'a str,
}

/// The motion of a case.
#[derive(Clone, Copy)]
struct MotionCase<'a> {
    work: Work,
    terrain: &'a str,
    level: &'a str,
    formulation: &'a str,
    parameter: Option<(&'static str, f64)>,
    /// s
    seconds: f64,
    route: &'a Route,
}

impl Protocol<'_> {
    fn cases(&self, bench: Bench) -> Vec<Case> {
        match bench {
            Bench::Table1 => self.motions(Work::Plan, &TERRAINS, &LEVELS),
            Bench::Track => self.motions(Work::Track, &TERRAINS, &TRACK_LEVELS),
            Bench::Fig8 | Bench::Fig9 => self.motions(Work::Plan, &["rippled", "conic"], &["medium"]),
            Bench::Fig11 => self.climb(),
            Bench::Frontier => self.coarser_knots().into_iter().chain(self.steeper_terrains()).collect(),
            Bench::Speed => self.speed(),
            Bench::Map => self.maps(&MAP_METHODS, &TERRAINS, &LEVELS),
            Bench::Fig5 => self.maps(&[LOCAL_GLOBAL, NEWTON, MIPS], &TERRAINS, &["medium"]),
            Bench::Fig4 => {
                let terrains = if self.options.terrains.is_empty() { &TERRAINS[..1] } else { &TERRAINS };
                self.maps(&[MIPS], terrains, &["medium"])
            }
        }
    }

    fn quick(&self) -> bool {
        self.options.quick
    }

    fn levels(&self, default: &[&'static str]) -> Vec<String> {
        match (self.options.levels.is_empty(), self.quick()) {
            (false, _) => self.options.levels.clone(),
            (true, true) => vec!["medium".into()],
            (true, false) => default.iter().map(|&level| level.into()).collect(),
        }
    }

    fn terrains<'b>(&self, of: &'b [&'static str]) -> impl Iterator<Item = &'b &'static str> {
        of.iter().filter(|name| {
            self.options.terrains.is_empty() || self.options.terrains.iter().any(|other| other == *name)
        })
    }

    fn formulations(&self) -> Vec<String> {
        match self.options.formulations.is_empty() {
            true => FORMULATIONS.iter().take(OF_THE_PAPER).map(ToString::to_string).collect(),
            false => self.options.formulations.clone(),
        }
    }

    /// All routes on all terrains and levels, in both formulations; a few routes in a quick run.
    fn motions(&self, work: Work, terrains: &[&'static str], levels: &[&'static str]) -> Vec<Case> {
        let mut cases = Vec::new();
        for level in &self.levels(levels) {
            for terrain in self.terrains(terrains) {
                for route in &thinned(routes(terrain), self.quick()) {
                    for formulation in &self.formulations() {
                        let (parameter, seconds) = (None, SECONDS);
                        let motion =
                            MotionCase { work, terrain, level, formulation, parameter, seconds, route };
                        cases.push(self.motion(motion));
                    }
                }
            }
        }
        cases
    }

    /// Fig. 11: the climb to the top of the hill.
    fn climb(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for level in &self.levels(&["medium"]) {
            for formulation in &self.formulations() {
                cases.push(self.motion(MotionCase {
                    work: Work::Plan,
                    terrain: "hilly",
                    level,
                    formulation,
                    parameter: None,
                    seconds: SECONDS,
                    route: &routes("hilly")[HILL_TOP],
                }));
            }
        }
        cases
    }

    /// The frontier with fewer variables for each row of the dynamics.
    fn coarser_knots(&self) -> Vec<Case> {
        let knots = if self.quick() { &KNOTS[..2] } else { &KNOTS[..] };
        let mut cases = Vec::new();
        for terrain in self.terrains(&TERRAINS) {
            cases.extend(self.varied(terrain, "medium", BASE_KNOTS, knots, KNOTS_SECONDS));
        }
        cases
    }

    /// The frontier beyond the hard level.
    fn steeper_terrains(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for terrain in self.terrains(&TERRAINS) {
            let (name, values) = steeper(terrain);
            let values = if self.quick() { vec![values[0], values[4]] } else { values.to_vec() };
            cases.extend(self.varied(terrain, "hard", name, &values, SECONDS));
        }
        cases
    }

    /// A few routes on one terrain for each value of a parameter, in both formulations.
    fn varied(
        &self,
        terrain: &str,
        level: &str,
        name: &'static str,
        values: &[f64],
        seconds: f64,
    ) -> Vec<Case> {
        let mut cases = Vec::new();
        for &value in values {
            for route in &thinned(routes(terrain), true) {
                for formulation in &self.formulations() {
                    let (work, parameter) = (Work::Plan, Some((name, value)));
                    let motion = MotionCase { work, terrain, level, formulation, parameter, seconds, route };
                    cases.push(self.motion(motion));
                }
            }
        }
        cases
    }

    /// One route over the ripple, walked in more and more time, evaluated by one thread and by two.
    fn speed(&self) -> Vec<Case> {
        let horizons = if self.quick() { &SPEED_SECONDS[..2] } else { &SPEED_SECONDS[..] };
        let mut cases = Vec::new();
        for level in &self.levels(&["medium"]) {
            for &seconds in horizons {
                for formulation in &self.formulations() {
                    let one = self.motion(MotionCase {
                        work: Work::Speed,
                        terrain: "rippled",
                        level,
                        formulation,
                        parameter: Some((HORIZON, seconds)),
                        seconds,
                        route: &routes("rippled")[RIPPLE_DIAGONAL],
                    });
                    let two = Case {
                        name: format!("{}-2-threads", one.name),
                        method: format!("{formulation}{TWO_THREADS}"),
                        scenario: one.scenario.replace("[solver]\n", "[solver]\nthreads = 2\n"),
                        ..one.clone()
                    };
                    cases.extend([one, two]);
                }
            }
        }
        cases
    }

    fn maps(
        &self,
        methods: &[MapMethodKeys],
        terrains: &[&'static str],
        levels: &[&'static str],
    ) -> Vec<Case> {
        let mut cases = Vec::new();
        for level in &self.levels(levels) {
            for terrain in self.terrains(terrains) {
                cases.extend(methods.iter().map(|&method| self.map(terrain, level, method)));
            }
        }
        cases
    }

    fn map(&self, terrain: &str, level: &str, (method, keys): MapMethodKeys) -> Case {
        let quick = if self.quick() { "-quick" } else { "" };
        let name = format!("map-{terrain}-{level}-{}{quick}", method.replace(", ", "-").replace(' ', "-"));
        let motion = MotionCase {
            work: Work::Map,
            terrain,
            level,
            formulation: "warped",
            parameter: None,
            seconds: SECONDS,
            route: &routes(terrain)[0],
        };
        let cells = if self.quick() { QUICK_CELLS } else { cells(terrain) };
        let scenario = format!("{}{keys}\n{cells}", self.scenario(&name, motion));
        Case { name, method: method.into(), heading: None, scenario, ..self.motion(motion) }
    }

    fn motion(&self, motion: MotionCase) -> Case {
        let MotionCase { work, terrain, level, formulation, parameter, route, .. } = motion;
        let varied = parameter.map_or(String::new(), |(key, value)| format!("-{key}-{value}"));
        let name = format!("{}-{terrain}-{level}{varied}-{}-{formulation}", self.robot, route.label);
        let scenario = self.scenario(&name, motion) + cells(terrain);
        Case {
            name,
            work,
            robot: self.robot.into(),
            terrain: terrain.into(),
            level: level.into(),
            method: formulation.into(),
            parameter,
            heading: route.heading,
            scenario,
        }
    }

    /// The scenario file up to the header of its last section, `[map]`. What it does not set has its default, the same in
    /// both formulations.
    fn scenario(&self, name: &str, motion: MotionCase) -> String {
        let MotionCase { terrain, level, formulation, parameter, seconds, route, .. } = motion;
        let adhesive = if has_adhesive_feet(terrain) { "\"LF\", \"RF\"" } else { "" };
        let (terrain_key, discretization) = match parameter {
            None | Some((HORIZON, _)) => Default::default(),
            Some((BASE_KNOTS, n)) => (String::new(), format!("[discretization]\nbase_knots = {n}\n\n")),
            Some((key, value)) => (format!("{key} = {value:?}\n"), String::new()),
        };
        // The paper's robot walks as it did when the paper was compared with, and plans may use all of the friction, as in the paper.
        let gait = if self.robot == ROBOT { "[gait]\ncycle = 1.0\nduty = 0.75\n\n" } else { "" };
        let contact = if motion.work == Work::Track { "" } else { "[contact]\nfriction_margin = 0.0\n\n" };
        // Steeper and steeper ground is to be crossed, not to be gone around.
        let detours = if terrain_key.is_empty() { "" } else { "detours = false\n" };
        let ([x, y], [u, v]) = (route.start, route.goal);
        format!(
            "# {name}, written by warpgait bench\n\
             schema = 1\nformulation = \"{formulation}\"\nhorizon = {seconds:?}\n\n\
             [robot]\nname = \"{}\"\nadhesive_feet = [{adhesive}]\n\n\
             [terrain]\nkind = \"{terrain}\"\nlevel = \"{level}\"\n{terrain_key}\
             extent = [-{HALF_EXTENT:?}, {HALF_EXTENT:?}, -{HALF_EXTENT:?}, {HALF_EXTENT:?}]\n\n\
             [start]\nposition = [{x:.6}, {y:.6}]\n\n[goal]\nposition = [{u:.6}, {v:.6}]\n{detours}\n\
             {gait}{contact}{discretization}[solver]\nmax_iterations = 200\ntolerance = {TOLERANCE:e}\n\n\
             [map]\n",
            self.robot
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scenario, terrain};

    #[test]
    fn table_one_has_the_cases_of_the_paper() {
        let options = BenchOptions { levels: vec!["medium".into()], ..BenchOptions::default() };
        let cases = cases(Bench::Table1, &options);
        let count = |terrain: &str, method: &str| {
            cases.iter().filter(|c| c.terrain == terrain && c.method == method).count()
        };
        assert!(cases.iter().all(|case| case.method != "hybrid"));
        for method in FORMULATIONS.into_iter().take(OF_THE_PAPER) {
            assert_eq!(TERRAINS.map(|t| count(t, method)), [24, 24, 15, 15]);
        }
    }

    #[test]
    fn every_case_has_a_unique_name_and_a_valid_scenario() {
        for bench in Bench::ALL {
            for quick in [false, true] {
                let cases = super::cases(bench, &BenchOptions { quick, ..BenchOptions::default() });
                assert!(!cases.is_empty());
                let names: std::collections::BTreeSet<&str> = cases.iter().map(|c| c.name.as_str()).collect();
                assert_eq!(names.len(), cases.len(), "{}", bench.name());
                for case in &cases {
                    // A coarse grid is built quickly.
                    let coarse = ["terrain.spacing=0.2".into()];
                    let loaded =
                        scenario::load_text(&case.name, &case.scenario, ".".as_ref(), &coarse).unwrap();
                    let ground = terrain::build(&loaded.scenario, &loaded.robot, &loaded.base_dir);
                    assert!(ground.is_ok(), "{}", case.name);
                }
            }
        }
    }

    #[test]
    fn the_routes_of_table_one_go_straight() {
        let cases = cases(Bench::Table1, &BenchOptions::default());
        let mut count = 0;
        for case in cases.iter().filter(|case| case.method == "direct") {
            let coarse = ["terrain.spacing=0.05".into()];
            let loaded = scenario::load_text(&case.name, &case.scenario, ".".as_ref(), &coarse).unwrap();
            let ground = terrain::build(&loaded.scenario, &loaded.robot, &loaded.base_dir).unwrap();
            let surfaces = terrain::Surfaces::of(&loaded.scenario, &loaded.robot, &ground).unwrap();
            assert!(
                loaded.scenario.goal.detours && surfaces.bends.iter().all(Vec::is_empty),
                "{}",
                case.name
            );
            count += 1;
        }
        assert!(count >= 78, "{count}");
    }

    #[test]
    fn filters_keep_the_selected_cases() {
        let options = BenchOptions {
            terrains: vec!["pit".into()],
            formulations: vec!["direct".into()],
            quick: true,
            ..BenchOptions::default()
        };
        let cases = cases(Bench::Table1, &options);
        assert_eq!(cases.len(), 3);
        assert!(cases.iter().all(|c| c.terrain == "pit" && c.method == "direct" && c.level == "medium"));
    }
}
