//! Chooses a cell for every stance before the motion is optimized, where feet may stand on patches only, and refuses what no motion
//! can do. [`super::foothold_search`] is the search.

use nalgebra::Vector3;

use super::base_path::BasePath;
use super::foothold_search::{Avoided, Place, Search, WAY, advice, largest_step, obstacle};
use super::standing::Pose;
use crate::nlp::Model;
use crate::scenario::Scenario;
use crate::terrain::ContactGround;
use crate::{Error, Result};

/// What is beyond a limit by more than this, in standing heights, is refused before the NLP.
const HOPELESS: f64 = 0.3;
/// The same at the start, where the pose of the base is given.
const HOPELESS_AT_START: f64 = 0.03;

/// The best cells for the stances of a model, on other patches than those to be avoided.
///
/// # Errors
/// Where a foot finds nothing to stand on, or only what is out of its reach: which foot, where, when and by how much.
pub fn assign(
    scenario: &Scenario,
    model: &Model,
    contact: &ContactGround,
    avoided: &[Avoided],
) -> Result<Assignment> {
    let path = BasePath::new(scenario, model)?;
    let (chosen, cost) = Search::new(model, contact, &path, avoided).run()?;
    let each = |places: &Vec<Place>| places.iter().map(|place| [place.point.x, place.point.y]).collect();
    ensure_start(model, contact, &path, &chosen)?;
    ensure_walkable(model, contact, &path.retimed(&chosen.iter().map(each).collect::<Vec<_>>()), &chosen)?;
    let cells = chosen.iter().map(|places| places.iter().map(|place| place.cell).collect()).collect();
    Ok(Assignment { cells, cost })
}

/// A cell for every stance.
pub struct Assignment {
    /// `[foot][stance]`, cells of the contact ground.
    pub cells: Vec<Vec<usize>>,
    /// What the search minimized, m².
    pub cost: f64,
}

/// Refuses a start at which a foot does not reach its patch, whose nearest point counts.
fn ensure_start(
    model: &Model,
    contact: &ContactGround,
    path: &BasePath,
    chosen: &[Vec<Place>],
) -> Result<()> {
    let pose = path.pose(0.0);
    for (foot, places) in chosen.iter().enumerate() {
        let patch = contact.patch(places[0].cell);
        let middle = pose.position + pose.rotation * Vector3::from(model.reach[foot].center);
        let [x, y] = patch.nearest([middle.x, middle.y]);
        let beyond = out_of_box(model, foot, &pose, &Vector3::new(x, y, patch.jet(x, y).h));
        if beyond > HOPELESS_AT_START * -model.nominal[foot].z {
            let what = format!(
                "foot {} finds nothing to stand on in its reach there: the best place, x = {x:.2}, y = {y:.2} m, is {beyond:.2} m too far; {}",
                model.foot_names[foot],
                advice(contact)
            );
            return Err(Error::key("start.position", what));
        }
    }
    Ok(())
}

/// How far a point is out of a foot's reach box, m.
fn out_of_box(model: &Model, foot: usize, pose: &Pose, point: &Vector3<f64>) -> f64 {
    let reach = &model.reach[foot];
    let local = pose.rotation.tr_mul(&(point - pose.position));
    Vector3::from_fn(|d, _| ((local[d] - reach.center[d]).abs() - reach.half_size[d]).max(0.0)).norm()
}

/// Refuses steps and footholds that no motion of the base makes possible; `path` is timed for them.
fn ensure_walkable(
    model: &Model,
    contact: &ContactGround,
    path: &BasePath,
    chosen: &[Vec<Place>],
) -> Result<()> {
    let layout = &model.layout;
    for (foot, places) in chosen.iter().enumerate() {
        let name = &model.foot_names[foot];
        let hopeless = HOPELESS * -model.nominal[foot].z;
        let [longest, highest] = largest_step(model, path, foot);
        for (j, pair) in places.windows(2).enumerate() {
            let [a, b] = [pair[0].point, pair[1].point];
            let (length, height) = ((b - a).norm(), b.z - a.z);
            let over = obstacle(contact, &pair[0], &pair[1]);
            let what = if over > highest + hopeless {
                format!("over {over:.2} m of ground; it can take about {highest:.2} m")
            } else if height.abs() > highest + hopeless {
                format!(
                    "{:.2} m {}; it can take about {highest:.2} m",
                    height.abs(),
                    if height > 0.0 { "up" } else { "down" }
                )
            } else if length > longest + hopeless {
                format!("{length:.2} m; it can take about {longest:.2} m")
            } else {
                continue;
            };
            let what = format!(
                "foot {name} would have to step from x = {:.2}, y = {:.2} to x = {:.2}, y = {:.2} m at {:.1} s, {what}; {}",
                a.x,
                a.y,
                b.x,
                b.y,
                layout.feet[foot].stances[j].stance.end * layout.time_step,
                advice(contact)
            );
            return Err(Error::key(WAY, what));
        }
        for (place, stance) in places.iter().zip(&layout.feet[foot].stances) {
            for k in [stance.stance.start, stance.stance.end] {
                let beyond = out_of_box(model, foot, &path.pose(k * layout.time_step), &place.point);
                if beyond > hopeless {
                    let what = format!(
                        "foot {name} finds nothing to stand on in its reach at {:.1} s: the best place, x = {:.2}, y = {:.2} m, is {beyond:.2} m too far; {}",
                        k * layout.time_step,
                        place.point.x,
                        place.point.y,
                        advice(contact)
                    );
                    return Err(Error::key(WAY, what));
                }
            }
        }
    }
    Ok(())
}
