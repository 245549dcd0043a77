//! How many absolute readings? The best accuracy against their number.

use std::sync::atomic::Ordering;

use super::{AbsolutePlan, AbsolutePlanError, AbsolutePlanning};
use crate::plan::search::{BudgetPoint, CandidatePlan, PlanBound, Watch};
use crate::plan::{Plan, UncertaintyBudget};

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
            match self.design([readings; 2], seed, Watch::quiet(watch.stop)) {
                Ok(mut found) => {
                    if are_sampled {
                        found.bound = found.bound.map(PlanBound::as_evidence);
                    }
                    points.extend(self.point(found, readings));
                }
                Err(error @ AbsolutePlanError::Undetermined { .. }) => return Err(error),
                // So few do not: more may.
                Err(error) => problem = Some(error),
            }
        }
        match problem.filter(|_| points.is_empty()) {
            Some(problem) => Err(problem),
            None => Ok(points),
        }
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
}
