//! What a designed plan is shown beside: other plans over many runs, other criteria's plans, and
//! other numbers of measurements. All by the linear model, so that it takes seconds.

use std::sync::atomic::AtomicBool;

use thiserror::Error;

use super::model_level::LinearModel;
use super::runner::{Runner, RunsInBlocks, references};
use super::summary::Summary;
use super::tally::Tally;
use super::{Conditions, Entry, EntryKind, Level, Setting, StudyError};
use crate::plan::search::{
    ApproximateDesign, Bound, BudgetPoint, CriterionPlan, Problem, SearchError, Watch,
    compare_criteria, exact_design,
};
use crate::plan::{Criterion, Plan};
use crate::task::Task;
use crate::testbed::Truth;

/// The number of runs.
const TRIALS: u64 = 10_000;
/// Searches for each of the other numbers of measurements, at most.
const SEARCHES: usize = 48;
/// Numbers of measurements that are searched.
const SIZES: [u32; 7] = [1, 2, 3, 4, 6, 8, 12];
/// Plans of this many times as many measurements are not searched.
const WIDEST: u32 = 2;
/// As many measurements are always searched for.
const ALWAYS: u32 = 6;

/// Why there is no evidence.
#[derive(Debug, Error)]
pub enum EvidenceError {
    /// No plan was found.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// The study cannot be made.
    #[error(transparent)]
    Study(#[from] StudyError),
}

/// The distances that one plan leaves over many runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Distances {
    /// The plan's name.
    pub name: String,
    /// The number of measurements in each run.
    pub experiments: u32,
    /// What is kept of the runs.
    pub tally: Tally,
    /// What it says; `None` if all runs failed.
    pub summary: Option<Summary>,
}

/// What a designed plan is shown beside.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// The number of runs of each plan.
    pub trials: u64,
    /// Many runs of each plan, and of a fresh random plan each run.
    pub distances: Vec<Distances>,
    /// The best plans for other criteria.
    pub criteria: Vec<CriterionPlan>,
    /// The best accuracy that was found for other numbers of measurements, in ascending order.
    pub accuracy: Vec<BudgetPoint>,
    /// The designed plan repeated as a whole, up to as many measurements as were searched for.
    pub repeated: Vec<BudgetPoint>,
    /// What no plan of 1, 2, 3, ... measurements is below (m); `None` where there is no bound.
    pub lower_bounds_m: Vec<Option<f64>>,
}

/// Gathers the evidence for the first of `plans`, which all have as many measurements, under a seed.
/// `approximate` is the task's approximate design for the test poses, `bound` what follows from it.
pub fn gather(
    task: &Task,
    truth: &Truth,
    (approximate, bound): (&ApproximateDesign, &Bound),
    plans: &[(String, Plan)],
    seed: u64,
    watch: Watch<'_>,
) -> Result<Evidence, EvidenceError> {
    let Some((_, designed)) = plans.first() else {
        return Err(StudyError::NoPlan.into());
    };
    // The linear model makes runs only of plans that determine what the test poses need.
    let model = LinearModel::new(task, truth);
    let determined = plans.iter().filter(|(_, plan)| model.plan(plan).is_ok());
    let mut entries: Vec<Entry> = determined
        .map(|(name, plan)| Entry {
            name: name.clone(),
            setting: 0,
            kind: EntryKind::Fixed(plan.clone()),
        })
        .collect();
    entries.push(Entry {
        name: "random".to_owned(),
        setting: 0,
        kind: EntryKind::RandomEach,
    });
    // Every number that is shown has the bound that is its own.
    let own = designed.measurements();
    let largest = (own * WIDEST).max(ALWAYS);
    let bound = &bound.clone().with_sizes(seed, 1..=largest);
    let conditions = Conditions::plain(task, own);
    let setting = Setting::new(task, truth, conditions);
    Ok(Evidence {
        trials: TRIALS,
        distances: distances(&setting, seed, &entries, TRIALS, None)?,
        criteria: compare_criteria(task, approximate, designed, seed, watch),
        accuracy: accuracy(task, (approximate, bound), designed, seed, watch)?,
        repeated: (2..=largest / own.max(1))
            .filter_map(|times| BudgetPoint::repeated(task, designed, times, bound))
            .collect(),
        lower_bounds_m: (1..=largest)
            .map(|size| bound.of_size(size).ok().map(|bound| bound.best))
            .collect(),
    })
}

/// So many runs of each entry in one setting, under a seed, unless the flag is set meanwhile.
///
/// # Errors
/// The study cannot be made, or was stopped.
pub fn distances(
    setting: &Setting<'_>,
    seed: u64,
    entries: &[Entry],
    trials: u64,
    stop: Option<&AtomicBool>,
) -> Result<Vec<Distances>, StudyError> {
    let mut runner = Runner::new(std::slice::from_ref(setting), seed, Level::Model, entries)?;
    if let Some(stop) = stop {
        runner = runner.stopped_by(stop);
    }
    let tallies = runner.run(trials, 0..runner.blocks(trials), 1, &|_| ())?;
    let references = references(entries);
    let sum_up = |(index, tally): (usize, &Tally)| {
        let reference = references[index].filter(|&other| other != index);
        Summary::new(
            tally,
            setting.conditions.sigma_m,
            reference.and_then(|other| tallies.get(other)),
        )
    };
    let summaries: Vec<_> = tallies.iter().enumerate().map(sum_up).collect();
    let named = entries.iter().map(|entry| entry.name.clone());
    let all = named.zip(tallies).zip(summaries);
    Ok(all
        .map(|((name, tally), summary)| Distances {
            name,
            experiments: setting.conditions.experiments,
            tally,
            summary,
        })
        .collect())
}

/// The best accuracy for fewer and for more measurements, each in a configuration of its own, and
/// that of the designed plan.
fn accuracy(
    task: &Task,
    (approximate, bound): (&ApproximateDesign, &Bound),
    designed: &Plan,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Vec<BudgetPoint>, SearchError> {
    let mut problem = Problem::new(task, Criterion::TestPose);
    problem.effort.searches = SEARCHES;
    let own = designed.measurements();
    let size = |plan: &Plan| u32::try_from(plan.experiments.len()).unwrap_or(u32::MAX);
    let point = |plan: &Plan, cost: f64| {
        let sizes = [plan.measurements(), size(plan)];
        BudgetPoint::new(task, plan.clone(), sizes, cost, bound)
    };
    let fewest = (problem.to_find().div_ceil(3).max(1)).max(size(&task.design.mandatory) as usize);
    let largest = (own * WIDEST).max(ALWAYS);
    let mut points = Vec::new();
    for m in SIZES {
        if m == own || (m as usize) < fewest || m > largest {
            continue;
        }
        match exact_design(&problem, approximate, m, m, seed, watch) {
            Ok(design) => points.push(point(&design.plan, design.cost)),
            // So few measurements do not determine the compliances: more may.
            Err(SearchError::Singular { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    points.extend(BudgetPoint::repeated(task, designed, 1, bound));
    points.sort_by_key(|point| point.experiments);
    Ok(points)
}
