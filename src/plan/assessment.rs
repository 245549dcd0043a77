//! The assessment of a plan: predicted accuracy at the test poses, standard errors, criteria, violations.

use clap::ValueEnum;

use super::conditions::{conditions, less_than_nominal};
use super::search::{Bound, NoBound, PlanBound, Problem};
use super::{
    Criterion, Feasibility, Plan, UncertaintyBudget, Violation, posterior, quantile95_m, rho0_m,
};
use crate::codes::{Condition, ConditionCode};
use crate::numeric::posterior::Posterior;
use crate::task::{Belief, Task};
use crate::text::wording::counted;

/// A plan judged against a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// The number m of measurements.
    pub experiments: u32,
    /// The predicted rms distance `rho_0` over the test poses (m), eq. 20; `None` where the
    /// compensation needs a compliance that the plan does not determine.
    pub rho0_m: Option<f64>,
    /// The distance (m) that 95 % of the draws of what is uncertain stay below, see [`quantile95_m`]; `None` where there is
    /// no `rho_0`.
    pub quantile95_m: Option<f64>,
    /// What `rho_0` is made of; `None` where there is none.
    pub uncertainty_budget: Option<UncertaintyBudget>,
    /// The standard error of each compliance (rad/(N m)), eq. 13; `None` where the plan does not
    /// determine it.
    pub standard_errors: Vec<Option<f64>>,
    /// What else is to be found.
    pub further: Vec<FurtherError>,
    /// The value of each criterion of Table 1, see [`Criterion`]; `None` where they need a compliance
    /// that the plan does not determine: those of Table 1 need all, and are about nothing else.
    pub criteria: Vec<(Criterion, Option<f64>)>,
    /// No plan of the bound's class with as many measurements has a smaller `rho_0` (m), or why there is
    /// no bound for this plan; `None` where no bound was given.
    pub lower_bound_m: Option<Result<PlanBound, NoBound>>,
    /// The same by another criterion, in its own terms; `None` where no such bound was given.
    pub criterion_bound: Option<(Criterion, Result<PlanBound, NoBound>)>,
    /// What makes the plan impossible.
    pub violations: Vec<Violation>,
    /// What is to be known before the accuracy is relied on, by name.
    pub conditions: Vec<Condition>,
    /// Which compliances identification keeps nominal, in a sentence, see [`less_than_nominal`](super::less_than_nominal).
    pub less_than_nominal: Option<String>,
}

/// How well a plan determines something that is to be found besides compliances.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct FurtherError {
    /// Its name.
    pub name: String,
    /// What it is, in words.
    #[serde(skip)]
    pub words: String,
    /// The unit of its value; "1" for a logarithm.
    pub unit: &'static str,
    /// The standard error in that unit; `None` where the plan does not determine it.
    #[serde(rename = "std")]
    pub standard_error: Option<f64>,
}

/// That a plan has so many violations.
pub fn violated(count: u64) -> Condition {
    let violations = counted(count, "violation");
    ConditionCode::Violation.with(format!("the plan has {violations}"))
}

impl Assessment {
    /// Judges a plan, beside the bound of `rho_0` for the task's plans where it is given.
    pub fn new(task: &Task, plan: &Plan, bound: Option<&Bound>) -> Self {
        let all = Problem::new(task, Criterion::A);
        let information = all.information(plan);
        let posterior = posterior(&task.belief, plan);
        let rho0_m = rho0_m(task, &posterior);
        let further = further(&task.belief, &posterior);
        let has_further = !further.is_empty();
        let value = |criterion| match criterion {
            Criterion::TestPose => rho0_m,
            _ if has_further || !posterior.estimable.is_complete() => None,
            other => all.cost_of(other).value(&information),
        };
        let experiments = plan.measurements();
        Self {
            experiments,
            uncertainty_budget: UncertaintyBudget::of_deflections(task, plan, &posterior),
            conditions: conditions(task, plan, rho0_m),
            less_than_nominal: less_than_nominal(
                task.belief.uncertain.set(),
                &task.belief.precision(),
                &posterior,
            ),
            quantile95_m: quantile95_m(task, &posterior),
            rho0_m,
            standard_errors: (0..task.belief.parameters.len())
                .map(|index| posterior.standard_error(index))
                .collect(),
            further,
            criteria: Criterion::value_variants()
                .iter()
                .map(|&criterion| (criterion, value(criterion)))
                .collect(),
            lower_bound_m: bound.map(|bound| bound.of_plan(plan)),
            criterion_bound: None,
            violations: Feasibility::new(task).violations(plan),
        }
    }

