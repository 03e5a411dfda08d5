//! A TOML file with the line of every key, so that errors can point at it.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::nesting::too_deep;
use super::words::show;
use crate::{Error, Result, files};

/// Parts of the key of an override; no key of a scenario has as many.
const MOST_PARTS: usize = 16;

/// A parsed file, possibly with values overridden from the command line.
#[derive(Clone, Debug)]
pub struct Document {
    file: String,
    table: Table,
    origins: Origins,
}

/// Where a value was set, and the values in it: of tables by key, of arrays by `[index]`. A tree, because full names of all values can be
/// much longer than the file.
#[derive(Clone, Debug, Default)]
struct Origins {
    here: Option<Origin>,
    within: Vec<(String, Origins)>,
}

#[derive(Clone, Debug)]
enum Origin {
    Line(usize),
    /// The argument of `--set`.
    Override(String),
    /// The key from which the program derived the value.
    Derived(String),
}

impl Document {
    /// Reads a file; also returns its text.
    ///
    /// # Errors
    /// If it cannot be read, is not UTF-8, or is not TOML.
    pub fn read(path: &Path) -> Result<(Self, String)> {
        let file = path.display().to_string();
        let text = files::read_text(path)?;
        Ok((Self::parse(&file, &text)?, text))
    }

    /// Parses TOML; `file` is its name in messages.
    ///
    /// # Errors
    /// If the text is not TOML; points at the line.
    pub fn parse(file: &str, text: &str) -> Result<Self> {
        let breaks: Vec<usize> = text.match_indices('\n').map(|(at, _)| at).collect();
        let line = |span: &Range<usize>| 1 + breaks.partition_point(|&at| at < span.start);
        let malformed = |error: toml::de::Error| {
            let at = error.span().map_or(String::new(), |span| format!(":{}", line(&span)));
            let shown = error.span().and_then(|span| text.lines().nth(line(&span) - 1)).unwrap_or("").trim();
            Error::input(format!("{file}{at}: not TOML: {}: `{shown}`", error.message().replace('\n', "; ")))
        };
        if let Some(at) = too_deep(text) {
            let line = line(&(at..at));
            return Err(Error::input(format!("{file}:{line}: brackets or braces are nested too deeply")));
        }
        let spanned = DeTable::parse(text).map_err(malformed)?;
        let origins = Origins::of_table(None, spanned.get_ref(), &line);
        let table = toml::from_str(text).map_err(malformed)?;
        Ok(Self { file: file.to_owned(), table, origins })
    }

