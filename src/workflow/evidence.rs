//! What a designed plan is shown beside: other plans over many runs, other criteria's plans, and
//! other numbers of measurements. All by the linear model, so that it takes seconds.

use std::sync::atomic::AtomicBool;

use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::plan::search::{
    ApproximateDesign, Basis, Bound, BudgetPoint, CriterionPlan, PlanSearch, PlanSize, Problem,
    SearchError, Watch, compare_criteria,
};
use crate::plan::{Criterion, Plan};
use crate::record::messages::plan_messages;
use crate::record::study::StudyPlanMessage;
use crate::robot::Commands;
use crate::scenario::Scenario;
use crate::study::model_level::LinearModel;
use crate::study::runner::Runner;
use crate::study::{Conditions, Entry, Level, Setting, StudyError, TakenPlan};
use crate::task::{AccuracyKind, Task};

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

/// What a designed plan is shown beside, and what its bound rests on.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvidenceMessage {
    /// The number of local searches that the lower bound rests on.
    pub bound_searches: usize,
    /// How many of them ended within 0.1 % of the largest directional derivative.
    pub bound_searches_agreeing: usize,
    /// The number of runs of each plan in `study`.
    pub trials: u64,
    /// Many runs of each plan by the linear model.
    pub study: Vec<StudyPlanMessage>,
    /// The best plans for other criteria, see [`criterion_plan_json`].
    pub criteria_compared: Vec<Value>,
    /// The best accuracy that was found for other numbers of measurements.
    #[serde(serialize_with = "written")]
    pub accuracy: Vec<BudgetPoint>,
    /// The designed plan, repeated as a whole.
    #[serde(serialize_with = "written")]
    pub repeated: Vec<BudgetPoint>,
    /// The lower bound of `rho0_mm` for 1, 2, 3, ... measurements (mm); null where there is none.
    pub lower_bounds_rho0_mm: Vec<Option<f64>>,
}

/// The best plan for some criteria, with what it predicts at the test poses; how many searches ended in a plan as good for these, or why
/// there is none.
pub fn criterion_plan_json(commands: &Commands, best: &CriterionPlan) -> Value {
    let mut record = json!({
        "criteria": best.criteria,
        "rho0_mm": best.rho0_m.map(|value| value * 1e3),
        "searches_agreeing": best.agreeing,
        "plan": plan_messages(commands, &best.plan),
    });
    if let Some(problem) = &best.problem {
        record["problem"] = json!(problem);
    }
    record
}

/// The accuracy and the bound for each number of measurements and of configurations.
fn written<S: Serializer>(points: &[BudgetPoint], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(points.iter().map(|point| {
        json!({
            "experiments": point.experiments,
            "configurations": point.configurations,
            "rho0_mm": point.rho0_m * 1e3,
            "lower_bound_rho0_mm": point.lower_bound_m().map(|bound_m| bound_m * 1e3),
        })
    }))
}

/// Gathers the evidence for the first of `plans`, which all have as many measurements. `approximate` is the task's approximate
/// design for the test poses, `bound` what follows from it.
///
/// # Errors
/// No plan was found, or no run can be made.
pub fn gather(
    scenario: &Scenario,
    (approximate, bound): (&ApproximateDesign, &Bound),
    plans: &[(String, Plan)],
    watch: Watch<'_>,
) -> anyhow::Result<EvidenceMessage> {
    let (task, seed) = (&scenario.task, scenario.seed);
    let Some((_, designed)) = plans.first() else {
        return Err(StudyError::NoPlan.into());
    };
    // The linear model makes runs only of plans that determine what the test poses need.
    let model = LinearModel::new(task, &scenario.truth);
    let determined = plans.iter().filter(|(_, plan)| model.plan(plan).is_ok());
    let fixed = determined.map(|(name, plan)| (name.clone(), Some(plan.clone())));
    let random = ("random".to_owned(), None);
    let plans = fixed.chain([random]).collect();
    // Every number that is shown has the bound that is its own.
    let own = designed.measurements();
    let largest = (own * WIDEST).max(ALWAYS);
    let (searches, agreeing) = match bound.basis() {
        Basis::Searches(certificate) => (certificate.searches, certificate.agreeing),
        Basis::Candidates(_) | Basis::Nothing(_) => (0, 0),
    };
    let bound = &bound.clone().with_sizes(seed, 1..=largest);
    let commands = task.belief.commands();
    let accuracy = accuracy(task, (approximate, bound), designed, seed, watch)?;
    Ok(EvidenceMessage {
        bound_searches: searches,
        bound_searches_agreeing: agreeing,
        trials: TRIALS,
        study: distances(scenario, own, plans, TRIALS, None)?,
        criteria_compared: (compare_criteria(task, approximate, designed, seed, watch).iter())
            .map(|best| criterion_plan_json(&commands, best))
            .collect(),
        accuracy,
        repeated: (2..=largest / own.max(1))
            .filter_map(|times| BudgetPoint::repeated(task, designed, times, bound))
            .collect(),
        lower_bounds_rho0_mm: (1..=largest)
            .map(|size| bound.of_size(size).ok().map(|bound| bound.best * 1e3))
            .collect(),
    })
}

/// So many runs of plans of so many measurements, by the linear model, unless the flag is set meanwhile; where there is no plan, every run
/// has a random one.
///
/// # Errors
/// The study cannot be made, or was stopped.
pub fn distances(
    scenario: &Scenario,
    experiments: u32,
    plans: Vec<(String, Option<Plan>)>,
    trials: u64,
    stop: Option<&AtomicBool>,
) -> Result<Vec<StudyPlanMessage>, StudyError> {
    let conditions = Conditions::plain(&scenario.task, experiments);
    let setting = [Setting::new(&scenario.task, &scenario.truth, conditions)];
    let entry = |(name, plan): (_, Option<Plan>)| Entry {
        name,
        setting: 0,
        is_random: plan.is_none(),
        plan: plan.map(TakenPlan::Deflections),
    };
    let entries: Vec<Entry<'_>> = plans.into_iter().map(entry).collect();
    let mut runner = Runner::new(&setting, scenario.seed, Level::Model, &entries)?;
    if let Some(stop) = stop {
        runner = runner.stopped_by(stop);
    }
    let tallies = runner.run(trials, 0..runner.blocks(trials), 1, &|_| ())?;
    let parameters = scenario.task.belief.parameters.len();
    let message = |(index, reference): (usize, Option<usize>)| {
        let runs = (&tallies[index], reference.map(|other| &tallies[other]));
        let name = &entries[index].name;
        StudyPlanMessage::new(
            name,
            (&conditions, AccuracyKind::Relative),
            parameters,
            runs,
            (None, None),
        )
    };
    let references = runner.references().into_iter();
    Ok(references.enumerate().map(message).collect())
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
    let point = |plan: &Plan, cost: f64| {
        BudgetPoint::new(task, plan.clone(), PlanSize::of(plan), cost, bound)
    };
    let fewest = (problem.fewest() as usize).max(task.design.mandatory.experiments.len());
    let largest = (own * WIDEST).max(ALWAYS);
    let mut search = PlanSearch {
        problem,
        approximate: approximate.clone(),
        seed,
    };
    let mut points = Vec::new();
    for m in SIZES {
        if m == own || (m as usize) < fewest || m > largest {
            continue;
        }
        match search.best(PlanSize::all_different(m), watch, &[]) {
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
