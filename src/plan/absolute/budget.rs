//! How many absolute readings? The best accuracy against their number, from the first reading or beside some.

use std::ops::RangeInclusive;
use std::sync::atomic::Ordering;

use super::{AbsolutePlan, AbsolutePlanError, AbsolutePlanning, SEARCHES};
use crate::plan::search::{BudgetPoint, CandidatePlan, PlanBound, Watch};
use crate::plan::{Plan, UncertaintyBudget};
use crate::quantities::limits::MOST_EXPERIMENTS;

/// What is to be read beside what is measured.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RestOfReadings {
    /// The candidates by their places, and how often each is read.
    pub plan: CandidatePlan,
    /// No rest of as many readings of the candidates predicts a smaller rho0 (m), where that is known.
    pub bound_m: Option<f64>,
}

impl AbsolutePlanning<'_> {
    /// The best plans that are found of up to so many readings, those first that are enough for the tool's place. Where candidates
    /// are sampled, bounds are evidence. When it is stopped, the numbers that it has not come to are left out.
    ///
    /// # Errors
    /// The candidates do not determine the tool's place, or no plan of so few of them does.
    pub fn budget(
        &self,
        largest: u32,
        are_sampled: bool,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<Vec<(BudgetPoint, CandidatePlan)>, AbsolutePlanError> {
        let mut points: Vec<(BudgetPoint, CandidatePlan)> = Vec::new();
        let mut problem = None;
        for (done, readings) in (1..=largest).enumerate() {
            if watch.stop.load(Ordering::Relaxed) && !points.is_empty() {
                break;
            }
            (watch.progress)(done, largest as usize, f64::NAN);
            // One reading less, with one more repeat.
            let fewer = points.last().map(|(_, plan)| plan.clone());
            let known: Vec<CandidatePlan> = (fewer.into_iter())
                .filter_map(|plan| self.once_more(plan))
                .collect();
            let here = Watch::quiet(watch.stop);
            match self.design_by((SEARCHES, &known), [readings; 2], seed, here) {
                Ok(mut found) => {
                    if are_sampled {
                        found.bound = found.bound.map(PlanBound::into_evidence);
                    }
                    points.extend(self.point(found, readings));
                }
                Err(error @ AbsolutePlanError::Undetermined { .. }) => return Err(error),
                // So few do not: more may.
                Err(error) => problem = Some(error),
            }
        }
        // What more readings cannot reach fewer do not.
        let mut least: Option<PlanBound> = None;
        for (point, _) in points.iter_mut().rev() {
            if least
                .as_ref()
                .is_some_and(|least| point.bound.as_ref().is_none_or(|own| own.best < least.best))
            {
                point.bound.clone_from(&least);
            }
            least.clone_from(&point.bound);
        }
        match problem.filter(|_| points.is_empty()) {
            Some(problem) => Err(problem),
            None => Ok(points),
        }
    }

    /// A plan with one more repeat, where there may be one.
    fn once_more(&self, mut plan: CandidatePlan) -> Option<CandidatePlan> {
        let most = |place: usize| self.candidates[place].most.unwrap_or(MOST_EXPERIMENTS);
        let (_, times) = plan
            .iter_mut()
            .find(|(place, times)| *times < most(*place))?;
        *times += 1;
        Some(plan)
    }

    /// The point of a plan, with the plan.
    fn point(&self, found: AbsolutePlan, readings: u32) -> Option<(BudgetPoint, CandidatePlan)> {
        let prediction = self.prediction(&found.plan);
        let budget = self.uncertainty_budget(&found.plan, &prediction);
        let uncertain = budget.filter(|_| self.case.belief.uncertain.is_some());
        let rows = self.readings(&found.plan).into_iter();
        let point = BudgetPoint {
            plan: Plan {
                experiments: rows.map(|(row, times)| row.experiment(times)).collect(),
            },
            experiments: readings,
            configurations: readings,
            rho0_m: prediction.rho0_m()?,
            shared_m: uncertain.as_ref().map(UncertaintyBudget::shared_m),
            common_sources: self.common_sources(&found.plan, &prediction),
            bound: found.bound,
        };
        Some((point, found.plan))
    }

    /// What to read next: so many readings, or as few of them as give an accuracy (m).
    ///
    /// # Errors
    /// The candidates do not determine the tool's place, or none of these numbers of them does.
    pub fn rest(
        &self,
        counts: RangeInclusive<u32>,
        wanted_m: Option<f64>,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<RestOfReadings, AbsolutePlanError> {
        let mut found = Ok(RestOfReadings::default());
        for count in counts {
            match self.design([count; 2], seed, watch) {
                Ok(AbsolutePlan { plan, bound, .. }) => {
                    let rho0_m = self.prediction(&plan).rho0_m();
                    let bound_m = bound.map(|bound| bound.best);
                    found = Ok(RestOfReadings { plan, bound_m });
                    let is_enough = |wanted_m| rho0_m.is_some_and(|rho0_m| rho0_m <= wanted_m);
                    if wanted_m.is_some_and(is_enough) {
                        break;
                    }
                }
                // More may do.
                Err(error) if found.as_ref().is_ok_and(|rest| rest.plan.is_empty()) => {
                    found = Err(error);
                }
                Err(_) => {}
            }
            if watch.stop.load(Ordering::Relaxed) {
                break;
            }
        }
        found
    }
}
