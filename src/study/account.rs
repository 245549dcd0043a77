//! What a plan's errors are made of in truth, whatever the belief knows of it, beside what the belief promises.
//!
//! The gain K = C M^-1 is the belief's. With the true covariance of a source's part of a reading, `R_s`, the true
//! deviation d of a parameter that the belief knows of, and that of one that it does not, with the derivatives
//! Z of readings and `C_h` of the test poses by it, one standard deviation of each leaves
//!
//! ```text
//! trace(K (sum J^T R^-1 R_s R^-1 J) K^T),    |K M_0 d|^2,    |(K sum J^T R^-1 Z - C_h) d|^2
//! ```
//!
//! Nothing is hidden if these are the shares of the promise ([`crate::plan::shares`]).

use nalgebra::{Cholesky, DMatrix};

use super::absolute::AbsoluteEntry;
use super::deviations::{Deviations, by_repeats};
use crate::compensation::{test_pose_rows, weighted_rows};
use crate::parameter::{ParameterKind, ReadingSource, Source, Uncertainty};
use crate::plan::absolute::AbsolutePromise;
use crate::plan::{
    EARLIER, Experiment, ExperimentModel, NOISE, Plan, PromiseShare, alone_and_together, posterior,
};
use crate::task::Task;
use crate::testbed::Truth;

/// A part of the errors.
#[derive(Debug, Clone, PartialEq)]
pub struct AccountPart {
    /// What leaves it.
    pub name: String,
    /// Whether the belief does not know of it.
    pub is_hidden: bool,
    /// What it alone leaves, rms over the test poses (m).
    pub rms_m: f64,
}

/// What is promised, and what is to be expected in truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Account {
    /// The belief's promise `rho_0` (m).
    pub promised_m: f64,
    /// What the errors are made of, to first order.
    pub parts: Vec<AccountPart>,
}

impl Account {
    /// The rms distance that is to be expected (m).
    #[must_use]
    pub fn expected_m(&self) -> f64 {
        let squares = self.parts.iter().map(|part| part.rms_m * part.rms_m);
        squares.sum::<f64>().sqrt()
    }

    /// The account of a plan of absolute readings; `None` where it promises nothing.
    #[must_use]
    pub fn of_absolute(
        task: &Task,
        truth: &Truth,
        entry: &AbsoluteEntry<'_>,
        promise: &AbsolutePromise,
    ) -> Option<Self> {
        let (planning, plan) = (&entry.planning, &entry.plan);
        let believed = planning.shares(plan, promise).into_iter();
        let hidden: Vec<&Uncertainty> = (truth.uncertainties.iter())
            .filter(|each| each.is_hidden || task.belief.uncertain.is_none())
            .collect();
        let hidden = planning.left_by_hidden(task, (plan, promise), &hidden);
        let part = |is_hidden| {
            move |share: PromiseShare| AccountPart {
                name: share.name,
                is_hidden,
                rms_m: share.rho0_m,
            }
        };
        let mut parts: Vec<AccountPart> = believed
            .map(part(false))
            .chain(hidden.into_iter().map(part(true)))
            .collect();
        // How much a robot of another kind leaves is not computed.
        let nominal = &task.belief.nominal;
        let is_found = |joint: usize| {
            let kind = ParameterKind::JointCompliance { joint };
            planning.set().index_of(kind).is_some()
        };
        let softer = (truth.robot.compliance_rad_per_nm.iter())
            .zip(&nominal.compliance_rad_per_nm)
            .enumerate()
            .any(|(joint, (own, believed))| (own - believed).abs() > 0.0 && !is_found(joint));
        let is_another = softer
            || !truth.robot.torque_laws.is_empty()
            || truth.robot.model.path() != nominal.model.path();
        if is_another {
            parts.push(AccountPart {
                name: "true robot".to_owned(),
                is_hidden: true,
                rms_m: 0.0,
            });
        }
        Some(Self {
            promised_m: promise.rho0_m()?,
            parts,
        })
    }

