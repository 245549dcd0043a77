//! The paper's eq. 23, Tables 4 to 6 and Fig. 7, by this program.
//!
//! Eq. 23, Table 5 and the rule of repeated plans (`rho_0` times the root of m/M) must agree. Table 6
//! and Fig. 7 do not, since Table 6 does not follow from eq. 23; they are set side by side. Beside
//! the plans of Table 4 stand those that this program designs for the same numbers of measurements
//! and configurations.

mod designs;
pub mod published;
mod tables;

use serde::Serialize;
use thiserror::Error;

use crate::files::FileError;
use crate::plan::search::{SearchError, Watch};
use crate::plan::{Feasibility, Plan, read_plan};
use crate::record::messages::{PlanRowMessage, plan_messages};
use crate::record::study::StudyPlanMessage;
use crate::scenario::Scenario;
use crate::study::{StudyError, repeated};
use crate::workflow::evidence::distances;
use published::{FIGURE_7, FIGURE_7_RANDOM};

pub use designs::{DesignedPlan, designs};
pub use tables::{
    Accuracy, Number, StandardErrors, TABLE_5_TOLERANCE, accuracies, equation_23, standard_errors,
};

/// The number of measurements of Fig. 7.
const FIGURE_7_EXPERIMENTS: u32 = 12;

/// Why the paper cannot be reproduced.
#[derive(Debug, Error)]
pub enum ReproductionError {
    /// The scenario is another problem.
    #[error("the scenario is not the paper's problem: {0}")]
    OtherProblem(String),
    /// A plan of Table 4 cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// No plan was found.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// Fig. 7 cannot be simulated.
    #[error(transparent)]
    Study(#[from] StudyError),
}

/// A plan of Table 4.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PrintedPlan {
    /// The number of measurements.
    pub experiments: u32,
    /// The plan as printed.
    pub plan: Vec<PlanRowMessage>,
    /// The bounds of Table 3 that it breaks.
    pub violations: Vec<String>,
}

/// The mean distance that one plan of Fig. 7 leaves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeanDistance {
    /// What the plan is.
    pub description: String,
    /// The mean that the paper prints (mm).
    pub printed_mean_mm: Option<f64>,
    /// What the paper prints for random plans over what it prints for this one.
    pub printed_random_over_mean: Option<f64>,
    /// The mean over random plans over this plan's mean.
    pub random_over_mean: Option<f64>,
    /// Its 95 % interval.
    pub random_over_mean_ci95: Option<[f64; 2]>,
    /// This program's runs.
    #[serde(flatten)]
    pub runs: StudyPlanMessage,
}

/// The paper's numbers and this program's. What does not exist is null.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reproduction {
    /// Whether everything agrees that should.
    pub agrees: bool,
    /// What should agree and does not.
    pub failures: Vec<String>,
    /// Eq. 23, row by row.
    pub eq23: Vec<Vec<Number>>,
    /// Table 4: the paper's plans by the number of measurements.
    pub table4: Vec<PrintedPlan>,
    /// Table 5.
    pub table5: Vec<StandardErrors>,
    /// Table 6, with what this program designs for each row.
    pub table6: Vec<Accuracy>,
    /// Fig. 7: random plans, the paper's, this program's.
    pub fig7: Vec<MeanDistance>,
    /// The number of runs of each plan of Fig. 7.
    pub trials: u64,
}

/// Makes all that the paper prints from the scenario of its problem, whose plans
/// `klimchik2012_m2` to `klimchik2012_m12` are those of Table 4. `progress` hears of the plans that
/// were designed and of all. Asked to stop, it gives up.
pub fn reproduce(
    scenario: &Scenario,
    trials: u64,
    watch: Watch<'_>,
    progress: &dyn Fn(usize, usize),
) -> Result<Reproduction, ReproductionError> {
    let table_4 = table_4(scenario)?;
    let task = &scenario.task;
    let eq23 = equation_23(task)?;
    let designs = designs(scenario, watch, progress)?;
    let fig7 = figure_7(scenario, &table_4, &designs, trials, watch)?;
    let mut feasibility = Feasibility::new(task);
    let printed = table_4.iter().map(|plan| PrintedPlan {
        experiments: plan.measurements(),
        plan: plan_messages(&task.belief.commands(), plan),
        violations: (feasibility.violations(plan).iter())
            .map(ToString::to_string)
            .collect(),
    });
    let table4 = printed.collect();
    let table5 = standard_errors(task, &table_4);
    let table6 = accuracies(task, &table_4, &designs);
    let failures = failures(&eq23, &table5, &table6);
    Ok(Reproduction {
        agrees: failures.is_empty(),
        failures,
        eq23,
        table4,
        table5,
        table6,
        fig7,
        trials,
    })
}