    /// That the plan has violations, if it has.
    pub fn violated(&self) -> Option<Condition> {
        let count = self.violations.len() as u64;
        (count > 0).then(|| violated(count))
    }

    /// The same beside the bound of the plan's values by another criterion.
    pub fn beside(self, bound: &Bound, plan: &Plan) -> Self {
        Self {
            criterion_bound: Some((bound.criterion(), bound.of_plan(plan))),
            ..self
        }
    }

    /// The criterion that was asked for, and what no plan is better than by it: that of [`Self::beside`], and
    /// otherwise `rho_0` (m). `None` where no bound was asked for.
    pub fn asked_for(&self) -> Option<(Criterion, &Result<PlanBound, NoBound>)> {
        let rho0 = || Some((Criterion::TestPose, self.lower_bound_m.as_ref()?));
        let other = self.criterion_bound.as_ref();
        other.map_or_else(rho0, |(criterion, bound)| Some((*criterion, bound)))
    }

    /// How near the plan comes to the bound of [`Self::asked_for`]: 1 for the best that there can be.
    pub fn criterion_efficiency(&self) -> Option<f64> {
        let (criterion, bound) = self.asked_for()?;
        let best = bound.as_ref().ok()?.best;
        let value = self.value(criterion)?;
        Some(if criterion.is_maximised() {
            value / best
        } else {
            best / value
        })
    }

    /// The plan's value by a criterion; `None` where it needs a compliance that the plan does not determine.
    pub fn value(&self, criterion: Criterion) -> Option<f64> {
        let found = (self.criteria.iter()).find(|(each, _)| *each == criterion);
        found.and_then(|(_, value)| *value)
    }

    /// The lower bound (m), if there is one for this plan.
    pub fn bound_m(&self) -> Option<f64> {
        Some(self.bound()?.best)
    }

    /// The same with what it rests on.
    pub fn bound(&self) -> Option<&PlanBound> {
        self.lower_bound_m.as_ref()?.as_ref().ok()
    }

    /// Why there is no bound for this plan, where one was asked for.
    pub fn no_bound(&self) -> Option<&NoBound> {
        self.lower_bound_m.as_ref()?.as_ref().err()
    }

    /// Lower bound over `rho_0`: 1 for the best plan that there can be.
    pub fn efficiency(&self) -> Option<f64> {
        Some(self.bound_m()? / self.rho0_m?)
    }

    /// What is to be found and the plan does not determine, in words.
    pub fn undetermined(&self, belief: &Belief) -> Vec<String> {
        let names = belief.parameter_names().into_iter();
        let compliances = names.map(|name| format!("the compliance of {name}"));
        let compliances = compliances.zip(self.standard_errors.iter().copied());
        let further = (self.further.iter()).map(|each| (each.words.clone(), each.standard_error));
        (compliances.chain(further))
            .filter(|(_, error)| error.is_none())
            .map(|(words, _)| words)
            .collect()
    }
}

fn further(belief: &Belief, posterior: &Posterior) -> Vec<FurtherError> {
    let extended = &belief.uncertain;
    let first = extended.identified();
    let places = first..first + extended.further().count();
    places
        .map(|place| {
            let parameter = &extended.set().parameters()[place];
            FurtherError {
                name: parameter.name.clone(),
                words: parameter.kind.words(extended.arm()),
                unit: parameter.unit(),
                standard_error: posterior.standard_error(place),
            }
        })
        .collect()
}
