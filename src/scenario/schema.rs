//! The JSON Schema of the input files, and the check of a document against it.
//!
//! The Rust types are the single source: their schema says which keys, types and ranges there are, `warpgait schema`
//! prints it for editors, and the same schema words the errors.

use schemars::JsonSchema;
use serde_json::{Map, Value as Json};
use toml::Value;

use super::Scenario;
use super::document::{Document, join};
use crate::{Error, Result};

/// The JSON Schema (draft 2020-12) of a scenario file.
pub fn json_schema() -> Json {
    schema_of::<Scenario>()
}

fn schema_of<T: JsonSchema>() -> Json {
    schemars::schema_for!(T).to_value()
}

/// Refuses what the schema of `T` does not allow: unknown and missing keys, types, ranges, lengths, NaN and infinity.
pub(super) fn check<T: JsonSchema>(document: &Document) -> Result<()> {
    let root = schema_of::<T>();
    let checker = Checker { root: &root, document };
    checker.table(&root, document.table(), "")
}

struct Checker<'a> {
    root: &'a Json,
    document: &'a Document,
}

impl<'a> Checker<'a> {
    /// Follows `$ref` and drops the `null` of optional values.
    fn resolve(&self, mut schema: &'a Json) -> &'a Json {
        loop {
            if let Some(name) = schema["$ref"].as_str().and_then(|r| r.strip_prefix("#/$defs/")) {
                schema = &self.root["$defs"][name];
                continue;
            }
            let Some(choices) = schema["anyOf"].as_array() else { return schema };
            let mut real = choices.iter().filter(|choice| choice["type"] != "null");
            match (real.next(), real.next()) {
                (Some(only), None) => schema = only,
                _ => return schema,
            }
        }
    }

    fn table(&self, schema: &'a Json, table: &toml::Table, path: &str) -> Result<()> {
        let empty = Map::new();
        let properties = schema["properties"].as_object().unwrap_or(&empty);
        for (key, value) in table {
            let at = join(path, key);
            match properties.get(key) {
                Some(property) => self.value(property, value, &at)?,
                None => {
                    let allowed: Vec<&str> = properties.keys().map(String::as_str).collect();
                    let guess =
                        closest(key, &allowed).map_or(String::new(), |k| format!("did you mean `{k}`? "));
                    let what = format!("unknown key; {guess}allowed here: {}", allowed.join(", "));
                    return Err(self.document.error(&at, what));
                }
            }
        }
        for required in schema["required"].as_array().into_iter().flatten().filter_map(Json::as_str) {
            if !table.contains_key(required) {
                let allowed = self.describe(&properties[required]);
                return Err(self
                    .document
                    .error(&join(path, required), format!("missing; it must be {allowed}")));
            }
        }
        Ok(())
    }

    fn value(&self, schema: &'a Json, value: &Value, path: &str) -> Result<()> {
        let schema = self.resolve(schema);
        if let Some(choices) = schema["anyOf"].as_array() {
            if choices.iter().any(|choice| self.value(choice, value, path).is_ok()) {
                return Ok(());
            }
            return Err(self.wrong(schema, value, path));
        }
        if let Some(words) = words(schema) {
            let given = value.as_str().unwrap_or_default();
            if words.contains(&given) {
                return Ok(());
            }
            let guess =
                closest(given, &words).map_or(String::new(), |word| format!("; did you mean \"{word}\"?"));
            let what = format!("given {}, allowed: {}{guess}", show(value), self.describe(schema));
            return Err(self.document.error(path, what));
        }
        let is = |name: &str| match &schema["type"] {
            Json::Array(names) => names.iter().any(|n| n == name),
            one => one == name,
        };
        let fits = match value {
            Value::Table(table) if is("object") => return self.table(schema, table, path),
            Value::Array(items) if is("array") => {
                let (least, most) = length(schema);
                if items.len() < least || items.len() > most {
                    return Err(self.wrong(schema, value, path));
                }
                for (i, item) in items.iter().enumerate() {
                    self.value(&schema["items"], item, &format!("{path}[{i}]"))?;
                }
                true
            }
            Value::String(_) => is("string"),
            Value::Boolean(_) => is("boolean"),
            Value::Integer(n) => (is("integer") || is("number")) && in_range(schema, *n as f64),
            Value::Float(x) => is("number") && x.is_finite() && in_range(schema, *x),
            _ => false,
        };
        if fits { Ok(()) } else { Err(self.wrong(schema, value, path)) }
    }

    fn wrong(&self, schema: &'a Json, value: &Value, path: &str) -> Error {
        self.document.error(path, format!("given {}, allowed: {}", show(value), self.describe(schema)))
    }

    /// What a schema allows, in words.
    fn describe(&self, schema: &'a Json) -> String {
        let schema = self.resolve(schema);
        if let Some(choices) = schema["anyOf"].as_array() {
            return choices.iter().map(|choice| self.describe(choice)).collect::<Vec<_>>().join(", or ");
        }
        if let Some(words) = words(schema) {
            return words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", ");
        }
        let name = match &schema["type"] {
            Json::Array(names) => names.iter().filter_map(Json::as_str).find(|&n| n != "null").unwrap_or(""),
            one => one.as_str().unwrap_or(""),
        };
        match name {
            "object" => match schema["required"].as_array() {
                Some(keys) => {
                    let keys: Vec<&str> = keys.iter().filter_map(Json::as_str).collect();
                    format!("a table with at least {}", keys.join(", "))
                }
                None => "a table".into(),
            },
            "array" => {
                let items = self.describe(&schema["items"]);
                match length(schema) {
                    (0, usize::MAX) => format!("an array, each {items}"),
                    (least, most) if least == most => format!("an array of {least}, each {items}"),
                    (least, most) => format!("an array of {least} to {most}, each {items}"),
                }
            }
            "number" | "integer" => {
                let article = if name == "number" { "a finite number" } else { "an integer" };
                match bounds(schema) {
                    (Some(a), Some(b)) if a == b => format!("{a}"),
                    (Some(a), Some(b)) => format!("{article} from {a} to {b}"),
                    (Some(a), None) => format!("{article} of at least {a}"),
                    (None, Some(b)) => format!("{article} of at most {b}"),
                    (None, None) => article.into(),
                }
            }
            "boolean" => "true or false".into(),
            _ => "a string".into(),
        }
    }
}

