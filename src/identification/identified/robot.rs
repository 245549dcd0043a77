//! A robot from the file of its absolute readings.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector, Isometry3, Vector3};

use super::checks::CheckedFile;
use super::impossible::hold_impossible;
use super::readings::{
    AbsoluteMessage, JointErrorMessage, MountedFrameMessage, ReadRange, UnknownMessage,
};
use crate::codes::{Condition, ConditionCode, ErrorCode};
use crate::files::FileError;
use crate::identification::{DiscrepancyModel, JointError, MOST_SPREAD, SPREAD_ORDERS};
use crate::numeric::markov::MarkovProcess;
use crate::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};
use crate::quantities::plausible::ANY_VARIANCE;
use crate::robot::nearest_turn;
use crate::text::wording::counted;

/// A robot as `identify --identified-out` tells it from absolute readings.
#[derive(Debug, Clone)]
pub struct StoredRobot {
    /// The file.
    pub path: PathBuf,
    /// What was fitted.
    pub message: AbsoluteMessage,
    /// The covariance of the unknowns, in their units.
    pub covariance: DMatrix<f64>,
}

/// An unknown as a parameter of an arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnknownValue {
    /// Which one; none of a frame.
    pub kind: Option<ParameterKind>,
    /// Its value, or the logarithm of its ratio to the arm's.
    pub value: f64,
    /// By how much that changes with the quantity.
    pub factor: f64,
}

/// Configurations that are further outside of the angles read count, as a share of their range,
const BEYOND: f64 = 0.1;
/// and no nearer than this (rad; m).
const LEAST_BEYOND: f64 = 0.05;

/// The angles that were read of a robot in whose readings a model discrepancy remains.
#[derive(Debug, Clone, Default)]
pub struct ReadRanges(Vec<ReadRange>);

impl ReadRanges {
    /// What must be looked at where configurations of an arm, in words, lie outside.
    pub fn beyond<'a>(
        &self,
        arm: &ElasticArm,
        what: &str,
        configurations: impl IntoIterator<Item = &'a DVector<f64>>,
    ) -> Option<Condition> {
        let joints = &arm.chain.joints;
        // By how much each joint is outside; zero where it is not.
        let beyond = |q: &DVector<f64>| -> Vec<f64> {
            let joints = joints.iter().zip(q).map(|(joint, at)| {
                let read = self.0.iter().find(|each| each.joint == joint.name);
                let [low, high] = read.map_or([*at; 2], |each| each.range);
                // What comes again in each turn was read in any of them.
                let middle = joint.turn_about().map(|_| f64::midpoint(low, high));
                let at = nearest_turn(*at, middle);
                let beyond = f64::max(low - at, at - high);
                let counts = beyond > (BEYOND * (high - low)).max(LEAST_BEYOND);
                if counts { beyond } else { 0.0 }
            });
            joints.collect()
        };
        let all: Vec<Vec<f64>> = configurations.into_iter().map(beyond).collect();
        let is_outside = |beyond: &&Vec<f64>| beyond.iter().any(|far| *far > 0.0);
        let outside = all.iter().filter(is_outside).count();
        let named = joints.iter().enumerate().filter_map(|(place, joint)| {
            let far = all.iter().map(|beyond| beyond[place]).fold(0.0, f64::max);
            let (shown, unit) = joint.drive.shown(far);
            (far > 0.0).then(|| format!("{} by {shown:.1} {unit}", joint.name))
        });
        let named: Vec<String> = named.collect();
        (outside > 0).then(|| {
            ConditionCode::BeyondRead.with(format!(
                "{outside} of {} outside of the joint angles that were read, where the model discrepancy is not known: {}",
                counted(all.len() as u64, what),
                named.join(", ")
            ))
        })
    }
}

impl StoredRobot {
    /// What a file says.
    ///
    /// # Errors
    /// Its numbers are none, or do not go together, by their keys.
    pub(super) fn new(path: &Path, message: AbsoluteMessage) -> Result<Self, FileError> {
        Ok(Self {
            path: path.to_owned(),
            covariance: message.validate(CheckedFile(path))?,
            message,
        })
    }

    /// Which parameters of an arm the unknowns are; none of what it does not have. Stations and targets have these places among the
    /// arm's.
    pub fn kinds(
        &self,
        arm: &ElasticArm,
        stations: &[Option<usize>],
        tools: &[Option<usize>],
    ) -> Vec<Option<ParameterKind>> {
        let named = self.kind_of_names(arm, stations, tools);
        let unknowns = self.message.unknowns.iter();
        unknowns.map(|each| named(&each.name)).collect()
    }

