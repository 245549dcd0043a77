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

use nalgebra::DMatrix;

use super::uncertainty_budget::{BudgetSource, Input, UncertaintyBudget};
use super::{ExperimentModel, Plan, alone_and_together, hung, quantile95_m};
use crate::compensation::{test_pose_rows, weighted_rows};
use crate::numeric::posterior::Posterior;
use crate::task::{Instrument, Task};

impl UncertaintyBudget {
    /// That of a plan of deflections for a task, with what is known after it; `None` where that does not determine the test poses.
    pub fn of_deflections(task: &Task, plan: &Plan, posterior: &Posterior) -> Option<Self> {
        let radius95_m = quantile95_m(task, posterior)?;
        Some(Self::new(sources(task, plan, posterior), Some(radius95_m)))
    }
}

/// u(x) of the noise of deflections, where one number says it.
fn of_instrument(instrument: &Instrument) -> Option<Input> {
    (instrument.rotation_sigma_rad.is_none()).then_some((instrument.sigma_m, "m"))
}

/// The noise, the earlier identification where there is one, then the uncertainties.
fn sources(task: &Task, plan: &Plan, posterior: &Posterior) -> Vec<BudgetSource> {
    let belief = &task.belief;
    let rows = weighted_rows(&task.test_poses, belief.unknowns(), &|pose| {
        test_pose_rows(belief, pose)
    });
    let gain = rows * &posterior.covariance;
    let square = |matrix: &DMatrix<f64>| (&gain * matrix * gain.transpose()).trace().max(0.0);
    let noise_of = |square| {
        let instrument = &belief.instrument;
        BudgetSource::of_noise(instrument, of_instrument(instrument), square)
    };
    let earlier = |square| {
        let campaign = belief.prior_campaign.as_ref();
        BudgetSource::earlier(square, campaign.and_then(|each| each.degrees_of_freedom))
    };
    let sigma_m = belief.instrument.sigma_m;
    let Some(extended) = &belief.uncertain else {
        let information = ExperimentModel::new(belief).information(plan) / sigma_m.powi(2);
        let prior = belief.prior.as_ref();
        let earlier = prior.map(|prior| earlier(square(&prior.precision)));
        return [noise_of(square(&information))]
            .into_iter()
            .chain(earlier)
            .collect();
    };
    // The instrument's noise, then each source.
    let mut squares = vec![0.0; 1 + extended.sources().count()];
    let precision = belief.instrument.precision();
    let rows = precision.rows();
    let mut model = extended.readings_of_all(precision);
    let (alone, together) = alone_and_together(plan, extended.is_shared_by_configuration());
    let alone = alone.into_iter().map(|experiment| vec![experiment]);
    for experiments in together.into_iter().chain(alone) {
        model.come_from(experiments[0].approach.as_ref());
        model.move_to(experiments[0].configuration_rad.as_slice());
        let hung = hung(&experiments);
        let covariance = model.covariance_together(&hung);
        let Some(inverse) = covariance.all().cholesky().map(|factor| factor.inverse()) else {
            continue;
        };
        let mut seen = model.derivatives_together(&hung);
        for (place, (_, repeats)) in hung.iter().enumerate() {
            seen.rows_mut(rows * place, rows)
                .scale_mut(f64::from(*repeats).sqrt());
        }
        let weighted = &gain * seen.transpose() * inverse;
        let added = |covariance: &DMatrix<f64>| (&weighted * covariance).dot(&weighted);
        squares[0] += added(&covariance.noise);
        for (square, source) in squares[1..].iter_mut().zip(&covariance.sources) {
            *square += added(source);
        }
    }
    let mut sources = vec![noise_of(squares[0])];
    if let Some(prior) = &belief.prior {
        let own = gain.columns(0, extended.identified());
        let square = (own * &prior.precision * own.transpose()).trace();
        sources.push(earlier(square));
    }
    let of_readings = extended.sources().zip(&squares[1..]);
    sources.extend(of_readings.map(|((name, source), square)| {
        BudgetSource::of_readings(name, source, extended, *square)
    }));
    for (name, places) in extended.shared() {
        let square =
            |&place: &usize| gain.column(place).norm_squared() * extended.own_precision(place);
        let square = places.iter().map(square).sum();
        sources.push(BudgetSource::of_parameters(name, extended, places, square));
    }
    sources
}
