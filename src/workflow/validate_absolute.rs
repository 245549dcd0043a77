//! Other absolute readings beside a robot that was identified.

use std::path::Path;

use nalgebra::Matrix3;

use super::stored_robot::{StoredRobot, robot_kinds};
use crate::codes::{Condition, ConditionCode};
use crate::files::FileError;
use crate::identification::{
    AbsoluteCase, AbsoluteError, MovedStation, ReadingPrognosis, ReadingResidual, fit_parameters,
};
use crate::measurement::AbsoluteReading;
use crate::numeric::estimable::Estimable;
use crate::parameter::{Axis, ParameterKind, ParameterSet};
use crate::record::absolute::MountedFrameMessage;
use crate::task::Belief;
use crate::text::wording::p_value;

/// What is left of readings that were not fitted.
#[derive(Debug, Clone)]
pub struct AbsoluteValidation {
    /// Of each reading, beside the identified parameters alone.
    pub left: Vec<ReadingResidual>,
    /// The covariance of each reading's position by the instrument (m^2).
    pub readings_m2: Vec<Matrix3<f64>>,
    /// The same beside all that was identified, what joints are off by among it, with regions.
    pub prognoses: Vec<ReadingPrognosis>,
    /// The probability of differences as large, where all errors are counted: of distances.
    pub probability: Option<f64>,
    /// What is read: positions or distances, and orientations.
    pub names: [&'static str; 2],
    /// Beside the nominal robot in frames that suit these readings best; none where these readings do not tell frames.
    pub before: Option<Vec<ReadingResidual>>,
    /// Stations and targets that were not identified: their frames are fitted to these readings.
    pub frames_anew: Vec<String>,
    /// Whether readings lie outside of the angles at which the robot was identified.
    pub beyond: Option<Condition>,
    /// How far the identified stations stand from where they were.
    pub moved: Vec<(String, MovedStation)>,
}

impl AbsoluteValidation {
    /// The share of positions (0) or rotations (1) that lie in their regions of 95 %.
    pub fn coverage(&self, part: usize) -> Option<f64> {
        let judged = self
            .prognoses
            .iter()
            .filter_map(|each| each.is_within[part]);
        let (within, all) = judged.fold((0_usize, 0_usize), |(within, all), is_within| {
            (within + usize::from(is_within), all + 1)
        });
        (all > 0).then(|| within as f64 / all as f64)
    }