/// The words of an enumeration.
fn words(schema: &Json) -> Option<Vec<&str>> {
    if let Some(words) = schema["enum"].as_array() {
        return Some(words.iter().filter_map(Json::as_str).collect());
    }
    schema["oneOf"].as_array().map(|choices| {
        choices
            .iter()
            .flat_map(|choice| match choice["const"].as_str() {
                Some(word) => vec![word],
                None => words(choice).unwrap_or_default(),
            })
            .collect()
    })
}

fn length(schema: &Json) -> (usize, usize) {
    let read = |key: &str| schema[key].as_u64().map(|n| n as usize);
    (read("minItems").unwrap_or(0), read("maxItems").unwrap_or(usize::MAX))
}

fn bounds(schema: &Json) -> (Option<f64>, Option<f64>) {
    (schema["minimum"].as_f64(), schema["maximum"].as_f64())
}

fn in_range(schema: &Json, x: f64) -> bool {
    let (least, most) = bounds(schema);
    least.is_none_or(|a| x >= a) && most.is_none_or(|b| x <= b)
}

/// A value as the user wrote it, cut when long.
pub(super) fn show(value: &Value) -> String {
    let kind = match value {
        Value::Table(_) => return "a table".into(),
        Value::String(_) => " (a string)",
        Value::Boolean(_) => " (a truth value)",
        Value::Datetime(_) => " (a date)",
        Value::Array(items) => return format!("an array of {}: {}", items.len(), cut(&value.to_string())),
        Value::Integer(_) | Value::Float(_) => "",
    };
    format!("{}{kind}", cut(&value.to_string()))
}

fn cut(text: &str) -> String {
    if text.chars().count() <= 60 {
        text.to_owned()
    } else {
        format!("{}…", text.chars().take(60).collect::<String>())
    }
}

/// The most similar of the allowed words, when similar enough to be what was meant.
pub(crate) fn closest<'a>(given: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let best = allowed.iter().map(|word| (edit_distance(given, word), *word)).min()?;
    let tolerated = 1 + given.chars().count() / 4;
    (best.0 <= tolerated).then_some(best.1)
}

/// Levenshtein's distance.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
