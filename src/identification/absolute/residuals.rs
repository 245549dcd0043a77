//! The residuals of a fit of absolute readings.

use nalgebra::Matrix6xX;
use serde::{Deserialize, Serialize};

use super::{AbsoluteCase, ReadingResidual};
use crate::observation::{Form, Observation, ObservationModel, Reading};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::{EquilibriumError, rotation_vector};

/// How long vectors are.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DistanceStatistics {
    /// The mean length.
    pub mean: f64,
    /// The root of the mean square.
    pub rms: f64,
    /// What 95 % of them stay below.
    pub quantile95: f64,
    /// The longest.
    pub largest: f64,
}

impl DistanceStatistics {
    /// Of lengths; none of none.
    pub fn of(mut lengths: Vec<f64>) -> Option<Self> {
        lengths.sort_by(f64::total_cmp);
        let count = lengths.len() as f64;
        let &largest = lengths.last()?;
        // The smallest length that 95 % do not exceed.
        let place = (lengths.len() * 95).div_ceil(100).max(1) - 1;
        Some(Self {
            mean: lengths.iter().sum::<f64>() / count,
            rms: (lengths.iter().map(|length| length * length).sum::<f64>() / count).sqrt(),
            quantile95: lengths[place],
            largest,
        })
    }

    /// The same in thousandths: mm for m.
    pub fn in_thousandths(&self) -> Self {
        Self {
            mean: self.mean * 1e3,
            rms: self.rms * 1e3,
            quantile95: self.quantile95 * 1e3,
            largest: self.largest * 1e3,
        }
    }

    /// Of the positions that are left (m).
    pub fn of_positions(left: &[ReadingResidual]) -> Option<Self> {
        Self::of(left.iter().map(|each| each.position_m.norm()).collect())
    }

    /// Of the orientations that are left (rad); none where none are read.
    pub fn of_rotations(left: &[ReadingResidual]) -> Option<Self> {
        let rotations = left.iter().filter_map(|each| each.rotation_rad);
        Self::of(rotations.map(|rotation| rotation.norm()).collect())
    }
}

impl AbsoluteCase<'_> {
    /// What an arm leaves of the readings.
    ///
    /// # Errors
    /// It has no equilibrium for one of them, whose place is given.
    pub fn left(
        &self,
        arm: &ElasticArm,
    ) -> Result<Vec<ReadingResidual>, (usize, EquilibriumError)> {
        left_of(&self.observations, arm)
    }
}

/// What an arm leaves of some readings; the place of one for which it has no equilibrium.
pub(super) fn left_of(
    observations: &[Observation],
    arm: &ElasticArm,
) -> Result<Vec<ReadingResidual>, (usize, EquilibriumError)> {
    let nothing = ParameterSet::empty();
    let mut model = ObservationModel::new(&nothing, arm, &[]);
    let mut derivatives = Matrix6xX::zeros(0);
    (observations.iter().enumerate())
        .map(|(index, each)| {
            let kind = each.reading.kind();
            let predicted = model
                .predict(Form::AtRest, &each.setup, kind, &mut derivatives)
                .map_err(|error| (index, error))?;
            let (position_m, rotation_rad) = match each.reading {
                Reading::Pose {
                    position_m,
                    rotation,
                } => {
                    let apart = rotation * predicted.rotation.transpose();
                    (position_m, Some(rotation_vector(&apart)))
                }
                Reading::Position { position_m } | Reading::Deflection { position_m, .. } => {
                    (position_m, None)
                }
            };
            Ok(ReadingResidual {
                position_m: position_m - predicted.position_m,
                rotation_rad,
            })
        })
        .collect()
}
