//! The keys of a robot that was identified from absolute readings.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::checks::{CheckedFile, rows_of};
use crate::codes::Condition;
use crate::files::FileError;
use crate::identification::{
    AbsoluteCase, AbsoluteFit, DistanceStatistics, JointError, LeftOut, Unexplained,
};
use crate::numeric::tolerance::ends;
use crate::parameter::ParameterKind;
use crate::quantities::plausible::ANY_VARIANCE;
use crate::robot::nearest_turn;

/// A quaternion is a rotation where its length is that near to 1.
const UNIT: f64 = 1e-6;

/// A parameter that was fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct UnknownMessage {
    /// Its name, such as `elbow.zero`, `link_3.x` or `base.rz`.
    pub name: String,
    /// What it is, in words.
    pub what: String,
    /// The unit of its value.
    pub unit: String,
    /// Its nominal value; displacements and rotations of frames count from the nominal frame, those of base and targets from
    /// the frames that are listed.
    pub nominal: f64,
    /// Its value.
    pub value: f64,
    /// Its standard error; null where it is not determined.
    pub standard_error: Option<f64>,
    /// Its interval of 95 %.
    pub interval95: Option<[f64; 2]>,
}

/// Where a station or a target is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct MountedFrameMessage {
    /// The station's word, or the target's site; null for the only station of a file that names none.
    pub name: Option<String>,
    /// Which unknowns are its own: those that begin so.
    pub unknowns: String,
    /// The link that carries a target, by its joint's name; null for a station.
    pub link: Option<String>,
    /// The origin (mm): of the robot's base in the station's frame, or of the target in its link's.
    pub position_mm: [f64; 3],
    /// The orientation as a unit quaternion, real part first; null for a target of which positions were read.
    pub quaternion: Option<[f64; 4]>,
    /// The standard errors of the position along the frame's own axes (mm); null where one is not determined.
    pub position_std_mm: Option<[f64; 3]>,
    /// Those of the orientation about them (mrad).
    pub rotation_std_mrad: Option<[f64; 3]>,
    /// How far it stands along and about its own axes from there, where something else is taken for certain than was found.
    #[serde(skip)]
    pub(super) shifts: Vec<Isometry3<f64>>,
}

/// What absolute readings tell of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct AbsoluteMessage {
    /// How many readings.
    pub readings: usize,
    /// How many numbers in them.
    pub numbers: usize,
    /// All that was fitted.
    pub unknowns: Vec<UnknownMessage>,
    /// The covariance of the unknowns in their order and units.
    pub covariance: Vec<Vec<f64>>,
    /// The robot's base as each station sees it.
    pub stations: Vec<MountedFrameMessage>,
    /// The targets on their links.
    pub targets: Vec<MountedFrameMessage>,
    /// What was left out as redundant.
    pub left_out: Vec<LeftOut>,
    /// The compliances that stay nominal, since the readings hardly show them.
    #[serde(default)]
    pub stays_nominal: Vec<LeftOut>,
    /// What the readings do not determine, in sentences.
    pub undetermined: Vec<String>,
    /// Distances from the predicted positions (mm).
    pub distance_mm: DistanceStatistics,
    /// Angles from the predicted orientations (mrad); null where positions were read.
    pub angle_mrad: Option<DistanceStatistics>,
    /// The standard deviation of what no parameter explains, of each coordinate of a position (mm), where it was taken from the
    /// residuals.
    pub discrepancy_mm: Option<f64>,
    /// The same of rotations (mrad).
    pub discrepancy_mrad: Option<f64>,
    /// The degrees of freedom of a coordinate's variance with that; null where it was known before.
    #[serde(default)]
    pub discrepancy_degrees: Option<f64>,
    /// The sum of squares of the weighted residuals.
    pub square: f64,
    /// The probability of residuals at least as large.
    pub consistency: Option<f64>,
    /// The number of steps.
    pub iterations: usize,
    /// Read less predicted positions (mm), in the station's frame.
    pub residuals_mm: Vec<[f64; 3]>,
    /// The same of orientations, as rotation vectors (mrad), null of positions; none where no poses are read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rotation_residuals_mrad: Vec<Option<[f64; 3]>>,
    /// What that discrepancy consists of, for predictions of other poses; null where there are too few readings to tell.
    #[serde(default)]
    pub discrepancy_model: Option<UnexplainedMessage>,
    /// The angles of each joint at which it was read.
    #[serde(default)]
    pub ranges_read: Vec<ReadRange>,
    /// Readings that were left out, since they lie far out.
    #[serde(default)]
    pub rejected: Vec<Value>,
    /// What must be looked at.
    pub conditions: Vec<Condition>,
}

