//! A TOML file with the line of every key, so that errors can point at it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::words::show;
use crate::{Error, Result};

/// A parsed file, possibly with values overridden from the command line.
#[derive(Clone, Debug)]
pub struct Document {
    file: String,
    table: Table,
    /// Where each value was set, by dotted key (`gait.duty`, `gait.phases[1]`).
    origins: BTreeMap<String, Origin>,
}

#[derive(Clone, Debug)]
enum Origin {
    Line(usize),
    /// The argument of `--set`.
    Override(String),
}

impl Document {
    /// Reads a file; also returns its text.
    ///
    /// # Errors
    /// If it cannot be read, is not UTF-8, or is not TOML.
    pub fn read(path: &Path) -> Result<(Self, String)> {
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        let text = String::from_utf8(bytes)
            .map_err(|_| Error::input(format!("{file}: not a text file in UTF-8")))?;
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
        let spanned = DeTable::parse(text).map_err(malformed)?;
        let mut origins = BTreeMap::new();
        note_lines(spanned.get_ref(), "", &line, &mut origins);
        let table = toml::from_str(text).map_err(malformed)?;
        Ok(Self { file: file.to_owned(), table, origins })
    }

    /// Sets a value from `key=value`, as given to `--set`: the key is dotted, the value is TOML or a bare word.
    ///
    /// # Errors
    /// If the argument is not of this form, or a part of the key is a value and not a table.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let refuse = |why: String| Err(Error::input(format!("--set {assignment}: {why}")));
        let Some((key, value)) = assignment.split_once('=') else {
            return refuse("expected key=value, for instance gait.kind=trot".into());
        };
        let (key, value) = (key.trim(), value.trim());
        let parts: Vec<&str> = key.split('.').collect();
        if parts.iter().any(|part| part.is_empty()) {
            return refuse("the key has an empty part; expected for instance gait.kind=trot".into());
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
        self.origins
            .retain(|known, _| !(known.starts_with(key) && known[key.len()..].starts_with(['.', '['])));
        self.origins.insert(key.to_owned(), Origin::Override(assignment.to_owned()));
        Ok(())
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

    /// An input error at a key, with file and line; for a missing key, the line of the table that lacks it.
    pub fn error(&self, key: &str, what: impl std::fmt::Display) -> Error {
        let mut known = key;
        let origin = loop {
            match (self.origins.get(known), known.rfind(['.', '['])) {
                (Some(origin), _) => break Some(origin),
                (None, Some(dot)) => known = &known[..dot],
                (None, None) => break None,
            }
        };
        let at = match origin {
            Some(Origin::Line(line)) => format!("{}:{line}", self.file),
            Some(Origin::Override(assignment)) => format!("--set {assignment}"),
            None => self.file.clone(),
        };
        Error::input(format!("{at}: {key}: {what}"))
    }
}

fn note_lines(
    table: &DeTable,
    prefix: &str,
    line: &dyn Fn(&Range<usize>) -> usize,
    origins: &mut BTreeMap<String, Origin>,
) {
    for (key, value) in table {
        let path = join(prefix, key.get_ref());
        origins.insert(path.clone(), Origin::Line(line(&key.span())));
        note_value(value, &path, line, origins);
    }
}

fn note_value(
    value: &Spanned<DeValue>,
    path: &str,
    line: &dyn Fn(&Range<usize>) -> usize,
    origins: &mut BTreeMap<String, Origin>,
) {
    match value.get_ref() {
        DeValue::Table(inner) => note_lines(inner, path, line, origins),
        DeValue::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                let path = format!("{path}[{i}]");
                origins.insert(path.clone(), Origin::Line(line(&item.span())));
                note_value(item, &path, line, origins);
            }
        }
        _ => {}
    }
}

/// `prefix.key`, or just `key` at the top level.
pub(super) fn join(prefix: &str, key: &str) -> String {
    if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") }
}
