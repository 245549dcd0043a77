//! Readings that share an error (a random effect): normal equations with the effect eliminated.
//!
//! Readings of one stand of the robot are y = h(x) + b + e, with a b of its own for each stand, target and station: what the
//! model does not know of the configuration, loaded and unloaded the same. With b distributed normally, of precision P, and W the
//! precision of e, leaving b to take its best value gives
//!
//! ```text
//! sum J^T W J - (sum W J)^T (sum W + P)^-1 (sum W J)
//! ```
//!
//! the same as generalised least squares with the whole covariance of the group. With P = 0 only differences within a
//! group count: deflections, with the correlation that a common unloaded reading gives them.

use nalgebra::{DVector, Matrix6, Matrix6xX, Vector6};

use super::information::{NormalEquations, ReadingSums, in_blocks};
use super::model::ObservationModel;
use super::reading::Observation;
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::EquilibriumError;

/// Groups whose sums are made in one piece.
const BLOCK: usize = 8;

/// Which readings share an error, and how large it may be.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedErrors {
    /// All readings by their places, each in one group; groups of one share nothing with others.
    pub groups: Vec<Vec<usize>>,
    /// The precision of the error of groups of several: of position (1/m^2) and rotation (1/rad^2) coordinates.
    pub precision: Vector6<f64>,
}

/// The normal equations of observations of which groups share an error, through the static equilibrium.
///
/// # Errors
/// The arm has no equilibrium for an observation, whose place in the list is given.
pub fn shared_equations(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    observations: &[Observation],
    shared: &SharedErrors,
) -> Result<NormalEquations, (usize, EquilibriumError)> {
    let model = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    in_blocks(set.len(), &shared.groups, BLOCK, |_, groups| {
        let mut block = ReadingSums::new(&model, &scales);
        let mut room = SharedSums::new(set.len());
        for group in groups {
            room.clear();
            for &index in group {
                let each = &observations[index];
                let residual = block.add(each).map_err(|error| (index, error))?;
                if group.len() > 1 {
                    room.add(each, &block.rows, &residual);
                }
            }
            if group.len() > 1 {
                room.take_from(&mut block.sums, &shared.precision);
            }
        }
        Ok(block.sums)
    })
}

/// The sums of one group.
struct SharedSums {
    weight: Matrix6<f64>,
    columns: Matrix6xX<f64>,
    residual: Vector6<f64>,
}

impl SharedSums {
    fn new(parameters: usize) -> Self {
        Self {
            weight: Matrix6::zeros(),
            columns: Matrix6xX::zeros(parameters),
            residual: Vector6::zeros(),
        }
    }

    fn clear(&mut self) {
        self.weight.fill(0.0);
        self.columns.fill(0.0);
        self.residual.fill(0.0);
    }

    fn add(&mut self, each: &Observation, rows: &Matrix6xX<f64>, residual: &Vector6<f64>) {
        let mut whitener = *each.whitener.matrix();
        if each.reading.kind().rows() == 3 {
            whitener.fixed_view_mut::<3, 6>(3, 0).fill(0.0);
            whitener.fixed_view_mut::<6, 3>(0, 3).fill(0.0);
        }
        let turned = whitener.transpose();
        self.weight += turned * whitener;
        self.residual += turned * residual;
        for (mut sum, column) in self.columns.column_iter_mut().zip(rows.column_iter()) {
            sum += turned * column;
        }
    }

    fn take_from(&self, sums: &mut NormalEquations, precision: &Vector6<f64>) {
        let mut weight = self.weight + Matrix6::from_diagonal(precision);
        for row in 0..6 {
            // Rows that were not read share nothing.
            if self.weight[(row, row)] == 0.0 {
                weight[(row, row)] = 1.0;
            }
        }
        let Some(inverse) = weight.cholesky().map(|factor| factor.inverse()) else {
            return;
        };
        let best = inverse * &self.columns;
        sums.information -= self.columns.tr_mul(&best);
        sums.gradient -= best.tr_mul(&self.residual);
        sums.square -= self.residual.dot(&(inverse * self.residual));
    }
}
