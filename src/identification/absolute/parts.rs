//! Fits of parts of the readings, all with the same unknowns, priors and weights.

use nalgebra::{DMatrix, Matrix6xX, Rotation3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::super::gauss_newton::{FitError, ParameterFit, fit_from};
use super::{
    AbsoluteCase, AbsoluteError, AbsoluteFit, ParameterGroup, ReadingResidual, ReadingWeights,
};
use crate::observation::{
    Form, Observation, ObservationModel, Reading, planned_information_of_each, planned_positions,
};
use crate::parameter::{ParameterSet, relative_precision};
use crate::robot::EquilibriumError;

/// Readings of which any part can be fitted as all were: the same unknowns, what is known of them before, and weights.
#[derive(Debug, Clone)]
pub struct PartsOfReadings<'a> {
    /// The readings, with the weights that all together ask for.
    pub case: AbsoluteCase<'a>,
    /// What all together say.
    pub all: AbsoluteFit,
}

impl<'a> AbsoluteCase<'a> {
    /// Fits all readings, those far out among them, and keeps what fits of parts of them share.
    ///
    /// # Errors
    /// As [`fit`](Self::fit); or some readings cannot be taken by themselves.
    pub fn in_parts(
        mut self,
        groups: &[ParameterGroup],
    ) -> Result<PartsOfReadings<'a>, AbsoluteError> {
        if self.visits.len() < self.observations.len() {
            return Err(AbsoluteError::Together);
        }
        self.keeps_all = true;
        let all = self.fit(groups, ReadingWeights::AsNeeded)?;
        // The fit leaves the readings with their own weights.
        if let Some(discrepancy) = all.discrepancy {
            self.weigh(discrepancy);
        }
        Ok(PartsOfReadings { case: self, all })
    }
}

impl PartsOfReadings<'_> {
    /// What is fitted.
    pub const fn set(&self) -> &ParameterSet {
        &self.all.set
    }

    /// What each reading tells of the unknowns (p x p, in typical sizes), with the robot nominal, and frames where all readings
    /// say.
    pub fn told(&self) -> Vec<DMatrix<f64>> {
        let set = self.set();
        let planned: Vec<_> = (self.case.observations.iter())
            .map(Observation::planned)
            .collect();
        planned_information_of_each(set, &self.case.arm, &set.prior().mean, &planned)
    }

    /// What is known before (p x p, in typical sizes).
    pub fn known_before(&self) -> DMatrix<f64> {
        relative_precision(self.set())
    }

    /// C^T (p x 3 n): how the positions of all n readings follow the unknowns (in typical sizes), times the root of 1/n, so that
    /// `rho_0`^2 is the mean square distance over them.
    pub fn positions(&self) -> DMatrix<f64> {
        let set = self.set();
        let setups: Vec<_> = (self.case.observations.iter())
            .map(|each| &each.setup)
            .collect();
        let rows = planned_positions(set, &self.case.arm, &set.prior().mean, &setups);
        rows.transpose() / (setups.len().max(1) as f64).sqrt()
    }

    /// The fit of some of these observations, which may be those of the case or others in their places.
    pub fn fit(
        &self,
        observations: &[Observation],
        chosen: &[usize],
    ) -> Result<ParameterFit, FitError> {
        let chosen: Vec<Observation> = chosen
            .iter()
            .map(|&index| observations[index].clone())
            .collect();
        let set = self.set();
        fit_from(&self.case.arm, set, &chosen, None, &set.prior().mean)
    }

    /// What a fit leaves of all readings.
    ///
    /// # Errors
    /// The robot has no equilibrium there.
    pub fn left_by(&self, fit: &ParameterFit) -> Result<Vec<ReadingResidual>, EquilibriumError> {
        self.case.left(&fit.belief).map_err(|(_, error)| error)
    }

    /// The readings of a robot that is exactly as all readings together say, with errors that are normal, independent and as large
    /// as the weights say.
    ///
    /// # Errors
    /// The robot has no equilibrium there.
    pub fn without_discrepancy(
        &self,
        random: &mut ChaCha8Rng,
    ) -> Result<Vec<Observation>, EquilibriumError> {
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &self.all.arm, &[]);
        let mut derivatives = Matrix6xX::zeros(0);
        (self.case.observations.iter())
            .map(|each| {
                let kind = each.reading.kind();
                let predicted = model.predict(Form::AtRest, &each.setup, kind, &mut derivatives)?;
                let normal = Vector6::from_fn(|_, _| StandardNormal.sample(random));
                let error = each.whitener.coloured(&normal);
                let position_m = predicted.position_m + error.fixed_rows::<3>(0);
                let turned = error.fixed_rows::<3>(3).into_owned();
                let reading = match each.reading {
                    Reading::Pose { .. } => Reading::Pose {
                        position_m,
                        rotation: Rotation3::new(turned).into_inner() * predicted.rotation,
                    },
                    _ => Reading::Position { position_m },
                };
                Ok(Observation {
                    reading,
                    ..each.clone()
                })
            })
            .collect()
    }
}
