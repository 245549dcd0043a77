//! An identified file: which of the two kinds it is, what it holds, and what that rests on.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::deflections::IdentificationMessage;
use super::robot::StoredRobot;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::files::schema::read_results;
use crate::files::typed::from_json;
use crate::measurement::{Origin, SimulatedRun};
use crate::task::{Fingerprint, LeftNominal};

/// Which file is wanted.
const WANTED: &str = "the file must be one that `elastocal identify --identified-out` wrote";

/// What `identify --identified-out` or `run` wrote.
#[derive(Debug, Clone)]
pub struct IdentifiedFile {
    /// The file.
    pub path: PathBuf,
    /// What was identified.
    pub record: IdentifiedRecord,
    /// What that rests on.
    pub basis: IdentificationBasis,
    json: Value,
}

/// What was identified.
#[derive(Debug, Clone)]
pub enum IdentifiedRecord {
    /// From deflections; and what these leave.
    Deflections(Box<IdentificationMessage>, Remainder),
    /// From absolute readings.
    Readings(Box<StoredRobot>),
}

/// What an identification rests on; files of earlier versions do not say all of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdentificationBasis {
    /// The robot, and what was believed.
    pub identified_with: Option<Fingerprint>,
    /// What was left nominal before.
    pub earlier_left_out: Option<Vec<LeftNominal>>,
    /// The scenario; none where its name is no text, which JSON could not hold.
    pub scenario_file: Option<String>,
    /// The names of the error sources.
    pub error_sources: Option<Vec<String>>,
    /// The digests of all readings, those among them that were left out, and of what was known before.
    pub reading_digests: Option<Vec<u64>>,
}

/// What deflections leave; files of earlier versions do not say all of it.
#[derive(Debug, Clone, Deserialize)]
pub struct Remainder {
    #[serde(default)]
    pub(super) residuals: Vec<ResidualKeys>,
    pub(super) discrepancy_mm: Option<f64>,
    pub(super) discrepancy_mrad: Option<f64>,
}

#[derive(Debug, Clone, Deserialize)]
pub(super) struct ResidualKeys {
    #[serde(default)]
    pub standardised: Vec<Option<f64>>,
    #[serde(default)]
    pub leverage: f64,
}

impl IdentifiedFile {
    /// Reads it.
    ///
    /// # Errors
    /// It is no such file, or its numbers do not go together, by their keys.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let coded = |wrong: FileError| wrong.or_code(ErrorCode::IdentifiedFile);
        let hinted = |wrong: FileError| coded(wrong.hint(WANTED));
        let (text, json) = read_results(path, &["identify", "run"], WANTED).map_err(coded)?;
        let record = if json["kind"] == "absolute" {
            let message = from_json(path, &text).map_err(hinted)?;
            IdentifiedRecord::Readings(Box::new(StoredRobot::new(path, message).map_err(coded)?))
        } else {
            let message = from_json(path, &text).map_err(hinted)?;
            let left = from_json(path, &text).map_err(hinted)?;
            IdentifiedRecord::Deflections(Box::new(message), left)
        };
        Ok(Self {
            path: path.to_owned(),
            record,
            basis: from_json(path, &text).map_err(hinted)?,
            json,
        })
    }

    /// Refuses another robot than the one of these kinematics, by their hash.
    ///
    /// # Errors
    /// It was identified with another robot.
    pub fn check_robot(&self, robot_sha256: &str) -> Result<(), FileError> {
        let found = self.basis.identified_with.as_ref();
        if found.is_none_or(|found| found.robot_sha256 == robot_sha256) {
            return Ok(());
        }
        let problem = "was identified with another robot: its joints' names, axes or places are not those \
                       of the scenario's model";
        let wrong = FileError::new(&self.path, problem).at("identified_with.robot_sha256");
        Err(wrong.code(ErrorCode::OtherRobot))
    }

    /// The scenario under which it was made, where it says so.
    pub fn origin(&self) -> Option<Origin> {
        let hash = self.json["provenance"]["scenario_sha256"].as_str()?;
        Some(Origin {
            scenario: self.basis.scenario_file.as_ref()?.into(),
            scenario_sha256: hash.to_owned(),
            simulated: SimulatedRun::deserialize(&self.json["simulated"]).ok(),
        })
    }
}
