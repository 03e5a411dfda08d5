//! The scenarios that ship with the program: the folder `scenarios`.

use crate::{Error, Result};

/// A scenario that ships.
#[derive(Debug)]
pub struct Example {
    /// Its name.
    pub name: &'static str,
    text: &'static str,
    /// Name and content of the terrain's file, where it has one.
    pub ground: Option<(&'static str, &'static [u8])>,
}

/// The folder of the terrains' files, relative to the scenarios.
const FOLDER: &str = "data/";

macro_rules! example {
    ($name:literal) => {
        Example { name: $name, text: include_str!(concat!("../../scenarios/", $name, ".toml")), ground: None }
    };
    ($name:literal, $file:literal) => {
        Example {
            ground: Some(($file, include_bytes!(concat!("../../scenarios/data/", $file)))),
            ..example!($name)
        }
    };
}

/// All of them.
pub const EXAMPLES: &[Example] = &[
    example!("flat"),
    example!("rippled"),
    example!("conic"),
    example!("hilly"),
    example!("pit"),
    example!("formula"),
    example!("stairs", "stairs.png"),
    example!("stepping_stones", "stepping_stones.png"),
    example!("rubble", "rubble.png"),
];

impl Example {
    /// The example of a name.
    ///
    /// # Errors
    /// When there is none; the message names all.
    pub fn find(name: &str) -> Result<&'static Self> {
        EXAMPLES.iter().find(|example| example.name == name).ok_or_else(|| {
            let names: Vec<_> = EXAMPLES.iter().map(|example| example.name).collect();
            Error::input(format!("{name}: there is no such example; the examples are {}", names.join(", ")))
        })
    }

    /// The scenario, whose terrain's file is to lie beside it.
    pub fn text(&self) -> String {
        match self.ground {
            Some((file, _)) => self.text.replace(&format!("{FOLDER}{file}"), file),
            None => self.text.to_owned(),
        }
    }

    /// What it is about: the first line of the scenario.
    pub fn purpose(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches(['#', ' '])
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scenario::load_text;

    #[test]
    fn every_scenario_of_the_folder_is_an_example_and_can_be_read() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
        let names = std::fs::read_dir(&folder).unwrap().filter_map(|entry| {
            let name = entry.unwrap().file_name().into_string().unwrap();
            name.strip_suffix(".toml").map(str::to_owned)
        });
        let mut count = 0;
        for name in names {
            let example = Example::find(&name).unwrap();
            assert!(example.purpose().len() > 10, "{name}");
            let folder = tempfile::tempdir().unwrap();
            if let Some((file, content)) = example.ground {
                std::fs::write(folder.path().join(file), content).unwrap();
            }
            load_text(&name, &example.text(), folder.path(), &[]).unwrap();
            count += 1;
        }
        assert_eq!(count, EXAMPLES.len());
        assert!(Example::find("sea").unwrap_err().to_string().contains("stepping_stones"));
    }
}
