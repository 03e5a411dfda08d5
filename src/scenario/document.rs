//! A TOML file with the line of every key, so that an error can say where.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::schema;
use crate::{Error, Result};

/// A parsed file, possibly with values set from the command line.
#[derive(Clone, Debug)]
pub struct Document {
    file: String,
    table: Table,
    /// By dotted key (`gait.duty`, `gait.phases[1]`): where it was set.
    origins: BTreeMap<String, Origin>,
}

#[derive(Clone, Debug)]
enum Origin {
    Line(usize),
    /// The argument of `--set`.
    Override(String),
}

impl Document {
    /// Reads a file. Fails when it is not there, not UTF-8 or not TOML.
    pub fn read(path: &Path) -> Result<(Self, String)> {
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        let text = String::from_utf8(bytes)
            .map_err(|_| Error::input(format!("{file}: not a text file in UTF-8")))?;
        Ok((Self::parse(&file, &text)?, text))
    }

    /// Parses TOML; `file` is the name for messages.
    pub fn parse(file: &str, text: &str) -> Result<Self> {
        let line = |span: &Range<usize>| {
            1 + text.as_bytes()[..span.start.min(text.len())].iter().filter(|&&b| b == b'\n').count()
        };
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

    /// Sets a value from `key=value` as given to `--set`: the key dotted, the value in TOML or a bare word.
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
        let (last, folders) = parts.split_last().unwrap_or((&"", &[]));
        let mut table = &mut self.table;
        for part in folders {
            table = match table.entry(*part).or_insert_with(|| Value::Table(Table::new())) {
                Value::Table(inner) => inner,
                other => return refuse(format!("`{part}` is {} there, not a table", schema::show(other))),
            };
        }
        table.insert((*last).to_owned(), value);
        self.origins
            .retain(|known, _| !(known.starts_with(key) && known[key.len()..].starts_with(['.', '['])));
        self.origins.insert(key.to_owned(), Origin::Override(assignment.to_owned()));
        Ok(())
    }

    /// The values.
    pub fn table(&self) -> &Table {
        &self.table
    }

    /// An input error at a key; the line is that of the key or of the table it is missing from.
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

    /// The typed content. The JSON Schema of `T` decides what is allowed, so that errors can name it.
    pub fn typed<T: DeserializeOwned + JsonSchema>(&self) -> Result<T> {
        schema::check::<T>(self)?;
        self.table
            .clone()
            .try_into()
            .map_err(|e: toml::de::Error| Error::input(format!("{}: {}", self.file, e.message())))
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

/// `prefix.key`, or `key` alone at the top.
pub(super) fn join(prefix: &str, key: &str) -> String {
    if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") }
}
