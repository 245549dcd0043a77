//! Other absolute readings beside a robot that was identified.

use std::path::Path;

use nalgebra::{DMatrix, DVector};

use crate::files::FileError;
use crate::files::schema::read_results;

use crate::identification::{
    AbsoluteCase, AbsoluteError, FitError, JointError, Misfit, MisfitModel, MountedFrames,
    MovedStation, ParameterGroup, ReadingPrognosis, ReadingResidual, ReadingWeights,
    fit_parameters,
};
use crate::measurement::{AbsoluteReading, Origin};
use crate::numeric::estimable::Estimable;
use crate::numeric::wandering::Wandering;
use crate::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use crate::record::absolute::{AbsoluteMessage, MountedFrameMessage};
use crate::robot::EquilibriumError;
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
        let kinds = robot_kinds(arm);
        let (mut found, mut values) = (Vec::new(), Vec::new());
        for (index, unknown) in self.message.unknowns.iter().enumerate() {
            if self.is_of_frame(&unknown.name) {
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

    /// Whether an unknown is one of a station's or a target's frame.
    fn is_of_frame(&self, name: &str) -> bool {
        let owner = name.rsplit_once('.').map_or("", |(owner, _)| owner);
        let mut frames = self.message.stations.iter().chain(&self.message.targets);
        frames.any(|frame| frame.unknowns == owner)
    }

    /// What is known of the unknowns and of what they leave, for an arm that has their values: masses and springs as
    /// logarithms, all else in its own unit.
    ///
    /// # Errors
    /// The file's numbers are none, or do not belong together.
    pub fn misfit_model(&self, path: &Path, arm: &ElasticArm) -> Result<MisfitModel, FileError> {
        let message = &self.message;
        let unknowns = message.unknowns.len();
        let wrong = |key: &str, problem: String| FileError::new(path, problem).at(key.to_owned());
        let kinds = robot_kinds(arm);
        let divisors: Vec<f64> = (message.unknowns.iter())
            .map(|unknown| {
                let mut kinds = kinds.iter().filter(|kind| kind.is_logarithmic(false));
                let is_logarithmic = kinds.any(|kind| kind.name(arm) == unknown.name);
                if is_logarithmic { unknown.value } else { 1.0 }
            })
            .collect();
        let divisor = |index: usize| divisors.get(index).copied().unwrap_or(1.0);
        let Some(found) = &message.unexplained else {
            let rows = &message.covariance;
            if rows.len() != unknowns || rows.iter().any(|row| row.len() != unknowns) {
                let problem = format!("found no {unknowns} rows of {unknowns} numbers");
                return Err(wrong("covariance", problem));
            }
            let covariance = DMatrix::from_fn(unknowns, unknowns, |row, column| {
                rows[row][column] / (divisor(row) * divisor(column))
            });
            let rest = Misfit {
                position_m: message.misfit_mm.unwrap_or(0.0) * 1e-3,
                rotation_rad: message.misfit_mrad.unwrap_or(0.0) * 1e-3,
            };
            return Ok(MisfitModel::plain(covariance, rest));
        };
        let mut joints = Vec::new();
        for (index, each) in found.joints.iter().enumerate() {
            let key = format!("unexplained.joints[{index}]");
            let Some(joint) = (arm.chain.joints.iter()).position(|joint| joint.name == each.joint)
            else {
                return Err(wrong(
                    &key,
                    format!("the robot has no joint {:?}", each.joint),
                ));
            };
            let ascends = each.knots.windows(2).all(|pair| pair[0] < pair[1]);
            let is_one = !each.knots.is_empty() && each.knots.len() == each.values.len();
            if !(ascends && is_one && each.length > 0.0 && each.deviation >= 0.0) {
                let problem = "wants ascending knots, a value at each, and a positive length";
                return Err(wrong(&key, problem.to_owned()));
            }
            joints.push(JointError {
                joint,
                wandering: Wandering {
                    knots: each.knots.clone(),
                    length: each.length,
                },
                deviation: each.deviation,
                values: each.values.clone(),
            });
        }
        let size = unknowns + joints.iter().map(|each| each.values.len()).sum::<usize>();
        let rows = &found.covariance;
        let is_triangle = rows.len() == size
            && (rows.iter().enumerate()).all(|(index, row)| row.len() == index + 1);
        if !is_triangle || found.shift.len() != unknowns {
            let problem = format!(
                "wants the lower triangle of {size} rows, and a shift of each of {unknowns} unknowns"
            );
            return Err(wrong("unexplained.covariance", problem));
        }
        Ok(MisfitModel {
            joints,
            shift: DVector::from_fn(unknowns, |index, _| found.shift[index] / divisor(index)),
            covariance: DMatrix::from_fn(size, size, |row, column| {
                let (low, high) = (row.min(column), row.max(column));
                rows[high][low] / (divisor(row) * divisor(column))
            }),
            rest: Misfit {
                position_m: found.rest_mm * 1e-3,
                rotation_rad: found.rest_mrad * 1e-3,
            },
            scale: found.scale,
        })
    }
}

/// All that may be unknown about a robot, masses of links among it.
fn robot_kinds(arm: &ElasticArm) -> Vec<ParameterKind> {
    let mut kinds = ParameterKind::all_of(arm);
    for link in 0..arm.chain.len() {
        kinds.push(ParameterKind::LinkMass { link });
        kinds.extend(Axis::ALL.map(|axis| ParameterKind::LinkCentre { link, axis }));
    }
    kinds
}

/// What is left of readings that were not fitted.
#[derive(Debug, Clone)]
pub struct AbsoluteValidation {
    /// Of each reading, beside the identified parameters alone.
    pub left: Vec<ReadingResidual>,
    /// The same beside all that was identified, what joints are off by among it, with regions.
    pub prognoses: Vec<ReadingPrognosis>,
    /// Beside the nominal robot in frames that suit these readings best; none where these readings do not tell frames.
    pub before: Option<Vec<ReadingResidual>>,
    /// Stations and targets that were not identified: their frames are fitted to these readings.
    pub frames_anew: Vec<String>,
    /// How far the identified stations stand from where they were.
    pub moved: Vec<(String, MovedStation)>,
}

impl AbsoluteValidation {
    /// The share of positions (0) or rotations (1) that lie in their regions of 95 %.
    #[must_use]
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

    /// What does not hold.
    #[must_use]
    pub fn conditions(&self) -> Vec<String> {
        let mut conditions = Vec::new();
        for (name, moved) in &self.moved {
            if moved.probability < MOVED {
                conditions.push(format!(
                    "{name} stands {:.3} mm and {:.3} mrad from where it was identified (probability {:.1e}): it was moved; give \
                     these readings a station word of their own, and its frame is fitted anew",
                    moved.position_m.norm() * 1e3,
                    moved.rotation_rad.norm() * 1e3,
                    moved.probability
                ));
            }
        }
        for (part, name) in ["positions", "orientations"].into_iter().enumerate() {
            if let Some(share) = self.coverage(part)
                && self.prognoses.len() >= LEAST_JUDGED
                && share < LEAST_COVERAGE
            {
                conditions.push(format!(
                    "the robot does not keep what was promised: {:.0} % of the {name} lie in their regions of 95 %",
                    share * 100.0
                ));
            }
        }
        conditions
    }
}

/// Stations that stand as far off with a smaller probability were moved.
const MOVED: f64 = 1e-6;
/// Fewer readings say nothing of shares.
const LEAST_JUDGED: usize = 20;
/// Regions of 95 % that hold less are none.
const LEAST_COVERAGE: f64 = 0.8;

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
    let tools: Vec<_> = (case.arm.tools.iter())
        .map(|tool| tool.link_from_tool)
        .collect();
    let mut frames = MountedFrames::guessed(&case.sights(), case.stations.len(), &tools);
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
            known.anew.extend(kinds.into_iter().flatten());
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
    let no_rest = |(index, source): (usize, EquilibriumError)| {
        AbsoluteError::from(FitError::Equilibrium {
            observation: index + 1,
            source,
        })
    };
    let left = case.left(&case.arm).map_err(no_rest)?;
    let arm = case.arm.clone();
    for (place, unknown) in stored.message.unknowns.iter().enumerate() {
        let kinds = robot_kinds(&nominal);
        if let Some(kind) = kinds
            .into_iter()
            .find(|kind| kind.name(&nominal) == unknown.name)
            && !stored.is_of_frame(&unknown.name)
        {
            known.kinds.push(kind);
            known.places.push(place);
        }
    }
    let set = known.kinds.iter().map(|kind| (*kind, None));
    let set = ParameterSet::new(&arm, set).map_err(AbsoluteError::from)?;
    let misfit = stored.misfit_model(path, &arm)?;
    let places = &known.places;
    let prognoses =
        (case.prognoses(&arm, &set, places, &misfit, &anew)).map_err(AbsoluteError::from)?;
    let mut moved = Vec::new();
    for &station in &known.stations {
        let found = case
            .moved_station(&arm, &set, places, &misfit, station)
            .map_err(AbsoluteError::from)?;
        let name = (case.stations[station].as_ref()).map_or_else(
            || "the station".to_owned(),
            |name| format!("station {name}"),
        );
        moved.extend(found.map(|found| (name, found)));
    }
    Ok(AbsoluteValidation {
        left,
        prognoses,
        before: before(belief, readings),
        frames_anew: known.names,
        moved,
    })
}

/// What the nominal robot leaves in frames that suit the readings best.
fn before(belief: &Belief, readings: &[AbsoluteReading]) -> Option<Vec<ReadingResidual>> {
    let mut case = AbsoluteCase::new(belief, readings).ok()?;
    case.keeps_all = true;
    let fit = case.fit(&[ParameterGroup::Frames], ReadingWeights::Own);
    Some(fit.ok()?.left)
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