    /// The parameter of an arm that a name of the file means, in the same way.
    fn kind_of_names(
        &self,
        arm: &ElasticArm,
        stations: &[Option<usize>],
        tools: &[Option<usize>],
    ) -> impl Fn(&str) -> Option<ParameterKind> {
        let all = ParameterKind::of_robot(arm);
        move |name: &str| {
            let (owner, last) = name.rsplit_once('.').unwrap_or(("", name));
            let (turn, word) = (last.strip_prefix('r')).map_or((0, last), |word| (1, word));
            let one = |kinds: [[ParameterKind; 3]; 2]| {
                let axis = Axis::ALL.iter().position(|axis| axis.to_string() == word)?;
                Some(kinds[turn][axis])
            };
            let is_it = |frame: &MountedFrameMessage| frame.unknowns == owner;
            if let Some(place) = self.message.stations.iter().position(is_it) {
                return one(ParameterKind::of_base((*stations.get(place)?)?));
            }
            if let Some(place) = self.message.targets.iter().position(is_it) {
                return one(ParameterKind::of_tool((*tools.get(place)?)?));
            }
            ParameterKind::named(name, &all, arm)
        }
    }

    /// The values of the unknowns as an arm's parameters have them, with their kinds, none of frames, and by how much they change with the
    /// quantities: logarithms are of the ratio to what the arm has, which may be another than was nominal then.
    ///
    /// # Errors
    /// The arm has no such parameter, or a value is none, by the key.
    pub fn values(&self, arm: &ElasticArm) -> Result<Vec<UnknownValue>, FileError> {
        let kinds = self.kinds(arm, &[], &[]).into_iter();
        let unknowns = self.message.unknowns.iter().zip(kinds).enumerate();
        unknowns
            .map(|(index, (unknown, kind))| {
                let at = |key: &str, problem: String| {
                    FileError::new(&self.path, problem).at(format!("unknowns[{index}].{key}"))
                };
                if kind.is_none() && !self.message.is_of_frame(&unknown.name) {
                    let problem = format!("the robot has no {:?}", unknown.name);
                    return Err(at("name", problem).code(ErrorCode::OtherRobot));
                }
                let (value, factor) = match kind {
                    Some(kind) if kind.is_logarithmic(false) => {
                        let nominal = kind.quantity(arm).unwrap_or(unknown.nominal);
                        ((unknown.value / nominal).ln(), unknown.value.recip())
                    }
                    _ => (unknown.value, 1.0),
                };
                if !value.is_finite() {
                    let wrong = at("value", format!("found {}", unknown.value));
                    return Err(wrong.code(ErrorCode::IdentifiedFile));
                }
                Ok(UnknownValue {
                    kind,
                    value,
                    factor,
                })
            })
            .collect()
    }

    /// The arm of a belief with all that was fitted but the frames of stations and targets.
    ///
    /// # Errors
    /// A parameter does not exist, or its value is none.
    pub fn apply(&self, arm: &ElasticArm) -> Result<ElasticArm, FileError> {
        let all = self.values(arm)?.into_iter();
        let (found, values): (Vec<_>, Vec<f64>) = all
            .filter_map(|each| Some(((each.kind?, None), each.value)))
            .unzip();
        let set = ParameterSet::new(arm, found)
            .map_err(|error| self.wrong("unknowns", error.to_string()))?;
        Ok(set.apply(arm, &values))
    }

    /// What was left out as redundant with other unknowns: each with by how much these, in their order, change for one unit of it. Stations
    /// and targets as in [`kinds`](Self::kinds).
    pub fn redundant(
        &self,
        arm: &ElasticArm,
        stations: &[Option<usize>],
        tools: &[Option<usize>],
    ) -> Vec<(ParameterKind, &[f64])> {
        let named = self.kind_of_names(arm, stations, tools);
        let left_out = self.message.left_out.iter();
        let found = left_out.filter_map(|each| {
            let kind = named(&each.name)?;
            (each.shift.len() == self.message.unknowns.len())
                .then_some((kind, each.shift.as_slice()))
        });
        found.collect()
    }

