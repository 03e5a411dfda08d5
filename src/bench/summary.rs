//! From rows to groups: counts, medians and maxima.

use serde::Serialize;

use super::case::{Case, CaseRow};
use super::measured::{MapMeasured, MotionMeasured};
use crate::replay::{Tracked, Verdict};

/// Summary of the cases that differ only in start and goal. Figures of motions are medians unless their names end in `max`;
/// those of the map, which is the same for all cases of a group, are maxima.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Group {
    /// Name of the robot.
    pub robot: String,
    /// Kind of terrain.
    pub terrain: String,
    /// Level of the terrain, or the one whose parameter is varied.
    pub level: String,
    /// Formulation, or method of the map.
    pub method: String,
    /// Name and value of a parameter that the bench varies besides.
    pub parameter: Option<(&'static str, f64)>,
    /// Number of cases.
    pub cases: usize,
    /// Cases with a motion that meets the tolerance.
    pub solved: usize,
    /// … and passes all checks.
    pub passed: usize,
    /// Cases without a result.
    pub without_result: usize,
    /// Cases that needed a continuation.
    pub continued: usize,
    /// Iterations of the solved cases.
    pub iterations: Option<f64>,
    /// Maximum of that.
    pub iterations_max: Option<f64>,
    /// First iteration within the tolerance, of the solved cases.
    pub first_feasible: Option<f64>,
    /// Processor time of guess and NLP, s, of all cases with a motion.
    pub cpu_solve: Option<f64>,
    /// Maximum of that, s.
    pub cpu_solve_max: Option<f64>,
    /// Processor time of the map, s, where one of the cases built it.
    pub cpu_map: Option<f64>,
    /// Largest violation of a case, units of the NLP.
    pub violation: Option<f64>,
    /// Maximum of that.
    pub violation_max: Option<f64>,
    /// Mean conformal error of the map on the ground, %.
    pub conformal_error: Option<f64>,
    /// Maximum of the conformal error of the map on the ground, %.
    pub conformal_error_max: Option<f64>,
    /// Maximum distance of the map's bottom from the terrain, mm.
    pub misfit: Option<f64>,
    /// Points where the map is folded.
    pub inversions: Option<f64>,
    /// Final energy of the map, m³; energies of different methods cannot be compared.
    pub energy: Option<f64>,
    /// The method that made the map, which `auto` selects.
    pub taken: Option<&'static str>,
    /// Numbers of replays that pass, are marginal, and fail.
    pub replayed: [usize; 3],
    /// The metrics that decide against replays, each with the number of replays that it decides, most frequent first.
    pub objections: Vec<(String, usize)>,
}

impl Group {
    fn of(rows: &[&CaseRow]) -> Self {
        let case = &rows[0].case;
        let mut group = Self {
            robot: case.robot.clone(),
            terrain: case.terrain.clone(),
            level: case.level.clone(),
            method: case.method.clone(),
            parameter: case.parameter,
            cases: rows.len(),
            without_result: rows.iter().filter(|row| row.outcome.is_err()).count(),
            ..Self::default()
        };
        group.add_motions(rows);
        group.add_maps(rows);
        group.add_replays(rows);
        group
    }

    fn add_motions(&mut self, rows: &[&CaseRow]) {
        let motions: Vec<&MotionMeasured> = rows.iter().filter_map(|row| row.motion()).collect();
        let solved: Vec<&MotionMeasured> = motions.iter().copied().filter(|m| m.solved).collect();
        self.solved = solved.len();
        self.passed = solved.iter().filter(|m| m.passed).count();
        self.continued = motions.iter().filter(|m| m.continuation).count();

        let iterations = || solved.iter().map(|m| m.iterations as f64);
        let violations = || motions.iter().map(|m| m.violation);
        let with_motion = || rows.iter().filter(|row| row.motion().is_some());
        let cpu_solve = || with_motion().filter_map(|row| Some(row.measured()?.cpu.solve));
        self.iterations = median(iterations());
        self.iterations_max = max(iterations());
        self.first_feasible = median(solved.iter().filter_map(|m| Some(m.first_feasible? as f64)));
        self.cpu_solve = median(cpu_solve());
        self.cpu_solve_max = max(cpu_solve());
        self.violation = median(violations());
        self.violation_max = max(violations());
    }

