//! Wording that error messages share: the value that was given, and the word that was probably meant.

use toml::Value;

/// A value as the user wrote it, truncated if long.
pub(super) fn show(value: &Value) -> String {
    let kind = match value {
        Value::Table(_) => return "a table".into(),
        Value::String(_) => " (a string)",
        Value::Boolean(_) => " (a boolean)",
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

/// The allowed word closest to the given one, if it is close enough to be a typo of it.
pub fn closest<'a>(given: &str, allowed: &[&'a str]) -> Option<&'a str> {
    let best = allowed.iter().map(|word| (edit_distance(given, word), *word)).min()?;
    let tolerated = 1 + given.chars().count() / 4;
    (best.0 <= tolerated).then_some(best.1)
}

/// Levenshtein distance.
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
