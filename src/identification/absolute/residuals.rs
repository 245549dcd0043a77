//! Residuals of absolute readings, and their derivatives.

use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};

use super::{AbsoluteCase, FitResult, ReadingResidual};
use crate::observation::{ObservationModel, Whitener, of_each_prediction};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};

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
    pub fn in_thousandths(self) -> Self {
        Self {
            mean: self.mean * 1e3,
            rms: self.rms * 1e3,
            quantile95: self.quantile95 * 1e3,
            largest: self.largest * 1e3,
        }
    }

    /// Of the positions (mm) and of the orientations (mrad) that are left.
    pub fn in_mm_and_mrad(left: &[ReadingResidual]) -> [Option<Self>; 2] {
        [Self::of_positions(left), Self::of_rotations(left)]
            .map(|statistics| statistics.map(Self::in_thousandths))
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

/// One reading at an arm: rows of the position (m) above those of the rotation (rad), where it is read.
#[derive(Debug, Clone)]
pub(super) struct LinearReading {
    /// Read less predicted.
    pub residual: DVector<f64>,
    /// Derivatives of the prediction with respect to the parameters, in their units.
    pub columns: DMatrix<f64>,
    /// The same with respect to the joints' angles (rad; m where they slide).
    pub joints: DMatrix<f64>,
    /// The reading's own covariance.
    pub own: DMatrix<f64>,
}

/// A set with the zeros of joints besides, and the places of these.
pub(super) fn with_joints(
    set: &ParameterSet,
    arm: &ElasticArm,
    joints: &[usize],
) -> (ParameterSet, Vec<usize>) {
    let zeros = (joints.iter()).map(|&joint| ParameterKind::JointZero { joint });
    // Zeros are parameters of any chain.
    set.with_more(arm, zeros)
        .unwrap_or_else(|_| (set.clone(), Vec::new()))
}

impl AbsoluteCase<'_> {
    /// What an arm leaves of the readings.
    ///
    /// # Errors
    /// It has no equilibrium for one of them.
    pub fn left(&self, arm: &ElasticArm) -> FitResult<Vec<ReadingResidual>> {
        let rows = self.rows_at(arm, &ParameterSet::empty(), &[], &[])?;
        let left = rows
            .iter()
            .map(|rows| ReadingResidual::of_rows(&rows.residual));
        Ok(left.collect())
    }

    pub(super) fn commanded_joints(&self) -> Vec<usize> {
        self.arm.chain.commanded().collect()
    }

    /// Which of these turn; the others slide.
    pub(super) fn commanded_turns(&self) -> Vec<bool> {
        let joints = self.arm.chain.commanded();
        (joints.map(|joint| !self.arm.chain.joints[joint].drive.slides)).collect()
    }

    /// All readings at the values (p) of a set's parameters, which count from `reference`.
    pub(super) fn rows_at(
        &self,
        reference: &ElasticArm,
        set: &ParameterSet,
        values: &[f64],
        joints: &[usize],
    ) -> FitResult<Vec<LinearReading>> {
        let (all, places) = with_joints(set, reference, joints);
        let mut all_values = all.prior().mean.clone();
        all_values.as_mut_slice()[..set.len()].copy_from_slice(values);
        let model = ObservationModel::new(&all, reference, all_values.as_slice());
        let one = Vector3::repeat(1.0);
        let rows = of_each_prediction(&model, &self.observations, |place, predicted, by| {
            let mut each = self.observations[place].clone();
            each.whitener = Whitener::independent(one, one);
            let residual = each.whiten(predicted, by);
            let (rows, covariance) = (each.reading.kind().rows(), &self.covariances[place]);
            LinearReading {
                residual: DVector::from_fn(rows, |row, _| residual[row]),
                columns: by.view((0, 0), (rows, set.len())).into_owned(),
                joints: by.rows(0, rows).select_columns(&places),
                own: covariance.view((0, 0), (rows, rows)).into_owned(),
            }
        });
        Ok(rows?)
    }
}