    /// What is wrong with a key of the file.
    pub(crate) fn wrong(&self, key: impl Into<String>, problem: String) -> FileError {
        (CheckedFile(&self.path).wrong(key, problem)).code(ErrorCode::IdentifiedFile)
    }

    /// Whether the readings showed a discrepancy: it consists of the errors that the scenario lists of readings, which count without one.
    pub const fn has_discrepancy(&self) -> bool {
        self.message.discrepancy_mm.is_some()
    }

    /// The angles that were read, where the model left a discrepancy.
    pub fn read_ranges(&self) -> ReadRanges {
        if !self.has_discrepancy() {
            return ReadRanges::default();
        }
        ReadRanges(self.message.ranges_read.clone())
    }

    /// The robot to which what joints are off by belongs: parameters and frames are off together with that. None where nothing is
    /// told of joints.
    pub fn beside_joint_errors(&self) -> Option<Self> {
        let found = self.message.discrepancy_model.as_ref()?;
        let mut other = self.moved(&found.shift);
        other.message.discrepancy_model = None;
        Some(other)
    }

    /// The robot with nominal compliances in place of those that no joint has, and all else as it goes with that; and what was
    /// done.
    pub fn with_possible_compliances(&self, arm: &ElasticArm) -> (Self, Vec<Condition>) {
        let kinds = self.kinds(arm, &[], &[]);
        let unknowns = &self.message.unknowns;
        let mut values: Vec<f64> = unknowns.iter().map(|each| each.value).collect();
        let compliance = |place: usize| {
            let UnknownMessage {
                name,
                unit,
                nominal,
                ..
            } = &unknowns[place];
            let is_one = matches!(kinds[place], Some(ParameterKind::JointCompliance { .. }));
            is_one.then_some((*nominal, name.as_str(), unit.as_str()))
        };
        let (done, shift) = hold_impossible(&mut values, &self.covariance, compliance);
        if done.is_empty() {
            return (self.clone(), done);
        }
        let mut robot = self.moved(shift.as_slice());
        robot.covariance.ger(1.0, &shift, &shift, 1.0);
        let message = &mut robot.message;
        for (unknown, value) in message.unknowns.iter_mut().zip(values) {
            unknown.value = value;
        }
        if let Some(model) = &mut message.discrepancy_model {
            for (row, own) in model.covariance.iter_mut().zip(&shift) {
                for (entry, other) in row.iter_mut().zip(&shift) {
                    *entry += own * other;
                }
            }
        }
        (robot, done)
    }

    /// The robot whose unknowns are off by so much, frames along and about their own axes.
    fn moved(&self, shift: &[f64]) -> Self {
        let mut other = self.clone();
        let shift_of = |name: String| {
            let place = (self.message.unknowns.iter()).position(|each| each.name == name);
            place.and_then(|place| shift.get(place).copied())
        };
        for (unknown, shift) in other.message.unknowns.iter_mut().zip(shift) {
            unknown.value += shift;
        }
        let message = &mut other.message;
        for frame in message.stations.iter_mut().chain(&mut message.targets) {
            let [moved, turned] = ["", "r"].map(|turn| {
                let shift = |axis| shift_of(format!("{}.{turn}{axis}", frame.unknowns));
                Vector3::from(["x", "y", "z"].map(|axis| shift(axis).unwrap_or(0.0)))
            });
            frame.shifts.push(Isometry3::new(moved, turned));
        }
        other
    }

    /// What is known of the unknowns and of what they leave, for an arm that has their values: masses and springs as
    /// logarithms, all else in its own unit.
    ///
    /// # Errors
    /// The file's numbers are none, or do not belong together.
    pub fn discrepancy_model(&self, arm: &ElasticArm) -> Result<DiscrepancyModel, FileError> {
        let message = &self.message;
        let unknowns = message.unknowns.len();
        let values = self.values(arm)?;
        let factor = |index: usize| values.get(index).map_or(1.0, |each| each.factor);
        let relative = |found: &DMatrix<f64>| {
            found.map_with_location(|row, column, entry| entry * factor(row) * factor(column))
        };
        let Some(found) = &message.discrepancy_model else {
            let covariance = relative(&self.covariance);
            let plain = DiscrepancyModel::plain(covariance, message.discrepancy());
            return Ok(match message.discrepancy_degrees {
                Some(degrees) => plain.estimated(degrees),
                None => plain,
            });
        };
        let joints = self.joint_errors(&found.joints, arm)?;
        let knots = joints.iter().map(|each| each.values.len()).sum::<usize>();
        let rows = whole(&found.covariance, unknowns + knots)
            .map_err(|problem| self.wrong("discrepancy_model.covariance", problem))?;
        let shift = found.shift.iter().zip(&values);
        let shift = shift.map(|(shift, each)| shift * each.factor);
        let (key, counted) = ("discrepancy_model.covariance", (rows.len(), "values"));
        let covariance = CheckedFile(&self.path)
            .covariance(key, &rows, counted, &ANY_VARIANCE)
            .map_err(|wrong| wrong.or_code(ErrorCode::IdentifiedFile))?;
        Ok(DiscrepancyModel {
            joints,
            shift: DVector::from_iterator(unknowns, shift),
            covariance: relative(&covariance),
            rest: [found.remainder_mm, found.remainder_mrad].map(|size| size * 1e-3),
            scale: found.scale,
            mean_scale: found.mean_scale,
        })
    }

