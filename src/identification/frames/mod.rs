//! Frames of stations and tools in closed form: a start for the fit that needs no guess.
//!
//! A reading sees the target at B F X: B is the robot's base in the frame of the instrument's station, F the link
//! that carries the target, from the commanded angles, X the target on its link. For poses positions and orientations together give
//! all B and X at once (the robot-world and hand-eye problem AX = ZB, linear where these may be any matrices); positions give
//! them by turns from linear starts. What fits best is taken.

mod positions;
mod robust;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

/// A metre of position counts as this much of rotation (rad) where starts are compared: a robot's half metre.
const LENGTH_M: f64 = 0.5;

/// A reading as closed forms need it.
#[derive(Debug, Clone)]
pub struct Sight {
    /// From which station, from 0.
    pub station: usize,
    /// Which target, from 0.
    pub target: usize,
    /// The link that carries the target in the robot's base, at the commanded angles.
    pub base_from_link: Isometry3<f64>,
    /// What was read of its position (m).
    pub position_m: Vector3<f64>,
    /// What was read of its orientation.
    pub rotation: Option<Matrix3<f64>>,
    /// How much it counts; one of all, as a rule.
    pub weight: f64,
}

/// Frames of stations and targets.
#[derive(Debug, Clone, PartialEq)]
pub struct MountedFrames {
    /// The robot's base as each station sees it.
    pub instrument_from_base: Vec<Isometry3<f64>>,
    /// Each target on its link.
    pub link_from_tool: Vec<Isometry3<f64>>,
}

impl MountedFrames {
    /// What readings let one guess; `tools` are where the targets are believed to be.
    pub fn guessed(sights: &[Sight], stations: usize, tools: &[Isometry3<f64>]) -> Self {
        let mut starts = vec![Self {
            instrument_from_base: vec![Isometry3::identity(); stations],
            link_from_tool: tools.to_vec(),
        }];
        if sights.iter().all(|sight| sight.rotation.is_some()) {
            let mut frames = positions::relaxed(sights, stations, tools);
            positions::translate(&mut frames, sights, tools);
            starts.push(frames);
        }
        starts.extend(positions::solved(sights, stations, tools));
        let mut best = (f64::INFINITY, starts[0].clone());
        for mut start in starts {
            start.turn_tools(sights);
            let cost = start.cost(sights);
            if cost < best.0 {
                best = (cost, start);
            }
        }
        best.1
    }

    /// The sum of squares of what is left (m^2).
    fn cost(&self, sights: &[Sight]) -> f64 {
        let of_one = |sight: &Sight| sight.weight * self.square(sight);
        sights.iter().map(of_one).sum()
    }

    /// What is left of one (m^2).
    fn square(&self, sight: &Sight) -> f64 {
        let seen = self.instrument_from_base[sight.station]
            * sight.base_from_link
            * self.link_from_tool[sight.target];
        let turned = sight.rotation.map_or(0.0, |rotation| {
            (rotation - seen.rotation.to_rotation_matrix().matrix()).norm_squared() / 2.0
        });
        (sight.position_m - seen.translation.vector).norm_squared() + turned * LENGTH_M * LENGTH_M
    }

    /// What is left of each (m).
    pub(super) fn left(&self, sights: &[Sight]) -> Vec<f64> {
        let left = sights.iter().map(|sight| self.square(sight).sqrt());
        left.collect()
    }

    /// Turns each tool as the orientations have it where the stations are.
    fn turn_tools(&mut self, sights: &[Sight]) {
        for (target, tool) in self.link_from_tool.iter_mut().enumerate() {
            let mut sum = Matrix3::zeros();
            for sight in sights.iter().filter(|sight| sight.target == target) {
                let Some(rotation) = sight.rotation else {
                    continue;
                };
                let base = self.instrument_from_base[sight.station].rotation;
                let link = (base * sight.base_from_link.rotation).to_rotation_matrix();
                sum += link.matrix().transpose() * rotation * sight.weight;
            }
            if sum != Matrix3::zeros() {
                tool.rotation = UnitQuaternion::from_rotation_matrix(&nearest(&sum));
            }
        }
    }
}

/// The rotation that is nearest to a matrix.
pub(super) fn nearest(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    let svd = matrix.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Rotation3::identity();
    };
    // A mirror image is put right along the direction that matters least.
    let least = svd.singular_values.imin();
    let mut signs = Vector3::repeat(1.0);
    signs[least] = (u.determinant() * v_t.determinant()).signum();
    Rotation3::from_matrix_unchecked(u * Matrix3::from_diagonal(&signs) * v_t)
}

pub use robust::RobustFrames;
pub(super) use robust::{evenly, groups, median_or_zero, reach};

#[cfg(test)]
mod tests;
