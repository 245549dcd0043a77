//! Under which scenario measurements were made, as their file says it.

use std::path::{Path, PathBuf};

use crate::csv::comments;
use crate::files::FileError;

const FILE: &str = "scenario: ";
const HASH: &str = "scenario_sha256: ";

/// The scenario that a file says it belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The scenario file, as it was called then.
    pub scenario: PathBuf,
    /// The SHA-256 that the scenario had then.
    pub scenario_sha256: String,
}

impl Origin {
    /// What the comments of a measurement file say; `None` where they name no scenario, as those of a
    /// laboratory.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let comments = comments(path)?;
        let after = |key: &str| comments.iter().find_map(|line| line.strip_prefix(key));
        Ok(after(FILE).zip(after(HASH)).map(|(file, hash)| Self {
            scenario: PathBuf::from(file),
            scenario_sha256: hash.to_owned(),
        }))
    }

    /// The comments of a measurement file.
    #[must_use]
    pub fn comments(&self) -> String {
        // A line end in a file's name would end the comment.
        let file = self.scenario.to_string_lossy().replace(['\n', '\r'], " ");
        format!("# {FILE}{file}\n# {HASH}{}\n", self.scenario_sha256)
    }
}