    /// What joints are off by.
    fn joint_errors(
        &self,
        messages: &[JointErrorMessage],
        arm: &ElasticArm,
    ) -> Result<Vec<JointError>, FileError> {
        let mut joints: Vec<JointError> = Vec::new();
        for (index, JointErrorMessage { joint: name, error }) in messages.iter().enumerate() {
            let joint = (arm.chain.joints.iter()).position(|joint| joint.name == *name);
            let is_twice = joints.iter().any(|known| Some(known.joint) == joint);
            let MarkovProcess { knots, kernel } = &error.process;
            let is_ascending = !knots.is_empty() && knots.windows(2).all(|pair| pair[0] < pair[1]);
            let (count, values) = (knots.len(), error.values.len());
            let size = |found: f64| format!("found {found}; a size is needed");
            let mut checks = vec![
                (
                    "joint",
                    joint.is_some(),
                    format!("the robot has no joint {name:?}"),
                ),
                ("joint", !is_twice, format!("found {name:?} twice")),
                (
                    "knots",
                    is_ascending,
                    "wants finite numbers in ascending order".to_owned(),
                ),
                (
                    "values",
                    values == count * kernel.order(),
                    format!("found {values}; there are {count} knots"),
                ),
                (
                    "knots",
                    error.turn_about.is_none() || knots.iter().all(|knot| knot - knots[0] < TAU),
                    "go over more than a turn".to_owned(),
                ),
                ("length", kernel.length > 0.0, size(kernel.length)),
                ("deviation", error.deviation >= 0.0, size(error.deviation)),
                (
                    "repeatability",
                    error.repeatability >= 0.0,
                    size(error.repeatability),
                ),
            ];
            for (key, spread) in [
                ("spread_of_positions", &error.spread_of_positions),
                ("spread_of_rotations", &error.spread_of_rotations),
            ] {
                let far = spread.iter().find(|value| value.abs() > MOST_SPREAD);
                let found = far.copied().unwrap_or_default();
                let allowed = format!(
                    "found {found}; numbers from -{MOST_SPREAD} to {MOST_SPREAD} are needed"
                );
                checks.push((key, far.is_none(), allowed));
                let count = spread.len();
                let allowed = format!("found {count} numbers; {SPREAD_ORDERS} are the most");
                checks.push((key, count <= SPREAD_ORDERS, allowed));
            }
            if let Some((key, _, problem)) = checks.into_iter().find(|(_, holds, _)| !holds) {
                return Err(self.wrong(format!("discrepancy_model.joints[{index}].{key}"), problem));
            }
            let mut error = error.clone();
            error.process.kernel.period = error.turn_about.map(|_| TAU);
            joints.extend(joint.map(|joint| JointError { joint, ..error }));
        }
        Ok(joints)
    }
}

/// All rows of a symmetric matrix of which the lower triangle is given.
fn whole(triangle: &[Vec<f64>], size: usize) -> Result<Vec<Vec<f64>>, String> {
    let is_triangle = triangle.len() == size
        && (triangle.iter().enumerate()).all(|(index, row)| row.len() == index + 1);
    if !is_triangle {
        return Err(format!(
            "wants the lower triangle of {size} rows: of the unknowns, and of the joints' values"
        ));
    }
    let entry = |row: usize, column: usize| triangle[row.max(column)][row.min(column)];
    Ok((0..size)
        .map(|row| (0..size).map(|column| entry(row, column)).collect())
        .collect())
}