    /// The account of a plan; `None` where it does not determine what the test poses need.
    #[must_use]
    pub fn new(task: &Task, truth: &Truth, plan: &Plan) -> Option<Self> {
        let belief = &task.belief;
        let posterior = posterior(belief, plan);
        let rows = weighted_rows(&task.test_poses, belief.unknowns(), &|pose| {
            test_pose_rows(belief, pose)
        });
        let promised_m = posterior.variance_of(&rows).ok()?.sqrt();
        let gain = &rows * &posterior.covariance;
        let deviations = Deviations::new(belief, truth);
        let model = ExperimentModel::new(belief);
        let sigma_m = belief.instrument.sigma_m;

        let readings = deviations.readings();
        let mut noise = 0.0;
        let mut of_sources = vec![0.0; readings.len()];
        let mut foreign = -deviations.test_poses(task);
        let is_shared = deviations.is_shared_by_configuration();
        let (alone, together) = alone_and_together(plan, is_shared);
        let groups = alone.into_iter().map(|only| vec![only]).chain(together);
        for group in groups {
            let matrices = model.observation_matrices_of(&group);
            let rows = model.rows();
            let mut weighted = DMatrix::zeros(gain.nrows(), rows * group.len());
            let seen = deviations.observation_matrices(&model, &group);
            for (place, (matrix, seen)) in matrices.iter().zip(seen).enumerate() {
                let own = &gain * matrix.transpose() / sigma_m.powi(2);
                foreign += &own * seen * f64::from(group[place].repeats);
                weighted.columns_mut(rows * place, rows).copy_from(&own);
            }
            let covariances = deviations.covariances(&group);
            let believed = Cholesky::new(covariances.believed)?.l().try_inverse()?;
            let believed = by_repeats(&group, believed, |one, other| (one / other).sqrt());
            // K J^T R^-1: from weighted rows, sigma L^-1 J, to readings.
            let weighted = weighted * (believed * sigma_m);
            let repeats = f64::from(group[0].repeats);
            let added = |covariance: DMatrix<f64>| {
                let all = by_repeats(&group, covariance, |one, other| {
                    (one * other).sqrt() / repeats
                });
                (&weighted * all).dot(&weighted) * repeats
            };
            noise += added(covariances.noise);
            for (sum, covariance) in of_sources.iter_mut().zip(covariances.sources) {
                *sum += added(covariance);
            }
        }

        let part = |name: &str, is_hidden, square: f64| AccountPart {
            name: name.to_owned(),
            is_hidden,
            rms_m: square.max(0.0).sqrt(),
        };
        let mut parts = vec![part(NOISE, false, noise)];
        if let Some(prior) = &belief.prior {
            let own = gain.columns(0, belief.parameters.len());
            let square = (own * &prior.precision * own.transpose()).trace();
            parts.push(part(EARLIER, false, square));
        }
        let precision = belief.precision();
        let mut next_source = 0;
        for each in &truth.uncertainties {
            let square = match &each.source {
                Source::Reading(ReadingSource::Dropped(share)) => {
                    next_source += 1;
                    share * of_dropped(task, plan, &rows, promised_m.powi(2))
                }
                Source::Reading(_) => {
                    next_source += 1;
                    of_sources[next_source - 1]
                }
                Source::Plan(parameters) => (parameters.iter())
                    .map(|&(kind, deviation)| {
                        let effect = match deviations.place(kind) {
                            Some(place) => &gain * precision.column(place),
                            None => foreign.column(deviations.foreign_place(kind)?).into_owned(),
                        };
                        Some(effect.norm_squared() * deviations.in_units(kind, deviation).powi(2))
                    })
                    .sum::<Option<f64>>()
                    .unwrap_or(0.0),
            };
            // A belief in noise alone knows of none.
            let is_hidden = each.is_hidden || belief.uncertain.is_none();
            parts.push(part(&each.name, is_hidden, square));
        }
        // Compliances that the scenario says to be others than believed.
        let told = deviations.told(truth);
        if told.iter().any(|(_, value)| *value != 0.0) {
            let mut effect = nalgebra::DVector::zeros(foreign.nrows());
            for (place, value) in told {
                effect.axpy(value, &foreign.column(place), 1.0);
            }
            parts.push(part("true robot", true, effect.norm_squared()));
        }
        if let Some(place) = deviations.torque_laws() {
            parts.push(part(
                "torque_law",
                true,
                foreign.column(place).norm_squared(),
            ));
        }
        Some(Self { promised_m, parts })
    }
}

/// What each share of dropped readings adds to the square of a promise (m^2): every reading is missing alone, which is all to
/// first order in the share. Where the rest does not determine what the test poses need, the run fails.
fn of_dropped(task: &Task, plan: &Plan, rows: &DMatrix<f64>, promised_m2: f64) -> f64 {
    let without = |index: usize| {
        let mut experiments: Vec<Experiment> = plan.experiments.clone();
        experiments[index].repeats -= 1;
        experiments.retain(|experiment| experiment.repeats > 0);
        let known = posterior(&task.belief, &Plan { experiments });
        let more = known.variance_of(rows).ok()? - promised_m2;
        Some(more * f64::from(plan.experiments[index].repeats))
    };
    (0..plan.experiments.len()).filter_map(without).sum()
}

impl Deviations<'_> {
    /// A standard deviation of a parameter in the unit of its column: compliances that are identified are linear.
    fn in_units(&self, kind: ParameterKind, deviation: f64) -> f64 {
        let is_compliance = matches!(kind, ParameterKind::JointCompliance { .. });
        if self.is_logarithmic(kind) || (self.place(kind).is_none() && !is_compliance) {
            deviation
        } else {
            deviation * self.whole(kind)
        }
    }
}
