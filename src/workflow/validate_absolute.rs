//! Other absolute readings beside a robot that was identified.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3};

use crate::codes::{Condition, ConditionCode};
use crate::files::FileError;
use crate::identification::{
    AbsoluteCase, DistanceStatistics, FitResult, IdentificationError, MountedFrameMessage,
    MovedStation, ReadingResidual, StoredRobot, fit_parameters,
};
use crate::measurement::AbsoluteReading;
use crate::numeric::estimable::Estimable;
use crate::parameter::{ParameterKind, ParameterSet};
use crate::task::Belief;
use crate::text::wording::p_value;

/// What is left of readings that were not fitted.
#[derive(Debug, Clone)]
pub struct AbsoluteValidation {
    /// Of each reading, beside the identified parameters alone.
    pub left: Vec<ReadingResidual>,
    /// The covariance of each reading's position by the instrument and by what else is listed as new in each reading (m^2).
    pub readings_m2: Vec<Matrix3<f64>>,
    /// The same as in `left` with what joints are off by, where that was identified.
    pub with_joint_errors: Vec<ReadingResidual>,
    /// Whether positions and rotations lie in their regions of 95 % beside all that was identified.
    pub is_within: Vec<[Option<bool>; 2]>,
    /// The probability of differences as large, where all errors are counted: of lengths.
    pub probability: Option<f64>,
    /// Whether the readings are so coarse that chance may repeat them.
    pub may_repeat: bool,
    /// What is read: positions or lengths, and orientations.
    pub names: [String; 2],
    /// Beside the nominal robot in frames that suit these readings best; none where these readings do not tell frames.
    pub before: Option<Vec<ReadingResidual>>,
    /// Stations and targets that were not identified: their frames are fitted to these readings.
    pub frames_anew: Vec<String>,
    /// Whether readings lie outside of the angles at which the robot was identified.
    pub beyond: Option<Condition>,
    /// How far the identified stations stand from where they were.
    pub moved: Vec<(Option<String>, MovedStation)>,
}

impl AbsoluteValidation {
    /// The share of positions (0) or rotations (1) that lie in their regions of 95 %.
    pub fn coverage(&self, part: usize) -> Option<f64> {
        let judged = self.is_within.iter();
        let judged: Vec<bool> = judged.filter_map(|each| each[part]).collect();
        let within = judged.iter().filter(|is_within| **is_within).count();
        (!judged.is_empty()).then(|| within as f64 / judged.len() as f64)
    }

