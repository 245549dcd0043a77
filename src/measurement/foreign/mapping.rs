//! The file that says what the columns of a foreign table are.

use std::path::Path;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::quantity::{ANGLE, ForeignQuantity, LENGTH, PURE};
use crate::files::FileError;
use crate::measurement::columns::unit_quaternion;
use crate::quantities::limits::MOST_JOINTS;

/// A mapping as it is written; see `docs/files.md`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mapping {
    /// The commanded joints in the order of the model.
    pub joint: Vec<JointMapping>,
    /// Where the target is, in the instrument's frame.
    pub position: Option<NumbersMapping>,
    /// How it is turned there.
    pub rotation: Option<NumbersMapping>,
    /// Loaded minus unloaded position, in the world frame, in place of position and rotation.
    pub deflection: Option<NumbersMapping>,
    /// The load at the calibration tool, in the world frame.
    pub force: Option<NumbersMapping>,
    pub torque: Option<NumbersMapping>,
    /// The size of a weight there.
    pub weight: Option<NumbersMapping>,
    pub target: Option<Word>,
    pub station: Option<Word>,
    pub visit: Option<Word>,
    pub approach: Option<Word>,
    pub time: Option<NumbersMapping>,
    pub temperature: Option<NumbersMapping>,
}

/// Numbers of one unit, and their standard deviations.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NumbersMapping {
    #[serde(alias = "column")]
    pub columns: Names,
    #[serde(default)]
    pub unit: String,
    pub std_columns: Option<Names>,
    /// That of the values if not given.
    pub std_unit: Option<String>,
    /// Of rotations.
    pub convention: Option<Convention>,
}

/// The names of columns.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Names {
    One(String),
    More(Vec<String>),
}

impl Names {
    pub fn all(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::More(names) => names,
        }
    }
}

/// Where a word comes from.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Word {
    Column(String),
    /// The same in every row.
    Value(String),
}

/// A joint: the model's angle is sign times the table's plus the offset.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointMapping {
    pub column: String,
    pub unit: String,
    /// One if not given.
    pub sign: Option<f64>,
    /// In the same unit.
    #[serde(default)]
    pub offset: f64,
}

impl JointMapping {
    /// Whether it is given as a length.
    pub fn slides(&self) -> bool {
        LENGTH.in_si(&self.unit).is_some()
    }
}

impl Mapping {
    /// The columns of numbers, with their keys; standard deviations may share theirs.
    fn columns(&self) -> impl Iterator<Item = (String, &str)> {
        let joints = self.joint.iter().enumerate();
        let joints = joints.map(|(index, joint)| (format!("joint[{index}].column"), &joint.column));
        let numbers = [
            ("position", &self.position),
            ("rotation", &self.rotation),
            ("deflection", &self.deflection),
            ("force", &self.force),
            ("torque", &self.torque),
            ("weight", &self.weight),
            ("time", &self.time),
            ("temperature", &self.temperature),
        ];
        let numbers = numbers.into_iter().flat_map(|(key, numbers)| {
            let names = numbers.iter().flat_map(|numbers| numbers.columns.all());
            let names = names.enumerate();
            names.map(move |(index, name)| (format!("{key}.columns[{index}]"), name))
        });
        joints.chain(numbers).map(|(key, name)| (key, name.trim()))
    }

