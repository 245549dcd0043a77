//! A table read without an input error.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DVector, Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::super::Case;
use super::super::frames::Sight;
use super::InputError;
use crate::measurement::Measurement;
use crate::robot::Load;

impl InputError {
    /// The commanded angles without it.
    pub(super) fn correct_commands(&self, q: &mut DVector<f64>) {
        match self {
            Self::AngleUnit(factor) => *q *= *factor,
            Self::JointSigns(joints) => joints.iter().for_each(|&joint| q[joint] *= -1.0),
            Self::JointsSwapped([one, other]) => q.swap_rows(*one, *other),
            Self::JointOffset(joint, quarters) => q[*joint] += f64::from(*quarters) * FRAC_PI_2,
            Self::JointFromBefore(joint, times) => q[*joint] += times * q[joint - 1],
            _ => {}
        }
    }

    /// A case's measured deflection without it.
    pub(super) fn correct_measurement(&self, case: &Case<'_>, each: &mut Measurement) {
        self.correct_commands(&mut each.configuration_rad);
        let arm = case.nominal.chain.at(case.tool);
        let q = each.configuration_rad.clone();
        let tool_axes = || arm.state(q.as_slice()).tool_rotation;
        match self {
            Self::SignsReversed => turn(each, &-Matrix3::identity(), 1.0),
            Self::LoadUnit(factor) => each.load = each.load.scaled(*factor),
            Self::DeflectionUnit(factor) => {
                each.deflection_m *= *factor;
                each.sigma_m = each.sigma_m.map(|sigma| sigma * *factor);
            }
            Self::Frame(matrix) => turn(each, matrix, matrix.determinant()),
            Self::DeflectionsInToolFrame => turn(each, &tool_axes(), 1.0),
            Self::LoadsInToolFrame => {
                let axes = tool_axes();
                each.load = Load {
                    force_n: axes * each.load.force_n,
                    torque_nm: axes * each.load.torque_nm,
                };
            }
            _ => {}
        }
    }

    /// What was seen without it: `reading` is its place, and after the instrument was moved there are so many `stations` more.
    pub(super) fn correct_sight(&self, reading: usize, stations: usize, sight: &mut Sight) {
        match self {
            Self::LeftHanded => {
                let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
                sight.position_m = mirror * sight.position_m;
                sight.rotation = sight.rotation.map(|each| mirror * each * mirror);
            }
            Self::PositionColumns(matrix) => sight.position_m = matrix * sight.position_m,
            Self::StationMoved(first) if reading >= *first => sight.station += stations,
            _ => {}
        }
        let rotation = sight.rotation.map(Rotation3::from_matrix_unchecked);
        sight.rotation = rotation.map(|each| self.corrected_rotation(each).into_inner());
    }

    fn corrected_rotation(&self, rotation: Rotation3<f64>) -> Rotation3<f64> {
        match self {
            Self::RotationsInverted => rotation.inverse(),
            Self::QuaternionOrder(places) => {
                let read = UnitQuaternion::from_rotation_matrix(&rotation);
                let read = [read.w, read.i, read.j, read.k];
                let [w, x, y, z] = places.map(|place| read[place]);
                UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix()
            }
            Self::EulerOrder => {
                // About fixed axes x, y, z is about those that turn along z, y, x.
                let (x, y, z) = rotation.euler_angles();
                let about = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle);
                about(Vector3::x(), x) * about(Vector3::y(), y) * about(Vector3::z(), z)
            }
            _ => rotation,
        }
    }
}

/// Turns a reading; rotation vectors are multiplied by `parity`, too.
fn turn(each: &mut Measurement, matrix: &Matrix3<f64>, parity: f64) {
    let turned_sigma = |sigma: Vector3<f64>| {
        let variance = matrix.component_mul(matrix) * sigma.component_mul(&sigma);
        variance.map(f64::sqrt)
    };
    each.deflection_m = matrix * each.deflection_m;
    each.sigma_m = each.sigma_m.map(turned_sigma);
    if let Some(rotation) = &mut each.rotation {
        rotation.vector_rad = matrix * rotation.vector_rad * parity;
        rotation.sigma_rad = turned_sigma(rotation.sigma_rad);
    }
}
