//! When a motion over patches is not found, or misses a law between its samples: which other steps are worth a try.
//!
//! First other patches for the stances in question: those of the feet and times at which something is wrong, or those that are pressed against
//! the border of their patch. Then gaits with other numbers of steps, the better ones first.

use super::motion::{Motion, Trouble};
use super::problem::GaitProblem;
use super::steps::Steps;
use super::task::Task;
use crate::constraints::foothold_patch::FOOTHOLD_PATCH;
use crate::ipopt::Multipliers;
use crate::trajectory::Layout;

/// Other steps are tried this often, at most.
const TRIES: usize = 3;
/// Stances that are moved at once, at most.
const MOST_MOVED: usize = 4;
/// Multipliers of a patch's sides from this on count as large, cost a meter.
const LARGE_MULTIPLIER: f64 = 1.0;

/// Other steps.
pub struct Reassignment {
    /// What they are.
    pub steps: Steps,
    /// The same in words.
    pub words: String,
    /// Whether feet step when they did before, so that a motion can go on from the one before.
    pub goes_on: bool,
}

/// Footholds on the border of their patch that would rather be beyond it, the most urgent first.
pub fn pressed_footholds(problem: &GaitProblem, multipliers: &Multipliers) -> Vec<Trouble> {
    let model = &problem.model;
    let Some((block, first)) = problem.blocks().find(|(block, _)| block.name() == FOOTHOLD_PATCH) else {
        return Vec::new();
    };
    let mut pressed: Vec<(f64, Trouble)> = (0..block.rows())
        .filter_map(|row| {
            let (place, multiplier) = (block.place(row), multipliers.constraint.get(first + row)?.abs());
            let trouble = Trouble { foot: place.foot?, time: place.sample * model.layout.time_step };
            (multiplier > LARGE_MULTIPLIER).then_some((multiplier, trouble))
        })
        .collect();
    pressed.sort_by(|a, b| b.0.total_cmp(&a.0));
    pressed.into_iter().map(|(_, trouble)| trouble).collect()
}

/// What is worth a try after a motion, and where something is wrong with it.
pub fn reassignments<'a>(
    task: &'a Task,
    motion: &'a Motion,
    troubles: &'a [Trouble],
) -> impl Iterator<Item = Reassignment> + 'a {
    let moved = std::iter::once_with(move || moved(task, motion, troubles)).flatten();
    let other_gait = move |n: usize| {
        let steps = task.steps.with_other_gait(task.surfaces, n)?;
        let [these, before] =
            [&steps, task.steps].map(|steps| steps.gait.swings.iter().map(Vec::len).max().unwrap_or(0));
        let words = if these == before {
            format!("{these} steps of each foot at other times")
        } else {
            format!("{these} steps of each foot instead of {before}")
        };
        Some(Reassignment { steps, words, goes_on: false })
    };
    moved.chain((0..).map_while(other_gait)).take(TRIES)
}

/// The same gait with other patches for the stances in question.
fn moved(task: &Task, motion: &Motion, troubles: &[Trouble]) -> Option<Reassignment> {
    let layout = &motion.model.layout;
    let mut stances: Vec<(usize, usize)> = Vec::new();
    for trouble in troubles.iter().chain(&motion.pressed) {
        let stance = (trouble.foot, stance_at(layout, trouble));
        if !stances.contains(&stance) && stances.len() < MOST_MOVED {
            stances.push(stance);
        }
    }
    let steps = task.steps.moved(task.scenario, task.robot, task.surfaces, &stances)?;
    let names: Vec<String> = (0..layout.feet.len())
        .flat_map(|i| (0..layout.feet[i].stances.len()).map(move |j| (i, j)))
        .filter(|&(i, j)| steps.patches[i][j] != task.steps.patches[i][j])
        .map(|(i, j)| {
            let from = layout.feet[i].stances[j].stance.start * layout.time_step;
            format!("{} from {from:.1} s", motion.model.foot_names[i])
        })
        .collect();
    let words = match names.len() {
        0..=MOST_MOVED => format!("other patches for {}", names.join(", ")),
        n => format!("other patches for {} and {} more", names[..MOST_MOVED].join(", "), n - MOST_MOVED),
    };
    Some(Reassignment { steps, words, goes_on: true })
}

/// The number of the stance of a foot at a time; in swing, of the one at its end.
fn stance_at(layout: &Layout, trouble: &Trouble) -> usize {
    let sample = trouble.time / layout.time_step;
    layout.feet[trouble.foot].swings.iter().filter(|swing| swing.swing.start < sample).count()
}
