//! How many absolute readings? The best accuracy against their number, from the first reading or beside some.

use std::ops::RangeInclusive;
use std::sync::atomic::Ordering;

use super::drawn::PlanOfRows;
use super::{AbsolutePlan, AbsolutePlanning, CandidateError, ReadingsWanted};
use crate::experiment::Candidate;
use crate::plan::search::{BudgetPoint, CandidatePlan, PlanBound, PlanSize, Watch};
use crate::plan::{Plan, UncertaintyBudget};
use crate::quantities::limits::MOST_EXPERIMENTS;

impl ReadingsWanted<'_> {
    /// The best plans that are found of so many readings each in at most so many configurations, those first that are enough for the tool's
    /// place, and until one gives an accuracy (m). What may be read has the readings of all of them then. When it is stopped, the numbers that it has not come to are
    /// left out.
    ///
    /// # Errors
    /// The candidates do not determine the tool's place, or none of these numbers of them does.
    pub fn of_sizes<'t>(
        &self,
        plannings: Vec<AbsolutePlanning<'t>>,
        (counts, configurations): (RangeInclusive<u32>, Option<u32>),
        wanted_m: Option<f64>,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<(AbsolutePlanning<'t>, Vec<AbsolutePlan>), CandidateError> {
        Self::best_of(plannings, watch, |planning, here| {
            let sizes = (counts.clone()).map(|readings| PlanSize::new(readings, configurations));
            self.of_sizes_among(planning, sizes.collect(), wanted_m, seed, here)
        })
    }

    /// The same among what may be read from some stations.
    fn of_sizes_among(
        &self,
        planning: &mut AbsolutePlanning<'_>,
        sizes: Vec<PlanSize>,
        wanted_m: Option<f64>,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<Vec<AbsolutePlan>, CandidateError> {
        let mut found: Vec<PlanOfRows> = Vec::new();
        let mut problem = None;
        let numbers = sizes.len();
        for (number, size) in sizes.into_iter().enumerate() {
            if watch.stop.load(Ordering::Relaxed) && !found.is_empty() {
                break;
            }
            let known = found.last().and_then(|last| once_more(last.rows.clone()));
            let known = known.unwrap_or_default();
            let searched = watch.part(number, numbers, |here| {
                // Each goes on from the last.
                self.design_from(planning, (&known, 1), size, seed, here)
            });
            match searched {
                Ok(plan) => {
                    let is_enough = wanted_m.is_some_and(|most| plan.rho0_m <= most);
                    found.push(plan);
                    if is_enough {
                        break;
                    }
                }
                Err(error) if error.is_of_all => return Err(error),
                // So few do not: more may.
                Err(error) => problem = Some(error),
            }
        }
        match problem.filter(|_| found.is_empty()) {
            Some(problem) => Err(problem),
            None => self.placed(planning, found),
        }
    }
}

impl AbsolutePlanning<'_> {
    /// The points of plans of rising numbers of readings, with these.
    pub fn budget(&self, plans: Vec<AbsolutePlan>) -> Vec<(BudgetPoint, CandidatePlan)> {
        let points = plans.into_iter().filter_map(|found| self.point(found));
        let mut points: Vec<(BudgetPoint, CandidatePlan)> = points.collect();
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
        points
    }

    /// The point of a plan, with the plan.
    fn point(&self, found: AbsolutePlan) -> Option<(BudgetPoint, CandidatePlan)> {
        let prediction = self.prediction(&found.plan);
        let readings = prediction.readings;
        let budget = self.uncertainty_budget(&found.plan, &prediction);
        let uncertain = budget.filter(|_| !self.case.belief.uncertain.is_plain());
        let rows = self.readings(&found.plan).into_iter();
        let point = BudgetPoint {
            plan: Plan {
                experiments: rows.map(|(row, times)| row.experiment(times)).collect(),
            },
            experiments: readings,
            configurations: readings,
            rho0_m: prediction.rho0_m()?,
            shared_m: uncertain.as_ref().map(UncertaintyBudget::shared_m),
            bound: found.bound,
        };
        Some((point, found.plan))
    }
}

/// A plan with one more repeat, where there may be one.
fn once_more(mut plan: Vec<(Candidate, u32)>) -> Option<Vec<(Candidate, u32)>> {
    let most = |row: &Candidate| row.most.unwrap_or(MOST_EXPERIMENTS);
    let (_, times) = plan.iter_mut().find(|(row, times)| *times < most(row))?;
    *times += 1;
    Some(plan)
}
