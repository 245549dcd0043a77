//! Eq. 23, Table 5 and Table 6: what is printed, and what this program makes of it.

use nalgebra::DMatrix;

use super::ReproductionError;
use crate::compensation::test_pose_matrix;
use crate::paper::published::{EQUATION_23, HALF_A_PLACE, TABLE_5, TABLE_6};
use crate::plan::{Assessment, Plan};
use crate::study::repeated;
use crate::task::{Task, TestPose};

/// The standard errors of Table 5 agree within this share: they are printed with three digits.
pub const TABLE_5_TOLERANCE: f64 = 0.005;
/// Half a unit of the last place of Table 6 (m).
const HALF_A_PLACE_OF_TABLE_6: f64 = 0.5e-9;

/// What is printed beside what this program finds.
pub trait Agreement {
    /// Whether both agree as far as the printing goes.
    fn agrees(&self) -> bool;
}

/// A number of eq. 23 (N m^2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Number {
    /// As printed.
    pub printed: f64,
    /// By this program.
    pub found: f64,
    /// Half a unit of the last place, and what half a unit in the angles of Table 2 adds to it.
    pub allowed: f64,
}

/// A row of Table 5 (rad/(N m)).
#[derive(Debug, Clone, PartialEq)]
pub struct StandardErrors {
    /// The number of measurements.
    pub experiments: u32,
    /// As printed.
    pub printed: Vec<f64>,
    /// Of the plan of Table 4, by eq. 13.
    pub found: Vec<f64>,
}

/// A number of Table 6 (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// The number M of measurements.
    pub experiments: u32,
    /// The number m of different configurations.
    pub configurations: u32,
    /// As printed.
    pub printed_m: f64,
    /// Of Table 4's plan of m measurements repeated to M, by eq. 20.
    pub found_m: f64,
    /// What the rule of repeated plans makes of the printed number for m measurements.
    pub by_rule_m: Option<f64>,
}

impl Agreement for Number {
    fn agrees(&self) -> bool {
        (self.found - self.printed).abs() <= self.allowed
    }
}

impl StandardErrors {
    /// The largest difference from what is printed, as a share of it.
    pub fn largest_difference(&self) -> f64 {
        self.differences().fold(0.0, f64::max)
    }

    fn differences(&self) -> impl Iterator<Item = f64> {
        let pairs = self.found.iter().zip(&self.printed);
        pairs.map(|(found, printed)| (found / printed - 1.0).abs())
    }
}

impl Agreement for StandardErrors {
    fn agrees(&self) -> bool {
        self.found.len() == self.printed.len()
            && self.differences().all(|each| each <= TABLE_5_TOLERANCE)
    }
}

impl Accuracy {
    /// Found over printed.
    pub fn ratio(&self) -> f64 {
        self.found_m / self.printed_m
    }

    /// Whether the printed number follows the rule of repeated plans as far as the printing of both
    /// goes; `None` for a plan that is not repeated.
    pub fn keeps_the_rule(&self) -> Option<bool> {
        let apart = (self.by_rule_m? - self.printed_m).abs();
        Some(apart <= 2.0 * HALF_A_PLACE_OF_TABLE_6)
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
    let number = |row: usize, column: usize, printed: f64| Number {
        printed,
        found: matrix[(row, column)],
        allowed: allowed[(row, column)],
    };
    let rows = EQUATION_23.iter().enumerate();
    Ok(rows
        .map(|(row, printed)| {
            let cells = printed.iter().enumerate();
            cells
                .map(|(column, &printed)| number(row, column, printed))
                .collect()
        })
        .collect())
}

/// Table 5 from the plans of Table 4.
pub fn standard_errors(task: &Task, table_4: &[Plan]) -> Vec<StandardErrors> {
    let rows = TABLE_5.iter().zip(table_4);
    rows.map(|((experiments, printed), plan)| {
        let found = Assessment::new(task, plan, None).standard_errors;
        StandardErrors {
            experiments: *experiments,
            printed: printed.iter().map(|value| value * 1e-9).collect(),
            found: found.iter().map(|each| each.unwrap_or(f64::NAN)).collect(),
        }
    })
    .collect()
}

/// Table 6 from the plans of Table 4 and eq. 20.
pub fn accuracies(task: &Task, table_4: &[Plan]) -> Vec<Accuracy> {
    let row = |&(experiments, configurations, printed): &(u32, u32, f64)| {
        let plan = (table_4.iter()).find(|plan| plan.measurements() == configurations);
        let found = plan
            .and_then(|plan| repeated(plan, experiments))
            .and_then(|plan| Assessment::new(task, &plan, None).rho0_m);
        let of_once =
            (TABLE_6.iter()).find(|(m, c, _)| (*m, *c) == (configurations, configurations));
        let times = f64::from(configurations) / f64::from(experiments);
        let by_rule = of_once.map(|(_, _, once)| once * 1e-6 * times.sqrt());
        Accuracy {
            experiments,
            configurations,
            printed_m: printed * 1e-6,
            found_m: found.unwrap_or(f64::NAN),
            by_rule_m: by_rule.filter(|_| configurations < experiments),
        }
    };
    TABLE_6.iter().map(row).collect()
}
