//! Likely input errors of absolute readings: how they would have to be read for frames alone to explain them.
//!
//! Geometry may take up a joint's sign or a quarter of a turn as if a maker could have built it. Frames cannot: as it is read, a right table is off by
//! what robots are off by, a wrong one by much more. An input error is named where reading the table without it leaves a quarter at most.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::super::absolute::AbsoluteCase;
use super::super::frames::{MountedFrames, RobustFrames, Sight, median_or_zero, reach};
use super::{InputError, angle_units, sets_of_signs, swapped_joints};
use crate::codes::{Condition, ConditionCode};

/// Frames alone leave less than this share of how far positions reach, whatever robot it is.
const LOOKED_AT: f64 = 5e-3;
/// An input error explains a table where no more than this share is left without it.
const EXPLAINS: f64 = 0.25;
/// Of two errors the one of fewer joints, unless another one leaves less than this share of what it leaves.
const CLEARLY: f64 = 0.5;
/// So many readings are enough to see it.
const ENOUGH: usize = 80;
/// Stations may have been changed after so many parts of the table.
const PARTS: usize = 8;

impl AbsoluteCase<'_> {
    /// The input error that explains why frames alone do not explain the readings; none where they do, or where none explains it.
    pub fn likely_input_error(&self) -> Option<Condition> {
        if self.reads_distances() {
            return None;
        }
        let step = self.observations.len().div_ceil(ENOUGH).max(1);
        let some = self.part_of(|index| index % step == 0);
        let sights = some.sights();
        let robust = RobustFrames::guessed(&sights, some.stations.len(), &some.link_from_tools());
        let as_it_is_m = robust.median_m;
        if as_it_is_m <= LOOKED_AT * reach(&sights) {
            return None;
        }
        // Where positions hardly differ, whatever makes the robot's hardly differ would leave little of them.
        let explained_m = EXPLAINS * as_it_is_m.min(reach(&sights));
        let explaining = |errors: Vec<InputError>| {
            let left: Vec<f64> = (errors.par_iter())
                .map(|error| some.left_without(error, step))
                .collect();
            // An earlier one unless a later one is clearly better.
            let best = errors.into_iter().zip(left).reduce(|best, next| {
                if next.1 < CLEARLY * best.1 {
                    next
                } else {
                    best
                }
            });
            best.filter(|(_, left_m)| *left_m <= explained_m)
        };
        let (of_several, mut simple): (Vec<_>, Vec<_>) =
            (sets_of_signs(self.arm.chain.len()).into_iter()).partition(|set| set.len() > 1);
        let simple = (simple.drain(..).map(InputError::JointSigns))
            .chain(some.errors_besides_signs(step))
            .collect();
        let several = of_several.into_iter().map(InputError::JointSigns);
        let (error, left_m) = explaining(simple).or_else(|| explaining(several.collect()))?;
        Some(ConditionCode::InputError.with(format!(
            "likely input error: {}. Residuals of frames alone: {:.2} mm so, {:.2} mm as read (medians)",
            error.advice(&self.arm.chain),
            left_m * 1e3,
            as_it_is_m * 1e3
        )))
    }

    /// What frames alone leave of the readings, which are every so many of a table, without an error (m, a median, with rotations as
    /// lengths).
    fn left_without(&self, error: &InputError, step: usize) -> f64 {
        let mut case = self.clone();
        for each in &mut case.observations {
            error.correct_commands(&mut each.setup.commanded_rad);
        }
        let mut sights = case.sights();
        for (place, sight) in sights.iter_mut().enumerate() {
            error.correct_sight(place * step, self.stations.len(), sight);
        }
        let stations = sights.iter().map(|sight| sight.station + 1);
        let stations = stations.fold(self.stations.len(), usize::max);
        let frames = MountedFrames::guessed(&sights, stations, &self.link_from_tools());
        let left = |sight: &Sight| frames.square(sight).sqrt();
        median_or_zero(sights.iter().map(left).collect())
    }

    /// All but signs of joints; the readings are every so many of a table.
    fn errors_besides_signs(&self, step: usize) -> Vec<InputError> {
        let joints = &self.arm.chain.joints;
        let turning = (0..joints.len()).filter(|&joint| !joints[joint].drive.slides);
        let offsets = |joint| [1, -1, 2].map(|quarters| InputError::JointOffset(joint, quarters));
        let mut all: Vec<InputError> = turning.flat_map(offsets).collect();
        let mut readings = self.observations.iter();
        let has_rotations = readings.any(|each| each.reading.kind().rows() == 6);
        if has_rotations {
            all.push(InputError::RotationsInverted);
            all.extend([[3, 0, 1, 2], [1, 2, 3, 0]].map(InputError::QuaternionOrder));
            all.push(InputError::EulerOrder);
        }
        all.push(InputError::LeftHanded);
        if has_rotations {
            // Two columns or one sign: orientations say along which axes, the base's frame takes the rest.
            let signed = |axis: usize| {
                Matrix3::from_diagonal(&Vector3::from_fn(
                    |row, _| if row == axis { -1.0 } else { 1.0 },
                ))
            };
            let swapped = |[one, other]: [usize; 2]| {
                let mut matrix = Matrix3::identity();
                matrix.swap_rows(one, other);
                matrix
            };
            let columns =
                ([0, 1, 2].map(signed).into_iter()).chain([[0, 1], [0, 2], [1, 2]].map(swapped));
            all.extend(columns.map(InputError::PositionColumns));
        }
        all.extend(angle_units());
        all.extend(swapped_joints(joints.len()));
        let both = |joint| [1.0, -1.0].map(|times| InputError::JointFromBefore(joint, times));
        all.extend((1..joints.len()).flat_map(both));
        let moved = |part| part * self.observations.len() / PARTS * step;
        all.extend((1..PARTS).map(|part| InputError::StationMoved(moved(part))));
        all
    }
}
