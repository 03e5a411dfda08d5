//! The JSON Schema of the input files, and the check of a document against it.
//!
//! The Rust types are the single source: their schema says which keys, types and ranges there are, `warpgait schema`
//! prints it for editors, and the error messages are worded from it.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};
use toml::Value;

use super::document::{Document, join};
use super::words::{closest, show};
use crate::{Error, Result};

/// The JSON Schema (draft 2020-12) of files with the content `T`.
pub fn json_schema<T: JsonSchema>() -> Json {
    schemars::schema_for!(T).to_value()
}

/// The content of a document as a `T`.
///
/// # Errors
/// For what the schema of `T` does not allow: unknown and missing keys, wrong types and lengths, values out of range, NaN
/// and infinity. The message has file, line, key, what was given and what is allowed.
pub fn read_as<T: DeserializeOwned + JsonSchema>(document: &Document) -> Result<T> {
    let root = json_schema::<T>();
    let checker = Checker { root: &root, document };
    checker.table(&root, document.table(), "")?;
    let malformed = |e: toml::de::Error| Error::input(format!("{}: {}", document.file(), e.message()));
    document.table().clone().try_into().map_err(malformed)
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
        match Variants::of(schema) {
            Some(variants) => {
                let chosen = self.chosen(&variants, table, path)?;
                self.keys(chosen, table, path, Some(&variants))
            }
            None => self.keys(schema, table, path, None),
        }
    }

    /// The variant that a table's tag names.
    fn chosen(&self, variants: &Variants<'a>, table: &toml::Table, path: &str) -> Result<&'a Json> {
        let at = join(path, variants.tag);
        let names = variants.names();
        let Some(given) = table.get(variants.tag) else {
            return Err(self.document.error(&at, format!("missing; it must be {}", one_of(&names))));
        };
        match names.iter().position(|name| Some(*name) == given.as_str()) {
            Some(i) => Ok(&variants.schemas[i]),
            None => Err(self.not_a_word(&names, given, &at)),
        }
    }

    /// Checks the keys and values of a table; `variants` are those of its tagged enum, if it belongs to one.
    fn keys(
        &self,
        schema: &'a Json,
        table: &toml::Table,
        path: &str,
        variants: Option<&Variants<'a>>,
    ) -> Result<()> {
        let empty = Map::new();
        let properties = schema["properties"].as_object().unwrap_or(&empty);
        // The tag itself was checked when the variant was chosen.
        let is_tag = |key: &str| variants.is_some_and(|v| v.tag == key);
        let with_tag = variants.map(|v| format!("{} = {}", v.tag, properties[v.tag]["const"]));
        for (key, value) in table.iter().filter(|(key, _)| !is_tag(key)) {
            let at = join(path, key);
            if let Some(property) = properties.get(key) {
                self.value(property, value, &at)?;
                continue;
            }
            let allowed: Vec<&str> = properties.keys().map(String::as_str).filter(|k| !is_tag(k)).collect();
            let list = allowed.join(", ");
            let known_elsewhere = variants.is_some_and(|v| v.know(key));
            let guess = closest(key, &allowed).map_or(String::new(), |k| format!("did you mean `{k}`? "));
            let what = match &with_tag {
                Some(tag) if known_elsewhere => format!("not a key of {tag}; allowed with it: {list}"),
                Some(tag) => format!("unknown key; {guess}allowed with {tag}: {list}"),
                None => format!("unknown key; {guess}allowed here: {list}"),
            };
            return Err(self.document.error(&at, what));
        }
        for required in schema["required"].as_array().into_iter().flatten().filter_map(Json::as_str) {
            if !table.contains_key(required) {
                let allowed = self.describe(&properties[required]);
                let what = match &with_tag {
                    Some(tag) => format!("missing; {tag} needs it: {allowed}"),
                    None => format!("missing; it must be {allowed}"),
                };
                return Err(self.document.error(&join(path, required), what));
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
            return match value.as_str() {
                Some(given) if words.contains(&given) => Ok(()),
                _ => Err(self.not_a_word(&words, value, path)),
            };
        }
        let is = |name: &str| match &schema["type"] {
            Json::Array(names) => names.iter().any(|n| n == name),
            one => one == name,
        };
        let fits = match value {
            Value::Table(table) if is("object") || Variants::of(schema).is_some() => {
                return self.table(schema, table, path);
            }
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

    fn not_a_word(&self, words: &[&str], value: &Value, path: &str) -> Error {
        let guess = closest(value.as_str().unwrap_or_default(), words)
            .map_or(String::new(), |word| format!("; did you mean \"{word}\"?"));
        self.document.error(path, format!("given {}, allowed: {}{guess}", show(value), one_of(words)))
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
            return one_of(&words);
        }
        if let Some(variants) = Variants::of(schema) {
            return format!("a table with at least {}", variants.tag);
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

/// The variants of an internally tagged enum, whose tag is the key that is constant in each of them.
struct Variants<'a> {
    tag: &'a str,
    schemas: &'a [Json],
}

impl<'a> Variants<'a> {
    fn of(schema: &'a Json) -> Option<Self> {
        let schemas = schema["oneOf"].as_array()?;
        let constant = |key: &str| schemas.iter().all(|s| s["properties"][key]["const"].is_string());
        let tag = schemas.first()?["properties"].as_object()?.keys().find(|key| constant(key))?;
        Some(Self { tag, schemas })
    }

    fn names(&self) -> Vec<&'a str> {
        self.schemas.iter().filter_map(|s| s["properties"][self.tag]["const"].as_str()).collect()
    }

    /// Whether any variant has this key.
    fn know(&self, key: &str) -> bool {
        self.schemas.iter().any(|s| s["properties"].get(key).is_some())
    }
}

fn one_of(words: &[&str]) -> String {
    words.iter().map(|word| format!("\"{word}\"")).collect::<Vec<_>>().join(", ")
}

/// The words of an enumeration of strings.
fn words(schema: &Json) -> Option<Vec<&str>> {
    if let Some(words) = schema["enum"].as_array() {
        return Some(words.iter().filter_map(Json::as_str).collect());
    }
    let choices = schema["oneOf"].as_array()?;
    let words = choices.iter().map(|choice| match choice["const"].as_str() {
        Some(word) => Some(vec![word]),
        None => words(choice),
    });
    Some(words.collect::<Option<Vec<_>>>()?.concat())
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