    /// What must be looked at.
    pub fn conditions(&self) -> Vec<Condition> {
        let mut conditions: Vec<Condition> = self.beyond.iter().cloned().collect();
        for (name, moved) in &self.moved {
            if moved.is_moved() {
                let name = (name.as_ref()).map_or_else(
                    || "the station".to_owned(),
                    |name| format!("station {name}"),
                );
                conditions.push(ConditionCode::StationMoved.with(format!(
                    "{name} moved by {:.3} mm and {:.3} mrad since it was identified, {}",
                    moved.position_m.norm() * 1e3,
                    moved.rotation_rad.norm() * 1e3,
                    p_value(moved.probability)
                )));
            }
        }
        conditions.extend(self.probability.and_then(prediction_failed));
        conditions.extend(self.worse_than_nominal());
        // Regions share what the fit errs by: some may all miss by chance, which the probability of all counts.
        let is_unlikely = self.probability.is_none_or(|each| each < UNLIKELY);
        for (part, name) in self.names.iter().enumerate() {
            if let Some(share) = self.coverage(part)
                && is_unlikely
                && self.is_within.len() >= LEAST_JUDGED
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

    /// That the nominal robot in its best frames is nearer to the readings, by more than what these frames and chance may do. Where a
    /// station moved that is why.
    fn worse_than_nominal(&self) -> Option<Condition> {
        let has_moved = self.moved.iter().any(|(_, moved)| moved.is_moved());
        let before =
            (self.before.as_ref()).filter(|all| !has_moved && all.len() >= LEAST_JUDGED)?;
        let rms_mm =
            |all: &[ReadingResidual]| Some(DistanceStatistics::of_positions(all)?.rms * 1e3);
        let (identified_mm, nominal_mm) = (rms_mm(&self.with_joint_errors)?, rms_mm(before)?);
        (identified_mm > WORSE * nominal_mm).then(|| {
            let words = format!(
                "the identified robot is {identified_mm:.3} mm (rms) from the readings, the nominal one in its best frames {nominal_mm:.3} mm"
            );
            ConditionCode::PredictionFailed.with(words)
        })
    }
}

/// Frames that are fitted to the readings take less than this factor of what they are off by, with as many readings as are judged.
const WORSE: f64 = 1.5;

/// Differences that are likelier than this are no sign of small regions.
const UNLIKELY: f64 = 0.01;
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
    /// The places of the file's stations and targets among those of the readings.
    stations: Vec<Option<usize>>,
    targets: Vec<Option<usize>>,
    /// The parameters of frames that were not identified,
    anew: Vec<ParameterKind>,
    /// and whose these are.
    names: Vec<String>,
}

/// Puts identified frames in their places and notes the others.
fn known_frames(case: &mut AbsoluteCase<'_>, stored: &StoredRobot, is_turned: bool) -> KnownFrames {
    let mut frames = case.first_frames();
    let message = &stored.message;
    let mut known = KnownFrames {
        stations: vec![None; message.stations.len()],
        targets: vec![None; message.targets.len()],
        anew: Vec::new(),
        names: Vec::new(),
    };
    // The place of a frame in the file, and the frame itself.
    let found = |stored: &[MountedFrameMessage], name: Option<&str>, otherwise: &Isometry3<f64>| {
        let place = (stored.iter()).position(|frame| frame.name.as_deref() == name)?;
        Some((place, stored[place].frame(otherwise)))
    };
    for (station, name) in case.stations.iter().enumerate() {
        let frame = &mut frames.instrument_from_base[station];
        if let Some((place, stored)) = found(&message.stations, name.as_deref(), frame) {
            *frame = stored;
            known.stations[place] = Some(station);
        } else {
            known.anew.extend(case.base_kinds(station));
            let only = || "the only station".to_owned();
            known.names.push(name.clone().unwrap_or_else(only));
        }
    }
    for (tool, name) in case.targets.iter().enumerate() {
        let frame = &mut frames.link_from_tool[tool];
        if let Some((place, stored)) = found(&message.targets, Some(name), frame) {
            *frame = stored;
            known.targets[place] = Some(tool);
            continue;
        }
        let kinds = ParameterKind::of_tool(tool).into_iter();
        let kinds = kinds.take(1 + usize::from(is_turned));
        known.anew.extend(kinds.flatten());
        known.names.push(name.clone());
    }
    case.set_frames(frames);
    known
}

/// What is wrong with the readings of a file.
fn in_file<E: Into<IdentificationError>>(file: &Path) -> impl Fn(E) -> FileError {
    move |error| error.into().in_file(file)
}

/// Predicts the readings of a file with a robot that was identified, from its file; where a station or a target is a new one, its frame alone is fitted.
///
/// # Errors
/// The file does not fit the robot, or a new frame is not determined.
pub fn validate_absolute(
    belief: &Belief,
    stored: &StoredRobot,
    file: &Path,
    readings: &[AbsoluteReading],
) -> Result<AbsoluteValidation, FileError> {
    let mut case = AbsoluteCase::placed(belief, readings).map_err(in_file(file))?;
    case.hang_where_found();
    let may_repeat = case.may_repeat();
    let mut nominal = case.arm.clone();
    case.arm = stored.apply(&case.arm)?;
    let is_turned = readings.iter().any(|each| each.rotation.is_some());
    let known = known_frames(&mut case, stored, is_turned);
    // Sources disturb the nominal robot's readings, in the frames where they are seen.
    (nominal.instrument_from_base).clone_from(&case.arm.instrument_from_base);
    let identified = std::mem::replace(&mut case.arm, nominal.clone());
    let readings_m2 = of_positions(&case.clone().counting_reading_errors());
    case = if stored.has_discrepancy() {
        case.counting_sources_of_lengths()
    } else {
        case.counting_sources()
    };
    case.arm = identified;
    let anew = (known.anew.iter()).map(|kind| (*kind, None));
    let anew = ParameterSet::new(&case.arm, anew).map_err(in_file(file))?;
    if !anew.is_empty() {
        let fit = fit_parameters(&case.arm, &anew, &case.observations).map_err(in_file(file))?;
        if !Estimable::is_complete(&fit.posterior.estimable) {
            let sentences = (fit.freedoms.named.into_iter())
                .map(|each| each.sentence)
                .collect();
            let what = known.names.join(", ");
            return Err(IdentificationError::Frames { what, sentences }.in_file(file));
        }
        case.arm = fit.belief;
    }
    let left = case.left(&case.arm).map_err(in_file(file))?;
    let arm = &case.arm;
    let kinds = stored.kinds(&nominal, &known.stations, &known.targets);
    let (places, kinds): (Vec<usize>, Vec<_>) = (kinds.into_iter().enumerate())
        .filter_map(|(place, kind)| Some((place, (kind?, None))))
        .unzip();
    let set = ParameterSet::new(arm, kinds).map_err(in_file(file))?;
    let discrepancy = stored.discrepancy_model(arm)?;
    let beside = (case.beside(&set, &places, &discrepancy)).map_err(in_file(file))?;
    let is_known = |station: &usize| known.stations.contains(&Some(*station));
    let moved = (0..case.stations.len()).filter(is_known).map(|station| {
        let found = beside.moved_station(station)?;
        Ok(found.map(|found| (case.stations[station].clone(), found)))
    });
    let moved: FitResult<Vec<_>> = moved.filter_map(Result::transpose).collect();
    let prognoses = beside.prognoses(&anew).map_err(in_file(file))?;
    let with_joint_errors = match &discrepancy.joints[..] {
        [] => left.clone(),
        _ => prognoses.iter().map(|each| each.left).collect(),
    };
    let setups = case.observations.iter().map(|each| &each.setup);
    let configurations = setups.map(|each| &each.commanded_rad);
    Ok(AbsoluteValidation {
        beyond: (stored.read_ranges()).beyond(arm, "reading", configurations),
        left,
        readings_m2,
        probability: beside.probability(&anew).map_err(in_file(file))?,
        may_repeat,
        names: [
            match case.lengths_in_words() {
                Some(lengths) if case.positions().is_empty() => lengths,
                Some(_) => "readings".to_owned(),
                None => "positions".to_owned(),
            },
            "orientations".to_owned(),
        ],
        with_joint_errors,
        is_within: prognoses.iter().map(|each| each.is_within).collect(),
        before: before(belief, readings),
        frames_anew: known.names,
        moved: moved.map_err(in_file(file))?,
    })
}

/// The covariance of each reading's position, or of its length, by what is new in it (m^2).
fn of_positions(case: &AbsoluteCase<'_>) -> Vec<Matrix3<f64>> {
    let reads = case.observations.iter().zip(&case.covariances);
    let of_positions = reads.map(|(each, covariance)| {
        let rows = each.reading.kind().rows().min(3);
        let mut own = Matrix3::zeros();
        (own.view_mut((0, 0), (rows, rows))).copy_from(&covariance.view((0, 0), (rows, rows)));
        own
    });
    of_positions.collect()
}

/// What the nominal robot leaves in frames that suit the readings best.
fn before(belief: &Belief, readings: &[AbsoluteReading]) -> Option<Vec<ReadingResidual>> {
    let case = AbsoluteCase::new(belief, readings).ok()?;
    case.left(&case.in_best_frames().ok()?).ok()
}
