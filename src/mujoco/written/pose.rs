//! Frames as the attributes of URDF have them.

use nalgebra::UnitQuaternion;

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
