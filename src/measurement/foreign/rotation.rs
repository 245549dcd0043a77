//! Rotations as foreign tables write them.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// A quaternion's length and a matrix's columns may be so far from 1.
const NEARLY_ONE: f64 = 1e-3;
/// The step of differences (rad).
const STEP: f64 = 1e-5;

/// How a table writes rotations, of the target's axes in the instrument's frame.
#[derive(Debug, Clone, Deserialize)]
#[serde(try_from = "String")]
pub(super) enum Convention {
    /// Angles about axes, 0 to 2, one after the other: about those that turn with the target, or those that stand still.
    Euler {
        axes: [usize; 3],
        is_intrinsic: bool,
    },
    Quaternion {
        real_part_first: bool,
    },
    /// The axis times the angle.
    RotationVector,
    /// Nine numbers, row by row.
    Matrix,
}

impl TryFrom<String> for Convention {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.split_once(' ').unwrap_or((&text, "")) {
            ("rotation_vector", "") => return Ok(Self::RotationVector),
            ("matrix", "") => return Ok(Self::Matrix),
            ("quaternion", order @ ("wxyz" | "xyzw")) => {
                let real_part_first = order == "wxyz";
                return Ok(Self::Quaternion { real_part_first });
            }
            (about @ ("intrinsic" | "extrinsic"), letters) if letters.len() == 3 => {
                let axes: Vec<usize> = letters
                    .chars()
                    .filter_map(|axis| "xyz".find(axis))
                    .collect();
                if let [a, b, c] = axes[..]
                    && a != b
                    && b != c
                {
                    let is_intrinsic = about == "intrinsic";
                    return Ok(Self::Euler {
                        axes: [a, b, c],
                        is_intrinsic,
                    });
                }
            }
            _ => {}
        }
        Err(format!(
            "found {text:?}; \"intrinsic\" or \"extrinsic\" and three axes, no axis twice in a row, such as \"intrinsic xyz\", \
             \"quaternion wxyz\", \"quaternion xyzw\", \"rotation_vector\" or \"matrix\" is allowed"
        ))
    }
}

impl Convention {
    /// How many numbers a rotation has; three are angles.
    pub const fn numbers(&self) -> usize {
        match self {
            Self::Euler { .. } | Self::RotationVector => 3,
            Self::Quaternion { .. } => 4,
            Self::Matrix => 9,
        }
    }

    /// The target's axes in the instrument's frame, of numbers (rad where they are angles).
    pub fn rotation(&self, values: &[f64]) -> Result<UnitQuaternion<f64>, String> {
        match self {
            Self::Euler { axes, is_intrinsic } => {
                let turns = axes.iter().zip(values).map(|(&axis, angle)| {
                    UnitQuaternion::from_axis_angle(&Vector3::ith_axis(axis), *angle)
                });
                Ok(turns.fold(UnitQuaternion::identity(), |turn, next| {
                    if *is_intrinsic {
                        turn * next
                    } else {
                        next * turn
                    }
                }))
            }
            Self::RotationVector => Ok(UnitQuaternion::from_scaled_axis(Vector3::from_row_slice(
                values,
            ))),
            Self::Quaternion { real_part_first } => {
                let mut numbers = values.to_vec();
                numbers.rotate_left(usize::from(*real_part_first));
                let quaternion = Quaternion::from(nalgebra::Vector4::from_row_slice(&numbers));
                let length = quaternion.norm();
                if (length - 1.0).abs() > NEARLY_ONE {
                    return Err(format!(
                        "found a quaternion of length {length:.6}; 1 is allowed, to {NEARLY_ONE}"
                    ));
                }
                Ok(UnitQuaternion::from_quaternion(quaternion))
            }
            Self::Matrix => {
                let matrix = Matrix3::from_row_slice(values);
                let off = (matrix.tr_mul(&matrix) - Matrix3::identity()).amax();
                if off > NEARLY_ONE || matrix.determinant() < 0.0 {
                    return Err(format!(
                        "found no rotation matrix: its columns are off by {off:.1e}, its determinant is {:.3}",
                        matrix.determinant()
                    ));
                }
                Ok(UnitQuaternion::from_rotation_matrix(
                    &Rotation3::from_matrix(&matrix),
                ))
            }
        }
    }

    /// The covariance of the rotation vector about the instrument's axes (rad^2), of the standard deviations (rad) of the
    /// three numbers, or about these axes themselves where the numbers are no angles.
    pub fn covariance(
        &self,
        values: &[f64],
        deviations: &Vector3<f64>,
    ) -> Result<Matrix3<f64>, String> {
        let mut derivative = Matrix3::identity();
        if self.numbers() == 3 {
            for column in 0..3 {
                let moved = |by: f64| {
                    let mut moved = values.to_vec();
                    moved[column] += by;
                    self.rotation(&moved)
                };
                let turn = moved(STEP)? * moved(-STEP)?.inverse();
                derivative.set_column(column, &(turn.scaled_axis() / (2.0 * STEP)));
            }
        }
        let own = Matrix3::from_diagonal(&deviations.map(|sigma| sigma * sigma));
        let covariance = derivative * own * derivative.transpose();
        // The same to the bit on both sides of the diagonal.
        Ok((covariance + covariance.transpose()) / 2.0)
    }
}
