//! The floors of `docs/architecture.md`, enforced: a module imports only from lower floors, and no two files import each other
//! in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A module path below the crate, such as `["nlp", "sink"]`.
type Module = Vec<String>;

/// All source files with what they import.
struct Sources {
    /// Module → file, relative to `src`.
    files: BTreeMap<Module, String>,
    /// Module → paths that it uses, absolute, its re-exports left out.
    uses: BTreeMap<Module, Vec<Module>>,
    /// Re-exported name → the path that it stands for.
    exports: BTreeMap<Module, Module>,
}

impl Sources {
    fn read() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut texts = BTreeMap::new();
        collect(&root, &root, &mut texts);
        let files: BTreeMap<Module, String> =
            texts.keys().map(|file| (module_of(file), file.clone())).collect();
        let mut sources = Self { files, uses: BTreeMap::new(), exports: BTreeMap::new() };
        for (file, text) in &texts {
            let module = module_of(file);
            let mut used = Vec::new();
            let (statements, rest) = use_statements(text);
            for (public, tree) in statements {
                for path in expand(&tree) {
                    let Some(path) = sources.absolute(&module, &path) else { continue };
                    if public {
                        let name = path.last().cloned().unwrap_or_default();
                        sources.exports.insert([module.clone(), vec![name]].concat(), path);
                    } else {
                        used.push(path);
                    }
                }
            }
            used.extend(inline_paths(&rest).iter().filter_map(|path| sources.absolute(&module, path)));
            sources.uses.insert(module, used);
        }
        sources
    }

    /// A path as written in a module, from the crate's root; none for other crates.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Module> {
        let mut base = module.clone();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => (base, rest) = (Vec::new(), &path[1..]),
            "self" => rest = &path[1..],
            "super" => {
                while rest.first().is_some_and(|part| part == "super") {
                    base.pop();
                    rest = &rest[1..];
                }
            }
            child => {
                let child: Module = [module.clone(), vec![child.to_string()]].concat();
                self.files.get(&child)?;
            }
        }
        Some([base, rest.to_vec()].concat())
    }

    /// The file that defines what a path names.
    fn definition(&self, path: &Module) -> Option<&str> {
        let mut path = path.clone();
        // Re-exports may be chained, but not forever.
        for _ in 0..8 {
            let known = (0..=path.len()).rev().find(|&n| self.files.contains_key(&path[..n]))?;
            match path.get(..=known).and_then(|name| self.exports.get(name)) {
                Some(target) => path = [target.clone(), path[known + 1..].to_vec()].concat(),
                None => return self.files.get(&path[..known]).map(String::as_str),
            }
        }
        panic!("re-exports of {path:?} form a circle");
    }

    /// File → files that it imports from.
    fn imports(&self) -> BTreeMap<&str, BTreeSet<&str>> {
        let mut imports: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for (module, paths) in &self.uses {
            let file = self.files[module].as_str();
            let targets = paths.iter().filter_map(|path| self.definition(path)).filter(|to| *to != file);
            imports.entry(file).or_default().extend(targets);
        }
        imports
    }
}

fn collect(root: &Path, folder: &Path, texts: &mut BTreeMap<String, String>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(root, &path, texts);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let file = path.strip_prefix(root).expect("below src").to_string_lossy().replace('\\', "/");
            // Files of tests may look anywhere.
            if !file.ends_with("tests.rs") {
                texts
                    .insert(file, without_tests_and_comments(&std::fs::read_to_string(&path).expect("text")));
            }
        }
    }
}

