//! Other absolute readings beside a robot that was identified.

use std::path::Path;

use crate::files::FileError;
use crate::files::schema::read_results;
use crate::identification::{
    AbsoluteCase, AbsoluteError, FitError, MountedFrames, ReadingResidual, fit_parameters,
};
use crate::measurement::{AbsoluteReading, Origin};
use crate::numeric::estimable::Estimable;
use crate::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use crate::record::absolute::AbsoluteMessage;
use crate::task::{Belief, Fingerprint};
use serde::Deserialize;

/// A robot as `identify --identified-out` tells it from absolute readings.
#[derive(Debug, Clone)]
pub struct StoredRobot {
    /// What was fitted.
    pub message: AbsoluteMessage,
    /// What it rests on.
    pub identified_with: Fingerprint,
    /// Under which scenario.
    pub origin: Option<Origin>,
}

/// The keys that are read besides.
#[derive(Deserialize)]
struct RobotFile {
    #[serde(flatten)]
    message: AbsoluteMessage,
    identified_with: Fingerprint,
    scenario_file: Option<String>,
    provenance: RobotProvenance,
}

#[derive(Deserialize)]
struct RobotProvenance {
    scenario_sha256: Option<String>,
}

#[derive(Deserialize)]
struct KindOfFile {
    kind: Option<String>,
}

impl StoredRobot {
    /// Reads what `identify --identified-out` wrote; `None` if it is of deflections.
    ///
    /// # Errors
    /// What is wrong with it, with its key.
    pub fn read(path: &Path) -> Result<Option<Self>, FileError> {
        let wanted = "the file must be one that `elastocal identify --identified-out` wrote";
        let (text, _) = read_results(path, &["identify", "run"], wanted)?;
        let kind = serde_json::from_str::<KindOfFile>(&text)
            .ok()
            .and_then(|file| file.kind);
        if kind.as_deref() != Some("absolute") {
            return Ok(None);
        }
        let stored: RobotFile = serde_json::from_str(&text)
            .map_err(|error| FileError::new(path, error.to_string()).hint(wanted))?;
        let hash = stored.provenance.scenario_sha256;
        Ok(Some(Self {
            message: stored.message,
            identified_with: stored.identified_with,
            origin: stored
                .scenario_file
                .zip(hash)
                .map(|(scenario, scenario_sha256)| Origin {
                    scenario: scenario.into(),
                    scenario_sha256,
                }),
        }))
    }

    /// The arm of a belief with all that was fitted but the frames of stations and targets.
    ///
    /// # Errors
    /// A parameter does not exist, or its value is none.
    pub fn apply(&self, path: &Path, arm: &ElasticArm) -> Result<ElasticArm, FileError> {
        let wrong = |index: usize, problem: String| {
            FileError::new(path, problem).at(format!("unknowns[{index}]"))
        };
        let mut kinds = ParameterKind::all_of(arm);
        for link in 0..arm.chain.len() {
            kinds.push(ParameterKind::LinkMass { link });
            kinds.extend(Axis::ALL.map(|axis| ParameterKind::LinkCentre { link, axis }));
        }
        let (mut found, mut values) = (Vec::new(), Vec::new());
        for (index, unknown) in self.message.unknowns.iter().enumerate() {
            let owner = unknown.name.rsplit_once('.').map_or("", |(owner, _)| owner);
            let mut frames = self.message.stations.iter().chain(&self.message.targets);
            if frames.any(|frame| frame.unknowns == owner) {
                continue;
            }
            let Some(&kind) = kinds.iter().find(|kind| kind.name(arm) == unknown.name) else {
                return Err(wrong(index, format!("the robot has no {:?}", unknown.name)));
            };
            let is_logarithmic = kind.is_logarithmic(false);
            let value = if is_logarithmic {
                (unknown.value / unknown.nominal).ln()
            } else {
                unknown.value
            };
            if !value.is_finite() {
                return Err(wrong(index, format!("found the value {}", unknown.value)));
            }
            found.push((kind, None));
            values.push(value);
        }
        let set = ParameterSet::new(arm, found).map_err(|error| wrong(0, error.to_string()))?;
        Ok(set.apply(arm, &values))
    }
}

