//! Searches for plans of several sizes that leave nothing out that counts in one of them.

use super::approximate::{ApproximateDesign, approximate_design};
use super::error::SearchError;
use super::exact::exact_design;
use super::exact_plan::ExactDesign;
use super::problem::Problem;
use super::size::PlanSize;
use super::watch::Watch;
use crate::plan::Plan;

/// A search that begins without what makes next to nothing of random plans. Where that counts in a plan that is found, all is
/// considered from there on.
#[derive(Debug, Clone)]
pub struct PlanSearch<'a> {
    /// The problem.
    pub problem: Problem<'a>,
    /// Its approximate design.
    pub approximate: ApproximateDesign,
    /// The seed.
    pub seed: u64,
}

impl<'a> PlanSearch<'a> {
    /// Of a problem under a seed.
    ///
    /// # Errors
    /// See [`approximate_design`].
    pub fn new(problem: Problem<'a>, seed: u64) -> Result<Self, SearchError> {
        Ok(Self {
            approximate: approximate_design(&problem, seed)?,
            problem,
            seed,
        })
    }

    /// The best plan of a size, as [`exact_design`] finds it beside plans that are known, by all that is uncertain.
    ///
    /// # Errors
    /// No plan determines the compliances.
    pub fn best(
        &mut self,
        size: PlanSize,
        watch: Watch<'_>,
        known: &[Plan],
    ) -> Result<ExactDesign, SearchError> {
        let search = |own: &Self| {
            let (problem, approximate) = (&own.problem, &own.approximate);
            exact_design(problem, approximate, size, own.seed, watch, known)
        };
        let first = search(self)?;
        let Some(whole) = self.problem.with_left_out(&first.plan) else {
            return Ok(first);
        };
        self.approximate = approximate_design(&whole, self.seed)?;
        self.problem = whole;
        Ok(first.or_better(search(self)?, &self.problem))
    }
}
