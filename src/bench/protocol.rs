//! Which cases a bench consists of: the paper's Section V, and what goes beyond it.

use super::Options;
use super::case::Work;
use super::ways::{RADIUS, Way, cells, is_steep, steeper, thinned, ways};

/// Knot spacings of the base, in time steps.
const KNOTS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];
/// … and the horizon for them, s: a multiple of all in time steps, so that knots lie on samples.
const KNOTS_HORIZON: f64 = 9.6;
/// Horizons of `speed`, s.
const HORIZONS: [f64; 4] = [5.0, 10.0, 20.0, 40.0];

/// The four terrains of the paper.
pub const TERRAINS: [&str; 4] = ["rippled", "conic", "hilly", "pit"];
/// Their levels.
pub const LEVELS: [&str; 3] = ["easy", "medium", "hard"];
/// Robots with a full model.
pub const FULL_MODELS: [&str; 2] = ["anymal_b", "anymal_c"];
/// Both formulations.
pub const FORMULATIONS: [&str; 2] = ["warped", "direct"];
/// How a map can be found: a name and keys of `[map]`.
pub const METHODS: [(&str, &str); 8] = [
    ("shear", "method = \"shear\""),
    ("dirichlet", "method = \"dirichlet\""),
    ("arap", "method = \"arap\""),
    ("acap-local-global, as printed", "method = \"acap-local-global\"\nscale = \"determinant\""),
    ("acap-local-global", "method = \"acap-local-global\""),
    ("acap-newton", "method = \"acap-newton\""),
    ("mips", "method = \"mips\""),
    ("auto", "method = \"auto\""),
];
/// Of a quick run, which is about what there is and not how good it is.
const FEW_CELLS: &str = "cells = [24, 24, 8]\n";

/// A table or figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bench {
    /// Table I: how many motions are found, on four terrains, by both formulations.
    Table1,
    /// Fig. 4: the conformal error of the map on the ground.
    Fig4,
    /// Fig. 5: how the map's energy falls, by the paper's methods and ours.
    Fig5,
    /// Fig. 8: violation by iteration, for all headings.
    Fig8,
    /// Fig. 9: time to solve, for all headings.
    Fig9,
    /// Fig. 11: violation by iteration, for one climb.
    Fig11,
    /// Success against steepness beyond the hard level, and against coarser knots.
    Frontier,
    /// Maps by method, terrain and level.
    Map,
    /// Cost against the length of the motion.
    Speed,
    /// The plans of Table I on the full robots.
    Track,
}

impl Bench {
    /// All of them.
    pub const ALL: [Bench; 10] = [
        Bench::Table1,
        Bench::Fig4,
        Bench::Fig5,
        Bench::Fig8,
        Bench::Fig9,
        Bench::Fig11,
        Bench::Frontier,
        Bench::Map,
        Bench::Speed,
        Bench::Track,
    ];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Bench::Table1 => "table1",
            Bench::Fig4 => "fig4",
            Bench::Fig5 => "fig5",
            Bench::Fig8 => "fig8",
            Bench::Fig9 => "fig9",
            Bench::Fig11 => "fig11",
            Bench::Frontier => "frontier",
            Bench::Map => "map",
            Bench::Speed => "speed",
            Bench::Track => "track",
        }
    }

    /// The cases, in the order in which they are run.
    pub fn cases(self, options: &Options) -> Vec<Case> {
        if self == Bench::Track {
            let robots = FULL_MODELS
                .iter()
                .filter(|&&name| options.robot.as_deref().is_none_or(|robot| robot == name));
            let of = |robot: &&str| {
                let protocol = Protocol { options, robot };
                protocol.table(Work::Track, &TERRAINS, protocol.levels(&LEVELS[..2]))
            };
            return robots.flat_map(of).collect();
        }
        let protocol = Protocol { options, robot: options.robot.as_deref().unwrap_or("anymal_towr") };
        match self {
            Bench::Table1 => protocol.table(Work::Plan, &TERRAINS, protocol.levels(&LEVELS)),
            Bench::Fig8 | Bench::Fig9 => {
                protocol.table(Work::Plan, &["rippled", "conic"], protocol.levels(&["medium"]))
            }
            Bench::Fig11 => protocol.climb(),
            Bench::Fig4 => protocol.ground_errors(),
            Bench::Frontier => protocol.frontier(),
            Bench::Fig5 => protocol.energies(),
            Bench::Map => protocol.maps(),
            Bench::Speed => protocol.speed(),
            Bench::Track => unreachable!("handled above"),
        }
    }
}

