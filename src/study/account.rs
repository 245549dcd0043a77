//! The contributions to a plan's errors in the simulated truth, hidden ones included, beside the predicted accuracy.
//!
//! The gain K = C M^-1 is the belief's. With the true covariance of a source's part of a reading, `R_s`, the true
//! deviation d of a parameter that the belief knows of, and that of one that it does not, with the derivatives
//! Z of readings and `C_h` of the test poses by it, one standard deviation of each leaves
//!
//! ```text
//! trace(K (sum J^T R^-1 R_s R^-1 J) K^T),    |K M_0 d|^2,    |(K sum J^T R^-1 Z - C_h) d|^2
//! ```
//!
//! Nothing is hidden if these are the contributions of the [uncertainty budget](crate::plan::UncertaintyBudget).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::deviations::Deviations;
use super::runner::PlanInStudy;
use super::{TakenPlan, TakenReadings, summary::Measured, verdict::Kept};
use crate::parameter::{ParameterKind, Source, Uncertainty};
use crate::plan::absolute::PredictedAccuracy;
use crate::plan::{
    EARLIER, ExperimentModel, NOISE, Plan, as_repeats, left_by_readings, posterior, quantile95_m,
    sharing_groups, task_rows,
};
use crate::task::Task;
use crate::testbed::Truth;
use crate::text::wording::in_um;

/// The contribution of a source to the errors of the simulated truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Contribution {
    /// Its name: "noise", "earlier identification", "true robot", or that of an uncertainty.
    pub source: String,
    /// Whether the planner's model does not know of it.
    pub hidden: bool,
    /// The contribution `u_i` (um), to first order, rms over the test poses; none where it was not computed.
    pub contribution_um: Option<f64>,
}

impl Contribution {
    fn new(source: &str, hidden: bool, contribution_m: Option<f64>) -> Self {
        Self {
            source: source.to_owned(),
            hidden,
            contribution_um: contribution_m.map(|m| m * 1e6),
        }
    }

    /// Its share of the variance of all; none where it was not computed.
    pub fn share_of(&self, all: &[Self]) -> Option<f64> {
        let total: f64 = all.iter().filter_map(Self::square_um2).sum();
        Some(self.square_um2()? / total)
    }

    fn or_zero_um(&self) -> f64 {
        self.contribution_um.unwrap_or(0.0)
    }

    fn square_um2(&self) -> Option<f64> {
        self.contribution_um.map(|um| um.powi(2))
    }
}

/// What is predicted, and what is to be expected in truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Account {
    /// The belief's prediction `rho_0` (m).
    pub predicted_m: f64,
    /// What the errors are made of, to first order.
    pub parts: Vec<Contribution>,
}

impl Account {
    /// What an observed rms distance (m) of so many runs says of the prediction, in words.
    pub fn verdict(&self, observed_m: Measured, runs: u64, failed_share: f64) -> String {
        let ratio = observed_m.value / self.predicted_m;
        match Kept::of(self.predicted_m, observed_m, runs, failed_share) {
            Kept::Undecided => {
                return format!(
                    "undecided: {:.1} % of the runs failed, and the others are no sample of what is predicted",
                    failed_share * 100.0
                );
            }
            Kept::Holds => return "holds".to_owned(),
            Kept::Conservative => return format!("conservative: {ratio:.3} of what is predicted"),
            Kept::Exceeded => {}
        }
        let hidden = self.parts.iter().filter(|part| part.hidden);
        let worst = hidden.max_by(|one, other| one.or_zero_um().total_cmp(&other.or_zero_um()));
        let why = match worst {
            Some(part) if part.or_zero_um() > 0.0 => format!(
                "; the largest hidden contribution is {:?}, {} um",
                part.source,
                in_um(part.or_zero_um() * 1e-6, 3)
            ),
            // What it leaves was not computed, or is no first order.
            Some(part) => format!("; {:?} is hidden", part.source),
            None => ", though nothing is hidden: the model is not linear enough".to_owned(),
        };
        format!("exceeded: {ratio:.3} times what is predicted{why}")
    }

    /// The account of a plan of a study, of absolute readings with what it predicts; `None` where every run has a plan of its own,
    /// or where the plan does not determine what the test poses need.
    pub fn of_plan(plan: PlanInStudy<'_>) -> Option<Self> {
        let (task, truth) = (&plan.setting.task, plan.setting.truth);
        match plan.entry.plan.as_ref()? {
            TakenPlan::Deflections(plan) => Self::new(task, truth, plan),
            TakenPlan::Readings(readings) => {
                Self::of_readings(task, truth, readings, plan.prediction?)
            }
        }
    }

