//! What parameters leave of readings, told apart by a mixed model: errors of joints, and what is new at each visit.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::super::estimate::told_degrees;
use super::super::fit::ParameterFit;
use super::mixed::{ComponentIntervals, MixedModel, VarianceComponents};
use super::residuals::LinearReading;
use super::visits::LEAST_VISITS;
use super::{AbsoluteCase, AbsoluteFit, DiscrepancyModel, ReadingResidual, Unexplained};
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::parameter::ParameterSet;
use crate::robot::Load;

impl AbsoluteCase<'_> {
    /// A mixed model of what the parameters leave, with the readings; none where there is too little to tell.
    pub(super) fn mixed(
        &self,
        fit: &ParameterFit,
        discrepancy: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        let joints = self.commanded_joints();
        let variances = joints.len() + 1;
        if self.visits.len() < LEAST_VISITS || fit.degrees_of_freedom() < 4.0 * variances as f64 {
            return None;
        }
        self.mixed_of(&fit.set, &fit.posterior, joints, discrepancy)
    }

    /// The variance components of what a fit leaves of the readings that it kept; none where there is too little to tell, or where nothing
    /// is left beyond the readings' own covariances. How well they are known by that.
    pub fn variance_components(
        &self,
        fit: &AbsoluteFit,
    ) -> Option<(VarianceComponents, ComponentIntervals)> {
        fit.discrepancy_model.as_ref()?;
        let joints = self.commanded_joints();
        let kept = self.kept(fit);
        let (_, mixed) = kept.mixed_of(&fit.set, &fit.posterior, joints, fit.discrepancy?)?;
        mixed.components()
    }

    /// What the planner's model says of what the parameters leave: joint error functions, with what is new at each visit where it says that
    /// and `rest` where it does not; none where it has no functions, or weighs readings by them already.
    pub(super) fn known_components(&self, rest: [f64; 2]) -> Option<VarianceComponents> {
        let uncertain = Some(&self.belief.uncertain)
            .filter(|_| self.choices.uses_joint_errors && !self.is_sharing_known)?;
        let functions = uncertain.joint_functions();
        // One size for all readings, that of loaded ones where there are any.
        let mut loads = self.observations.iter().map(|each| each.setup.load);
        let load = loads.find(|load| *load != Load::NONE).unwrap_or(Load::NONE);
        (!functions.is_empty()).then(|| VarianceComponents {
            functions,
            rest: [uncertain.discrepancy_m(&load).unwrap_or(rest[0]), rest[1]],
        })
    }

    /// The likeliest parameters, near a fit of them, together with functions and sizes that are known, and what these say of what they leave.
    pub(super) fn with_known(
        &self,
        fit: &mut ParameterFit,
        known: &VarianceComponents,
    ) -> Option<Unexplained> {
        let set = &fit.set;
        let (rows, mixed) = self.mixed_of(set, &fit.posterior, known.joints(), known.rest)?;
        let (model, degrees) = mixed.with_remainder(known)?;
        let model = model.estimated(degrees);
        let count = set.len();
        let covariance = model.covariance.view((0, 0), (count, count)).into_owned();
        let values = fit.posterior.mean.iter().copied().enumerate();
        let degrees = values.map(|value| told_degrees(set, &covariance, value, degrees));
        let degrees = degrees.collect();
        let mut told = self.told_by(model, &rows, &fit.posterior, &covariance, degrees);
        // From here on parameters count from where they are likeliest.
        for (value, shift) in fit.posterior.mean.iter_mut().zip(&told.model.shift) {
            *value += shift;
        }
        fit.belief = set.apply(&self.arm, &fit.posterior.mean);
        told.model.shift.fill(0.0);
        Some(told)
    }

    /// The same with errors of these joints, however many readings there are; none where visits have several lengths, which share what is
    /// along their own lines.
    pub(super) fn mixed_of(
        &self,
        set: &ParameterSet,
        posterior: &Posterior,
        joints: Vec<usize>,
        discrepancy: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        if self.reads_lengths() && self.visits.len() < self.observations.len() {
            return None;
        }
        let rows = (self.rows_at(&self.arm, set, &posterior.mean, &joints)).ok()?;
        let mixed = MixedModel::new(self, &rows, joints, (set, posterior), discrepancy)?;
        Some((rows, mixed))
    }

    /// What a mixed model tells of what the parameters leave; none where there is too little to tell. `left_out` are readings that were not
    /// fitted.
    pub(super) fn discrepancy_model(
        &self,
        fit: &ParameterFit,
        discrepancy: [f64; 2],
        left_out: &Self,
    ) -> Option<Unexplained> {
        let (rows, mixed) = self.mixed(fit, discrepancy)?;
        let (set, values) = (&fit.set, &fit.posterior.mean);
        let others = left_out.rows_at(&self.arm, set, values, &self.commanded_joints());
        let (model, predicted_by_others) = mixed.fit(&mixed.visits_of(left_out, &others.ok()?))?;
        let turns = self.commanded_turns();
        let parts = mixed.with_waves(&turns).covariance_parts()?;
        let degrees = (0..set.len()).map(|index| parts.of_sum(&[(index, 1.0)])[1]);
        let (covariance, degrees) = (parts.whole(), degrees.collect());
        Some(Unexplained {
            predicted_by_others,
            ..self.told_by(model, &rows, &fit.posterior, &covariance, degrees)
        })
    }

    /// What a model of the readings tells, with the covariance of the parameters by it and its degrees of freedom. As many visits tell as much
    /// of the parameters where readings are `independent` as their variances are smaller then, a geometric mean.
    fn told_by(
        &self,
        model: DiscrepancyModel,
        rows: &[LinearReading],
        independent: &Posterior,
        covariance: &DMatrix<f64>,
        degrees: Vec<f64>,
    ) -> Unexplained {
        let places: Vec<usize> = (0..model.shift.len()).collect();
        let left = rows.par_iter().zip(&self.observations).map(|(rows, each)| {
            let local = model.local(rows, &places, each.setup.commanded_rad.as_slice());
            ReadingResidual::of_rows(&local.left)
        });
        let logarithms = (0..covariance.nrows())
            .filter(|&index| independent.standard_error(index).is_some())
            .map(|index| {
                (independent.covariance[(index, index)] / covariance[(index, index)]).ln()
            });
        let logarithms: Vec<f64> = logarithms.filter(|each| each.is_finite()).collect();
        let ratio = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        Unexplained {
            left: left.collect(),
            model,
            covariance: symmetric(covariance),
            degrees,
            visits: self.visits.len(),
            effective_sample_size: self.visits.len() as f64 * ratio.exp().min(1.0),
            predicted_by_others: [None; 2],
        }
    }
}
