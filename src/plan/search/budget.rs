//! How many experiments? The best accuracy against the number of measurements, in new
//! configurations or repeated ones.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bound::{Bound, PlanBound};
use super::error::SearchError;
use super::plan_search::PlanSearch;
use super::problem::{Effort, Problem};
use super::size::PlanSize;
use super::watch::Watch;
use crate::plan::proof::ProofLimits;
use crate::plan::{Criterion, Plan, UncertaintyBudget, posterior, rho0_m};
use crate::task::Task;

/// Searches: fewer than for a single plan, since there are many, but for the size that the scenario asks for.
const SEARCHES: usize = 48;
/// Beyond so many measurements one more changes a plan little,
const MANY: u32 = 12;
/// and fewer searches are enough beside what is known from one measurement less.
const SEARCHES_OF_MANY: usize = 8;
/// Few configurations are tried up to this number, and then as many as measurements.
const FEW: u32 = 4;

/// The best accuracy that was found for m measurements in c configurations.
#[derive(Debug, Clone, PartialEq)]
pub struct BudgetPoint {
    /// The plan.
    pub plan: Plan,
    /// The number m of measurements.
    pub experiments: u32,
    /// The number c of different configurations.
    pub configurations: u32,
    /// The predicted rms distance at the test poses (m).
    pub rho0_m: f64,
    /// What of it stays however often is measured (m): what the whole plan shares; where nothing else than noise is
    /// uncertain there is none.
    pub shared_m: Option<f64>,
    /// No plan of m measurements has a smaller one (m), as [`Bound`] says; `None` where it says nothing.
    pub bound: Option<PlanBound>,
}