/// What is left of readings that were not fitted.
#[derive(Debug, Clone)]
pub struct AbsoluteValidation {
    /// Of each reading.
    pub left: Vec<ReadingResidual>,
    /// Stations and targets that were not identified: their frames are fitted to these readings.
    pub frames_anew: Vec<String>,
}

/// Predicts readings with a robot that was identified; where a station or a target is a new one, its frame alone is fitted.
///
/// # Errors
/// The file does not fit the robot, or a new frame is not determined.
pub fn validate_absolute(
    belief: &Belief,
    path: &Path,
    stored: &StoredRobot,
    readings: &[AbsoluteReading],
) -> Result<AbsoluteValidation, AbsoluteValidationError> {
    let mut case = AbsoluteCase::placed(belief, readings)?;
    let tools = |case: &AbsoluteCase<'_>| -> Vec<_> {
        case.arm
            .tools
            .iter()
            .map(|tool| tool.link_from_tool)
            .collect()
    };
    case.arm = stored.apply(path, &case.arm)?;
    let guess = MountedFrames::guessed(&case.sights(), case.stations.len(), &tools(&case));
    let (mut kinds, mut frames_anew) = (Vec::new(), Vec::new());
    let mut frames = guess;
    for (station, name) in case.stations.iter().enumerate() {
        let known = stored
            .message
            .stations
            .iter()
            .find(|frame| frame.name == *name);
        if let Some(frame) =
            known.and_then(|known| known.frame(&frames.instrument_from_base[station]))
        {
            frames.instrument_from_base[station] = frame;
        } else {
            kinds.extend(Axis::ALL.map(|axis| ParameterKind::BasePosition { station, axis }));
            kinds.extend(Axis::ALL.map(|axis| ParameterKind::BaseRotation { station, axis }));
            frames_anew.push(
                name.clone()
                    .unwrap_or_else(|| "the only station".to_owned()),
            );
        }
    }
    for (tool, name) in case.targets.iter().enumerate() {
        let is_it = |frame: &&crate::record::absolute::MountedFrameMessage| {
            frame.name.as_deref() == Some(name)
        };
        let known = stored.message.targets.iter().find(is_it);
        if let Some(frame) = known.and_then(|known| known.frame(&frames.link_from_tool[tool])) {
            frames.link_from_tool[tool] = frame;
        } else {
            kinds.extend(Axis::ALL.map(|axis| ParameterKind::ToolPosition { tool, axis }));
            if readings.iter().any(|each| each.rotation.is_some()) {
                kinds.extend(Axis::ALL.map(|axis| ParameterKind::ToolRotation { tool, axis }));
            }
            frames_anew.push(name.clone());
        }
    }
    case.set_frames(frames);
    if !kinds.is_empty() {
        let set = ParameterSet::new(&case.arm, kinds.into_iter().map(|kind| (kind, None)))
            .map_err(AbsoluteError::from)?;
        let fit =
            fit_parameters(&case.arm, &set, &case.observations).map_err(AbsoluteError::from)?;
        if !Estimable::is_complete(&fit.posterior.estimable) {
            let sentences = fit
                .freedoms
                .named
                .into_iter()
                .map(|each| each.sentence)
                .collect();
            let what = frames_anew.join(", ");
            return Err(AbsoluteError::Frames { what, sentences }.into());
        }
        case.arm = fit.belief;
    }
    let left = case.left(&case.arm).map_err(|(index, source)| {
        AbsoluteError::from(FitError::Equilibrium {
            observation: index + 1,
            source,
        })
    })?;
    Ok(AbsoluteValidation { left, frames_anew })
}

/// Why readings cannot be held beside a robot.
#[derive(Debug, thiserror::Error)]
pub enum AbsoluteValidationError {
    /// The identification's file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The readings.
    #[error(transparent)]
    Readings(#[from] AbsoluteError),
}