/// Between which angles a joint was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ReadRange {
    /// The joint's name.
    pub joint: String,
    /// The smallest and the largest (rad; m where it slides).
    pub range: [f64; 2],
}

/// What one joint is off by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct JointErrorMessage {
    /// The joint's name.
    pub joint: String,
    /// Its error.
    #[serde(flatten)]
    pub error: JointError,
}

/// What parameters leave unexplained, told apart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct UnexplainedMessage {
    /// What joints are off by.
    pub joints: Vec<JointErrorMessage>,
    /// By how much the unknowns, in their order and units, are off together with that.
    pub shift: Vec<f64>,
    /// The lower triangle, row by row, of the covariance of the unknowns and of the joints' values at their knots.
    pub covariance: Vec<Vec<f64>>,
    /// The standard deviation of each coordinate of a position that joints do not explain either (mm).
    pub remainder_mm: f64,
    /// The same of rotations (mrad).
    pub remainder_mrad: f64,
    /// By how much larger the squares of errors of positions and rotations are than computed, where each pose was
    /// predicted by the others: what 95 % stay below.
    pub scale: [f64; 2],
    /// The same in the mean; 1 in older files.
    #[serde(default = "as_computed")]
    pub mean_scale: [f64; 2],
    /// The shares of positions and of rotations that lay in their regions of 95 % then, before these were scaled.
    pub predicted_by_others: [Option<f64>; 2],
    /// Stands of the robot.
    pub visits: usize,
    /// As many with errors of their own would tell as much of the unknowns.
    pub effective_sample_size: f64,
    /// Distances from the positions that are predicted with the joints' errors (mm).
    pub distance_mm: DistanceStatistics,
    /// Angles from such orientations (mrad); null where positions were read.
    pub angle_mrad: Option<DistanceStatistics>,
}

impl AbsoluteMessage {
    /// What is left of the orientation of a reading (mrad), where it is a pose.
    pub fn rotation_residual_mrad(&self, reading: usize) -> Option<[f64; 3]> {
        self.rotation_residuals_mrad.get(reading).copied().flatten()
    }