    fn of_readings(
        task: &Task,
        truth: &Truth,
        readings: &TakenReadings<'_>,
        prediction: &PredictedAccuracy,
    ) -> Option<Self> {
        let (planning, plan) = (&readings.planning, &readings.plan);
        let believed = planning.uncertainty_budget(plan, prediction)?.sources;
        let hidden: Vec<&Uncertainty> = (truth.uncertainties.iter())
            .filter(|each| each.is_hidden || task.belief.uncertain.is_plain())
            .collect();
        let left_m = planning.left_by_hidden(task, plan, prediction, &hidden);
        let believed = (believed.iter()).map(|each| Contribution {
            source: each.source.clone(),
            hidden: false,
            contribution_um: Some(each.contribution_um),
        });
        let hidden = hidden.iter().zip(left_m);
        let hidden = hidden.map(|(each, rms_m)| Contribution::new(&each.name, true, rms_m));
        let mut parts: Vec<Contribution> = believed.chain(hidden).collect();
        for name in planning.places_of_loads() {
            parts.retain(|part| part.source != name);
            parts.push(Contribution::new(name, true, None));
        }
        // How much a robot of another kind leaves is not computed.
        let nominal = &task.belief.nominal;
        let is_found = |joint: usize| {
            let kind = ParameterKind::JointCompliance { joint };
            let mut parameters = planning.set().parameters().iter();
            parameters.any(|each| each.kind == kind && each.prior_deviation.is_none())
        };
        let softer = (truth.robot.compliance_rad_per_nm.iter())
            .zip(&nominal.compliance_rad_per_nm)
            .enumerate()
            .any(|(joint, (own, believed))| (own - believed).abs() > 0.0 && !is_found(joint));
        let is_another = softer
            || !truth.robot.torque_laws.is_empty()
            || truth.robot.model.path() != nominal.model.path();
        if is_another {
            parts.push(Contribution::new("true robot", true, None));
        }
        Some(Self {
            predicted_m: prediction.rho0_m()?,
            parts,
        })
    }

    /// The account of a plan; `None` where it does not determine what the test poses need.
    pub fn new(task: &Task, truth: &Truth, plan: &Plan) -> Option<Self> {
        let belief = &task.belief;
        let posterior = posterior(belief, plan);
        let rows = task_rows(task);
        let predicted_m = posterior.variance_of(&rows).ok()?.sqrt();
        let gain = &rows * &posterior.covariance;
        let deviations = Deviations::new(belief, truth);
        let bias = bias(task, &deviations, plan, &gain);
        // What one unit of a parameter leaves; nothing where it does not differ, or nothing is known of it before.
        let left_by_one = |kind: ParameterKind| {
            let column = deviations
                .column(kind)
                .map(|column| bias.column(column).into_owned());
            column.unwrap_or_else(|| DVector::zeros(bias.nrows()))
        };
        let plan = (plan, deviations.is_shared_by_configuration());
        let (noise, of_sources) =
            left_by_readings(task, plan, &gain, |group, _| deviations.covariance(group));
        let part = |name: &str, is_hidden, square: f64| {
            Contribution::new(name, is_hidden, Some(square.max(0.0).sqrt()))
        };
        let mut parts = vec![part(NOISE, false, noise)];
        if belief.prior.is_some() {
            let square = earlier(task, truth, &gain, left_by_one);
            parts.push(part(EARLIER, false, square));
        }
        let mut of_sources = of_sources.into_iter();
        for each in &truth.uncertainties {
            let square = match &each.source {
                Source::Reading(_) => of_sources.next().unwrap_or(0.0),
                Source::Plan(parameters) => {
                    let own = parameters.iter().map(|&(kind, deviation)| {
                        let deviation = deviations.in_units(kind, deviation);
                        left_by_one(kind).norm_squared() * deviation.powi(2)
                    });
                    own.sum::<f64>() + with_earlier(task, truth, &gain, &each.name)
                }
            };
            // A belief in noise alone knows of none.
            let is_hidden = each.is_hidden || belief.uncertain.is_plain();
            parts.push(part(&each.name, is_hidden, square));
        }
        // Compliances that the scenario says to be others than believed.
        let told = deviations.told(truth);
        if told.iter().any(|(_, value)| *value != 0.0) {
            let mut effect = DVector::zeros(bias.nrows());
            for (column, value) in told {
                effect.axpy(value, &bias.column(column), 1.0);
            }
            parts.push(part("true robot", true, effect.norm_squared()));
        } else if truth.robot.model.path() != belief.nominal.model.path() {
            // How much a robot of another model leaves is not computed.
            parts.push(Contribution::new("true robot", true, None));
        }
        if let Some(column) = deviations.torque_laws() {
            let square = bias.column(column).norm_squared();
            parts.push(part("torque_law", true, square));
        }
        Some(Self { predicted_m, parts })
    }
}