/// Searches the best plans of up to `largest` measurements, in 2, 3 and 4 configurations (as far as
/// these determine the compliances) and in as many as there are measurements; with their bound, which is proved as far as an effort
/// goes, where one is given (and recorded, if wanted). `progress` hears of the searches done and of all. When it is stopped, the
/// numbers that it has not come to are left out.
///
/// # Errors
/// No feasible experiment is found, or none that shows the compliances.
pub fn budget(
    task: &Task,
    largest: u32,
    seed: u64,
    proof: Option<ProofLimits<'_>>,
    stop: &AtomicBool,
    progress: &dyn Fn(usize, usize),
) -> Result<(Vec<BudgetPoint>, Bound), SearchError> {
    let mut problem = Problem::new(task, Criterion::TestPose);
    problem.effort.searches = SEARCHES;
    problem.stop = Some(stop);
    let mut search = PlanSearch::new(problem, seed)?;
    let fewest = search.problem.fewest();
    let all: Vec<u32> = (fewest..=largest).collect();
    let approximate = &search.approximate;
    let bound = Bound::new(task, approximate).prove(approximate, seed, &all, proof);
    let sizes: Vec<PlanSize> = (fewest..=largest)
        .flat_map(|measurements| {
            let few = (fewest..=FEW).filter(move |&few| few < measurements);
            few.chain([measurements])
                .map(move |configurations| PlanSize {
                    measurements,
                    configurations,
                })
        })
        .collect();
    let own = PlanSize::wanted_by(task);
    let mut points: Vec<BudgetPoint> = Vec::new();
    for (index, &size) in sizes.iter().enumerate() {
        if stop.load(Ordering::Relaxed) && !points.is_empty() {
            break;
        }
        progress(index, sizes.len());
        search.problem.effort.searches = match size.measurements {
            // What a plan of the scenario's own size is searched with.
            _ if size == own => Effort::default().searches,
            many if many > MANY => SEARCHES_OF_MANY,
            _ => SEARCHES,
        };
        let known: Vec<Plan> = points
            .iter()
            .filter_map(|point| point.known(size))
            .collect();
        match search.best(size, Watch::quiet(stop), &known) {
            Ok(design) => {
                let point = BudgetPoint::new(task, design.plan, size, design.cost, &bound);
                points.push(point);
            }
            // So few configurations do not determine the compliances: more may.
            Err(SearchError::Singular { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok((points, bound))
}

impl BudgetPoint {
    /// The point of a plan that a search found at a cost; it counts all that is uncertain, of which the search may leave something
    /// out.
    pub(crate) fn new(task: &Task, plan: Plan, size: PlanSize, cost: f64, bound: &Bound) -> Self {
        let (mut rho0_m, mut shared_m) = (cost.sqrt(), None);
        if !task.belief.uncertain.is_plain()
            && let posterior = posterior(&task.belief, &plan)
            && let Some(budget) = UncertaintyBudget::of_deflections(task, &plan, &posterior)
        {
            rho0_m = budget.combined_standard_uncertainty_um * 1e-6;
            shared_m = Some(budget.shared_m());
        }
        Self {
            plan,
            experiments: size.measurements,
            configurations: size.configurations,
            rho0_m,
            shared_m,
            bound: bound.of_size(size.measurements).ok(),
        }
    }

    /// Its plan as one of a size that is known: of as many measurements, or of one less, with one more repeat of its last experiment, which
    /// the search moves where it is best.
    fn known(&self, size: PlanSize) -> Option<Plan> {
        let are_all_different =
            self.configurations == self.experiments && size.configurations == size.measurements;
        let is_one_less = self.experiments + 1 == size.measurements
            && (self.configurations == size.configurations || are_all_different);
        let is_known = is_one_less || self.experiments == size.measurements;
        let mut plan = is_known.then(|| self.plan.clone())?;
        if let Some(last) = plan.experiments.last_mut().filter(|_| is_one_less) {
            last.repeats += 1;
        }
        Some(plan)
    }

    /// The point of a plan that is measured so many times as a whole; `None` where it does not determine what the test
    /// poses need. What repeats do not average stays.
    pub fn repeated(task: &Task, plan: &Plan, times: u32, bound: &Bound) -> Option<Self> {
        let plan = plan.repeated(times);
        let rho0_m = rho0_m(task, &posterior(&task.belief, &plan))?;
        let size = PlanSize::of(&plan);
        Some(Self::new(task, plan, size, rho0_m * rho0_m, bound))
    }

    /// The lower bound (m), where there is one.
    pub fn lower_bound_m(&self) -> Option<f64> {
        Some(self.bound.as_ref()?.best)
    }
}

/// More repeats than these of a plan nobody makes: what is left then stays.
const ENDLESS: u32 = 1_000_000;

/// How a plan gets to an accuracy by repeats.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RepeatsNeeded {
    /// Measured so many times as a whole.
    Times(u32),
    /// Never: however often it is measured, so much is left (m).
    Never(f64),
}

/// How many times a plan is to be measured as a whole for an accuracy (m); `None` where it does not determine what the test
/// poses need.
pub fn repeats_needed(task: &Task, plan: &Plan, accuracy_m: f64) -> Option<RepeatsNeeded> {
    let left_m = |times: u32| rho0_m(task, &posterior(&task.belief, &plan.repeated(times)));
    let least_m = left_m(ENDLESS)?;
    if least_m > accuracy_m {
        return Some(RepeatsNeeded::Never(least_m));
    }
    let (mut few, mut enough) = (0, ENDLESS);
    while enough - few > 1 {
        let between = few + (enough - few) / 2;
        if left_m(between)? > accuracy_m {
            few = between;
        } else {
            enough = between;
        }
    }
    Some(RepeatsNeeded::Times(enough))
}

/// The numbers of configurations that are repeated, in ascending order.
pub fn repeated_configurations(points: &[BudgetPoint]) -> Vec<u32> {
    let repeated = points
        .iter()
        .filter(|point| point.configurations < point.experiments)
        .map(|point| point.configurations);
    repeated.collect::<BTreeSet<_>>().into_iter().collect()
}

/// The cheapest way to an accuracy (m): fewest measurements, then fewest configurations.
pub fn cheapest(points: &[BudgetPoint], accuracy_m: f64) -> Option<BudgetPoint> {
    points
        .iter()
        .filter(|point| point.rho0_m <= accuracy_m)
        .min_by_key(|point| (point.experiments, point.configurations))
        .cloned()
}
