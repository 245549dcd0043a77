//! What a designed plan is shown beside: other plans over many runs, other criteria's plans, and
//! other numbers of measurements. All by the linear model, so that it takes seconds.

use thiserror::Error;

use super::model_level::Model;
use super::runner::{Runner, references};
use super::summary::Summary;
use super::tally::Tally;
use super::{Entry, EntryKind, Setting, StudyError};
use crate::plan::search::{
    ApproximateDesign, Bound, BudgetPoint, CriterionPlan, Problem, SearchError, Watch,
    compare_criteria, exact_design,
};
use crate::plan::{Assessment, Criterion, Plan};
use crate::scenario::{Level, Scenario};

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
}

/// Gathers the evidence for the first of `plans`, which all have as many measurements.
/// `approximate` is the scenario's approximate design for the test poses.
///
/// # Errors
/// See [`EvidenceError`].
pub fn gather(
    scenario: &Scenario,
    approximate: &ApproximateDesign,
    plans: &[(String, Plan)],
    watch: Watch<'_>,
) -> Result<Evidence, EvidenceError> {
    let Some((_, designed)) = plans.first() else {
        return Err(StudyError::NoPlan.into());
    };
    // The linear model makes runs only of plans that determine what the test poses need.
    let model = Model::new(scenario);
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
    Ok(Evidence {
        trials: TRIALS,
        distances: distances(scenario, designed.measurements(), &entries, TRIALS)?,
        criteria: compare_criteria(scenario, approximate, designed, watch),
        accuracy: accuracy(scenario, approximate, designed, watch)?,
    })
}

/// So many runs of each entry.
///
/// # Errors
/// The study cannot be made.
pub fn distances(
    scenario: &Scenario,
    experiments: u32,
    entries: &[Entry],
    trials: u64,
) -> Result<Vec<Distances>, StudyError> {
    let settings = [Setting::plain(scenario, experiments)];
    let runner = Runner::new(&settings, Level::Model, entries)?;
    let tallies = runner.run(trials, 0..runner.blocks(trials), 1, &|_| ())?;
    let references = references(entries);
    let sum_up = |(index, tally): (usize, &Tally)| {
        let reference = references[index].filter(|&other| other != index);
        Summary::new(
            tally,
            scenario.instrument.sigma_m,
            reference.and_then(|other| tallies.get(other)),
        )
    };
    let summaries: Vec<_> = tallies.iter().enumerate().map(sum_up).collect();
    let named = entries.iter().map(|entry| entry.name.clone());
    let all = named.zip(tallies).zip(summaries);
    Ok(all
        .map(|((name, tally), summary)| Distances {
            name,
            experiments,
            tally,
            summary,
        })
        .collect())
}

/// The best accuracy for fewer and for more measurements, each in a configuration of its own, and
/// that of the designed plan.
fn accuracy(
    scenario: &Scenario,
    approximate: &ApproximateDesign,
    designed: &Plan,
    watch: Watch<'_>,
) -> Result<Vec<BudgetPoint>, SearchError> {
    let mut problem = Problem::new(scenario, Criterion::TestPose);
    problem.effort.searches = SEARCHES;
    let bound = Bound::new(scenario, approximate);
    let own = designed.measurements();
    let size = |plan: &Plan| u32::try_from(plan.experiments.len()).unwrap_or(u32::MAX);
    let point = |plan: &Plan, cost: f64| BudgetPoint {
        experiments: plan.measurements(),
        configurations: size(plan),
        rho0_m: cost.sqrt(),
        lower_bound_m: bound.of_size(plan.measurements()).ok(),
    };
    let fewest = (problem.parameters().div_ceil(3)).max(size(&scenario.design.mandatory) as usize);
    let largest = (own * WIDEST).max(ALWAYS);
    let mut points = Vec::new();
    for m in SIZES {
        if m == own || (m as usize) < fewest || m > largest {
            continue;
        }
        match exact_design(&problem, approximate, m, m, scenario.seed, watch) {
            Ok(design) => points.push(point(&design.plan, design.cost)),
            // So few measurements do not determine the compliances: more may.
            Err(SearchError::Singular { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    let own_assessment = Assessment::new(scenario, designed, None);
    if let Some(rho0_m) = own_assessment.rho0_m {
        points.push(point(designed, rho0_m * rho0_m));
    }
    points.sort_by_key(|point| point.experiments);
    Ok(points)
}
