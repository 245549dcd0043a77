//! Sums over readings: information, gradient and sum of squares.

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector6};
use rayon::prelude::*;

use super::model::{Form, ObservationModel};
use super::reading::{Observation, PlannedReading, ReadingKind, Setup};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::EquilibriumError;

/// Readings whose sums are made in one piece: the pieces, and so the bits, do not depend on threads.
const BLOCK: usize = 32;

/// What readings say about p parameters at one vector of values, in units of the parameters' typical
/// sizes; readings are whitened.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalEquations {
    /// The information, the sum of J^T R^-1 J (p x p).
    pub information: DMatrix<f64>,
    /// The sum of J^T R^-1 r with residuals r (p).
    pub gradient: DVector<f64>,
    /// The sum of r^T R^-1 r.
    pub square: f64,
}

impl NormalEquations {
    pub(super) fn zeros(parameters: usize) -> Self {
        Self {
            information: DMatrix::zeros(parameters, parameters),
            gradient: DVector::zeros(parameters),
            square: 0.0,
        }
    }

    /// Adds one reading's whitened rows; only the lower triangle of the information is filled.
    pub(super) fn add(&mut self, rows: &Matrix6xX<f64>, residual: &Vector6<f64>) {
        let residual: [f64; 6] = std::array::from_fn(|row| residual[row]);
        let columns = rows.as_slice().as_chunks::<6>().0;
        for (index, one) in columns.iter().enumerate() {
            let mut information = self.information.column_mut(index);
            for (sum, other) in information.as_mut_slice()[index..]
                .iter_mut()
                .zip(&columns[index..])
            {
                *sum += dot(one, other);
            }
            self.gradient[index] += dot(one, &residual);
        }
        self.square += dot(&residual, &residual);
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.information += &other.information;
        self.gradient += &other.gradient;
        self.square += other.square;
    }

    pub(super) fn finish(mut self) -> Self {
        self.information.fill_upper_triangle_with_lower_triangle();
        self
    }
}

fn dot(one: &[f64; 6], other: &[f64; 6]) -> f64 {
    let products: [f64; 6] = std::array::from_fn(|row| one[row] * other[row]);
    (products[0] + products[3]) + (products[1] + products[4]) + (products[2] + products[5])
}

/// The normal equations of observations at values of the parameters (p), through the static equilibrium.
///
/// # Errors
/// The arm has no equilibrium for an observation, whose place in the list is given.
pub fn normal_equations(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    observations: &[Observation],
) -> Result<NormalEquations, (usize, EquilibriumError)> {
    let first = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    let blocks: Vec<_> = (observations.par_chunks(BLOCK).enumerate())
        .map(|(block, observations)| {
            let mut model = first.clone();
            let mut rows = Matrix6xX::zeros(set.len());
            let mut sums = NormalEquations::zeros(set.len());
            for (index, each) in observations.iter().enumerate() {
                let predicted = model
                    .predict(Form::AtRest, &each.setup, each.reading.kind(), &mut rows)
                    .map_err(|error| (block * BLOCK + index, error))?;
                let residual = each.whiten(&predicted, &mut rows);
                in_sizes(&mut rows, &scales);
                sums.add(&rows, &residual);
            }
            Ok(sums)
        })
        .collect();
    let mut sums = NormalEquations::zeros(set.len());
    for block in blocks {
        sums.join(&block?);
    }
    Ok(sums.finish())
}

/// The information of planned readings (p x p, in units of typical sizes) at values of the parameters,
/// to first order in compliance. Springs do not show in that: with them, it is that at rest, where there is
/// one.
#[must_use]
pub fn planned_information(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    readings: &[PlannedReading],
) -> DMatrix<f64> {
    let blocks = sums_of_planned(set, nominal, values, readings, BLOCK);
    let mut sums = NormalEquations::zeros(set.len());
    for block in &blocks {
        sums.join(block);
    }
    sums.finish().information
}

/// The same of each reading by itself.
#[must_use]
pub fn planned_information_of_each(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    readings: &[PlannedReading],
) -> Vec<DMatrix<f64>> {
    (sums_of_planned(set, nominal, values, readings, 1).into_iter())
        .map(|sums| sums.finish().information)
        .collect()
}

/// Of so many planned readings at a time.
fn sums_of_planned(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    readings: &[PlannedReading],
    at_a_time: usize,
) -> Vec<NormalEquations> {
    let first = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    readings
        .par_chunks(at_a_time)
        .map_init(
            || (first.clone(), Matrix6xX::zeros(set.len())),
            |(model, rows), readings| {
                let mut sums = NormalEquations::zeros(set.len());
                for each in readings {
                    model.predict_as_planned(&each.setup, each.kind, rows);
                    let mut residual = Vector6::zeros();
                    each.whitener.whiten(each.kind, &mut residual, rows);
                    in_sizes(rows, &scales);
                    sums.add(rows, &residual);
                }
                sums
            },
        )
        .collect()
}

/// How the positions of targets follow the parameters where readings are planned, as planning sees it: three rows of each setup
/// (3 n x p, m in units of typical sizes), in the instrument's frame.
#[must_use]
pub fn planned_positions(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    setups: &[&Setup],
) -> DMatrix<f64> {
    let mut model = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    let mut derivatives = Matrix6xX::zeros(set.len());
    let mut rows = DMatrix::zeros(3 * setups.len(), set.len());
    for (index, setup) in setups.iter().enumerate() {
        model.predict_as_planned(setup, ReadingKind::Position, &mut derivatives);
        in_sizes(&mut derivatives, &scales);
        rows.rows_mut(3 * index, 3)
            .copy_from(&derivatives.fixed_rows::<3>(0));
    }
    rows
}

pub(super) fn in_sizes(rows: &mut Matrix6xX<f64>, scales: &DVector<f64>) {
    for (mut column, scale) in rows.column_iter_mut().zip(scales) {
        column *= *scale;
    }
}
