//! The files of a command's results, where writing one may fail.

use std::path::{Path, PathBuf};

use crate::codes::{Condition, ConditionCode};
use crate::files::{FileError, output::write_whole};
use crate::text::{diagnostics::say, wording::joined};
use serde_json::Value;

/// Which files are there and which are not. What cannot be written costs no other result.
#[derive(Debug, Default)]
pub struct Written {
    there: Vec<PathBuf>,
    missing: Vec<PathBuf>,
    problems: Vec<String>,
}

/// Says what is wrong with something that the results do not depend on.
pub fn warn(problem: &str, hint: Option<&str>) {
    say(&format!("warning: {problem}; going on without it"));
    if let Some(hint) = hint {
        say(&format!("hint: {hint}"));
    }
}

/// The text of a file of results, with the conditions among them.
pub fn record_text(json: &mut Value, conditions: &[Condition]) -> serde_json::Result<String> {
    json["conditions"] = serde_json::to_value(conditions)?;
    Ok(serde_json::to_string_pretty(json)? + "\n")
}

impl Written {
    /// Notes that a file was written, or warns that it was not.
    pub fn note(&mut self, path: &Path, written: Result<(), FileError>) {
        let (files, others) = match &written {
            Ok(()) => (&mut self.there, &mut self.missing),
            Err(_) => (&mut self.missing, &mut self.there),
        };
        // A tally is written many times.
        others.retain(|other| other != path);
        if !files.iter().any(|other| other == path) {
            files.push(path.to_owned());
        }
        let Err(error) = written else { return };
        let problem = error.to_string();
        if !self.problems.contains(&problem) {
            warn(&problem, error.hint.as_deref());
            self.problems.push(problem);
        }
    }

    /// Writes a file of text, and notes what became of it.
    pub fn save(&mut self, path: &Path, text: &str) {
        self.note(path, write_whole(path, text.as_bytes()));
    }

    /// What could not be written, and which files are there all the same.
    pub fn conditions(mut self) -> Vec<Condition> {
        let code = ConditionCode::NotWritten;
        let mut conditions: Vec<Condition> = (self.problems.into_iter())
            .map(|text| code.with(text))
            .collect();
        if self.missing.is_empty() {
            return conditions;
        }
        let there = match &self.there[..] {
            [] => "no file was written".to_owned(),
            files => format!("written: {}", list(files)),
        };
        let mut text = format!("{there}; not written: {}", list(&self.missing));
        self.missing.retain(|file| file.is_file());
        if !self.missing.is_empty() {
            text += &format!("; from before are: {}", list(&self.missing));
        }
        conditions.push(code.with(text));
        conditions
    }
}

/// Files, by their paths.
pub fn list(files: &[PathBuf]) -> String {
    joined(files.iter().map(|file| file.display()), ", ")
}