/// One computation, to be done in a process of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// A name that no other case has; names its files.
    pub name: String,
    /// What is computed.
    pub work: Work,
    /// Name of the robot.
    pub robot: String,
    /// Kind of terrain.
    pub terrain: String,
    /// Level of the terrain, or the one that it departs from.
    pub level: String,
    /// Formulation, or method of the map.
    pub method: String,
    /// What the bench varies besides: name and value.
    pub parameter: Option<(&'static str, f64)>,
    /// Heading or direction of the goal θ, degrees, as the paper counts it: from +y to +x.
    pub heading: Option<f64>,
    /// The scenario file.
    pub scenario: String,
}

struct Protocol<'a> {
    options: &'a Options,
    robot: &'a str,
}

impl Protocol<'_> {
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
        of.iter()
            .filter(|t| self.options.terrains.is_empty() || self.options.terrains.iter().any(|u| u == *t))
    }

    fn formulations(&self) -> Vec<String> {
        match self.options.formulations.is_empty() {
            true => FORMULATIONS.map(String::from).to_vec(),
            false => self.options.formulations.clone(),
        }
    }

    /// Table I.
    fn table(&self, work: Work, terrains: &[&'static str], levels: Vec<String>) -> Vec<Case> {
        let mut cases = Vec::new();
        for level in &levels {
            for terrain in self.terrains(terrains) {
                for way in thinned(ways(terrain), self.quick()) {
                    for formulation in &self.formulations() {
                        cases.push(self.plan(work, terrain, level, formulation, None, 10.0, &way));
                    }
                }
            }
        }
        cases
    }

    /// Fig. 11: the climb to the top of the hill.
    fn climb(&self) -> Vec<Case> {
        let way = &ways("hilly")[5];
        let one = |level: &String| {
            let all = self.formulations().into_iter();
            all.map(|f| self.plan(Work::Plan, "hilly", level, &f, None, 10.0, way)).collect::<Vec<_>>()
        };
        self.levels(&["medium"]).iter().flat_map(one).collect()
    }

    /// Success beyond the hard level, and with fewer unknowns for each row of physics.
    fn frontier(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for terrain in self.terrains(&TERRAINS) {
            for knots in if self.quick() { &KNOTS[..2] } else { &KNOTS[..] } {
                for way in thinned(ways(terrain), true) {
                    for formulation in &self.formulations() {
                        let parameter = Some(("base_knots", *knots));
                        cases.push(self.plan(
                            Work::Plan,
                            terrain,
                            "medium",
                            formulation,
                            parameter,
                            KNOTS_HORIZON,
                            &way,
                        ));
                    }
                }
            }
        }
        for terrain in self.terrains(&TERRAINS) {
            let (name, values) = steeper(terrain);
            let values: Vec<f64> = if self.quick() { vec![values[0], values[4]] } else { values.to_vec() };
            for value in values {
                for way in thinned(ways(terrain), true) {
                    for formulation in &self.formulations() {
                        let parameter = Some((name, value));
                        cases.push(self.plan(
                            Work::Plan,
                            terrain,
                            "hard",
                            formulation,
                            parameter,
                            10.0,
                            &way,
                        ));
                    }
                }
            }
        }
        cases
    }

    /// The same way over the ripple, walked in more and more time, evaluated by one thread and by two.
    fn speed(&self) -> Vec<Case> {
        let horizons = if self.quick() { &HORIZONS[..2] } else { &HORIZONS[..] };
        let way = &ways("rippled")[3];
        let mut cases = Vec::new();
        for level in &self.levels(&["medium"]) {
            for &horizon in horizons {
                for formulation in &self.formulations() {
                    let parameter = Some(("horizon", horizon));
                    let one = self.plan(Work::Speed, "rippled", level, formulation, parameter, horizon, way);
                    let two = Case {
                        name: format!("{}-2-threads", one.name),
                        method: format!("{formulation}, 2 threads"),
                        scenario: one.scenario.replace("[solver]\n", "[solver]\nthreads = 2\n"),
                        ..one.clone()
                    };
                    cases.extend([one, two]);
                }
            }
        }
        cases
    }

    fn maps(&self) -> Vec<Case> {
        self.maps_by(&METHODS, &LEVELS)
    }

    /// Fig. 5: Algorithm 1, Gauss–Newton, and the default.
    fn energies(&self) -> Vec<Case> {
        self.maps_by(&METHODS[4..7], &["medium"])
    }

    fn maps_by(&self, methods: &[(&str, &str)], levels: &[&'static str]) -> Vec<Case> {
        let mut cases = Vec::new();
        for level in &self.levels(levels) {
            for terrain in self.terrains(&TERRAINS) {
                cases.extend(methods.iter().map(|&method| self.map(terrain, level, method)));
            }
        }
        cases
    }

    fn ground_errors(&self) -> Vec<Case> {
        let default: &[&'static str] =
            if self.options.terrains.is_empty() { &["rippled"] } else { &TERRAINS };
        let levels = self.levels(&["medium"]);
        let one = |level: &String| {
            self.terrains(default).map(|t| self.map(t, level, METHODS[6])).collect::<Vec<_>>()
        };
        levels.iter().flat_map(one).collect()
    }

    fn map(&self, terrain: &str, level: &str, (method, keys): (&str, &str)) -> Case {
        let quick = if self.quick() { "-quick" } else { "" };
        let name = format!("map-{terrain}-{level}-{}{quick}", method.replace(", ", "-").replace(' ', "-"));
        let way = &ways(terrain)[0];
        let scenario = self.scenario(&name, terrain, level, "warped", None, 10.0, way)
            + &format!("{keys}\n")
            + if self.quick() { FEW_CELLS } else { cells(terrain) };
        Case {
            name,
            work: Work::Map,
            robot: self.robot.into(),
            terrain: terrain.into(),
            level: level.into(),
            method: method.into(),
            parameter: None,
            heading: None,
            scenario,
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn plan(
        &self,
        work: Work,
        terrain: &str,
        level: &str,
        formulation: &str,
        parameter: Option<(&'static str, f64)>,
        horizon: f64,
        way: &Way,
    ) -> Case {
        let varied = parameter.map_or(String::new(), |(key, value)| format!("-{key}-{value}"));
        let name = format!("{}-{terrain}-{level}{varied}-{}-{formulation}", self.robot, way.label);
        let terrain_parameter = parameter.filter(|_| work == Work::Plan);
        let scenario = self.scenario(&name, terrain, level, formulation, terrain_parameter, horizon, way)
            + cells(terrain);
        Case {
            name,
            work,
            robot: self.robot.into(),
            terrain: terrain.into(),
            level: level.into(),
            method: formulation.into(),
            parameter,
            heading: way.heading,
            scenario,
        }
    }

    /// All that is not named has its default, for both formulations alike.
    #[allow(clippy::too_many_arguments)]
    fn scenario(
        &self,
        name: &str,
        terrain: &str,
        level: &str,
        formulation: &str,
        parameter: Option<(&'static str, f64)>,
        horizon: f64,
        way: &Way,
    ) -> String {
        let adhesive = if is_steep(terrain) { "\"LF\", \"RF\"" } else { "" };
        let (parameter, knots) = match parameter {
            Some(("base_knots", n)) => (String::new(), format!("[discretization]\nbase_knots = {n}\n\n")),
            Some((key, value)) => (format!("{key} = {value:?}\n"), String::new()),
            None => Default::default(),
        };
        let ([x, y], [u, v]) = (way.start, way.goal);
        format!(
            "# {name}, written by warpgait bench\n\
             schema = 1\nformulation = \"{formulation}\"\nhorizon = {horizon:?}\n\n\
             [robot]\nname = \"{}\"\nadhesive_feet = [{adhesive}]\n\n\
             [terrain]\nkind = \"{terrain}\"\nlevel = \"{level}\"\n{parameter}\
             extent = [-{RADIUS:?}, {RADIUS:?}, -{RADIUS:?}, {RADIUS:?}]\n\n\
             [start]\nposition = [{x:.6}, {y:.6}]\n\n[goal]\nposition = [{u:.6}, {v:.6}]\n\n\
             {knots}[solver]\nmax_iterations = 200\ntolerance = 1e-4\n\n\
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
        let options = Options { levels: vec!["medium".into()], ..Options::default() };
        let cases = Bench::Table1.cases(&options);
        let count = |terrain: &str, method: &str| {
            cases.iter().filter(|c| c.terrain == terrain && c.method == method).count()
        };
        for method in FORMULATIONS {
            assert_eq!(TERRAINS.map(|t| count(t, method)), [24, 24, 15, 15]);
        }
    }

    #[test]
    fn every_case_has_its_own_name_and_a_sound_scenario() {
        for bench in Bench::ALL {
            for quick in [false, true] {
                let cases = bench.cases(&Options { quick, ..Options::default() });
                assert!(!cases.is_empty());
                let names: std::collections::BTreeSet<&str> = cases.iter().map(|c| c.name.as_str()).collect();
                assert_eq!(names.len(), cases.len(), "{}", bench.name());
                for case in &cases {
                    // A coarse grid is built quickly.
                    let coarse = ["terrain.spacing=0.2".into()];
                    let loaded =
                        scenario::load_text(&case.name, &case.scenario, ".".as_ref(), &coarse).unwrap();
                    let ground = terrain::build(&loaded.scenario.terrain, &loaded.base_dir);
                    assert!(ground.is_ok(), "{}", case.name);
                }
            }
        }
    }

    #[test]
    fn filters_keep_what_was_asked_for() {
        let options = Options {
            terrains: vec!["pit".into()],
            formulations: vec!["direct".into()],
            quick: true,
            ..Options::default()
        };
        let cases = Bench::Table1.cases(&options);
        assert_eq!(cases.len(), 3);
        assert!(cases.iter().all(|c| c.terrain == "pit" && c.method == "direct" && c.level == "medium"));
    }
}
