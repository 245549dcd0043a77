//! Frames as the attributes of MJCF and URDF have them.

use nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};
use roxmltree::{Document, Node};

/// The attributes that say how a frame of MJCF is turned.
pub(super) const TURNS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// How an MJCF file writes angles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileAngles {
    pub degrees: bool,
    /// The axes of Euler angles; capitals turn about fixed axes.
    pub sequence: String,
}

impl FileAngles {
    /// Those of a file: the last compiler's word counts.
    pub fn of(document: &Document<'_>) -> Self {
        let mut angles = Self {
            degrees: true,
            sequence: "xyz".to_owned(),
        };
        let compilers = document
            .descendants()
            .filter(|each| each.has_tag_name("compiler"));
        for compiler in compilers {
            if let Some(unit) = compiler.attribute("angle") {
                angles.degrees = unit.trim() != "radian";
            }
            if let Some(sequence) = compiler.attribute("eulerseq") {
                sequence.clone_into(&mut angles.sequence);
            }
        }
        angles
    }

    /// An angle as the file writes it.
    pub fn written(&self, angle_rad: f64) -> f64 {
        if self.degrees {
            angle_rad.to_degrees()
        } else {
            angle_rad
        }
    }

    fn read(&self, angle: f64) -> f64 {
        if self.degrees {
            angle.to_radians()
        } else {
            angle
        }
    }

    /// The pose that an element's attributes give.
    pub fn pose(&self, node: Node<'_, '_>) -> Option<Isometry3<f64>> {
        let position = match node.attribute("pos") {
            Some(text) => vector(text)?,
            None => Vector3::zeros(),
        };
        Some(Isometry3::from_parts(
            Translation3::from(position),
            self.turn(node)?,
        ))
    }

    fn turn(&self, node: Node<'_, '_>) -> Option<UnitQuaternion<f64>> {
        let mut given = (TURNS.iter()).filter_map(|&name| Some((name, node.attribute(name)?)));
        let Some((name, text)) = given.next() else {
            return Some(UnitQuaternion::identity());
        };
        let values = values(text)?;
        Some(match (name, &values[..]) {
            ("quat", &[w, x, y, z]) => UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
            ("axisangle", &[x, y, z, angle]) => {
                let axis = Unit::try_new(Vector3::new(x, y, z), 0.0)?;
                UnitQuaternion::from_axis_angle(&axis, self.read(angle))
            }
            ("xyaxes", &[a, b, c, d, e, f]) => {
                let x = Vector3::new(a, b, c).try_normalize(0.0)?;
                let y = Vector3::new(d, e, f);
                let y = (y - x * x.dot(&y)).try_normalize(0.0)?;
                let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
            }
            ("zaxis", &[x, y, z]) => {
                UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::new(x, y, z))?
            }
            ("euler", &[a, b, c]) => {
                let mut turn = UnitQuaternion::identity();
                for (letter, angle) in self.sequence.chars().zip([a, b, c]) {
                    let axis = match letter.to_ascii_lowercase() {
                        'x' => Vector3::x_axis(),
                        'y' => Vector3::y_axis(),
                        _ => Vector3::z_axis(),
                    };
                    let next = UnitQuaternion::from_axis_angle(&axis, self.read(angle));
                    turn = if letter.is_ascii_uppercase() {
                        next * turn
                    } else {
                        turn * next
                    };
                }
                turn
            }
            _ => return None,
        })
    }
}

/// A frame's position and quaternion (w, x, y, z).
pub(super) fn position_and_quaternion(frame: &Isometry3<f64>) -> ([f64; 3], [f64; 4]) {
    let [x, y, z, w] = frame.rotation.coords.into();
    (frame.translation.vector.into(), [w, x, y, z])
}

/// Roll, pitch and yaw about the fixed x, then y, then z axis. Near a pitch of 90 deg they are not the only ones, but
/// give the rotation back to the last digits all the same.
pub(super) fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = rotation.to_rotation_matrix().into_inner();
    let roll = matrix[(2, 1)].atan2(matrix[(2, 2)]);
    let (sine, cosine) = roll.sin_cos();
    let pitch = (-matrix[(2, 0)]).atan2(sine * matrix[(2, 1)] + cosine * matrix[(2, 2)]);
    let yaw = (sine * matrix[(0, 2)] - cosine * matrix[(0, 1)])
        .atan2(cosine * matrix[(1, 1)] - sine * matrix[(1, 2)]);
    [roll, pitch, yaw]
}

pub(super) fn values(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace()
        .map(|word| word.parse().ok())
        .collect()
}

fn vector(text: &str) -> Option<Vector3<f64>> {
    match values(text)?[..] {
        [x, y, z] => Some(Vector3::new(x, y, z)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::roll_pitch_yaw;

    #[test]
    fn angles_give_the_rotation_back_near_the_lock_too() {
        use std::f64::consts::FRAC_PI_2;
        for pitch in [0.3, FRAC_PI_2 - 1e-7, FRAC_PI_2, 1e-11 - FRAC_PI_2, -2.9] {
            let turn = UnitQuaternion::from_euler_angles(0.7, pitch, -2.2)
                * UnitQuaternion::from_scaled_axis(Vector3::new(1e-9, -2e-9, 1e-10));
            let [roll, pitch, yaw] = roll_pitch_yaw(&turn);
            let back = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            assert!(
                back.angle_to(&turn) < 1e-14,
                "{pitch}: {}",
                back.angle_to(&turn)
            );
        }
    }
}
