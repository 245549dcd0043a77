//! The contributions to a predicted accuracy: of the instrument's noise, of each error source, and of the prior.
//!
//! With the information M of the extended vector and the rows C of the test poses, the estimate errs by the gain
//! K = C M^-1, from readings with noise e_s of each source s and covariance R = sum R_s, and from a prior's mean
//! that errs by d:
//!
//! ```text
//! C (x^ - x) = K (sum J^T R^-1 (e_1 + e_2 + ...) - M_0 d)
//! rho_0^2    = sum_s trace(K (sum J^T R^-1 R_s R^-1 J) K^T) + trace(K M_0 K^T) = trace(C M^-1 C^T)
//! ```
//!
//! All are those of the one gain, so that their squares add up to the square of the whole.

use std::iter::repeat;

use nalgebra::DMatrix;

use super::uncertainty_budget::{Squares, UncertaintyBudget, common};
use super::{
    Experiment, ExperimentModel, Plan, as_repeats, posterior, quantile95_m, rho0_m, sharing_groups,
    task_rows,
};
use crate::numeric::posterior::Posterior;
use crate::observation::{CovarianceTogether, PlannedReadings};
use crate::task::Task;
use crate::text::wording::significant;

impl UncertaintyBudget {
    /// That of a plan of deflections for a task, with what is known after it; `None` where that does not determine the test poses.
    pub fn of_deflections(task: &Task, plan: &Plan, posterior: &Posterior) -> Option<Self> {
        let radius95_m = quantile95_m(task, posterior)?;
        let mut budget = squares(task, plan, posterior).budget(&task.belief, Some(radius95_m));
        let noise = &mut budget.sources[0];
        if noise.standard_uncertainty.is_none() {
            let shown = |value: f64| format!("{} mm", significant(value * 1e3, 3));
            let both = task.belief.instrument.both_sigmas(shown);
            noise.remark = both.map(|both| format!("is {both}"));
        }
        Some(budget)
    }
}

/// The share of each group of uncertain parameters, in the order of the belief, of the square of what a plan of deflections predicts;
/// `None` where it does not determine the test poses.
pub(super) fn parameter_shares(task: &Task, plan: &Plan) -> Option<Vec<f64>> {
    let posterior = posterior(&task.belief, plan);
    let whole = rho0_m(task, &posterior)?.powi(2);
    let parameters = squares(task, plan, &posterior).parameters.into_iter();
    Some(parameters.map(|square| square / whole).collect())
}

fn squares(task: &Task, plan: &Plan, posterior: &Posterior) -> Squares {
    let belief = &task.belief;
    let extended = &belief.uncertain;
    let gain = task_rows(task) * &posterior.covariance;
    let (noise, readings) = left_by_readings(
        task,
        (plan, belief.is_shared_by_configuration()),
        &gain,
        |_, believed| believed,
    );
    let instrument = &belief.instrument;
    let is_of_positions = instrument.rotation_sigma_rad.is_none();
    let input = common(plan.experiments.iter().map(|each| match each.direction {
        Some(_) => (instrument.along_sigma_m(), "m"),
        None => (instrument.sigma_m, "m"),
    }));
    let before = || (&gain * belief.uncertain.earlier() * gain.transpose()).trace();
    let of_groups = extended.shared().iter();
    let of_group = |places: &Vec<usize>| -> f64 {
        let known = |place| extended.own_precision(place);
        let places = places.iter();
        places
            .map(|&place| gain.column(place).norm_squared() * known(place))
            .sum()
    };
    Squares {
        noise: (input.filter(|_| is_of_positions), noise),
        before: belief.prior.as_ref().map(|_| before()),
        readings: (extended.sources())
            .map(|(_, source)| source.level())
            .zip(readings.into_iter().chain(repeat(0.0)))
            .collect(),
        parameters: of_groups.map(|(_, places)| of_group(places)).collect(),
    }
}

/// What the noise of readings, and what each source of errors adds to it, leave (m^2) with a gain K of the belief, where deflections of
/// one configuration may share errors; their covariance in truth follows from that which is believed.
pub fn left_by_readings(
    task: &Task,
    (plan, is_shared): (&Plan, bool),
    gain: &DMatrix<f64>,
    in_truth: impl Fn(&[&Experiment], CovarianceTogether) -> CovarianceTogether,
) -> (f64, Vec<f64>) {
    let experiments = ExperimentModel::new(&task.belief);
    let plan = &*as_repeats(plan, &task.belief.uncertain);
    let mut model = experiments.readings();
    let (mut noise, mut of_sources) = (0.0, Vec::new());
    for group in sharing_groups(plan, is_shared) {
        let Some((weights, believed)) = weights_of_readings(gain, &mut model, &group) else {
            continue;
        };
        let left_by = |covariance: &DMatrix<f64>| (&weights * covariance).dot(&weights);
        let covariance = in_truth(&group, believed);
        noise += left_by(&covariance.noise);
        of_sources.resize(covariance.sources.len(), 0.0);
        for (sum, source) in of_sources.iter_mut().zip(&covariance.sources) {
            *sum += left_by(source);
        }
    }
    (noise, of_sources)
}

/// K J^T R^-1 of the readings of experiments of one configuration with a gain K, and R as it is believed; none where that is singular.
fn weights_of_readings(
    gain: &DMatrix<f64>,
    model: &mut PlannedReadings<'_>,
    experiments: &[&Experiment],
) -> Option<(DMatrix<f64>, CovarianceTogether)> {
    model.stand_at(experiments[0]);
    let covariance = model.covariance_together(experiments);
    let inverse = covariance.all().cholesky()?.inverse();
    let mut seen = model.derivatives_together(experiments);
    let rows = model.rows();
    for (place, experiment) in experiments.iter().enumerate() {
        let mut own = seen.rows_mut(rows * place, rows);
        own *= f64::from(experiment.repeats).sqrt();
    }
    Some((gain * seen.transpose() * inverse, covariance))
}
