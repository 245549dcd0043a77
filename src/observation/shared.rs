//! Readings that share errors (random effects): normal equations with the effects eliminated.
//!
//! Readings of one group are y = h(x) + Z b + e, with unit normal effects b of the group: what the model does not know of a visit or a
//! configuration, or what a scenario says of it. With W the precision of e, leaving b to take its best value gives
//!
//! ```text
//! sum J^T W J - (sum Z^T W J)^T (sum Z^T W Z + 1)^-1 (sum Z^T W J)
//! ```
//!
//! the same as generalised least squares with the whole covariance of the group. With large effects only differences within a
//! group count: deflections, with the correlation that a common unloaded reading gives them.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Matrix6xX, Vector6};
use rayon::prelude::*;

use super::information::{NormalEquations, ReadingSums, in_blocks};
use super::linear::{LinearObservations, ObservationSource, equations_of};
use super::model::ObservationModel;
use super::reading::{Observation, PlannedReading, ReadingKind, Whitener};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::EquilibriumError;

/// Groups whose sums are made in one piece.
const BLOCK: usize = 8;

/// Readings that share errors.
#[derive(Debug, Clone, PartialEq)]
pub struct SharingReadings {
    /// The readings by their places.
    pub readings: Vec<usize>,
    /// How one standard deviation of each effect moves each of them (6 x k; m, rad), in the instrument's frame.
    pub effects: Vec<Matrix6xX<f64>>,
}

/// Which readings share errors: all readings, each in one group.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedErrors {
    /// The groups.
    pub groups: Vec<SharingReadings>,
}

impl SharedErrors {
    /// The covariance of these errors in each reading by itself (m^2, m rad, rad^2).
    pub fn covariances(&self) -> Vec<Matrix6<f64>> {
        let each = self
            .groups
            .iter()
            .flat_map(|group| group.readings.iter().zip(&group.effects));
        let mut all = vec![Matrix6::zeros(); each.clone().count()];
        for (&index, effects) in each {
            all[index] = effects * effects.transpose();
        }
        all
    }

    /// The same of some readings, by their places in rising order, which become their new numbers.
    pub fn among(&self, places: &[usize]) -> Self {
        let of_group = |group: &SharingReadings| {
            let each = group.readings.iter().zip(&group.effects);
            let (readings, effects) = each
                .filter_map(|(index, effects)| {
                    Some((places.binary_search(index).ok()?, effects.clone()))
                })
                .unzip();
            SharingReadings { readings, effects }
        };
        let mut groups: Vec<SharingReadings> = self.groups.iter().map(of_group).collect();
        groups.retain(|group| !group.readings.is_empty());
        Self { groups }
    }
}

/// The normal equations of observations at values of the parameters (p), through the static equilibrium, or of what is known of them to
/// first order; groups may share errors.
///
/// # Errors
/// The arm has no equilibrium for an observation, whose place in the list is given.
pub fn normal_equations(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
    linear: Option<&LinearObservations>,
) -> Result<NormalEquations, (usize, EquilibriumError)> {
    let scales = set.scales();
    let model = || ObservationModel::new(set, nominal, values.as_slice());
    let from = match linear {
        Some(linear) => ObservationSource::Linear(linear, values),
        None => ObservationSource::Predicted(Box::new(model())),
    };
    match shared {
        None => equations_of(&from, &scales, observations),
        Some(shared) => equations_of_groups(&from, &scales, observations, shared),
    }
}

fn equations_of_groups(
    from: &ObservationSource<'_>,
    scales: &DVector<f64>,
    observations: &[Observation],
    shared: &SharedErrors,
) -> Result<NormalEquations, (usize, EquilibriumError)> {
    in_blocks(scales.len(), &shared.groups, BLOCK, |_, groups| {
        let (mut block, mut from) = (ReadingSums::new(scales), from.clone());
        for group in groups {
            let effects = group.effects.first().map_or(0, Matrix6xX::ncols);
            let mut sums = EffectSums::new(effects, scales.len());
            for (&index, effects) in group.readings.iter().zip(&group.effects) {
                let each = &observations[index];
                let by = (each.reading.kind(), &each.whitener);
                let residual = block.add(by, |rows| from.of(index, each, rows))?;
                sums.add(by, effects, &block.rows, &residual);
            }
            sums.take_from(&mut block.sums);
        }
        Ok(block.sums)
    })
}

/// The information of each group of planned readings (p x p, in units of typical sizes) at values of the parameters, to first order in
/// compliance.
pub fn planned_information_of_groups(
    set: &ParameterSet,
    nominal: &ElasticArm,
    values: &DVector<f64>,
    readings: &[PlannedReading],
    groups: &[SharingReadings],
) -> Vec<DMatrix<f64>> {
    let model = ObservationModel::new(set, nominal, values.as_slice());
    let scales = set.scales();
    let room = || (ReadingSums::new(&scales), model.clone());
    let of_group = |(block, model): &mut (ReadingSums<'_>, _), group: &SharingReadings| {
        let effects = group.effects.first().map_or(0, Matrix6xX::ncols);
        let mut shared = EffectSums::new(effects, set.len());
        for (&index, effects) in group.readings.iter().zip(&group.effects) {
            let each = &readings[index];
            block.add_planned(model, each);
            let by = (each.kind, &each.whitener);
            shared.add(by, effects, &block.rows, &Vector6::zeros());
        }
        shared.take_from(&mut block.sums);
        let sums = std::mem::replace(&mut block.sums, NormalEquations::zeros(set.len()));
        sums.finish().information
    };
    groups.par_iter().map_init(room, of_group).collect()
}

/// The sums of one group.
struct EffectSums {
    weight: DMatrix<f64>,
    columns: DMatrix<f64>,
    residual: DVector<f64>,
}

impl EffectSums {
    fn new(effects: usize, parameters: usize) -> Self {
        Self {
            weight: DMatrix::identity(effects, effects),
            columns: DMatrix::zeros(effects, parameters),
            residual: DVector::zeros(effects),
        }
    }

    fn add(
        &mut self,
        (kind, whitener): (ReadingKind, &Whitener),
        effects: &Matrix6xX<f64>,
        rows: &Matrix6xX<f64>,
        residual: &Vector6<f64>,
    ) {
        let mut effects = effects.clone();
        whitener.whiten(kind, &mut Vector6::zeros(), &mut effects);
        self.weight.gemm_tr(1.0, &effects, &effects, 1.0);
        self.columns.gemm_tr(1.0, &effects, rows, 1.0);
        self.residual.gemv_tr(1.0, &effects, residual, 1.0);
    }

    fn take_from(self, sums: &mut NormalEquations) {
        if self.residual.is_empty() {
            return;
        }
        let Some(factor) = Cholesky::new(self.weight) else {
            return;
        };
        let best = factor.solve(&self.columns);
        sums.information -= self.columns.tr_mul(&best);
        sums.gradient -= best.tr_mul(&self.residual);
        sums.square -= self.residual.dot(&factor.solve(&self.residual));
    }
}
