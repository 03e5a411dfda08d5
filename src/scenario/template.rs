//! The commented scenario that `warpgait init` writes.

/// A scenario with every key at its default, with comments. Its name is in the first line.
pub fn template(name: &str) -> String {
    // A line break in a name would end the comment.
    let name: String = name.chars().filter(|c| !c.is_control()).collect();
    format!("# {name}: a warpgait scenario. Solve it with: warpgait solve {name}.toml\n{BODY}")
}

const BODY: &str = include_str!("template.toml");
