//! Under which scenario measurements were made, as their file says it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::codes::ErrorCode;
use crate::csv::comments;
use crate::files::FileError;

const FILE: &str = "scenario: ";
const HASH: &str = "scenario_sha256: ";
const SIMULATED: &str = "simulated: ";

/// How a comment begins that says whether the robot's controller compensated deflections by itself: "yes" or "no".
pub const CONTROLLER_COMPENSATES: &str = "controller_compensates: ";

/// Whether a measurement file says that the robot's controller compensated deflections by itself.
///
/// # Errors
/// The file cannot be read, or says neither yes nor no.
pub fn controller_compensates(path: &Path) -> Result<bool, FileError> {
    let comments = comments(path)?;
    let said =
        (comments.iter()).find_map(|line| line.strip_prefix(CONTROLLER_COMPENSATES.trim_end()));
    match said.map(str::trim) {
        None | Some("no") => Ok(false),
        Some("yes") => Ok(true),
        Some(other) => {
            let problem = format!("found {CONTROLLER_COMPENSATES}{other:?}; yes or no is needed");
            Err(FileError::new(path, problem).code(ErrorCode::Measurements))
        }
    }
}

/// The scenario that a file says it belongs to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// The scenario file, as it was called then.
    pub scenario: PathBuf,
    /// The SHA-256 that the scenario had then.
    pub scenario_sha256: String,
    /// Which virtual robot of that scenario was measured; `None` where it is not said to be one, as in a laboratory.
    pub simulated: Option<SimulatedRun>,
}

/// A virtual robot of a scenario.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatedRun {
    /// The seed.
    pub seed: u64,
    /// The run; `None` for the robot of which nothing is sampled.
    pub run: Option<u64>,
    /// The campaign,
    #[serde(default, skip_serializing_if = "is_first")]
    pub campaign: u64,
    /// and the series of readings in it.
    #[serde(default, skip_serializing_if = "is_first")]
    pub series: u64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
const fn is_first(number: &u64) -> bool {
    *number == 0
}

impl SimulatedRun {
    /// Its first readings.
    pub const fn first(seed: u64, run: Option<u64>) -> Self {
        Self {
            seed,
            run,
            campaign: 0,
            series: 0,
        }
    }
}

impl Origin {
    /// What the comments of a measurement file say; `None` where they name no scenario, as those of a
    /// laboratory.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let comments = comments(path)?;
        let after = |key: &str| comments.iter().find_map(|line| line.strip_prefix(key));
        let simulated = after(SIMULATED).and_then(|run| serde_json::from_str(run).ok());
        Ok(after(FILE).zip(after(HASH)).map(|(file, hash)| Self {
            scenario: PathBuf::from(file),
            scenario_sha256: hash.to_owned(),
            simulated,
        }))
    }

    /// The comments of a measurement file.
    pub fn comments(&self) -> String {
        // A line end in a file's name would end the comment.
        let file = self.scenario.to_string_lossy().replace(['\n', '\r'], " ");
        let simulated = (self.simulated)
            .and_then(|run| serde_json::to_string(&run).ok())
            .map_or_else(String::new, |run| format!("# {SIMULATED}{run}\n"));
        format!(
            "# {FILE}{file}\n# {HASH}{}\n{simulated}",
            self.scenario_sha256
        )
    }

    /// The same of a virtual robot.
    pub fn simulated(self, run: SimulatedRun) -> Self {
        Self {
            simulated: Some(run),
            ..self
        }
    }
}
