//! A plan that a search found.

use super::problem::Problem;
use super::refinement::Found;
use crate::experiment::Experiment;
use crate::plan::Plan;

/// A plan with its cost.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactDesign {
    /// The plan.
    pub plan: Plan,
    /// Its cost.
    pub cost: f64,
    /// How many searches there were that knew nothing of one another; none where rounding the approximate design is enough.
    pub searches: usize,
    /// How many of them ended within 0.1 % of that cost's root.
    pub agreeing: usize,
}

impl ExactDesign {
    /// Experiments beside the mandatory ones, with their cost; how many searches there were, and how many agree.
    pub(super) fn beside_mandatory(
        problem: &Problem<'_>,
        chosen: impl IntoIterator<Item = Experiment>,
        cost: f64,
        [searches, agreeing]: [usize; 2],
    ) -> Self {
        let mut plan = problem.task.design.mandatory.clone();
        plan.experiments.extend(chosen);
        Self {
            plan,
            cost,
            searches,
            agreeing,
        }
    }

    /// The same of a plan that searches over a region ended in.
    pub(super) fn ended(problem: &Problem<'_>, found: &Found, counts: [usize; 2]) -> Self {
        let chosen = found.points.iter().zip(&found.repeats);
        let chosen = chosen.map(|(point, &repeats)| point.experiment(repeats));
        Self::beside_mandatory(problem, chosen, found.cost, counts)
    }

    /// This or another one, whichever a problem says is better.
    pub(super) fn or_better(self, other: Self, problem: &Problem<'_>) -> Self {
        let value = |each: &Self| problem.value(&each.plan).unwrap_or(f64::INFINITY);
        let (own, others) = (value(&self), value(&other));
        if others < own { other } else { self }
    }
}