    /// The record of a fit.
    pub fn new(case: &AbsoluteCase<'_>, fit: &AbsoluteFit) -> Self {
        let kept = fit.of_kept(&fit.left);
        let [distances, angles] = DistanceStatistics::in_mm_and_mrad(&kept);
        let factors = factors(fit);
        let covariance = scaled(&fit.posterior.covariance, &factors);
        let mut stays_nominal = fit.stays_nominal.clone();
        for each in &mut stays_nominal {
            let shift = each.shift.iter_mut().zip(&factors);
            shift.for_each(|(shift, factor)| *shift *= factor);
        }
        Self {
            readings: fit.left.len(),
            numbers: fit.rows,
            unknowns: (0..fit.set.len())
                .map(|index| unknown(fit, index))
                .collect(),
            covariance: rows_of(&covariance),
            stations: stations(case, fit),
            targets: targets(case, fit),
            left_out: fit.left_out.clone(),
            stays_nominal: stays_nominal.clone(),
            undetermined: (fit.undetermined.iter().cloned())
                .chain(stays_nominal.into_iter().map(|each| each.sentence))
                .collect(),
            distance_mm: distances.unwrap_or_default(),
            angle_mrad: angles,
            discrepancy_mm: fit.discrepancy.map(|[position_m, _]| position_m * 1e3),
            discrepancy_mrad: (fit.discrepancy.filter(|_| angles.is_some()))
                .map(|[_, rad]| rad * 1e3),
            square: fit.square,
            discrepancy_degrees: Some(fit.degrees).filter(|degrees| degrees.is_finite()),
            consistency: fit.consistency,
            iterations: fit.iterations,
            residuals_mm: (fit.left.iter())
                .map(|each| (each.position_m * 1e3).into())
                .collect(),
            rotation_residuals_mrad: (fit.left.iter().filter(|_| angles.is_some()))
                .map(|each| each.rotation_rad.map(|rad| (rad * 1e3).into()))
                .collect(),
            discrepancy_model: (fit.discrepancy_model.as_ref())
                .filter(|_| case.choices.uses_joint_errors)
                .map(|each| discrepancy_model(case, fit, each)),
            ranges_read: ranges_read(case, fit),
            rejected: fit.rejected.iter().map(|&each| each.into()).collect(),
            conditions: fit.conditions(),
        }
    }

    /// Whether an unknown is one of a station's or a target's frame.
    pub fn is_of_frame(&self, name: &str) -> bool {
        let owner = name.rsplit_once('.').map_or("", |(owner, _)| owner);
        let mut frames = self.stations.iter().chain(&self.targets);
        frames.any(|frame| frame.unknowns == owner)
    }

    /// The standard deviations of what no parameter explains, of positions (m) and rotations (rad); zero where there are none.
    pub fn discrepancy(&self) -> [f64; 2] {
        [self.discrepancy_mm, self.discrepancy_mrad].map(|size| size.unwrap_or(0.0) * 1e-3)
    }

    /// The covariance of the unknowns, in their units.
    ///
    /// # Errors
    /// It is none, or does not agree with what they say of it, or a station's or target's place is none, by the key.
    pub(super) fn validate(&self, file: CheckedFile<'_>) -> Result<DMatrix<f64>, FileError> {
        for (index, (unknown, row)) in self.unknowns.iter().zip(&self.covariance).enumerate() {
            let Some(&variance) = row.get(index) else {
                continue;
            };
            let key = |name: &str| format!("unknowns[{index}].{name}");
            file.agree_of_estimate(
                (&key("value"), unknown.value),
                (&format!("covariance[{index}][{index}]"), variance),
                (&key("standard_error"), unknown.standard_error.map(f64::abs)),
                (&key("interval95"), unknown.interval95),
            )?;
        }
        for (key, frames) in [("stations", &self.stations), ("targets", &self.targets)] {
            if let Some(index) = frames.iter().position(|frame| !frame.is_place()) {
                let problem = "is no place: a quaternion of length 1 is needed";
                return Err(file.wrong(format!("{key}[{index}]"), problem));
            }
        }
        let sizes = [
            ("discrepancy_mm", self.discrepancy_mm),
            ("discrepancy_mrad", self.discrepancy_mrad),
        ];
        file.sizes(sizes)?;
        let degrees = self.discrepancy_degrees.filter(|degrees| *degrees <= 0.0);
        if let Some(degrees) = degrees.filter(|_| self.discrepancy_model.is_none()) {
            let problem = format!("found {degrees}; a positive number is needed");
            return Err(file.wrong("discrepancy_degrees", problem));
        }
        let counted = (self.unknowns.len(), "unknowns");
        if let Some(model) = &self.discrepancy_model {
            model.validate(file, counted.0)?;
        }
        file.covariance("covariance", &self.covariance, counted, &ANY_VARIANCE)
    }
}

const fn as_computed() -> [f64; 2] {
    [1.0; 2]
}

