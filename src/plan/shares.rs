//! The uncertainty budget of a predicted accuracy: the contributions of the instrument's noise, of each error source, and of
//! the prior.
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
//! All shares are those of the one gain, so that their squares add up to the square of the whole.

use nalgebra::{DMatrix, Matrix6, Matrix6xX};

use super::{ExperimentModel, Plan, alone_and_together, hung};
use crate::compensation::{test_pose_rows, weighted_rows};
use crate::numeric::posterior::Posterior;
use crate::parameter::{ParameterKind, counted_times};
use crate::task::{Extended, Task};

/// What the instrument's own noise is called.
pub const NOISE: &str = "noise";
/// What an earlier identification is called.
pub const EARLIER: &str = "earlier identification";

/// A part of a predicted rms distance.
#[derive(Debug, Clone, PartialEq)]
pub struct PromiseShare {
    /// What leaves it.
    pub name: String,
    /// What it alone leaves (m); the squares of all add up to that of the whole.
    pub rho0_m: f64,
    /// What its parameters do not move, where the name might be read otherwise.
    pub remark: Option<&'static str>,
}

/// The remark on a source with these parameters of the extended vector.
#[must_use]
pub(crate) fn remark(extended: &Extended, places: &[usize]) -> Option<&'static str> {
    let first = extended.set().parameters().get(*places.first()?)?.kind;
    let is_of_the_only_tool = extended.machining_tool() == 0
        && matches!(
            first,
            ParameterKind::ToolPosition { .. } | ParameterKind::ToolRotation { .. }
        );
    first.remark().filter(|_| !is_of_the_only_tool)
}

/// The shares of a plan's promise for a task, with what is known after the plan, which must determine the test
/// poses: the noise, the earlier identification where there is one, then the uncertainties.
#[must_use]
pub fn shares(task: &Task, plan: &Plan, posterior: &Posterior) -> Vec<PromiseShare> {
    let belief = &task.belief;
    let rows = weighted_rows(&task.test_poses, belief.unknowns(), &|pose| {
        test_pose_rows(belief, pose)
    });
    let gain = rows * &posterior.covariance;
    let square = |matrix: &DMatrix<f64>| (&gain * matrix * gain.transpose()).trace().max(0.0);
    let share = |name: &str, square: f64| PromiseShare {
        name: name.to_owned(),
        rho0_m: square.sqrt(),
        remark: None,
    };
    let sigma_m = belief.instrument.sigma_m;
    let Some(extended) = &belief.uncertain else {
        let information = ExperimentModel::new(belief).information(plan) / sigma_m.powi(2);
        let mut shares = vec![share(NOISE, square(&information))];
        if let Some(prior) = &belief.prior {
            shares.push(share(EARLIER, square(&prior.precision)));
        }
        return shares;
    };
    // The instrument's noise, then each source.
    let names: Vec<&str> = extended.sources().map(|(name, _)| name).collect();
    let mut squares = vec![0.0; 1 + names.len()];
    let size = belief.unknowns();
    let precision = belief.instrument.precision();
    let rows = precision.rows();
    let own = |matrix: &Matrix6<f64>| matrix.view((0, 0), (rows, rows)).into_owned();
    let noise = own(&precision.covariance());
    let mut model = extended.readings_of_all(precision);
    let mut derivatives = Matrix6xX::zeros(size);
    let (alone, together) = alone_and_together(plan, extended.is_shared_by_configuration());
    for experiments in together {
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
    for experiment in alone {
        let load = &experiment.load;
        model.set_repeats(experiment.repeats);
        model.come_from(experiment.approach.as_ref());
        model.move_to(experiment.configuration_rad.as_slice());
        model.derivatives(load, &mut derivatives);
        // Repeats may share a part of the noise, too.
        let times = counted_times(
            extended.unloaded().shared_part(),
            f64::from(experiment.repeats),
        );
        let noise = &noise * times;
        let covariance = &noise + own(&model.covariance_of_all(load));
        let Some(inverse) = covariance.cholesky().map(|factor| factor.inverse()) else {
            continue;
        };
        let weighted = &gain
            * derivatives.rows(0, rows).transpose()
            * inverse
            * f64::from(experiment.repeats).sqrt();
        let added = |covariance: &DMatrix<f64>| (&weighted * covariance).dot(&weighted);
        squares[0] += added(&noise);
        for (source, square) in squares[1..].iter_mut().enumerate() {
            *square += added(&own(&model.covariance_of(source, load)));
        }
    }
    let mut shares = vec![share(NOISE, squares[0])];
    if let Some(prior) = &belief.prior {
        let own = gain.columns(0, extended.identified());
        shares.push(share(
            EARLIER,
            (own * &prior.precision * own.transpose()).trace(),
        ));
    }
    shares.extend((names.iter().zip(&squares[1..])).map(|(name, square)| share(name, *square)));
    for (name, places) in extended.shared() {
        let square = places.iter().map(|&place| {
            let precision = extended.own_precision(place);
            gain.column(place).norm_squared() * precision
        });
        shares.push(PromiseShare {
            remark: remark(extended, places),
            ..share(name, square.sum())
        });
    }
    shares
}
