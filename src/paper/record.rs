//! The records of the paper's reproduction. What does not exist is `null`.

use serde::{Deserialize, Serialize};

use crate::paper::{
    Accuracy, Agreement, DesignedPlan, MeanDistance, Number, Reproduction, StandardErrors,
};
use crate::plan::Feasibility;
use crate::record::evidence::distances_message;
use crate::record::messages::{ExperimentMessage, plan_messages};
use crate::record::study::StudyPlanMessage;
use crate::robot::Commands;
use crate::scenario::Scenario;

/// The paper's numbers beside this program's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ReproductionMessage {
    /// Whether everything agrees that should.
    pub agrees: bool,
    /// What should agree and does not.
    pub failures: Vec<String>,
    /// Eq. 23, row by row.
    pub eq23: Vec<Vec<NumberMessage>>,
    /// Table 4, the paper's plans.
    pub table4: Vec<PlanMessage>,
    /// Table 5.
    pub table5: Vec<StandardErrorsMessage>,
    /// Table 6, with the plans that this program designs.
    pub table6: Vec<TableSixMessage>,
    /// Fig. 7.
    pub fig7: Vec<FigureSevenMessage>,
    /// The number of runs in Fig. 7.
    pub trials: u64,
}

/// A number of eq. 23 (N m^2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct NumberMessage {
    /// As printed.
    pub printed_nm2: f64,
    /// By this program.
    pub found_nm2: f64,
    /// What the printing of eq. 23 and Table 2 leaves open.
    pub allowed_nm2: f64,
    /// Whether both agree within that.
    pub agrees: bool,
}

/// A plan of Table 4.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PlanMessage {
    /// The number of measurements.
    pub experiments: u32,
    /// The plan as printed.
    pub plan: Vec<ExperimentMessage>,
    /// The bounds of Table 3 that it breaks.
    pub violations: Vec<String>,
}

/// A row of Table 5.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct StandardErrorsMessage {
    /// The number of measurements.
    pub experiments: u32,
    /// As printed (rad/(N m)).
    pub printed_rad_per_nm: Vec<f64>,
    /// Of Table 4's plan, by eq. 13 (rad/(N m)).
    pub found_rad_per_nm: Vec<Option<f64>>,
    /// The largest difference as a share of what is printed.
    pub largest_difference: f64,
    /// Whether all agree.
    pub agrees: bool,
}

/// A number of Table 6.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TableSixMessage {
    /// The number of measurements.
    pub experiments: u32,
    /// The number of different configurations.
    pub configurations: u32,
    /// As printed (mm).
    pub printed_rho0_mm: f64,
    /// Of Table 4's plan repeated, by eq. 20 (mm).
    pub found_rho0_mm: Option<f64>,
    /// Found over printed.
    pub ratio: Option<f64>,
    /// The printed number for the plan that is repeated, times the root of m/M (mm).
    pub by_rule_rho0_mm: Option<f64>,
    /// Whether the printed number is that.
    pub keeps_the_rule: Option<bool>,
    /// Of this program's plan (mm).
    pub own_rho0_mm: f64,
    /// No plan of as many measurements has a smaller one (mm).
    pub lower_bound_rho0_mm: Option<f64>,
    /// This program's plan.
    pub own_plan: Vec<ExperimentMessage>,
}

/// A plan of Fig. 7.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FigureSevenMessage {
    /// What the plan is.
    pub description: String,
    /// The mean distance that the paper prints (mm).
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

impl ReproductionMessage {
    /// The record of a reproduction.
    pub fn new(scenario: &Scenario, reproduction: &Reproduction) -> Self {
        let failures = reproduction.failures();
        let mut feasibility = Feasibility::new(&scenario.task);
        let commands = scenario.task.belief.commands();
        let random = (reproduction.figure_7.first()).and_then(|random| random.printed_m);
        let table6 = reproduction.table_6.iter().zip(&reproduction.designs);
        Self {
            agrees: failures.is_empty(),
            failures,
            eq23: (reproduction.equation_23.iter())
                .map(|row| row.iter().map(Into::into).collect())
                .collect(),
            table4: (reproduction.table_4.iter())
                .map(|plan| PlanMessage {
                    experiments: plan.measurements(),
                    plan: plan_messages(&commands, plan),
                    violations: (feasibility.violations(plan).iter())
                        .map(ToString::to_string)
                        .collect(),
                })
                .collect(),
            table5: reproduction.table_5.iter().map(Into::into).collect(),
            table6: table6
                .map(|(accuracy, design)| TableSixMessage::new(&commands, accuracy, design))
                .collect(),
            fig7: (reproduction.figure_7.iter())
                .map(|each| FigureSevenMessage::new(scenario, each, random))
                .collect(),
            trials: reproduction.trials,
        }
    }
}

impl From<&Number> for NumberMessage {
    fn from(number: &Number) -> Self {
        Self {
            printed_nm2: number.printed,
            found_nm2: number.found,
            allowed_nm2: number.allowed,
            agrees: number.agrees(),
        }
    }
}

impl From<&StandardErrors> for StandardErrorsMessage {
    fn from(row: &StandardErrors) -> Self {
        Self {
            experiments: row.experiments,
            printed_rad_per_nm: row.printed.clone(),
            found_rad_per_nm: row.found.iter().map(|&value| finite(value)).collect(),
            largest_difference: row.largest_difference(),
            agrees: row.agrees(),
        }
    }
}

impl TableSixMessage {
    fn new(commands: &Commands, accuracy: &Accuracy, design: &DesignedPlan) -> Self {
        Self {
            experiments: accuracy.experiments,
            configurations: accuracy.configurations,
            printed_rho0_mm: accuracy.printed_m * 1e3,
            found_rho0_mm: finite(accuracy.found_m * 1e3),
            ratio: finite(accuracy.ratio()),
            by_rule_rho0_mm: accuracy.by_rule_m.map(|value| value * 1e3),
            keeps_the_rule: accuracy.keeps_the_rule(),
            own_rho0_mm: design.rho0_m * 1e3,
            lower_bound_rho0_mm: design.lower_bound_m.map(|bound| bound * 1e3),
            own_plan: plan_messages(commands, &design.plan),
        }
    }
}

impl FigureSevenMessage {
    fn new(scenario: &Scenario, figure: &MeanDistance, random_m: Option<f64>) -> Self {
        let runs = distances_message(scenario, &figure.distances);
        let inverse = |[low, high]: [f64; 2]| [high.recip(), low.recip()];
        let over = |printed: f64| random_m.map(|random| random / printed);
        Self {
            description: figure.description.clone(),
            printed_mean_mm: figure.printed_m.map(|value| value * 1e3),
            printed_random_over_mean: figure.printed_m.and_then(over),
            random_over_mean: runs.mean_ratio_to_random.map(f64::recip),
            random_over_mean_ci95: runs.mean_ratio_to_random_ci95.map(inverse),
            runs,
        }
    }
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}