/// The plans of Table 4, in the order of Table 5 and Fig. 7.
fn table_4(scenario: &Scenario) -> Result<Vec<Plan>, ReproductionError> {
    let read = |&(_, experiments, _): &(&str, u32, f64)| {
        let name = format!("klimchik2012_m{experiments}");
        let file = (scenario.plans.iter()).find(|file| file.name == name);
        let file = file.ok_or_else(|| {
            ReproductionError::OtherProblem(format!("it brings no plan named {name:?} (Table 4)"))
        })?;
        let plan = read_plan(&file.path, scenario.task.belief.commands())?;
        if plan.measurements() == experiments {
            return Ok(plan);
        }
        let found = plan.measurements();
        Err(ReproductionError::OtherProblem(format!(
            "its plan {name:?} has {found} measurements; Table 4 has {experiments}"
        )))
    };
    FIGURE_7.iter().map(read).collect()
}

/// Twelve measurements by each plan, over many runs.
fn figure_7(
    scenario: &Scenario,
    table_4: &[Plan],
    designs: &[DesignedPlan],
    trials: u64,
    watch: Watch<'_>,
) -> Result<Vec<MeanDistance>, ReproductionError> {
    let mut plans = vec![("random".to_owned(), None)];
    let mut about = vec![(
        "a fresh random plan each run".to_owned(),
        Some(FIGURE_7_RANDOM),
    )];
    let mut add = |name: &str, plan: &Plan, description: String, printed: Option<f64>| {
        if let Some(plan) = repeated(plan, FIGURE_7_EXPERIMENTS) {
            plans.push((name.to_owned(), Some(plan)));
            about.push((description, printed));
        }
    };
    let times = |experiments: u32| match FIGURE_7_EXPERIMENTS / experiments {
        1 => String::new(),
        times => format!(", {times} times"),
    };
    for ((name, experiments, printed), plan) in FIGURE_7.iter().zip(table_4) {
        let description = format!("Table 4's plan of {experiments}{}", times(*experiments));
        add(name, plan, description, Some(*printed));
    }
    for experiments in [3, FIGURE_7_EXPERIMENTS] {
        let own = (designs.iter())
            .find(|each| (each.experiments, each.configurations) == (experiments, experiments));
        if let Some(own) = own {
            let description = format!("elastocal's plan of {experiments}{}", times(experiments));
            add(
                &format!("elastocal {experiments}"),
                &own.plan,
                description,
                None,
            );
        }
    }
    let stop = Some(watch.stop);
    let runs = distances(scenario, FIGURE_7_EXPERIMENTS, plans, trials, stop)?;
    let over_mean = |printed_um: f64| FIGURE_7_RANDOM / printed_um;
    let inverse = |[low, high]: [f64; 2]| [high.recip(), low.recip()];
    let all = about.into_iter().zip(runs);
    Ok(all
        .map(|((description, printed_um), runs)| MeanDistance {
            description,
            printed_mean_mm: printed_um.map(|printed| printed * 1e-3),
            printed_random_over_mean: printed_um.map(over_mean),
            random_over_mean: runs.mean_ratio_to_random.map(f64::recip),
            random_over_mean_ci95: runs.mean_ratio_to_random_ci95.map(inverse),
            runs,
        })
        .collect())
}

/// What should agree with the paper and does not.
pub fn failures(
    eq23: &[Vec<Number>],
    table5: &[StandardErrors],
    table6: &[Accuracy],
) -> Vec<String> {
    let wrong = [
        (
            eq23.iter().flatten().filter(|cell| !cell.agrees).count(),
            "of the 15 numbers of eq. 23 differ",
        ),
        (
            table5.iter().filter(|row| !row.agrees).count(),
            "of the 5 rows of Table 5 differ",
        ),
        (
            (table6.iter())
                .filter(|row| row.keeps_the_rule == Some(false))
                .count(),
            "numbers of Table 6 break the rule of repeated plans",
        ),
    ];
    (wrong.iter())
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{count} {what}"))
        .collect()
}
