//! The ground that `warpgait terrain` is given: that of a scenario, or a bare file of heights with options.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::files::{ensure_no_inputs, ensure_outputs};
use crate::scenario::{self, LoadedScenario};
use crate::terrain::{self, Ground, Heightmap};
use crate::{Error, Result};

/// The keys of `[terrain]` for which there are options.
const KEYS: [&str; 6] = ["no_data", "height_scale", "spacing", "layout", "member", "origin"];

/// A ground, and how to read it.
#[derive(Debug, Args)]
pub(super) struct SourceArguments {
    /// A scenario (.toml), or a file of heights: image, array, grid or mesh
    input: PathBuf,
    /// Distance between neighboring cells, m
    #[arg(long, value_name = "M")]
    spacing: Option<f64>,
    /// Which way the indices run: picture, y-up, x-y or grid-map
    #[arg(long, value_name = "NAME")]
    layout: Option<String>,
    /// Height from black to white of an image, m; factor to m of anything else
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    height_scale: Option<f64>,
    /// Value of cells without data; may be repeated
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    no_data: Vec<f64>,
    /// What to take from a file with several members
    #[arg(long, value_name = "NAME")]
    member: Option<String>,
    /// x and y of the center, m
    #[arg(long, value_name = "M", num_args = 2, allow_negative_numbers = true)]
    origin: Vec<f64>,
    /// Override a value of a scenario: a dotted key, and a TOML value or a bare word; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

/// A ground that was read.
pub(super) struct Read {
    pub loaded: LoadedScenario,
    /// As planned on.
    pub ground: Ground,
    /// As measured; none for a terrain that is a function.
    pub heightmap: Option<Heightmap>,
    /// Whether the ground is that of a scenario, with start and goal.
    pub has_ends: bool,
}

impl SourceArguments {
    /// The file that was given.
    pub fn input(&self) -> &Path {
        &self.input
    }

    /// Reads the ground, unless the output cannot be written or is an input.
    ///
    /// # Errors
    /// For files and values that are wrong; in a message about a bare file, options stand for keys.
    pub fn read(&self, output: Option<&Path>) -> Result<Read> {
        let is_scenario = self.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        if is_scenario {
            let overrides: Vec<String> = self.set.iter().cloned().chain(self.overrides()).collect();
            return read(scenario::load(&self.input, &overrides)?, output, true);
        }
        if let Some(set) = self.set.first() {
            let what =
                format!("--set {set}: only allowed for a scenario; a file of heights has options of its own");
            return Err(Error::input(what));
        }
        let Some(name) = self.input.file_name().and_then(|name| name.to_str()) else {
            return Err(Error::input(format!("{}: not the name of a file", self.input.display())));
        };
        let file = toml::Value::String(name.to_owned());
        let text = format!(
            "[terrain]\nkind = \"heightmap\"\nfile = {file}\n[start]\nposition = [0, 0]\n[goal]\nposition = [0, 0]\n"
        );
        let folder = self.input.parent().unwrap_or(Path::new(""));
        let loaded = scenario::load_text(name, &text, folder, &self.overrides());
        loaded.and_then(|loaded| read(loaded, output, false)).map_err(|e| self.with_options(e))
    }

    /// The options as values of a scenario.
    fn overrides(&self) -> Vec<String> {
        let text = |text: &String| toml::Value::String(text.clone()).to_string();
        let list = |numbers: &[f64]| {
            let values = numbers.iter().map(|&n| toml::Value::Float(n)).collect();
            (!numbers.is_empty()).then(|| toml::Value::Array(values).to_string())
        };
        let number = |number: f64| toml::Value::Float(number).to_string();
        let options = [
            ("spacing", self.spacing.map(number)),
            ("layout", self.layout.as_ref().map(text)),
            ("height_scale", self.height_scale.map(number)),
            ("no_data", list(&self.no_data)),
            ("member", self.member.as_ref().map(text)),
            ("origin", list(&self.origin)),
        ];
        options.into_iter().filter_map(|(key, value)| Some(format!("terrain.{key}={}", value?))).collect()
    }

    /// An error about a scenario that was made up, in terms of what was given.
    fn with_options(&self, error: Error) -> Error {
        let mut what = match error {
            Error::Input(message) => message,
            // The place is in the scenario that was made up.
            Error::Value { key, what, .. } => format!("{key}: {what}"),
            other => return other,
        };
        if let Some(rest) = what.strip_prefix("terrain.file: ") {
            // The name is said once.
            let name = format!("{:?}: ", self.input.file_name().unwrap_or_default());
            what = rest.strip_prefix(&name).unwrap_or(rest).to_owned();
        }
        for key in KEYS {
            let option = format!("--{}", key.replace('_', "-"));
            what = what
                .replace(&format!("terrain.{key} = "), &format!("{option} "))
                .replace(&format!("terrain.{key}"), &option);
        }
        Error::input(format!("{}: {what}", self.input.display()))
    }
}

fn read(loaded: LoadedScenario, output: Option<&Path>, has_ends: bool) -> Result<Read> {
    ensure_outputs(output.as_slice(), &loaded.files())?;
    let built = terrain::build_with_source(&loaded.scenario, &loaded.robot, &loaded.base_dir);
    let (ground, heightmap) = built.map_err(|e| loaded.locate(e))?;
    ensure_no_inputs(output.as_slice(), &loaded.paths(&ground.inputs))?;
    Ok(Read { loaded, ground, heightmap, has_ends })
}
