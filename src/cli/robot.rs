//! `warpgait robot import`, `robot show` and `robot list`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::console::Console;
use super::ending::Ending;
use super::python::PythonArguments;
use crate::Result;
use crate::files::{ensure_outputs, write_atomically};
use crate::report::robot_sheet;
use crate::report::table::Table;
use crate::robot::{Robot, RobotSpec};
use crate::visible::visible;

const EXAMPLES: &str = "\
Examples:
  warpgait robot import go2.urdf                      go2.toml (for plans) and go2.xml (for replays)
  warpgait robot import spot.xml -o robots/spot --speed-limit 12    an MJCF, which has no speed limits
  warpgait robot import -- --help                     all options
  warpgait robot show go2.toml                        go2.robot.svg, and what a robot file says
  warpgait robot list                                 the robots that ship with the program

A scenario names the file: [robot] file = \"go2.toml\". For the replay: warpgait validate P.plan.npz --model go2.xml.
Import runs the Python package, as `warpgait validate` does.";

const IMPORT: &str = "\
Options of the Python package, among others:
  -o DIR/NAME               what the files are called
  --feet LINK,…             the feet, if the links that reach the ground are others
  --stance Q,…              the joint angles of a leg at rest, rad
  --range, --speed-limit, --torque-limit    limits that the file does not have
  --freeze JOINT,…          joints that are held still
  --forward AXIS            where the robot looks, if not along x
  --without-meshes, --mend-inertias         do without meshes that are absent; put impossible inertias right

All of them: warpgait robot import -- --help";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct RobotArguments {
    #[command(subcommand)]
    command: RobotCommand,
}

#[derive(Debug, Subcommand)]
enum RobotCommand {
    /// Make a robot of a URDF or MJCF: NAME.toml and NAME.xml
    #[command(after_help = IMPORT)]
    Import(PythonArguments),
    /// Draw a robot and print what it is: mass, size, legs, limits
    Show(ShowArguments),
    /// List the robots that ship with the program
    List,
}

#[derive(Debug, Args)]
struct ShowArguments {
    /// The name of a shipped robot, or a robot file (NAME.toml)
    robot: String,
    /// The drawing to write, an SVG file [default: NAME.robot.svg in the working folder]
    #[arg(short, long, value_name = "FILE", conflicts_with = "no_plot")]
    output: Option<PathBuf>,
    /// Draw nothing
    #[arg(long)]
    no_plot: bool,
}

impl RobotArguments {
    /// Whether `--json` is among the arguments for Python.
    pub fn has_json(&self) -> bool {
        matches!(&self.command, RobotCommand::Import(python) if python.has_json())
    }
}

pub(super) fn robot(arguments: &RobotArguments, console: &Console) -> Result<Ending> {
    match &arguments.command {
        RobotCommand::Import(python) => python.run("warpgait.importer", console),
        RobotCommand::Show(arguments) => show(arguments, console),
        RobotCommand::List => list(console),
    }
}

/// A robot file if the word looks like one, or else a shipped robot.
fn load(word: &str) -> Result<Robot> {
    let path = PathBuf::from(word);
    let is_file = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let file = is_file.then(|| word.to_owned());
    Robot::load(&RobotSpec { name: word.to_owned(), file, ..RobotSpec::default() }, ".".as_ref())
}

fn list(console: &Console) -> Result<Ending> {
    let robots = Robot::shipped().into_iter().map(load).collect::<Result<Vec<_>>>()?;
    let mut table = Table::new(&["robot", "mass", "stands", "feet", "legs", "cycle", "from"]);
    for robot in &robots {
        let legs = robot.feet.iter().filter_map(|foot| foot.leg()).count();
        table.row([
            robot.name.clone(),
            format!("{:.1} kg", robot.mass),
            format!("{:.2} m", robot.standing_height()),
            robot.feet.len().to_string(),
            if legs == 0 { "not described".into() } else { "described".into() },
            robot.gait_cycle.map_or("1 s".into(), |cycle| format!("{cycle} s")),
            robot.source.clone(),
        ]);
    }
    console.result(&table.lines(|_, _, cell| cell).join("\n"));
    console.object(&json!({ "robots": robots.iter().map(summary).collect::<Vec<_>>() }));
    Ok(Ending::Good)
}

fn summary(robot: &Robot) -> Value {
    json!({
        "name": robot.name,
        "mass": robot.mass,
        "standing_height": robot.standing_height(),
        "feet": robot.foot_names(),
        "gait_cycle": robot.gait_cycle,
        "source": robot.source,
    })
}

fn show(arguments: &ShowArguments, console: &Console) -> Result<Ending> {
    let robot = load(&arguments.robot)?;
    let named = || PathBuf::from(format!("{}.robot.svg", robot.name));
    let plot = (!arguments.no_plot).then(|| arguments.output.clone().unwrap_or_else(named));
    if let Some(plot) = &plot {
        ensure_outputs(&[plot.as_path()], &[PathBuf::from(&arguments.robot)])?;
        write_atomically(plot, robot_sheet(&robot).as_bytes())?;
    }
    let sizes = |half: [f64; 3]| half.map(|h| format!("{:.3}", 2.0 * h)).join(" × ");
    let place = |p: [f64; 3]| p.map(|c| format!("{c:.3}")).join(", ");
    console.result(&format!(
        "{}: {:.2} kg, {} feet; the center of mass stands {:.3} m high, the torso is {} m\n{}\n",
        visible(&robot.name),
        robot.mass,
        robot.feet.len(),
        robot.standing_height(),
        sizes(robot.torso.half_size),
        visible(&robot.source),
    ));
    let mut table = Table::new(&[
        "foot",
        "stands at, m",
        "reach box, m",
        "joint",
        "axis",
        "range, rad",
        "rad/s",
        "N m",
        "link, kg",
    ]);
    for foot in &robot.feet {
        let mut cells = [foot.name.clone(), place(foot.nominal), sizes(foot.reach.half_size)];
        let joints = foot.leg.as_ref().map_or(&[][..], |leg| &leg.joints);
        for joint in joints {
            table.row(std::mem::take(&mut cells).into_iter().chain([
                joint.name.clone(),
                place(joint.axis),
                format!("{:.2} to {:.2}", joint.range[0], joint.range[1]),
                joint.speed_limit.to_string(),
                joint.torque_limit.to_string(),
                format!("{:.3}", joint.mass),
            ]));
        }
        if joints.is_empty() {
            table.row(cells.into_iter().chain(std::iter::repeat_n(String::new(), 6)));
        }
    }
    console.result(&table.lines(|_, _, cell| cell).join("\n"));
    if let Some(plot) = &plot {
        console.result(&format!("Written: {}", visible(&plot.display().to_string())));
    }
    console.object(&serde_json::to_value(&robot).map_err(|e| crate::Error::Internal(format!("robot: {e}")))?);
    Ok(Ending::Good)
}
