//! What parameters leave of readings, told apart by a mixed model: errors of joints, and what is new at each visit.

use super::super::gauss_newton::ParameterFit;
use super::mixed::{MixedModel, VarianceComponents};
use super::residuals::LinearReading;
use super::{AbsoluteCase, AbsoluteFit, Unexplained};
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::parameter::ParameterSet;

/// Fewer visits tell nothing of what the parameters leave but its size.
const LEAST_VISITS: usize = 20;

impl AbsoluteCase<'_> {
    /// A mixed model of what the parameters leave, with the readings; none where there is too little to tell.
    pub(super) fn mixed(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        discrepancy: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        let joints = self.commanded_joints();
        let variances = joints.len() + 1;
        if self.visits.len() < LEAST_VISITS || fit.degrees_of_freedom() < 4.0 * variances as f64 {
            return None;
        }
        self.mixed_of(set, &fit.posterior, joints, discrepancy)
    }

    /// The variance components of what a fit leaves of the readings that it kept; none where there is too little to tell, or where nothing
    /// is left beyond the readings' own covariances.
    pub fn variance_components(&self, fit: &AbsoluteFit) -> Option<VarianceComponents> {
        fit.discrepancy_model.as_ref()?;
        let (joints, turns) = (self.commanded_joints(), self.commanded_turns());
        let kept = self.kept(fit);
        let (_, mixed) = kept.mixed_of(&fit.set, &fit.posterior, joints, fit.discrepancy?)?;
        mixed.components(&turns)
    }

    /// The same with errors of these joints, however many readings there are; none where visits have several distances, which share what is
    /// along their own lines.
    pub(super) fn mixed_of(
        &self,
        set: &ParameterSet,
        posterior: &Posterior,
        joints: Vec<usize>,
        discrepancy: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        if self.reads_distances() && self.visits.len() < self.observations.len() {
            return None;
        }
        let rows = self
            .rows_at(&self.arm, set, &posterior.mean, &joints)
            .ok()?;
        let mixed = MixedModel::new(self, &rows, joints, (set, posterior), discrepancy);
        Some((rows, mixed))
    }

    /// What a mixed model tells of what the parameters leave; none where there is too little to tell. `left_out` are readings that were not
    /// fitted.
    pub(super) fn discrepancy_model(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        discrepancy: [f64; 2],
        left_out: &Self,
    ) -> Option<Unexplained> {
        let (rows, mixed) = self.mixed(set, fit, discrepancy)?;
        let values = &fit.posterior.mean;
        let others = left_out.rows_at(&self.arm, set, values, &self.commanded_joints());
        let found = mixed.fit(&mixed.visits_of(left_out, &others.ok()?))?;
        let turns = self.commanded_turns();
        let (covariance, degrees) = mixed.with_waves(&turns).of_parameters()?;
        let places: Vec<usize> = (0..set.len()).collect();
        let prognoses = (rows.iter().zip(&self.observations)).map(|(rows, each)| {
            let q = each.setup.commanded_rad.as_slice();
            let (left, covariance) = found.model.prognosis(rows, &places, q);
            found.model.judged(&left, &covariance, q).left
        });
        // How much smaller the parameters' variances are if readings are independent: a geometric mean.
        let independent = &fit.posterior;
        let logarithms = (0..set.len())
            .filter(|&index| independent.standard_error(index).is_some())
            .map(|index| {
                (independent.covariance[(index, index)] / covariance[(index, index)]).ln()
            });
        let logarithms: Vec<f64> = logarithms.filter(|each| each.is_finite()).collect();
        let ratio = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        Some(Unexplained {
            left: prognoses.collect(),
            visits: self.visits.len(),
            effective_sample_size: self.visits.len() as f64 * ratio.exp().min(1.0),
            predicted_by_others: found.predicted_by_others,
            covariance: symmetric(&covariance),
            degrees,
            model: found.model,
        })
    }
}
