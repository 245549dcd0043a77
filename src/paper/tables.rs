//! Eq. 23, Table 5 and Table 6: what is printed, and what this program makes of it.

use nalgebra::DMatrix;
use serde::Serialize;

use super::{DesignedPlan, ReproductionError};
use crate::compensation::test_pose_matrix;
use crate::paper::published::{EQUATION_23, HALF_A_PLACE, TABLE_5, TABLE_6};
use crate::plan::{Assessment, Plan};
use crate::record::messages::{PlanRowMessage, plan_messages};
use crate::study::repeated;
use crate::task::{Task, TestPose};

/// The standard errors of Table 5 agree within this share: they are printed with three digits.
pub const TABLE_5_TOLERANCE: f64 = 0.005;
/// Half a unit of the last place of Table 6 (m).
const HALF_A_PLACE_OF_TABLE_6: f64 = 0.5e-9;

/// A number of eq. 23 (N m^2).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Number {
    /// As printed.
    pub printed_nm2: f64,
    /// By this program.
    pub found_nm2: f64,
    /// Half a unit of the last place, and what half a unit in the angles of Table 2 adds to it.
    pub allowed_nm2: f64,
    /// Whether both agree within that.
    pub agrees: bool,
}

/// A row of Table 5.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StandardErrors {
    /// The number of measurements.
    pub experiments: u32,
    /// As printed (rad/(N m)).
    pub printed_rad_per_nm: Vec<f64>,
    /// Of the plan of Table 4, by eq. 13 (rad/(N m)).
    pub found_rad_per_nm: Vec<Option<f64>>,
    /// The largest difference as a share of what is printed.
    pub largest_difference: f64,
    /// Whether all agree as far as they are printed.
    pub agrees: bool,
}

/// A number of Table 6, and what this program designs for as many measurements and configurations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Accuracy {
    /// The number M of measurements.
    pub experiments: u32,
    /// The number m of different configurations.
    pub configurations: u32,
    /// As printed (mm).
    pub printed_rho0_mm: f64,
    /// Of Table 4's plan of m measurements repeated to M, by eq. 20 (mm).
    pub found_rho0_mm: Option<f64>,
    /// Found over printed.
    pub ratio: Option<f64>,
    /// What the rule of repeated plans makes of the number that is printed for m measurements (mm); null for a plan that is not
    /// repeated.
    pub by_rule_rho0_mm: Option<f64>,
    /// Whether the printed number is that as far as the printing of both goes.
    pub keeps_the_rule: Option<bool>,
    /// Of this program's plan (mm).
    pub own_rho0_mm: Option<f64>,
    /// No plan of as many measurements has a smaller one (mm).
    pub lower_bound_rho0_mm: Option<f64>,
    /// This program's plan.
    pub own_plan: Vec<PlanRowMessage>,
}

impl StandardErrors {
    /// A printed row beside the standard errors that were found (rad/(N m)).
    pub fn new(experiments: u32, printed: &[f64], found: Vec<Option<f64>>) -> Self {
        let pairs = found.iter().zip(printed);
        let differences = pairs.map(|(found, printed)| {
            found.map_or(f64::INFINITY, |found| (found / printed - 1.0).abs())
        });
        let largest_difference = differences.fold(0.0, f64::max);
        Self {
            experiments,
            printed_rad_per_nm: printed.to_vec(),
            agrees: found.len() == printed.len() && largest_difference <= TABLE_5_TOLERANCE,
            found_rad_per_nm: found,
            largest_difference,
        }
    }
}

/// The test pose's matrix beside eq. 23.
///
/// # Errors
/// The task has other test poses or parameters.
pub fn equation_23(task: &Task) -> Result<Vec<Vec<Number>>, ReproductionError> {
    let other = |found: usize, what: &str, expected: usize| {
        let text = format!("it has {found} {what}; the paper's has {expected}");
        ReproductionError::OtherProblem(text)
    };
    let parameters = task.belief.parameters.len();
    if parameters != EQUATION_23[0].len() {
        return Err(other(parameters, "unknown compliances", 5));
    }
    let [pose] = task.test_poses.as_slice() else {
        return Err(other(task.test_poses.len(), "test poses", 1));
    };
    let matrix_at = |pose: &TestPose| test_pose_matrix(&task.belief, pose, &task.belief.parameters);
    let matrix = matrix_at(pose);
    let mut allowed: DMatrix<f64> = matrix.map(|_| HALF_A_PLACE);
    for joint in 0..task.belief.joints() {
        let mut turned = pose.clone();
        turned.configuration_rad[joint] += HALF_A_PLACE.to_radians();
        allowed += (matrix_at(&turned) - &matrix).abs();
    }
    let number = |place: (usize, usize), printed_nm2: f64| Number {
        printed_nm2,
        found_nm2: matrix[place],
        allowed_nm2: allowed[place],
        agrees: (matrix[place] - printed_nm2).abs() <= allowed[place],
    };
    let row = |(row, printed): (usize, &[f64; 5])| {
        let cells = printed.iter().enumerate();
        cells
            .map(|(column, &printed)| number((row, column), printed))
            .collect()
    };
    Ok(EQUATION_23.iter().enumerate().map(row).collect())
}

/// Table 5 from the plans of Table 4.
pub fn standard_errors(task: &Task, table_4: &[Plan]) -> Vec<StandardErrors> {
    let rows = TABLE_5.iter().zip(table_4);
    rows.map(|((experiments, printed), plan)| {
        let found = Assessment::new(task, plan, None).standard_errors;
        StandardErrors::new(*experiments, &printed.map(|value| value * 1e-9), found)
    })
    .collect()
}

/// Table 6 from the plans of Table 4 and eq. 20, beside this program's own plans, where there are some.
pub fn accuracies(task: &Task, table_4: &[Plan], designs: &[DesignedPlan]) -> Vec<Accuracy> {
    let row = |&(experiments, configurations, printed_um): &(u32, u32, f64)| {
        let plan = (table_4.iter()).find(|plan| plan.measurements() == configurations);
        let found_m = plan
            .and_then(|plan| repeated(plan, experiments))
            .and_then(|plan| Assessment::new(task, &plan, None).rho0_m);
        let of_once =
            (TABLE_6.iter()).find(|(m, c, _)| (*m, *c) == (configurations, configurations));
        let times = f64::from(configurations) / f64::from(experiments);
        let by_rule_m = (of_once.map(|(_, _, once)| once * 1e-6 * times.sqrt()))
            .filter(|_| configurations < experiments);
        let printed_m = printed_um * 1e-6;
        let own = (designs.iter())
            .find(|own| (own.experiments, own.configurations) == (experiments, configurations));
        Accuracy {
            experiments,
            configurations,
            printed_rho0_mm: printed_m * 1e3,
            found_rho0_mm: found_m.map(|value| value * 1e3),
            ratio: found_m.map(|value| value / printed_m),
            by_rule_rho0_mm: by_rule_m.map(|value| value * 1e3),
            keeps_the_rule: by_rule_m
                .map(|by_rule_m| (by_rule_m - printed_m).abs() <= 2.0 * HALF_A_PLACE_OF_TABLE_6),
            own_rho0_mm: own.map(|own| own.rho0_m * 1e3),
            lower_bound_rho0_mm: own.and_then(|own| Some(own.lower_bound_m? * 1e3)),
            own_plan: own.map_or_else(Vec::new, |own| {
                plan_messages(&task.belief.commands(), &own.plan)
            }),
        }
    };
    TABLE_6.iter().map(row).collect()
}