    /// What is measured, a position or a deflection, with its key, where all that it says goes together.
    ///
    /// # Errors
    /// What does not, by its key.
    pub fn check(&self, path: &Path) -> Result<(&'static str, &NumbersMapping), FileError> {
        let wrong = |key: &str, problem: &str| Err(FileError::new(path, problem).at(key));
        if self.joint.is_empty() || self.joint.len() > MOST_JOINTS {
            let problem = format!("found {}; 1 to {MOST_JOINTS} are allowed", self.joint.len());
            return wrong("joint", &problem);
        }
        for (index, joint) in self.joint.iter().enumerate() {
            if let Some(sign) = joint.sign.filter(|sign| ![1.0, -1.0].contains(sign)) {
                let problem = format!("found {sign}; 1 or -1 is allowed");
                return wrong(&format!("joint[{index}].sign"), &problem);
            }
        }
        let mut known: Vec<(String, &str)> = Vec::new();
        for (key, column) in self.columns() {
            if let Some((other, _)) = known.iter().find(|(_, name)| *name == column) {
                let problem = format!("found {column:?}, which {other} has, too");
                return wrong(&key, &problem);
            }
            known.push((key, column));
        }
        let place = match (&self.position, &self.deflection) {
            (Some(place), None) => ("position", place),
            (None, Some(place)) => ("deflection", place),
            _ => {
                let hint = "give [position] for what the instrument shows, or [deflection] for loaded minus unloaded";
                return Err(FileError::new(path, "is missing").at("position").hint(hint));
            }
        };
        if let Some(rotation) = &self.rotation {
            if rotation.convention.is_none() {
                return wrong("rotation.convention", "is missing");
            }
            if rotation.std_columns.is_some() != place.1.std_columns.is_some() {
                let problem = "poses have standard deviations of both or of none: std_columns of position and rotation";
                return wrong("rotation", problem);
            }
        }
        if self.weight.is_some() && self.force.is_some() {
            return wrong("weight", "is a force downwards; give it or force, not both");
        }
        let words = [&self.target, &self.visit, &self.station, &self.approach];
        let numbers = [&self.rotation, &self.time, &self.temperature];
        let is_more = words.iter().any(|word| word.is_some())
            || numbers.iter().any(|numbers| numbers.is_some());
        if self.deflection.is_some() && is_more {
            let problem = "files of deflections have loads and standard deviations besides, no rotations, words, times or temperatures";
            return wrong("deflection", problem);
        }
        Ok(place)
    }
}

/// How a table writes rotations, of the target's axes in the instrument's frame.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(try_from = "String")]
pub(super) enum Convention {
    /// Angles about axes, 0 to 2, one after the other, which turn with the target.
    Euler([usize; 3]),
    /// The real part first.
    Quaternion,
    /// The axis times the angle.
    RotationVector,
}

impl TryFrom<String> for Convention {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let axes = text.strip_prefix("intrinsic ").unwrap_or_default();
        let axes: Vec<Option<usize>> = axes.chars().map(|axis| "xyz".find(axis)).collect();
        match (text.as_str(), axes.as_slice()) {
            ("rotation_vector", _) => Ok(Self::RotationVector),
            ("quaternion wxyz", _) => Ok(Self::Quaternion),
            (_, &[Some(a), Some(b), Some(c)]) if a != b && b != c => Ok(Self::Euler([a, b, c])),
            _ => Err(format!(
                "found {text:?}; \"intrinsic\" and three axes, no axis twice in a row, such as \"intrinsic xyz\", \"quaternion wxyz\" \
                 or \"rotation_vector\" is allowed"
            )),
        }
    }
}

impl Convention {
    /// How many numbers a rotation has, and of what.
    pub const fn numbers(self) -> (usize, ForeignQuantity) {
        match self {
            Self::Euler(_) | Self::RotationVector => (3, ANGLE),
            Self::Quaternion => (4, PURE),
        }
    }

    /// The target's axes in the instrument's frame, of numbers (rad where they are angles); and about which axes of that frame
    /// its standard deviations turn: those of Euler angles about the axes of the angles, others about the frame's own.
    pub fn rotation(self, values: &[f64]) -> Result<(UnitQuaternion<f64>, Matrix3<f64>), String> {
        let mut about = Matrix3::identity();
        let turn = match self {
            Self::Euler(axes) => {
                let mut turn = UnitQuaternion::identity();
                for (place, (&axis, &angle)) in axes.iter().zip(values).enumerate() {
                    let axis = Vector3::ith_axis(axis);
                    about.set_column(place, &(turn * axis.into_inner()));
                    turn *= UnitQuaternion::from_axis_angle(&axis, angle);
                }
                turn
            }
            Self::RotationVector => {
                UnitQuaternion::from_scaled_axis(Vector3::from_row_slice(values))
            }
            Self::Quaternion => unit_quaternion([values[0], values[1], values[2], values[3]])?,
        };
        Ok((turn, about))
    }
}
