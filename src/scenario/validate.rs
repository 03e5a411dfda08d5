//! What single values cannot show: whether the values of a scenario go together.

use super::document::Document;
use super::{GaitKind, MapMethod, Scenario, TerrainKind};
use crate::Result;

/// Where h is defined when the scenario does not say, m.
const DEFAULT_EXTENT: [f64; 4] = [-3.0, 3.0, -3.0, 3.0];
/// More samples than this are a slip of the pen.
const MOST_STEPS: f64 = 20_000.0;

/// Refuses values that do not go together.
pub(super) fn together(document: &Document, scenario: &Scenario) -> Result<()> {
    robot(document)?;
    terrain(document, scenario)?;
    timing(document, scenario)?;
    map(document, scenario)?;
    gait(document, scenario)
}

fn map(document: &Document, scenario: &Scenario) -> Result<()> {
    let given = document.table().get("map").and_then(|map| map.get("scale")).is_some();
    let used = matches!(scenario.map.method, MapMethod::AcapLocalGlobal | MapMethod::AcapNewton);
    if given && !used {
        let what = "only allowed with map.method = \"acap-local-global\" or \"acap-newton\"; remove it";
        return Err(document.error("map.scale", what));
    }
    Ok(())
}

fn robot(document: &Document) -> Result<()> {
    let Some(table) = document.table().get("robot") else { return Ok(()) };
    if table.get("name").is_some() && table.get("file").is_some() {
        return Err(document.error("robot.file", "given together with robot.name; give one of them"));
    }
    Ok(())
}

/// The keys of `[terrain]` beside `kind` that a kind knows.
fn terrain_keys(kind: TerrainKind) -> &'static [&'static str] {
    match kind {
        TerrainKind::Flat => &["extent", "spacing"],
        TerrainKind::Rippled => &["level", "amplitude", "wavelength", "extent", "spacing"],
        TerrainKind::Conic => &["level", "slope", "radius", "tip", "foot", "extent", "spacing"],
        TerrainKind::Hilly => &["level", "height", "width", "extent", "spacing"],
        TerrainKind::Pit => &["level", "depth", "radius", "edge", "extent", "spacing"],
        TerrainKind::Formula => &["expression", "extent", "spacing"],
        TerrainKind::Heightmap => &["file", "spacing", "height_scale", "smoothing", "origin"],
        TerrainKind::Mesh => &["file", "spacing", "height_scale", "smoothing", "origin", "extent"],
    }
}

fn terrain(document: &Document, scenario: &Scenario) -> Result<()> {
    let terrain = &scenario.terrain;
    let allowed = terrain_keys(terrain.kind);
    let given = document.table().get("terrain").and_then(toml::Value::as_table);
    let kind = given.and_then(|table| table.get("kind")).map_or(String::new(), toml::Value::to_string);
    for key in given.into_iter().flat_map(toml::Table::keys).filter(|key| *key != "kind") {
        if !allowed.contains(&key.as_str()) {
            let what = format!("not a key of kind = {kind}; allowed with it: {}", allowed.join(", "));
            return Err(document.error(&format!("terrain.{key}"), what));
        }
    }
    let needs_file = matches!(terrain.kind, TerrainKind::Heightmap | TerrainKind::Mesh);
    if needs_file && terrain.file.is_none() {
        return Err(document.error("terrain.file", format!("missing; kind = {kind} needs it")));
    }
    if terrain.kind == TerrainKind::Formula && terrain.expression.is_none() {
        return Err(document.error("terrain.expression", format!("missing; kind = {kind} needs it")));
    }
    if let Some([x_min, x_max, y_min, y_max]) = terrain.extent
        && !(x_max - x_min >= 0.5 && y_max - y_min >= 0.5)
    {
        let what = format!(
            "given [{x_min}, {x_max}, {y_min}, {y_max}], allowed: [x_min, x_max, y_min, y_max] in m with at least 0.5 m between"
        );
        return Err(document.error("terrain.extent", what));
    }
    if needs_file {
        // Only the file says where its ground ends.
        return Ok(());
    }
    inside(document, scenario, terrain.extent.unwrap_or(DEFAULT_EXTENT))
}

/// Refuses a start or goal outside the ground.
pub(super) fn inside(document: &Document, scenario: &Scenario, extent: [f64; 4]) -> Result<()> {
    let [x_min, x_max, y_min, y_max] = extent;
    for (key, [x, y]) in
        [("start.position", scenario.start.position), ("goal.position", scenario.goal.position)]
    {
        if !(x_min..=x_max).contains(&x) || !(y_min..=y_max).contains(&y) {
            let what = format!(
                "given [{x}, {y}], outside the terrain; allowed: x from {x_min} to {x_max}, y from {y_min} to {y_max} m"
            );
            return Err(document.error(key, what));
        }
    }
    Ok(())
}

fn timing(document: &Document, scenario: &Scenario) -> Result<()> {
    let steps = scenario.horizon / scenario.time_step;
    if !(4.0..=MOST_STEPS).contains(&steps) {
        let what = format!(
            "given {}, which makes {steps:.1} steps of the horizon of {} s; allowed: 4 to {MOST_STEPS} steps",
            scenario.time_step, scenario.horizon
        );
        return Err(document.error("time_step", what));
    }
    Ok(())
}

fn gait(document: &Document, scenario: &Scenario) -> Result<()> {
    let gait = &scenario.gait;
    let [least, most] = gait.duration_bounds;
    if least >= most {
        let what = format!("given [{least}, {most}], allowed: the least before the greatest duration, in s");
        return Err(document.error("gait.duration_bounds", what));
    }
    if gait.optimize_durations && gait.kind == GaitKind::Stand {
        let what =
            "given true, but kind = \"stand\" has no steps whose durations could be found; set it to false";
        return Err(document.error("gait.optimize_durations", what));
    }
    if gait.optimize_durations && scenario.discretization.force_knots > 1 {
        let what = "given true, but discretization.force_knots is not 1; forces follow the switches sample by sample, so set that to 1 or this to false";
        return Err(document.error("gait.optimize_durations", what));
    }
    match (&gait.phases, gait.kind) {
        (None, GaitKind::Custom) => {
            let what =
                "missing; kind = \"custom\" needs a row of stance and swing durations by foot, stance first";
            Err(document.error("gait.phases", what))
        }
        (Some(_), kind) if kind != GaitKind::Custom => {
            Err(document.error("gait.phases", "only allowed with kind = \"custom\""))
        }
        (Some(rows), _) => {
            for (foot, row) in rows.iter().enumerate() {
                let sum: f64 = row.iter().sum();
                if (sum - scenario.horizon).abs() > 1e-6 {
                    let what =
                        format!("the durations sum to {sum} s, expected the horizon, {} s", scenario.horizon);
                    return Err(document.error(&format!("gait.phases[{foot}]"), what));
                }
            }
            Ok(())
        }
        (None, _) => Ok(()),
    }
}