impl UnexplainedMessage {
    /// Whether it can belong to so many unknowns; joints are looked at beside a robot.
    fn validate(&self, file: CheckedFile<'_>, unknowns: usize) -> Result<(), FileError> {
        if self.shift.len() != unknowns {
            let count = self.shift.len();
            let problem = format!("found {count} numbers; there are {unknowns} unknowns");
            return Err(file.wrong("discrepancy_model.shift", problem));
        }
        for (key, scale) in [("scale", &self.scale), ("mean_scale", &self.mean_scale)] {
            if let Some(place) = scale.iter().position(|&scale| scale <= 0.0) {
                let problem = format!("found {}; a positive number is needed", scale[place]);
                return Err(file.wrong(format!("discrepancy_model.{key}[{place}]"), problem));
            }
        }
        let sizes = [
            ("discrepancy_model.remainder_mm", Some(self.remainder_mm)),
            (
                "discrepancy_model.remainder_mrad",
                Some(self.remainder_mrad),
            ),
        ];
        file.sizes(sizes)
    }
}

/// The shortest arc that has all of some angles within a turn (rad): what the widest gap leaves.
fn arc(angles: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut sorted: Vec<f64> = angles.collect();
    sorted.sort_by(f64::total_cmp);
    let [low, high] = ends(sorted.iter().copied());
    let gaps = sorted.windows(2).map(|pair| (pair[1] - pair[0], pair));
    match gaps.max_by(|one, other| one.0.total_cmp(&other.0)) {
        Some((gap, pair)) if gap > low + TAU - high => [pair[1], pair[0] + TAU],
        _ => [low, high],
    }
}

fn ranges_read(case: &AbsoluteCase<'_>, fit: &AbsoluteFit) -> Vec<ReadRange> {
    let kept = fit.kept();
    let joints = case.arm.chain.joints.iter().enumerate();
    joints
        .map(|(joint, each)| {
            let angles =
                (kept.iter()).map(|&index| case.observations[index].setup.commanded_rad[joint]);
            ReadRange {
                joint: each.name.clone(),
                range: match each.turn_about() {
                    Some(middle) => arc(angles.map(|angle| nearest_turn(angle, Some(middle)))),
                    None => ends(angles),
                },
            }
        })
        .collect()
}

/// How the parameters' own values become quantities.
fn factors(fit: &AbsoluteFit) -> Vec<f64> {
    (0..fit.set.len()).map(|index| fit.factor(index)).collect()
}

/// A covariance in these.
fn scaled(covariance: &DMatrix<f64>, factors: &[f64]) -> DMatrix<f64> {
    covariance.map_with_location(|row, column, entry| entry * factors[row] * factors[column])
}

fn discrepancy_model(
    case: &AbsoluteCase<'_>,
    fit: &AbsoluteFit,
    found: &Unexplained,
) -> UnexplainedMessage {
    let model = &found.model;
    let mut factors = factors(fit);
    let shift = model.shift.iter().zip(&factors);
    let shift = shift.map(|(shift, factor)| shift * factor).collect();
    factors.resize(model.covariance.nrows(), 1.0);
    let mut covariance = rows_of(&scaled(&model.covariance, &factors));
    for (index, row) in covariance.iter_mut().enumerate() {
        row.truncate(index + 1);
    }
    let [distances, angles] = DistanceStatistics::in_mm_and_mrad(&found.left);
    let joints = &case.arm.chain.joints;
    UnexplainedMessage {
        joints: (model.joints.iter())
            .map(|each| JointErrorMessage {
                joint: joints[each.joint].name.clone(),
                error: each.clone(),
            })
            .collect(),
        shift,
        covariance,
        remainder_mm: model.rest[0] * 1e3,
        remainder_mrad: model.rest[1] * 1e3,
        scale: model.scale,
        mean_scale: model.mean_scale,
        predicted_by_others: found.predicted_by_others,
        visits: found.visits,
        effective_sample_size: found.effective_sample_size,
        distance_mm: distances.unwrap_or_default(),
        angle_mrad: angles,
    }
}

