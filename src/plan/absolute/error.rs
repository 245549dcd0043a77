//! Why there is no plan of absolute readings.

use std::path::Path;

use thiserror::Error;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::identification::IdentificationError;
use crate::plan::search::CandidateError;

/// So many names are told one by one.
const NAMED: usize = 6;

/// Some names, and how many more there are.
pub(super) fn some_of(names: &[String]) -> String {
    let (some, rest) = names.split_at(names.len().min(NAMED));
    let some = some.join(", ");
    if rest.is_empty() {
        some
    } else {
        format!("{some} and {} more unknowns", rest.len())
    }
}

/// Why there is no plan of absolute readings.
#[derive(Debug, Error)]
pub enum AbsolutePlanError {
    /// The task, the candidates, or the choice of some.
    #[error(transparent)]
    Candidates(#[from] CandidateError),
    /// What can be read.
    #[error(transparent)]
    Readings(IdentificationError),
    /// The place of the tool depends on what the candidates do not show.
    #[error(
        "the tool's place at the test poses depends on {}, which the candidates do not separate{}",
        some_of(names),
        unread.as_ref().map_or_else(String::new, |target| format!("; none of them reads {target}"))
    )]
    Undetermined {
        /// The unknowns.
        names: Vec<String>,
        /// The machining tool, where no candidate reads it.
        unread: Option<String>,
    },
}

impl AbsolutePlanError {
    /// A problem, and what to do about it.
    pub(super) fn other(problem: impl Into<String>, hint: Option<&str>) -> Self {
        Self::Candidates(CandidateError::new(problem, hint))
    }

    /// What is wrong with candidates in these lines.
    pub(super) fn of_lines(error: IdentificationError, lines: &[usize]) -> Self {
        let line = |reading: usize| lines.get(reading.wrapping_sub(1)).copied().unwrap_or(0);
        match error {
            IdentificationError::Target { reading, source } => {
                Self::target(line(reading), &source.to_string())
            }
            IdentificationError::BeyondLoad { reading, target } => Self::other(
                format!(
                    "line {}: the target {target:?} is carried by a joint beyond the calibration tool's, at which loads act",
                    line(reading)
                ),
                None,
            ),
            other => Self::Readings(other),
        }
    }

    /// A target that the model does not have, in the line of the first candidate of it.
    pub(super) fn target(line: usize, problem: &str) -> Self {
        let hint = "add the target to the scenario as a [[robot.tool]], or to the model as a site";
        Self::other(format!("line {line}: target: {problem}"), Some(hint))
    }

    /// The same about a file.
    pub fn in_file(&self, path: &Path) -> FileError {
        let wrong = FileError::new(path, self.to_string()).code(ErrorCode::AbsolutePlan);
        wrong.hinted(self.hint())
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Candidates(error) => error.hint(),
            Self::Readings(error) => error.hint(),
            Self::Undetermined { .. } => Some(
                "give candidates in which all joints differ and whose target is the machining site, or say with [[uncertainty]] \
                 how well joints and links are known",
            ),
        }
    }
}
