//! A plan is designed, and a bound is found that no plan can beat.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::plan::Criterion;
use crate::plan::search::{
    ApproximateDesign, Bound, Candidates, ExactDesign, Problem, SearchError, Watch,
    approximate_design, exact_design,
};
use crate::task::Task;

/// Which plan is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// What makes it good.
    pub criterion: Criterion,
    /// The number m of measurements.
    pub experiments: u32,
    /// The number of different configurations; as many as measurements if not given.
    pub configurations: Option<u32>,
}

impl Designed {
    /// The bound by the criterion that was wanted.
    pub fn wanted_bound(&self) -> &Bound {
        (self.by_criterion.as_ref()).map_or(&self.bound, |(_, bound)| bound)
    }

    /// The approximate design that it follows from.
    pub fn wanted_approximate(&self) -> &ApproximateDesign {
        (self.by_criterion.as_ref()).map_or(&self.approximate, |(design, _)| design)
    }
}

impl Wanted {
    /// What a task wants: a plan for its test poses.
    pub const fn by(task: &Task) -> Self {
        Self {
            criterion: Criterion::TestPose,
            experiments: task.design.experiments,
            configurations: task.design.configurations,
        }
    }
}

/// Who looks on while a plan is designed.
#[derive(Clone, Copy)]
pub struct Onlooker<'a> {
    /// When set, searches that have not begun are left out.
    pub stop: &'a AtomicBool,
    /// Makes the bound as sure as it is wanted.
    pub prove: &'a dyn Fn(Bound, &ApproximateDesign) -> Bound,
    /// Hears of the bound, the searches done, all of them, and the lowest cost so far.
    pub progress: &'a (dyn Fn(&Bound, usize, usize, f64) + Sync),
}

/// A designed plan with what was found on the way.
#[derive(Debug)]
pub struct Designed {
    /// The approximate design for the test poses.
    pub approximate: ApproximateDesign,
    /// The bound of `rho_0` that follows from it.
    pub bound: Bound,
    /// Where the plan is wanted by another criterion, the approximate design for that, and the bound of its values.
    pub by_criterion: Option<(ApproximateDesign, Bound)>,
    /// The plan.
    pub exact: ExactDesign,
    /// How long it took (s).
    pub elapsed_s: f64,
    /// Whether the search was cut short.
    pub is_cut_short: bool,
}

/// Designs a plan under a seed, as long as it is not asked to stop.
pub fn design(
    task: &Task,
    seed: u64,
    wanted: Wanted,
    onlooker: Onlooker<'_>,
) -> Result<Designed, SearchError> {
    let start = Instant::now();
    let mut for_test_poses = Problem::new(task, Criterion::TestPose);
    for_test_poses.stop = Some(onlooker.stop);
    let approximate = approximate_design(&for_test_poses, seed)?;
    let mut bound = Bound::new(task, &approximate);
    let by_criterion = if wanted.criterion == Criterion::TestPose {
        bound = (onlooker.prove)(bound, &approximate);
        None
    } else {
        let mut problem = Problem::new(task, wanted.criterion);
        problem.stop = Some(onlooker.stop);
        let design = approximate_design(&problem, seed)?;
        let bound = (onlooker.prove)(Bound::by(task, wanted.criterion, &design), &design);
        Some((problem, design, bound))
    };
    let (problem, near) = match &by_criterion {
        Some((problem, design, _)) => (problem, design),
        None => (&for_test_poses, &approximate),
    };
    let progress = |done: usize, all: usize, cost: f64| {
        (onlooker.progress)(&bound, done, all, cost);
    };
    let watch = Watch {
        stop: onlooker.stop,
        progress: &progress,
    };
    let exact = exact_design(
        problem,
        near,
        wanted.experiments,
        wanted.configurations.unwrap_or(wanted.experiments),
        seed,
        watch,
    )?;
    Ok(Designed {
        approximate,
        exact,
        elapsed_s: start.elapsed().as_secs_f64(),
        is_cut_short: onlooker.stop.load(Ordering::Relaxed),
        bound,
        by_criterion: by_criterion.map(|(_, design, bound)| (design, bound)),
    })
}

/// A plan of candidates with what was found on the way.
#[derive(Debug)]
pub struct DesignedAmong {
    /// The plan.
    pub exact: ExactDesign,
    /// What `rho_0` no plan of the candidates is below.
    pub bound: Bound,
    /// Where the plan is wanted by another criterion, what no plan of them is better than by that.
    pub by_criterion: Option<Bound>,
    /// How long it took (s).
    pub elapsed_s: f64,
    /// Whether the search was cut short.
    pub is_cut_short: bool,
}

/// Designs a plan of candidates under a seed, as long as it is not asked to stop.
pub fn design_among(
    task: &Task,
    candidates: &Candidates,
    seed: u64,
    wanted: Wanted,
    watch: Watch<'_>,
) -> Result<DesignedAmong, SearchError> {
    let start = Instant::now();
    let sizes = [
        wanted.experiments,
        wanted.configurations.unwrap_or(wanted.experiments),
    ];
    let (exact, bound) = candidates.design(task, wanted.criterion, sizes, seed, watch)?;
    let (bound, by_criterion) = if wanted.criterion == Criterion::TestPose {
        (bound, None)
    } else {
        let rho0 = candidates.bound(task, Criterion::TestPose, &exact.plan);
        (rho0, Some(bound))
    };
    Ok(DesignedAmong {
        exact,
        bound,
        by_criterion,
        elapsed_s: start.elapsed().as_secs_f64(),
        is_cut_short: watch.stop.load(Ordering::Relaxed),
    })
}
