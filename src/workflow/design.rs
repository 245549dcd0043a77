//! A plan is designed, and a bound is found that no plan can beat.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::plan::search::{
    ApproximateDesign, Bound, Candidates, ExactDesign, PlanSearch, PlanSize, Problem, SearchError,
    Watch, approximate_design,
};
use crate::plan::{Assessment, Criterion};
use crate::task::Task;

/// Which plan is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// What makes it good.
    pub criterion: Criterion,
    /// How large it is.
    pub size: PlanSize,
}

/// A designed plan with what was found on the way.
#[derive(Debug)]
pub struct Designed {
    /// The plan.
    pub exact: ExactDesign,
    /// What `rho_0` no plan is below.
    pub bound: Bound,
    /// Where the plan is wanted by another criterion, what no plan is better than by that.
    pub by_criterion: Option<Bound>,
    /// How long it took (s).
    pub elapsed_s: f64,
    /// Whether the search was cut short.
    pub is_cut_short: bool,
}

impl Designed {
    /// The plan judged against a task, beside its bounds.
    pub fn assessment(&self, task: &Task) -> Assessment {
        let assessment = Assessment::new(task, &self.exact.plan, Some(&self.bound));
        match &self.by_criterion {
            Some(bound) => assessment.beside(bound, &self.exact.plan),
            None => assessment,
        }
    }
}

/// Designs a plan under a seed, as long as it is not asked to stop; with the approximate design by the criterion that is wanted. `prove` makes
/// the bound as sure as it is wanted, `progress` hears of it, the searches done, all of them, and the lowest cost so far.
pub fn design(
    task: &Task,
    seed: u64,
    wanted: Wanted,
    stop: &AtomicBool,
    prove: &dyn Fn(Bound, &ApproximateDesign) -> Bound,
    progress: &(dyn Fn(&Bound, usize, usize, f64) + Sync),
) -> Result<(Designed, ApproximateDesign), SearchError> {
    let start = Instant::now();
    let approximate = |criterion: Criterion| {
        let mut problem = Problem::new(task, criterion);
        problem.stop = Some(stop);
        let design = approximate_design(&problem, seed)?;
        Ok((problem, design))
    };
    let (mut problem, mut design) = approximate(Criterion::TestPose)?;
    let mut bound = Bound::new(task, &design);
    let mut by_criterion = None;
    if wanted.criterion == Criterion::TestPose {
        bound = prove(bound, &design);
    } else {
        (problem, design) = approximate(wanted.criterion)?;
        let bound = Bound::by(task, wanted.criterion, &design);
        by_criterion = Some(prove(bound, &design));
    }
    let watch = Watch {
        stop,
        progress: &|done, all, cost| progress(&bound, done, all, cost),
    };
    // The bound without what is left out holds as it is, and so does its proof.
    let mut search = PlanSearch {
        problem,
        approximate: design.clone(),
        seed,
    };
    let designed = Designed {
        exact: search.best(wanted.size, watch, &[])?,
        elapsed_s: start.elapsed().as_secs_f64(),
        is_cut_short: stop.load(Ordering::Relaxed),
        bound,
        by_criterion,
    };
    Ok((designed, design))
}

/// Designs a plan of candidates under a seed, as long as it is not asked to stop.
pub fn design_among(
    task: &Task,
    candidates: &Candidates,
    seed: u64,
    wanted: Wanted,
    watch: Watch<'_>,
) -> Result<Designed, SearchError> {
    let start = Instant::now();
    let (exact, mut bound) = candidates.design(task, wanted.criterion, wanted.size, seed, watch)?;
    let mut by_criterion = None;
    if wanted.criterion != Criterion::TestPose {
        let rho0 = candidates.bound(task, Criterion::TestPose, &exact.plan);
        by_criterion = Some(std::mem::replace(&mut bound, rho0));
    }
    Ok(Designed {
        exact,
        bound,
        by_criterion,
        elapsed_s: start.elapsed().as_secs_f64(),
        is_cut_short: watch.stop.load(Ordering::Relaxed),
    })
}
