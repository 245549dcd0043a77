//! Observations that the model predicts, or that are known to first order for fits whose weights alone change; and their sums.

use nalgebra::{DVector, Matrix6xX, Vector6};

use super::information::{BLOCK, NormalEquations, ReadingSums, in_blocks, of_each_prediction};
use super::model::ObservationModel;
use super::reading::Observation;
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::EquilibriumError;

/// Residuals at values of the parameters and the predictions' derivatives there.
#[derive(Debug, Clone)]
pub struct LinearObservations {
    about: DVector<f64>,
    /// Of each observation what was read less what is predicted, and the derivatives (6 x p, in the parameters' units); not whitened.
    each: Vec<(Vector6<f64>, Matrix6xX<f64>)>,
}

impl LinearObservations {
    /// Through the static equilibrium at values (p).
    ///
    /// # Errors
    /// The arm has no equilibrium for an observation, whose place in the list is given.
    pub fn new(
        set: &ParameterSet,
        nominal: &ElasticArm,
        values: &DVector<f64>,
        observations: &[Observation],
    ) -> Result<Self, (usize, EquilibriumError)> {
        let model = ObservationModel::new(set, nominal, values.as_slice());
        let each = of_each_prediction(&model, observations, |place, predicted, by| {
            let residual = observations[place].compare(predicted, by);
            (residual, by.clone())
        })?;
        let about = values.clone();
        Ok(Self { about, each })
    }

    /// What is left of an observation at other values (p): rows in m and rad.
    pub fn residual(&self, place: usize, values: &DVector<f64>) -> Vector6<f64> {
        let (residual, columns) = &self.each[place];
        let mut residual = *residual;
        let changes = values.iter().zip(&self.about).zip(columns.column_iter());
        for ((value, about), column) in changes {
            residual -= column * (value - about);
        }
        residual
    }

    /// The derivatives.
    pub(super) fn columns(&self, place: usize) -> &Matrix6xX<f64> {
        &self.each[place].1
    }
}

/// Where observations' residuals and derivatives come from.
#[derive(Debug, Clone)]
pub(super) enum ObservationSource<'a> {
    /// The observation model.
    Predicted(Box<ObservationModel<'a>>),
    /// What is known to first order, at values (p).
    Linear(&'a LinearObservations, &'a DVector<f64>),
}

impl ObservationSource<'_> {
    /// The residual of an observation, by its place, with its derivatives; not whitened.
    pub fn of(
        &mut self,
        place: usize,
        each: &Observation,
        rows: &mut Matrix6xX<f64>,
    ) -> Result<Vector6<f64>, (usize, EquilibriumError)> {
        match self {
            Self::Predicted(model) => {
                let predicted = model.predict(&each.setup, each.reading.kind(), rows);
                let predicted = predicted.map_err(|error| (place, error))?;
                Ok(each.compare(&predicted, rows))
            }
            Self::Linear(linear, values) => {
                rows.copy_from(linear.columns(place));
                Ok(linear.residual(place, values))
            }
        }
    }
}

/// The normal equations of observations that share no errors.
pub(super) fn equations_of(
    from: &ObservationSource<'_>,
    scales: &DVector<f64>,
    observations: &[Observation],
) -> Result<NormalEquations, (usize, EquilibriumError)> {
    in_blocks(scales.len(), observations, BLOCK, |first, observations| {
        let (mut block, mut from) = (ReadingSums::new(scales), from.clone());
        for (place, each) in (first..).zip(observations) {
            let by = (each.reading.kind(), &each.whitener);
            block.add(by, |rows| from.of(place, each, rows))?;
        }
        Ok(block.sums)
    })
}