    /// Sets a value from `key=value`, as given to `--set`: the key is dotted, the value is TOML or a bare word.
    ///
    /// # Errors
    /// If the argument is not of this form, or a part of the key is a value and not a table.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        self.assign(assignment, Some(Origin::Override(assignment.to_owned())))
    }

    /// Sets a value that follows from that of another key, at which errors then point; without one, a default.
    ///
    /// # Errors
    /// Those of [`Self::set`].
    pub fn derive(&mut self, assignment: &str, from: Option<&str>) -> Result<()> {
        self.assign(assignment, from.map(|key| Origin::Derived(key.to_owned())))
    }

    fn assign(&mut self, assignment: &str, origin: Option<Origin>) -> Result<()> {
        let refuse = |why: String| Err(Error::input(format!("--set {assignment}: {why}")));
        let Some((key, value)) = assignment.split_once('=') else {
            return refuse("expected key=value, for instance gait.kind=trot".into());
        };
        let (key, value) = (key.trim(), value.trim());
        let parts: Vec<&str> = key.split('.').collect();
        if parts.iter().any(|part| part.is_empty()) {
            return refuse("the key has an empty part; expected for instance gait.kind=trot".into());
        }
        if parts.len() > MOST_PARTS {
            return refuse(format!("the key has {} parts; at most {MOST_PARTS} are allowed", parts.len()));
        }
        if too_deep(value).is_some() {
            return refuse("brackets or braces are nested too deeply".into());
        }
        let value = match toml::from_str::<Table>(&format!("value = {value}\n")) {
            Ok(mut table) if table.len() == 1 => table.remove("value").unwrap_or(Value::Boolean(false)),
            _ if value.is_empty() => return refuse("there is no value after the =".into()),
            _ if value.contains(['"', '\'', '[', ']', '{', '}', '\n', '=']) => {
                return refuse(format!(
                    "`{value}` is not a TOML value; quote it for the shell if it has spaces or brackets"
                ));
            }
            _ => Value::String(value.to_owned()),
        };
        let (last, tables) = parts.split_last().unwrap_or((&"", &[]));
        let mut table = &mut self.table;
        for part in tables {
            table = match table.entry(*part).or_insert_with(|| Value::Table(Table::new())) {
                Value::Table(inner) => inner,
                other => return refuse(format!("`{part}` is {} there, not a table", show(other))),
            };
        }
        table.insert((*last).to_owned(), value);
        if origin.is_some() {
            let mut origins = &mut self.origins;
            for part in parts {
                origins = origins.entry(part);
            }
            *origins = Origins { here: origin, within: Vec::new() };
        }
        Ok(())
    }

    /// Takes away a value of a table, by a key of two parts.
    pub fn remove(&mut self, table: &str, key: &str) {
        if let Some(Value::Table(inner)) = self.table.get_mut(table) {
            inner.remove(key);
        }
    }

    /// Replaces values of a table of an array by one, which keeps their places in messages.
    pub fn replace_in(&mut self, array: &str, index: usize, old: &[&str], key: &str, value: Value) {
        let items = self.table.get_mut(array).and_then(Value::as_array_mut);
        if let Some(Value::Table(item)) = items.and_then(|items| items.get_mut(index)) {
            old.iter().for_each(|old| {
                item.remove(*old);
            });
            item.insert(key.to_owned(), value);
        }
    }

    /// Its name in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The values.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// Whether a value was given for a dotted key.
    pub fn has(&self, key: &str) -> bool {
        let mut parts = key.split('.');
        let first = parts.next().and_then(|part| self.table.get(part));
        parts.fold(first, |value, part| value.and_then(|v| v.get(part))).is_some()
    }

    /// Where a value was set, for messages about another one that contradicts it.
    pub fn place(&self, key: &str) -> String {
        match self.origin(key) {
            (Some(Origin::Line(line)), true) => format!("{key}, line {line}"),
            (Some(Origin::Override(assignment)), true) => format!("--set {assignment}"),
            (Some(Origin::Derived(from)), true) => format!("{key}, from {}", self.place(from)),
            _ => format!("{key}, by default"),
        }
    }

    /// An input error at a key, with file and line; for a missing key, the line of the table that lacks it.
    pub fn error(&self, key: &str, what: impl std::fmt::Display) -> Error {
        let (file, line) = match self.origin(key).0 {
            Some(Origin::Line(line)) => (self.file.clone(), Some(*line)),
            Some(Origin::Override(assignment)) => (format!("--set {assignment}"), None),
            Some(Origin::Derived(from)) => return self.error(from, format!("sets {key}: {what}")),
            None => (self.file.clone(), None),
        };
        Error::Value { file, line, key: key.to_owned(), what: what.to_string() }
    }

    /// The key from which the program derived a value, if it did.
    pub fn derived_from(&self, key: &str) -> Option<&str> {
        match self.origin(key).0 {
            Some(Origin::Derived(from)) => Some(from),
            _ => None,
        }
    }

    /// Where the value at a key was set, or else the innermost of the tables and arrays around it; and whether there is a value.
    fn origin(&self, key: &str) -> (Option<&Origin>, bool) {
        let (mut origins, mut origin, mut rest) = (&self.origins, None, key);
        while !rest.is_empty() {
            // A key in quotes may itself have dots.
            let part = if origins.get(rest).is_some() { rest } else { first_part(rest) };
            let Some(inner) = origins.get(part) else { break };
            origins = inner;
            origin = inner.here.as_ref().or(origin);
            rest = rest[part.len()..].trim_start_matches('.');
        }
        // An element of an array that was set as a whole has the array's place.
        (origin, rest.is_empty() || rest.starts_with('['))
    }
}

impl Origins {
    fn get(&self, part: &str) -> Option<&Self> {
        self.within.iter().find(|(name, _)| name == part).map(|(_, inner)| inner)
    }

    fn entry(&mut self, part: &str) -> &mut Self {
        let known = self.within.iter().position(|(name, _)| name == part);
        let at = known.unwrap_or_else(|| {
            self.within.push((part.to_owned(), Self::default()));
            self.within.len() - 1
        });
        &mut self.within[at].1
    }

    fn of_table(here: Option<Origin>, table: &DeTable, line: &dyn Fn(&Range<usize>) -> usize) -> Self {
        let origin = |(key, value): (&Spanned<Cow<str>>, &Spanned<DeValue>)| {
            (key.get_ref().clone().into_owned(), Self::of_value(line(&key.span()), value, line))
        };
        Self { here, within: table.iter().map(origin).collect() }
    }

    fn of_value(at: usize, value: &Spanned<DeValue>, line: &dyn Fn(&Range<usize>) -> usize) -> Self {
        let here = Some(Origin::Line(at));
        let within = match value.get_ref() {
            DeValue::Table(inner) => return Self::of_table(here, inner, line),
            DeValue::Array(items) => {
                let origin = |(i, item): (usize, &Spanned<_>)| {
                    (format!("[{i}]"), Self::of_value(line(&item.span()), item, line))
                };
                items.iter().enumerate().map(origin).collect()
            }
            _ => Vec::new(),
        };
        Self { here, within }
    }
}

/// The first part of a dotted key, of which `gait.phases[1]` has three.
fn first_part(key: &str) -> &str {
    let end = key.char_indices().skip(1).find(|(_, c)| matches!(c, '.' | '['));
    &key[..end.map_or(key.len(), |(at, _)| at)]
}

/// `prefix.key`, or just `key` at the top level.
pub(super) fn join(prefix: &str, key: &str) -> String {
    if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") }
}
