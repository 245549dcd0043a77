//! The file that says what the columns of a foreign table are.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::quantity::{ANGLE, ForeignQuantity, PURE};
use crate::measurement::columns::unit_quaternion;

/// A mapping as it is written; see `docs/files.md`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Mapping {
    /// The commanded joints in the order of the model.
    pub joint: Vec<JointMapping>,
    /// Where the target is, in the instrument's frame.
    pub position: Option<Numbers>,
    /// How it is turned there.
    pub rotation: Option<Numbers>,
    /// Loaded minus unloaded position, in the world frame, in place of position and rotation.
    pub deflection: Option<Numbers>,
    /// The load at the calibration tool, in the world frame.
    pub force: Option<Numbers>,
    pub torque: Option<Numbers>,
    /// The size of a weight there.
    pub weight: Option<Numbers>,
    pub target: Option<Word>,
    pub station: Option<Word>,
    pub visit: Option<Word>,
    pub approach: Option<Word>,
    pub time: Option<Numbers>,
    pub temperature: Option<Numbers>,
}

/// Numbers of one unit, and their standard deviations.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Numbers {
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
    #[serde(default = "one")]
    pub sign: f64,
    /// In the same unit.
    #[serde(default)]
    pub offset: f64,
}

const fn one() -> f64 {
    1.0
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
