//! Rotations as foreign tables write them.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::mapping::{EulerAxes, RotationKind, RotationMapping};

/// A quaternion's length and a matrix's columns may be so far from 1.
const NEARLY_ONE: f64 = 1e-3;
/// The step of differences (rad).
const STEP: f64 = 1e-5;

/// How a table writes rotations, with what was said checked.
#[derive(Debug, Clone)]
pub(super) struct Convention {
    kind: RotationKind,
    /// The axes of Euler angles, 0 to 2, in the order in which they are turned about.
    axes: [usize; 3],
    about: EulerAxes,
    real_part_first: bool,
    inverse: bool,
}

/// What is wrong with a key, with a hint.
pub(super) type WrongKey = (&'static str, String, Option<String>);

impl Convention {
    pub fn of(mapping: &RotationMapping) -> Result<Self, WrongKey> {
        let is_euler = mapping.kind == RotationKind::Euler;
        let is_quaternion = mapping.kind == RotationKind::Quaternion;
        let mut axes = [0, 1, 2];
        let needs = |key, what: &str| (key, format!("is missing: {what}"), None);
        let only = |key: &'static str, of: &str| (key, format!("is for {of} alone"), None);
        match &mapping.axes {
            Some(_) if !is_euler => return Err(only("axes", "Euler angles")),
            None if is_euler => {
                return Err(needs(
                    "axes",
                    "the order of the axes, such as \"xyz\" or \"zyx\"",
                ));
            }
            Some(text) => {
                let letters: Vec<usize> = (text.to_lowercase().chars())
                    .filter_map(|letter| "xyz".find(letter))
                    .collect();
                let is_order = letters.len() == 3 && text.len() == 3;
                match letters[..] {
                    [a, b, c] if is_order && a != b && b != c => axes = [a, b, c],
                    _ => {
                        let problem = format!(
                            "found {text:?}; three of x, y and z are allowed, no axis twice in a row"
                        );
                        return Err(("axes", problem, None));
                    }
                }
            }
            None => {}
        }
        let about = match mapping.about {
            Some(_) if !is_euler => return Err(only("about", "Euler angles")),
            None if is_euler => {
                return Err(needs(
                    "about",
                    "\"intrinsic\" turns about the target's axes, \"extrinsic\" about those that stand still",
                ));
            }
            about => about.unwrap_or(EulerAxes::Intrinsic),
        };
        let real_part_first = match mapping.order.as_deref() {
            Some(_) if !is_quaternion => return Err(only("order", "quaternions")),
            None if is_quaternion => {
                return Err(needs("order", "\"wxyz\" or \"xyzw\""));
            }
            None | Some("wxyz") => true,
            Some("xyzw") => false,
            Some(other) => {
                let problem = format!("found {other:?}; \"wxyz\" or \"xyzw\" is allowed");
                return Err(("order", problem, None));
            }
        };
        Ok(Self {
            kind: mapping.kind,
            axes,
            about,
            real_part_first,
            inverse: mapping.inverse,
        })
    }

    /// How many numbers a rotation has.
    pub const fn numbers(&self) -> usize {
        match self.kind {
            RotationKind::Euler | RotationKind::RotationVector => 3,
            RotationKind::Quaternion => 4,
            RotationKind::Matrix => 9,
        }
    }

    /// Whether these are angles.
    pub const fn has_unit(&self) -> bool {
        self.numbers() == 3
    }

    /// In words.
    pub fn words(&self) -> String {
        let own = match self.kind {
            RotationKind::Euler => {
                let letters: String = (self.axes.iter())
                    .map(|&axis| ['x', 'y', 'z'][axis])
                    .collect();
                match self.about {
                    EulerAxes::Intrinsic => format!(
                        "Euler angles about the target's own {letters}, one after the other"
                    ),
                    EulerAxes::Extrinsic => format!(
                        "Euler angles about {letters} that stand still, one after the other"
                    ),
                }
            }
            RotationKind::Quaternion => "quaternions".to_owned(),
            RotationKind::RotationVector => "rotation vectors".to_owned(),
            RotationKind::Matrix => "matrices, row by row".to_owned(),
        };
        if self.inverse {
            format!("{own}, of the instrument's axes in the target's frame")
        } else {
            own
        }
    }

    /// The target's axes in the instrument's frame, of numbers (rad where they are angles).
    pub fn rotation(&self, values: &[f64]) -> Result<UnitQuaternion<f64>, String> {
        let rotation = match (self.kind, values) {
            (RotationKind::Euler, _) => {
                let mut turn = UnitQuaternion::identity();
                for (&axis, &angle) in self.axes.iter().zip(values) {
                    let mut vector = Vector3::zeros();
                    vector[axis] = angle;
                    let next = UnitQuaternion::from_scaled_axis(vector);
                    turn = match self.about {
                        EulerAxes::Intrinsic => turn * next,
                        EulerAxes::Extrinsic => next * turn,
                    };
                }
                turn
            }
            (RotationKind::RotationVector, &[x, y, z]) => {
                UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
            }
            (RotationKind::Quaternion, &[a, b, c, d]) => {
                let [w, x, y, z] = if self.real_part_first {
                    [a, b, c, d]
                } else {
                    [d, a, b, c]
                };
                let quaternion = Quaternion::new(w, x, y, z);
                if (quaternion.norm() - 1.0).abs() > NEARLY_ONE {
                    return Err(format!(
                        "found a quaternion of length {:.6}; 1 is allowed, to {NEARLY_ONE}",
                        quaternion.norm()
                    ));
                }
                UnitQuaternion::from_quaternion(quaternion)
            }
            (RotationKind::Matrix, values) if values.len() == 9 => {
                let matrix = Matrix3::from_row_slice(values);
                let off = (matrix.tr_mul(&matrix) - Matrix3::identity()).amax();
                if off > NEARLY_ONE || matrix.determinant() < 0.0 {
                    return Err(format!(
                        "found no rotation matrix: its columns are off by {off:.1e}, its determinant is {:.3}",
                        matrix.determinant()
                    ));
                }
                let svd = matrix.svd(true, true);
                let (Some(left), Some(right)) = (svd.u, svd.v_t) else {
                    return Err("found no rotation matrix".to_owned());
                };
                let nearest = Rotation3::from_matrix_unchecked(left * right);
                UnitQuaternion::from_rotation_matrix(&nearest)
            }
            _ => return Err("has not as many numbers as a rotation".to_owned()),
        };
        Ok(if self.inverse {
            rotation.inverse()
        } else {
            rotation
        })
    }

    /// The covariance of the rotation vector about the instrument's axes (rad^2), of the standard deviations (rad) of the
    /// three numbers, or about these axes themselves where the numbers are no angles.
    pub fn covariance(
        &self,
        values: &[f64],
        deviations: &Vector3<f64>,
    ) -> Result<Matrix3<f64>, String> {
        let mut derivative = Matrix3::identity();
        if self.has_unit() {
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

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::{Convention, EulerAxes, RotationKind};

    fn euler(axes: [usize; 3], about: EulerAxes) -> Convention {
        Convention {
            kind: RotationKind::Euler,
            axes,
            about,
            real_part_first: true,
            inverse: false,
        }
    }

    #[test]
    fn intrinsic_angles_are_extrinsic_ones_backwards() {
        let angles = [0.3, -0.7, 2.1];
        let backwards = [2.1, -0.7, 0.3];
        let one = euler([0, 1, 2], EulerAxes::Intrinsic)
            .rotation(&angles)
            .expect("a rotation");
        let other = euler([2, 1, 0], EulerAxes::Extrinsic)
            .rotation(&backwards)
            .expect("a rotation");
        assert!(one.angle_to(&other) < 1e-15);
        // Roll, pitch and yaw are about x, y and z that stand still.
        let fixed = euler([0, 1, 2], EulerAxes::Extrinsic)
            .rotation(&angles)
            .expect("a rotation");
        let known = UnitQuaternion::from_euler_angles(0.3, -0.7, 2.1);
        assert!(fixed.angle_to(&known) < 1e-15);
    }

    /// A small step of each angle turns about the axis that it is about by then.
    #[test]
    fn deviations_of_angles_become_those_of_the_rotation_vector() {
        let angles = [0.4, 0.9, -1.2];
        let sigma = Vector3::new(1e-3, 2e-3, 3e-3);
        let found = euler([0, 1, 2], EulerAxes::Intrinsic)
            .covariance(&angles, &sigma)
            .expect("a covariance");
        let x = UnitQuaternion::from_scaled_axis(Vector3::x() * angles[0]);
        let y = UnitQuaternion::from_scaled_axis(Vector3::y() * angles[1]);
        let columns = [Vector3::x(), x * Vector3::y(), x * y * Vector3::z()];
        let mut expected = nalgebra::Matrix3::zeros();
        for (column, sigma) in columns.iter().zip(&sigma) {
            expected += column * column.transpose() * (sigma * sigma);
        }
        assert!(
            (found - expected).amax() < 1e-9 * expected.amax(),
            "{found} {expected}"
        );
    }
}
