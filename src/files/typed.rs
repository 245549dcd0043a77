//! What texts say, as types: what is wrong is told with its key, and in TOML with its line.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde_path_to_error::{Path as KeyPath, Segment};
use toml::de::{DeTable, DeValue};

use super::FileError;

/// So much of a line is shown in an error (characters).
const LONGEST_SHOWN: usize = 60;

/// What the TOML text of a file says.
///
/// # Errors
/// It is no TOML, or something else than the type: with line and dotted key.
pub fn from_toml<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, FileError> {
    let syntax = |error: &toml::de::Error| {
        let Some(span) = error.span() else {
            return FileError::new(path, problem(error));
        };
        let line = line_of(text, span.start);
        let found = text.lines().nth(line - 1).map_or("", str::trim);
        let shown: String = found.chars().take(LONGEST_SHOWN).collect();
        let found = if shown.is_empty() {
            String::new()
        } else {
            format!(": `{shown}`")
        };
        FileError::new(path, problem(error) + &found).at(format!("line {line}"))
    };
    let table: toml::Table = toml::from_str(text).map_err(|error| syntax(&error))?;
    // From the table and not from the text: readers of a type are compiled for each of the text's own forms.
    serde_path_to_error::deserialize(toml::Value::Table(table)).map_err(|error| {
        let wrong = FileError::new(path, problem(error.inner()));
        let line = line_of_key(text, error.path()).map(|line| format!("line {line}"));
        match (key(error.path()), line) {
            (Some(key), Some(line)) => wrong.at(format!("{key} ({line})")),
            (Some(place), None) | (None, Some(place)) => wrong.at(place),
            (None, None) => wrong,
        }
    })
}

/// What the JSON text of a file says.
///
/// # Errors
/// It is no JSON, or something else than the type: with its line and dotted key.
pub fn from_json<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, FileError> {
    let mut json = serde_json::Deserializer::from_str(text);
    let said = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let wrong = FileError::new(path, in_words(&error.inner().to_string()));
        match key(error.path()) {
            Some(key) => wrong.at(key),
            None => wrong,
        }
    })?;
    json.end()
        .map_err(|error| FileError::new(path, error.to_string()))?;
    Ok(said)
}

fn problem(error: &toml::de::Error) -> String {
    in_words(&error.message().replace('\n', "; "))
}

/// What a type of numbers in this program is to a reader of its messages.
fn in_words(message: &str) -> String {
    const WORDS: [(&str, &str); 6] = [
        ("expected u64", "expected a whole number, at least 0"),
        ("expected u32", "expected a whole number, at least 0"),
        ("expected usize", "expected a whole number, at least 0"),
        ("expected f64", "expected a number"),
        ("` as i128", "`"),
        ("` as u128", "`"),
    ];
    let said = |message: String, (of_type, word): (&str, &str)| message.replace(of_type, word);
    WORDS.into_iter().fold(message.to_owned(), said)
}

/// None of the whole.
fn key(path: &KeyPath) -> Option<String> {
    (path.iter().next().is_some()).then(|| path.to_string())
}

/// The line of the last key of a path that is in the text.
fn line_of_key(text: &str, path: &KeyPath) -> Option<usize> {
    let mut value = DeValue::Table(DeTable::parse(text).ok()?.into_inner());
    let mut line = None;
    for segment in path {
        let (start, next) = match (segment, value) {
            (Segment::Map { key }, DeValue::Table(mut table)) => {
                let (name, next) = table.remove_entry(key.as_str())?;
                (name.span().start, next.into_inner())
            }
            (Segment::Seq { index }, DeValue::Array(array)) => {
                let next = array.into_iter().nth(*index)?;
                (next.span().start, next.into_inner())
            }
            _ => break,
        };
        line = Some(line_of(text, start));
        value = next;
    }
    line
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text[..offset].matches('\n').count()
}