/// What one unit of each parameter that differs leaves (m) with a gain K, for those that the belief does not have and for the others:
/// K sum J^T R^-1 Z - `C_h`, and -K `M_0`.
fn bias(
    task: &Task,
    deviations: &Deviations<'_>,
    plan: &Plan,
    gain: &DMatrix<f64>,
) -> DMatrix<f64> {
    let belief = &task.belief;
    let model = ExperimentModel::new(belief);
    let plan = &*as_repeats(plan, &belief.uncertain);
    let mut planned = model.readings();
    let mut foreign = -deviations.test_poses(task);
    for group in sharing_groups(plan, deviations.is_shared_by_configuration()) {
        let seen = deviations.observation_matrices(&model, &group);
        let matrices = model.observation_matrices_of(&mut planned, &group);
        for ((each, matrix), seen) in group.iter().zip(matrices).zip(seen) {
            let told = matrix.tr_mul(&seen) * f64::from(each.repeats);
            foreign += gain * told / belief.instrument.sigma_m.powi(2);
        }
    }
    let pulled = -(gain * belief.precision().select_columns(&deviations.tied()));
    let (first, count) = (foreign.ncols(), pulled.ncols());
    let mut all = foreign.resize_horizontally(first + count, 0.0);
    all.columns_mut(first, count).copy_from(&pulled);
    all
}

/// What an earlier identification's errors leave (m^2) with a gain K, and with what one unit of a parameter leaves.
fn earlier(
    task: &Task,
    truth: &Truth,
    gain: &DMatrix<f64>,
    left_by_one: impl Fn(ParameterKind) -> DVector<f64>,
) -> f64 {
    let belief = &task.belief;
    let Some(drawn) = (truth.earlier.as_ref()).filter(|drawn| !drawn.joints.is_empty()) else {
        return (gain * belief.uncertain.earlier() * gain.transpose()).trace();
    };
    let joints = drawn.joints.iter();
    let compliances = joints.map(|&joint| ParameterKind::JointCompliance { joint });
    let effects = compliances
        .chain(drawn.kept.iter().copied())
        .map(left_by_one);
    let effects: Vec<DVector<f64>> = effects.collect();
    let left = DMatrix::from_columns(&effects) * &drawn.spread;
    let sources = truth.uncertainties.iter();
    let others: f64 = (sources.map(|each| with_earlier(task, truth, gain, &each.name))).sum();
    left.norm_squared() - others
}

/// The part of it that a source of compliances leaves of which an earlier identification tells, too: runs sample these once, from
/// both.
fn with_earlier(task: &Task, truth: &Truth, gain: &DMatrix<f64>, name: &str) -> f64 {
    let extended = &task.belief.uncertain;
    if truth.earlier.is_none() {
        return 0.0;
    }
    let own = |&place: &usize| gain.column(place).norm_squared() * extended.own_precision(place);
    let of_source = extended.shared().iter().filter(|(each, _)| each == name);
    let places = of_source.flat_map(|(_, places)| places);
    places
        .filter(|place| **place < extended.identified())
        .map(own)
        .sum()
}

/// The distance (m) that a plan of a study predicts 95 % of the runs to stay below; `None` as of its account.
pub fn predicted_quantile95_m(plan: PlanInStudy<'_>) -> Option<f64> {
    let task = &plan.setting.task;
    match plan.entry.plan.as_ref()? {
        TakenPlan::Deflections(plan) => quantile95_m(task, &posterior(&task.belief, plan)),
        TakenPlan::Readings(_) => plan.prediction?.quantile95_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn account() -> Account {
        Account {
            predicted_m: 6e-6,
            parts: vec![
                Contribution::new("noise", false, Some(6e-6)),
                Contribution::new("scale", true, Some(8e-6)),
                Contribution::new("offset", true, Some(1e-6)),
                Contribution::new("true robot", true, None),
            ],
        }
    }

    #[test]
    fn verdicts_name_what_breaks_a_prediction() {
        let account = account();
        let said = |value, standard_error| {
            let observed = Measured {
                value,
                standard_error,
            };
            account.verdict(observed, 1000, 0.0)
        };
        assert_eq!(said(6.1e-6, 1e-9), "holds");
        assert_eq!(said(6.4e-6, 1e-7), "holds");
        assert!(said(5.5e-6, 1e-8).starts_with("conservative: 0.917"));
        let broken = said(1e-5, 1e-7);
        assert!(
            broken.contains("1.667 times") && broken.contains("\"scale\""),
            "{broken}"
        );
    }

    #[test]
    fn an_account_comes_back_from_its_text() {
        let text = serde_json::to_string(&account()).expect("JSON");
        let read: Account = serde_json::from_str(&text).expect("an account");
        assert_eq!(read, account());
    }
}