fn unknown(fit: &AbsoluteFit, index: usize) -> UnknownMessage {
    let parameter = &fit.set.parameters()[index];
    let value = fit.quantity(index);
    let error = fit.standard_error(index);
    // Of a logarithm the interval is that of the logarithm.
    let interval95 = error.map(|error| {
        let reach = fit.reach95(index) * error;
        if parameter.is_logarithmic && value != 0.0 {
            let factor = (reach / value).exp();
            [value / factor, value * factor]
        } else {
            [value - reach, value + reach]
        }
    });
    UnknownMessage {
        name: parameter.name.clone(),
        what: parameter.kind.words(&fit.reference),
        unit: parameter.quantity_unit().to_owned(),
        nominal: parameter.quantity(&fit.reference, parameter.nominal),
        value,
        standard_error: error,
        interval95,
    }
}

fn stations(case: &AbsoluteCase<'_>, fit: &AbsoluteFit) -> Vec<MountedFrameMessage> {
    let base = |(station, name): (usize, &Option<String>)| {
        let kinds = ParameterKind::of_base(station);
        let is_turned = case.base_kinds(station).contains(&kinds[1][0]);
        let frame = &fit.arm.instrument_from_base[station];
        MountedFrameMessage {
            name: name.clone(),
            ..MountedFrameMessage::new(fit, ("base", station), frame, kinds, is_turned)
        }
    };
    case.stations.iter().enumerate().map(base).collect()
}

fn targets(case: &AbsoluteCase<'_>, fit: &AbsoluteFit) -> Vec<MountedFrameMessage> {
    let target = |(tool, name): (usize, &String)| {
        let (kinds, place) = (ParameterKind::of_tool(tool), &fit.arm.tools[tool]);
        let is_turned = fit.set.index_of(kinds[1][0]).is_some();
        let carrier = place.joints.checked_sub(1);
        let link = carrier.and_then(|joint| fit.arm.chain.joints.get(joint));
        MountedFrameMessage {
            name: Some(name.clone()),
            link: link.map(|joint| joint.name.clone()),
            ..MountedFrameMessage::new(fit, ("tool", tool), &place.link_from_tool, kinds, is_turned)
        }
    };
    case.targets.iter().enumerate().map(target).collect()
}

impl MountedFrameMessage {
    /// A frame with the standard errors of its position and rotation, and its unknowns by their word and its place; not yet named.
    fn new(
        fit: &AbsoluteFit,
        (word, place): (&str, usize),
        frame: &Isometry3<f64>,
        unknowns: [[ParameterKind; 3]; 2],
        is_turned: bool,
    ) -> Self {
        let [x, y, z, w] = frame.rotation.coords.into();
        let thousandfold = |errors: [f64; 3]| errors.map(|error| error * 1e3);
        let errors = unknowns.map(|kinds| fit.standard_errors(kinds).map(thousandfold));
        Self {
            name: None,
            unknowns: match place {
                0 => word.to_owned(),
                place => format!("{word}_{}", place + 1),
            },
            link: None,
            position_mm: (frame.translation.vector * 1e3).into(),
            quaternion: is_turned.then_some([w, x, y, z]),
            position_std_mm: errors[0],
            rotation_std_mrad: errors[1],
            shifts: Vec::new(),
        }
    }

    /// Whether it can be a place.
    fn is_place(&self) -> bool {
        self.quaternion.is_none_or(|read| {
            let squares = read.iter().map(|part| part * part);
            (squares.sum::<f64>().sqrt() - 1.0).abs() < UNIT
        })
    }

    /// The frame; with the orientation of another where none was read.
    pub fn frame(&self, otherwise: &Isometry3<f64>) -> Isometry3<f64> {
        let read =
            |[w, x, y, z]: [f64; 4]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let position_m = Vector3::from(self.position_mm) * 1e-3;
        let rotation = self.quaternion.map_or(otherwise.rotation, read);
        let read = Isometry3::from_parts(Translation3::from(position_m), rotation);
        self.shifts.iter().fold(read, |frame, shift| frame * shift)
    }
}