    /// What must be looked at.
    pub fn conditions(&self) -> Vec<Condition> {
        let mut conditions: Vec<Condition> = self.beyond.iter().cloned().collect();
        for (name, moved) in &self.moved {
            if moved.is_moved() {
                conditions.push(ConditionCode::StationMoved.with(format!(
                    "{name} moved by {:.3} mm and {:.3} mrad since it was identified, {}",
                    moved.position_m.norm() * 1e3,
                    moved.rotation_rad.norm() * 1e3,
                    p_value(moved.probability)
                )));
            }
        }
        conditions.extend(self.probability.and_then(prediction_failed));
        for (part, name) in self.names.into_iter().enumerate() {
            if let Some(share) = self.coverage(part)
                && self.prognoses.len() >= LEAST_JUDGED
                && share < LEAST_COVERAGE
            {
                conditions.push(ConditionCode::Coverage.with(format!(
                    "coverage of the 95 % regions of {name} is {:.0} %",
                    share * 100.0
                )));
            }
        }
        conditions
    }
}

/// Less likely differences break the prediction.
const BROKEN: f64 = 1e-3;
/// Fewer readings say nothing of shares.
const LEAST_JUDGED: usize = 20;
/// Regions of 95 % that hold less are none.
const LEAST_COVERAGE: f64 = 0.8;

/// Measurements whose differences from a prediction are as improbable.
pub fn prediction_failed(probability: f64) -> Option<Condition> {
    let p = p_value(probability);
    let words = format!("the measurements differ from their prediction, {p}");
    (probability < BROKEN).then(|| ConditionCode::PredictionFailed.with(words))
}

/// The frames of a robot that was identified, as other readings name them.
struct KnownFrames {
    /// The parameters that these readings depend on, with their places in the file.
    kinds: Vec<ParameterKind>,
    places: Vec<usize>,
    /// Those of frames that were not identified.
    anew: Vec<ParameterKind>,
    /// The names of these.
    names: Vec<String>,
    /// The stations that were identified.
    stations: Vec<usize>,
}

/// Puts identified frames in their places and notes the others.
fn known_frames(case: &mut AbsoluteCase<'_>, stored: &StoredRobot, is_turned: bool) -> KnownFrames {
    let mut frames = case.first_frames();
    let mut known = KnownFrames {
        kinds: Vec::new(),
        places: Vec::new(),
        anew: Vec::new(),
        names: Vec::new(),
        stations: Vec::new(),
    };
    let message = &stored.message;
    let mut owned = |owner: &str, kinds: [[ParameterKind; 3]; 2]| {
        for (kinds, turn) in kinds.into_iter().zip(["", "r"]) {
            for (kind, axis) in kinds.into_iter().zip(["x", "y", "z"]) {
                let name = format!("{owner}.{turn}{axis}");
                let place = message.unknowns.iter().position(|each| each.name == name);
                if let Some(place) = place {
                    known.kinds.push(kind);
                    known.places.push(place);
                }
            }
        }
    };
    for (station, name) in case.stations.iter().enumerate() {
        let kinds = [
            Axis::ALL.map(|axis| ParameterKind::BasePosition { station, axis }),
            Axis::ALL.map(|axis| ParameterKind::BaseRotation { station, axis }),
        ];
        let stored = message.stations.iter().find(|frame| frame.name == *name);
        let frame = stored.and_then(|stored| stored.frame(&frames.instrument_from_base[station]));
        if let (Some(stored), Some(frame)) = (stored, frame) {
            frames.instrument_from_base[station] = frame;
            owned(&stored.unknowns, kinds);
            known.stations.push(station);
        } else {
            known.anew.extend(case.base_kinds(station));
            let name = name.clone();
            known
                .names
                .push(name.unwrap_or_else(|| "the only station".to_owned()));
        }
    }
    for (tool, name) in case.targets.iter().enumerate() {
        let kinds = [
            Axis::ALL.map(|axis| ParameterKind::ToolPosition { tool, axis }),
            Axis::ALL.map(|axis| ParameterKind::ToolRotation { tool, axis }),
        ];
        let is_it = |frame: &&MountedFrameMessage| frame.name.as_deref() == Some(name);
        let stored = message.targets.iter().find(is_it);
        let frame = stored.and_then(|stored| stored.frame(&frames.link_from_tool[tool]));
        if let (Some(stored), Some(frame)) = (stored, frame) {
            frames.link_from_tool[tool] = frame;
            owned(&stored.unknowns, kinds);
        } else {
            known.anew.extend(kinds[0]);
            if is_turned {
                known.anew.extend(kinds[1]);
            }
            known.names.push(name.clone());
        }
    }
    case.set_frames(frames);
    known
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
    let reads = case.observations.iter().zip(&case.covariances);
    let readings_m2 = reads.map(|(each, covariance)| {
        let rows = each.reading.kind().rows().min(3);
        let is_read = |row: usize, column: usize| row.max(column) < rows;
        Matrix3::from_fn(|row, column| {
            if is_read(row, column) {
                covariance[(row, column)]
            } else {
                0.0
            }
        })
    });
    let readings_m2 = readings_m2.collect();
    case = case.counting_sources();
    let nominal = case.arm.clone();
    case.arm = stored.apply(path, &case.arm)?;
    let is_turned = readings.iter().any(|each| each.rotation.is_some());
    let mut known = known_frames(&mut case, stored, is_turned);
    let anew = (known.anew.iter()).map(|kind| (*kind, None));
    let anew = ParameterSet::new(&case.arm, anew).map_err(AbsoluteError::from)?;
    if !anew.is_empty() {
        let fit =
            fit_parameters(&case.arm, &anew, &case.observations).map_err(AbsoluteError::from)?;
        if !Estimable::is_complete(&fit.posterior.estimable) {
            let sentences = (fit.freedoms.named.into_iter())
                .map(|each| each.sentence)
                .collect();
            let what = known.names.join(", ");
            return Err(AbsoluteError::Frames { what, sentences }.into());
        }
        case.arm = fit.belief;
    }
    let left = case.left(&case.arm).map_err(AbsoluteError::from)?;
    let arm = case.arm.clone();
    for (place, unknown) in stored.message.unknowns.iter().enumerate() {
        let kinds = robot_kinds(&nominal);
        if let Some(kind) = ParameterKind::named(&unknown.name, &kinds, &nominal)
            && !stored.is_of_frame(&unknown.name)
        {
            known.kinds.push(kind);
            known.places.push(place);
        }
    }
    let set = known.kinds.iter().map(|kind| (*kind, None));
    let set = ParameterSet::new(&arm, set).map_err(AbsoluteError::from)?;
    let discrepancy = stored.discrepancy_model(path, &arm)?;
    let places = &known.places;
    let prognoses =
        (case.prognoses(&arm, &set, places, &discrepancy, &anew)).map_err(AbsoluteError::from)?;
    let probability =
        (case.probability(&arm, &set, places, &discrepancy, &anew)).map_err(AbsoluteError::from)?;
    let mut moved = Vec::new();
    for &station in &known.stations {
        let found = case
            .moved_station(&arm, &set, places, &discrepancy, station)
            .map_err(AbsoluteError::from)?;
        let name = (case.stations[station].as_ref()).map_or_else(
            || "the station".to_owned(),
            |name| format!("station {name}"),
        );
        moved.extend(found.map(|found| (name, found)));
    }
    let configurations = case
        .observations
        .iter()
        .map(|each| &each.setup.commanded_rad);
    Ok(AbsoluteValidation {
        beyond: (stored.read_ranges()).beyond(&arm, "reading", configurations),
        left,
        readings_m2,
        probability,
        names: [
            if case.reads_distances() {
                "distances"
            } else {
                "positions"
            },
            "orientations",
        ],
        prognoses,
        before: before(belief, readings),
        frames_anew: known.names,
        moved,
    })
}

/// What the nominal robot leaves in frames that suit the readings best.
fn before(belief: &Belief, readings: &[AbsoluteReading]) -> Option<Vec<ReadingResidual>> {
    let case = AbsoluteCase::new(belief, readings).ok()?;
    case.left_in_best_frames().ok()
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