    fn add_maps(&mut self, rows: &[&CaseRow]) {
        let maps: Vec<&MapMeasured> = rows.iter().filter_map(|row| row.map()).collect();
        let largest = |value: fn(&MapMeasured) -> f64| max(maps.iter().map(|map| value(map)));
        let built = rows.iter().filter(|row| row.map().is_some_and(|map| !map.cached));
        self.cpu_map = max(built.filter_map(|row| Some(row.measured()?.cpu.map)));
        self.conformal_error = largest(|map| 100.0 * map.report.conformal_ground.mean);
        self.conformal_error_max = largest(|map| 100.0 * map.report.conformal_ground.max);
        self.misfit = largest(|map| 1e3 * map.report.misfit_max);
        self.inversions = largest(|map| map.report.inverted_points as f64);
        self.energy = largest(|map| map.report.energy);
        self.taken = maps.first().map(|map| map.report.method.name());
    }

    fn add_replays(&mut self, rows: &[&CaseRow]) {
        let tracks: Vec<&Tracked> = rows.iter().filter_map(|row| row.track()).collect();
        self.replayed = [Verdict::Pass, Verdict::Marginal, Verdict::Fail]
            .map(|verdict| tracks.iter().filter(|track| track.verdict == verdict).count());
        self.objections = objections(&tracks);
    }
}

/// The groups, in the order of their first rows.
pub fn groups(rows: &[CaseRow]) -> Vec<Group> {
    let mut sorted: Vec<Vec<&CaseRow>> = Vec::new();
    for row in rows {
        match sorted.iter_mut().find(|group| belong_together(&group[0].case, &row.case)) {
            Some(group) => group.push(row),
            None => sorted.push(vec![row]),
        }
    }
    sorted.iter().map(|group| Group::of(group)).collect()
}

fn belong_together(a: &Case, b: &Case) -> bool {
    let names = |case: &Case| [&case.robot, &case.terrain, &case.level, &case.method].map(String::clone);
    names(a) == names(b) && a.parameter == b.parameter
}

/// The first metric that decides against each replay, counted, most frequent first.
fn objections(tracks: &[&Tracked]) -> Vec<(String, usize)> {
    let mut counted: Vec<(String, usize)> = Vec::new();
    for metric in tracks.iter().filter_map(|track| track.first_failing()) {
        let name = format!("{}: {}", metric.layer, metric.name);
        match counted.iter_mut().find(|(known, _)| *known == name) {
            Some((_, count)) => *count += 1,
            None => counted.push((name, 1)),
        }
    }
    counted.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counted
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { None } else { Some(0.5 * (values[(n - 1) / 2] + values[n / 2])) }
}

fn max(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::{replayed_rows, rows};
    use super::*;

    #[test]
    fn a_group_counts_every_case() {
        let groups = groups(&rows());
        assert_eq!(groups.len(), 1);
        let group = &groups[0];
        assert_eq!((group.cases, group.solved, group.passed, group.without_result), (4, 2, 1, 1));
        assert_eq!(
            (group.iterations, group.cpu_solve, group.cpu_solve_max),
            (Some(15.0), Some(3.0), Some(9.0))
        );
        assert_eq!(group.violation_max, Some(0.3));
    }

    #[test]
    fn replays_are_counted_by_verdict_and_cause() {
        let rows = replayed_rows();
        let groups = groups(&rows);
        assert_eq!(groups.len(), 1);
        assert_eq!((groups[0].cases, groups[0].passed, groups[0].replayed), (3, 3, [1, 0, 2]));
        assert_eq!(groups[0].objections, [("closed loop: slip".to_owned(), 2)]);
        assert!(rows[0].is_good() && !rows[1].is_good());
    }

    #[test]
    fn medians() {
        let median = |values: &[f64]| super::median(values.iter().copied());
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0]), Some(2.5));
    }
}
