//! Why candidates are left out, and why no plan can be chosen from them.

use std::path::Path;

use thiserror::Error;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::quantities::limits::MOST_CANDIDATES;

/// What plans are chosen from, of what was offered.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OfferedCandidates {
    /// How many there were, each row of the file under each load, or from each station.
    pub offered: usize,
    /// How many are possible.
    pub possible: usize,
    /// Why others are not.
    pub left_out: Vec<LeftOutCandidates>,
}

/// Candidates that are not possible for one reason.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LeftOutCandidates {
    /// What is violated.
    pub what: String,
    /// How many.
    pub count: usize,
    /// The line of the first in its file.
    pub line: usize,
    /// What is wrong with that.
    pub first: String,
}

/// Why no plan can be chosen from candidates.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{problem}")]
pub struct CandidateError {
    problem: String,
    hint: Option<String>,
    /// Whether more measurements are no help.
    pub is_of_all: bool,
}

impl CandidateError {
    /// What is wrong, and what to do about it.
    pub(in crate::plan) fn new(problem: impl Into<String>, hint: Option<&str>) -> Self {
        Self {
            problem: problem.into(),
            hint: hint.map(str::to_owned),
            is_of_all: false,
        }
    }

    /// The same whatever the number of measurements.
    pub(in crate::plan) fn whatever_number(self) -> Self {
        Self {
            is_of_all: true,
            ..self
        }
    }

    /// There are too many, each row so, as "under each load".
    pub(in crate::plan) fn too_many(found: usize, each: &str, of: &str) -> Self {
        let problem = format!(
            "there are {found} candidates, each row {each} each {of} of the scenario; at most {MOST_CANDIDATES} are allowed"
        );
        Self::new(
            problem,
            Some(&format!("give fewer rows, or the {of} of each")),
        )
    }

    /// All together do not determine what is asked for.
    pub(in crate::plan) fn undetermined() -> Self {
        let problem = "the candidates do not determine what is asked for, whichever are measured";
        Self::new(problem, None)
    }

    /// The same about a file.
    pub fn in_file(&self, path: &Path) -> FileError {
        let wrong = FileError::new(path, self.to_string()).code(ErrorCode::AbsolutePlan);
        wrong.hinted(self.hint())
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<&str> {
        self.hint.as_deref()
    }
}

impl std::fmt::Display for LeftOutCandidates {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (what, count, line) = (&self.what, self.count, self.line);
        let first = &self.first;
        write!(
            formatter,
            "{count} for {what} (the first in line {line}: {first})"
        )
    }
}
