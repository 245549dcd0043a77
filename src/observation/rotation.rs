//! Derivatives of rotations and their vectors.

use nalgebra::{Matrix3, Vector3};

/// [v]: the matrix with [v] w = v x w.
pub(super) fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// The rotation matrix of a rotation vector (rad).
pub(super) fn exponential(v: &Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::from_scaled_axis(*v).into_inner()
}

/// The left Jacobian of rotation vectors: the angular velocity of exp(v) is `left_jacobian(v)` dv.
pub(super) fn left_jacobian(v: &Vector3<f64>) -> Matrix3<f64> {
    let angle = v.norm();
    // Below this the series' next terms are rounding.
    let (one, two) = if angle < 1e-3 {
        let square = angle * angle;
        (0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0)
    } else {
        let square = angle * angle;
        let half_sine = (angle / 2.0).sin();
        (
            2.0 * half_sine * half_sine / square,
            (angle - angle.sin()) / (square * angle),
        )
    };
    let matrix = cross(v);
    Matrix3::identity() + matrix * one + matrix * matrix * two
}

/// The inverse of [`left_jacobian`], for angles below 2 pi: dv = `inverse_left_jacobian(v)` omega.
pub(super) fn inverse_left_jacobian(v: &Vector3<f64>) -> Matrix3<f64> {
    let angle = v.norm();
    let factor = if angle < 1e-2 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        let half = angle / 2.0;
        (1.0 - half / half.tan()) / (angle * angle)
    };
    let matrix = cross(v);
    Matrix3::identity() - matrix * 0.5 + matrix * matrix * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::rotation_vector;

    #[test]
    fn derivatives_of_rotation_vectors_are_their_differences() {
        for v in [
            Vector3::new(1e-5, -2e-5, 3e-6),
            Vector3::new(9e-4, 1e-4, 2e-4),
            Vector3::new(5e-3, -8e-3, 1e-3),
            Vector3::new(0.3, -0.2, 0.5),
            Vector3::new(-1.5, 1.2, 0.7),
        ] {
            let h = 1e-6;
            for axis in 0..3 {
                let step = Vector3::ith(axis, h);
                let turned = exponential(&(v + step)) * exponential(&(v - step)).transpose();
                let omega = rotation_vector(&turned) / (2.0 * h);
                assert!((omega - left_jacobian(&v).column(axis)).amax() < 1e-9);
            }
            let product = left_jacobian(&v) * inverse_left_jacobian(&v);
            assert!((product - Matrix3::identity()).amax() < 1e-12);
        }
    }
}
