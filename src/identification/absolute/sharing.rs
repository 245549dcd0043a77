//! Readings that share errors, together: their rows one below the other, with the covariance of what is new there.

use std::borrow::Borrow;

use nalgebra::{DMatrix, DVector, Matrix6xX};

use super::joint_errors::LocalRows;
use super::residuals::LinearReading;
use super::{AbsoluteCase, DiscrepancyModel};
use crate::observation::SharingReadings;

/// Readings that share errors, by their places, each with how one standard deviation of each effect moves its rows (r x e).
pub(super) type SharedEffects = Vec<(usize, DMatrix<f64>)>;

/// The rows of readings that share errors, one below the other.
pub(super) struct StackedRows {
    /// The readings, by their places.
    pub readings: Vec<usize>,
    /// The place among all that is known of each column after those of frames, in rising order.
    pub index: Vec<usize>,
    /// How parameters of frames move them, then what is known (r x (f + k)).
    pub columns: DMatrix<f64>,
    /// What is left (r).
    pub left: DVector<f64>,
    /// The covariance of what is new (r x r).
    pub new: DMatrix<f64>,
}

impl StackedRows {
    /// Of those that share errors, from the rows of all readings and how frames move these.
    pub fn of(group: &SharedEffects, local: &[LocalRows], frames: &[LinearReading]) -> Self {
        let places = || group.iter().map(|(place, _)| *place);
        let mut index: Vec<usize> = places()
            .flat_map(|place| local[place].index.iter().copied())
            .collect();
        index.sort_unstable();
        index.dedup();
        let own = places().map(|place| frames[place].columns.ncols()).max();
        let own = own.unwrap_or(0);
        let new = new_together(
            &(group.iter())
                .map(|(place, effects)| (&local[*place].new, effects))
                .collect::<Vec<_>>(),
        );
        let mut stacked = Self {
            readings: places().collect(),
            columns: DMatrix::zeros(new.nrows(), own + index.len()),
            left: DVector::zeros(new.nrows()),
            index,
            new,
        };
        let mut row = 0;
        for place in places() {
            let local = &local[place];
            let count = local.left.len();
            stacked.left.rows_mut(row, count).copy_from(&local.left);
            let mut here = stacked.columns.rows_mut(row, count);
            here.columns_mut(0, own).copy_from(&frames[place].columns);
            for (column, known) in local.matrix.column_iter().zip(&local.index) {
                let at = stacked.index.binary_search(known).unwrap_or_default();
                let mut sum = here.column_mut(own + at);
                sum += column;
            }
            row += count;
        }
        stacked
    }
}

/// The covariance of what is new at readings that share errors, one below the other: each has all of its own, and any two have what the same
/// effects do to both.
pub(super) fn new_together<M: Borrow<DMatrix<f64>>>(readings: &[(M, M)]) -> DMatrix<f64> {
    let readings = readings.iter();
    let readings = readings.map(|(own, effects)| (own.borrow(), effects.borrow()));
    let size = readings.clone().map(|(own, _)| own.nrows()).sum();
    let mut all = DMatrix::zeros(size, size);
    let mut row = 0;
    for (one, (own, effects)) in readings.clone().enumerate() {
        let mut column = 0;
        for (other, (of_other, others)) in readings.clone().enumerate() {
            let mut block = all.view_mut((row, column), (own.nrows(), of_other.nrows()));
            if one == other {
                block.copy_from(own);
            } else {
                effects.mul_to(&others.transpose(), &mut block);
            }
            column += of_other.nrows();
        }
        row += own.nrows();
    }
    all
}

impl AbsoluteCase<'_> {
    /// Which readings share errors: as the planner's model says, or those of a visit all that is new there.
    pub(super) fn errors_together(
        &self,
        discrepancy: &DiscrepancyModel,
        rows: &[LinearReading],
    ) -> Vec<SharedEffects> {
        if let Some(shared) = self.shared.as_ref().filter(|_| self.is_sharing_known) {
            let group = |group: &SharingReadings| {
                let each = group.readings.iter().zip(&group.effects);
                let effects = |(&place, effects): (&usize, &Matrix6xX<f64>)| {
                    let count = rows[place].residual.len();
                    (place, effects.rows(0, count).into_owned())
                };
                each.map(effects).collect()
            };
            return shared.groups.iter().map(group).collect();
        }
        let of_reading = |&place: &usize| {
            let (joints, count) = (&rows[place].joints, rows[place].residual.len());
            let mut effects = DMatrix::zeros(count, 6 + joints.ncols());
            for row in 0..count {
                effects[(row, row)] = discrepancy.rest[row / 3];
            }
            for (number, joint) in discrepancy.joints.iter().enumerate() {
                let moved = joints.column(number) * joint.repeatability;
                effects.set_column(6 + number, &moved);
            }
            (place, effects)
        };
        let visits = self.visits.iter();
        visits
            .map(|visit| visit.iter().map(of_reading).collect())
            .collect()
    }
}
