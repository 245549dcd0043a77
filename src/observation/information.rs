//! Sums over readings: Fisher information, gradient and sum of squares.

use std::convert::Infallible;

use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6xX, Vector6};
use rayon::prelude::*;

use super::model::ObservationModel;
use super::reading::{Observation, PlannedReading, Prediction, ReadingKind, Setup, Whitener};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::EquilibriumError;

/// Readings whose sums are made in one piece: the pieces, and so the bits, do not depend on threads.
pub(super) const BLOCK: usize = 32;

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

    /// Adds one reading's whitened rows, of which so many are not zero; only the lower triangle of the information is filled.
    fn add(&mut self, rows: &Matrix6xX<f64>, count: usize, residual: &Vector6<f64>) {
        let residual: [f64; 6] = std::array::from_fn(|row| residual[row]);
        let columns = rows.as_slice().as_chunks::<6>().0;
        for (index, one) in columns.iter().enumerate() {
            let mut information = self.information.column_mut(index);
            for (sum, other) in information.as_mut_slice()[index..]
                .iter_mut()
                .zip(&columns[index..])
            {
                *sum += if count <= 3 {
                    one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
                } else {
                    dot(one, other)
                };
            }
            self.gradient[index] += dot(one, &residual);
        }
        self.square += dot(&residual, &residual);
    }

    fn join(&mut self, other: &Self) {
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

/// Sums over items, made in blocks that may run at the same time and are joined in their order. `sums_of` gets a block's
/// items and the place of the first.
pub(super) fn in_blocks<T: Sync, E: Send>(
    parameters: usize,
    items: &[T],
    block: usize,
    sums_of: impl Fn(usize, &[T]) -> Result<NormalEquations, E> + Sync,
) -> Result<NormalEquations, E> {
    let blocks: Vec<_> = (items.par_chunks(block).enumerate())
        .map(|(index, items)| sums_of(index * block, items))
        .collect();
    let mut sums = NormalEquations::zeros(parameters);
    for block in blocks {
        sums.join(&block?);
    }
    Ok(sums.finish())
}

/// The sums of a block of observations, with the room that they are made in.
pub(super) struct ReadingSums<'a> {
    scales: &'a DVector<f64>,
    /// The whitened rows of the last observation, in units of typical sizes.
    pub rows: Matrix6xX<f64>,
    pub sums: NormalEquations,
}

impl<'a> ReadingSums<'a> {
    pub fn new(scales: &'a DVector<f64>) -> Self {
        Self {
            scales,
            rows: Matrix6xX::zeros(scales.len()),
            sums: NormalEquations::zeros(scales.len()),
        }
    }

    /// Adds a reading of some kind and precision, whose derivatives are written, and returns its whitened residual.
    pub fn add<E>(
        &mut self,
        (kind, whitener): (ReadingKind, &Whitener),
        write: impl FnOnce(&mut Matrix6xX<f64>) -> Result<Vector6<f64>, E>,
    ) -> Result<Vector6<f64>, E> {
        let mut residual = write(&mut self.rows)?;
        whitener.whiten(kind, &mut residual, &mut self.rows);
        in_sizes(&mut self.rows, self.scales);
        self.sums.add(&self.rows, kind.rows(), &residual);
        Ok(residual)
    }

    /// Adds what a planned reading tells, as planning sees it.
    pub fn add_planned(&mut self, model: &mut ObservationModel<'_>, each: &PlannedReading) {
        let by = (each.kind, &each.whitener);
        let added: Result<_, Infallible> = self.add(by, |rows| {
            model.predict_as_planned(None, &each.setup, each.kind, rows);
            Ok(Vector6::zeros())
        });
        let Ok(_) = added;
    }
}

/// What is made of each observation's prediction through the static equilibrium, with the derivatives (6 x p), in their order.
///
/// # Errors
/// The arm has no equilibrium for an observation, whose place in the list is given.
pub fn of_each_prediction<T: Send>(
    model: &ObservationModel<'_>,
    observations: &[Observation],
    made_of: impl Fn(usize, &Prediction, &mut Matrix6xX<f64>) -> T + Sync,
) -> Result<Vec<T>, (usize, EquilibriumError)> {
    let of_block = |(block, observations): (usize, &[Observation])| {
        let mut model = model.clone();
        let mut derivatives = Matrix6xX::zeros(model.set().len());
        let each = (block * BLOCK..).zip(observations).map(|(place, each)| {
            let kind = each.reading.kind();
            let predicted = model.predict(&each.setup, kind, &mut derivatives);
            let predicted = predicted.map_err(|error| (place, error))?;
            Ok(made_of(place, &predicted, &mut derivatives))
        });
        each.collect::<Vec<_>>()
    };
    let blocks = observations.par_chunks(BLOCK).enumerate().map(of_block);
    blocks.collect::<Vec<_>>().into_iter().flatten().collect()
}

/// The information of planned readings (p x p, in units of typical sizes) at values of the parameters,
/// to first order in compliance. Springs do not show in that: with them, it is that at rest, where there is
/// one.
pub fn planned_information(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    readings: &[PlannedReading],
) -> DMatrix<f64> {
    let model = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    let sums = in_blocks(set.len(), readings, BLOCK, |_, readings| {
        let (mut block, mut model) = (ReadingSums::new(&scales), model.clone());
        for each in readings {
            block.add_planned(&mut model, each);
        }
        Ok::<_, Infallible>(block.sums)
    });
    let Ok(sums) = sums;
    sums.information
}

/// How positions follow the parameters where readings of any kind are planned, as planning sees it: three rows of each (3 n x p, m in
/// units of typical sizes), in the instrument's frame; of a distance the first alone.
pub fn planned_positions(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    wanted: &[(&Setup, ReadingKind)],
) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(3 * wanted.len(), set.len());
    for (index, each) in (planned_rows(set, nominal, values, wanted).iter()).enumerate() {
        rows.rows_mut(3 * index, 3)
            .copy_from(&each.fixed_rows::<3>(0));
    }
    rows
}

/// The same of readings of any kind: the rows of each (6 x p, m and rad in units of typical sizes), of which those of a position
/// alone are the first three.
pub fn planned_rows(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    wanted: &[(&Setup, ReadingKind)],
) -> Vec<Matrix6xX<f64>> {
    let mut model = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    (wanted.iter())
        .map(|&(setup, kind)| {
            let mut derivatives = Matrix6xX::zeros(set.len());
            model.predict_as_planned(None, setup, kind, &mut derivatives);
            in_sizes(&mut derivatives, &scales);
            derivatives
        })
        .collect()
}

/// What more is in the rows of a position (3 x p, m in units of typical sizes, in the station's frame) where the load is given in the
/// target's frame, and turns with it.
pub fn turning_load_rows(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    setup: &Setup,
) -> Matrix3xX<f64> {
    let mut model = ObservationModel::new(set, nominal, values.as_slice());
    let mut derivatives = Matrix6xX::zeros(set.len());
    model.add_turning_load(setup, &mut derivatives);
    in_sizes(&mut derivatives, &set.scales());
    let turn = nominal.instrument_from_base[setup.station].rotation;
    turn.to_rotation_matrix() * derivatives.fixed_rows::<3>(0)
}

pub(super) fn in_sizes(rows: &mut Matrix6xX<f64>, scales: &DVector<f64>) {
    for (mut column, scale) in rows.column_iter_mut().zip(scales) {
        column *= *scale;
    }
}