fn without_tests_and_comments(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

fn module_of(file: &str) -> Module {
    let mut parts: Module = file.trim_end_matches(".rs").split('/').map(String::from).collect();
    if parts.last().is_some_and(|name| name == "mod") || parts == ["lib"] {
        parts.pop();
    }
    parts
}

/// The trees of all `use` statements, whether each is public, and the text without them.
fn use_statements(text: &str) -> (Vec<(bool, String)>, String) {
    let (mut statements, mut rest, mut open) = (Vec::new(), String::new(), None::<(bool, String)>);
    for line in text.lines() {
        let (mut public, mut start) = (false, line.trim_start());
        if open.is_none() && start.starts_with("pub") {
            public = true;
            start = start.trim_start_matches("pub").trim_start();
            if start.starts_with('(') {
                start = start.split_once(')').map_or("", |(_, after)| after.trim_start());
            }
        }
        match (&mut open, start.strip_prefix("use ")) {
            (Some((_, tree)), _) => tree.push_str(line.trim()),
            (None, Some(tree)) => open = Some((public, tree.to_string())),
            (None, None) => {
                rest.push_str(line);
                rest.push('\n');
            }
        }
        if let Some((public, tree)) = open.take_if(|(_, tree)| tree.ends_with(';')) {
            statements.push((public, tree.trim_end_matches(';').to_string()));
        }
    }
    (statements, rest)
}

/// `a::{b, c::d}` → `a::b`, `a::c::d`.
fn expand(tree: &str) -> Vec<Module> {
    let parts = |text: &str| -> Module {
        let text = text.split(" as ").next().unwrap_or_default();
        text.split("::").map(|part| part.trim().to_string()).filter(|part| !part.is_empty()).collect()
    };
    let Some((prefix, rest)) = tree.split_once('{') else { return vec![parts(tree)] };
    let inner = rest.trim_end().trim_end_matches('}');
    let (mut branches, mut depth) = (vec![String::new()], 0);
    for c in inner.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        if c == ',' && depth == 0 {
            branches.push(String::new());
        } else if let Some(branch) = branches.last_mut() {
            branch.push(c);
        }
    }
    let branches = branches.iter().filter(|branch| !branch.trim().is_empty());
    branches.flat_map(|branch| expand(branch)).map(|path| [parts(prefix), path].concat()).collect()
}

/// Paths in the code itself, such as `crate::files::write` and `guess::guess`.
fn inline_paths(text: &str) -> Vec<Module> {
    let word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    text.split(|c| !word(c))
        .filter(|path| path.contains("::") && !path.starts_with("::"))
        .map(|path| path.split("::").filter(|part| !part.is_empty()).map(String::from).collect::<Module>())
        .filter(|path| path.len() > 1 && path[0].starts_with(|c: char| c.is_lowercase()))
        .collect()
}

/// The floors of the document, the highest first.
fn floors() -> Vec<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/architecture.md");
    let text = std::fs::read_to_string(path).expect("docs/architecture.md");
    let block = text.split("```floors\n").nth(1).and_then(|rest| rest.split("```").next());
    let block = block.expect("a block of floors");
    block.lines().map(|line| line.split_whitespace().map(String::from).collect()).collect()
}

#[test]
fn no_import_runs_up() {
    let floors = floors();
    let floor = |file: &str| {
        let module = file.split(['/', '.']).next().unwrap_or_default();
        floors.iter().position(|names| names.iter().any(|name| name == module))
    };
    let mut wrong = Vec::new();
    for (file, targets) in Sources::read().imports() {
        if ["lib.rs", "main.rs"].contains(&file) {
            continue;
        }
        let from = floor(file).unwrap_or_else(|| panic!("docs/architecture.md has no floor for {file}"));
        let module = |file: &str| file.split(['/', '.']).next().map(String::from);
        for to in targets.into_iter().filter(|to| *to != "lib.rs" && module(to) != module(file)) {
            if floor(to).is_none_or(|to| to <= from) {
                wrong.push(format!("{file} imports {to}"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "these imports do not run down the floors of docs/architecture.md:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let sources = Sources::read();
    let imports = sources.imports();
    assert!(imports.values().map(BTreeSet::len).sum::<usize>() > 400, "the imports were not found");
    // Files that import none of those left, or that none of those left imports, are in no circle.
    let mut left: BTreeMap<&str, BTreeSet<&str>> = imports;
    loop {
        let imported: BTreeSet<&str> = left.values().flatten().copied().collect();
        let before = left.len();
        left.retain(|file, targets| !targets.is_empty() && imported.contains(file));
        let names: BTreeSet<&str> = left.keys().copied().collect();
        left.values_mut().for_each(|targets| targets.retain(|to| names.contains(to)));
        if left.len() == before {
            break;
        }
    }
    let circle: Vec<String> = left.iter().map(|(file, targets)| format!("{file} → {targets:?}")).collect();
    assert!(circle.is_empty(), "circles of imports among:\n{}", circle.join("\n"));
}

#[test]
fn use_trees_are_expanded() {
    let paths = expand("crate::{a::{B, c::D}, e as f}");
    let words: Vec<String> = paths.iter().map(|path| path.join("::")).collect();
    assert_eq!(words, ["crate::a::B", "crate::a::c::D", "crate::e"]);
}
