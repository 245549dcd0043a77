//! Names and other text: one line without control characters, which would reach terminals, pages and
//! other programs.

use toml::Value;

use super::Checker;
use crate::files::FileError;
use crate::text::{is_unseen, wrong_name};

impl Checker<'_> {
    /// Checks every text of a table under its key, and every key that names something.
    pub(super) fn check_names(&self, path: &str, table: &toml::Table) -> Result<(), FileError> {
        for (key, value) in table {
            let path = match path {
                "" => key.clone(),
                path => format!("{path}.{key}"),
            };
            if let Some(problem) = wrong_name(key) {
                return Err(self.wrong(&path, problem));
            }
            self.check_value(&path, key, value)?;
        }
        Ok(())
    }

    fn check_value(&self, path: &str, key: &str, value: &Value) -> Result<(), FileError> {
        match value {
            Value::String(text) => match wrong_text(key, text) {
                Some(problem) => Err(self.wrong(path, problem)),
                None => Ok(()),
            },
            Value::Array(values) => (values.iter().enumerate()).try_for_each(|(index, each)| {
                self.check_value(&format!("{path}[{index}]"), key, each)
            }),
            Value::Table(table) => self.check_names(path, table),
            _ => Ok(()),
        }
    }
}

fn wrong_text(key: &str, text: &str) -> Option<String> {
    match key {
        "description" => {
            let is_wrong = |each: char| is_unseen(each) && !matches!(each, '\n' | '\r' | '\t');
            text.contains(is_wrong)
                .then(|| format!("found {text:?}; text without control characters is allowed"))
        }
        // The names of files may be long.
        "model" | "file" | "mandatory" => (text.is_empty() || text.contains(is_unseen))
            .then(|| format!("found {text:?}; the path of a file is allowed")),
        _ => wrong_name(text),
    }
}
