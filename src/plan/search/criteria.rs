//! Plans that are optimal by other criteria, compared at the test poses.

use super::approximate::ApproximateDesign;
use super::exact::exact_design;
use super::problem::Problem;
use super::size::PlanSize;
use super::watch::Watch;
use crate::plan::{Criterion, Plan, posterior, rho0_m};
use crate::task::Task;

/// Searches for each criterion: fewer than for a plan that will be measured.
const SEARCHES: usize = 24;
/// Criteria of Table 1 that plans are optimised by. Those of a row have the same optimum: `O1` is a power of D's
/// determinant.
const RIVALS: [&[Criterion]; 2] = [&[Criterion::A], &[Criterion::D, Criterion::O1]];

/// The best plan that was found for a criterion, judged at the test poses.
#[derive(Debug, Clone, PartialEq)]
pub struct CriterionPlan {
    /// The criteria that the plan is best for.
    pub criteria: Vec<Criterion>,
    /// The plan.
    pub plan: Plan,
    /// Its predicted rms distance at the test poses (m).
    pub rho0_m: Option<f64>,
    /// How many searches ended in a plan as good for these criteria. `None` for the plan that was given.
    pub agreeing: Option<usize>,
    /// Why there is no plan; it is empty then.
    pub problem: Option<String>,
}

/// Designs a plan for every criterion of Table 1 that plans are optimised by, of as many measurements and configurations as
/// `for_test_poses` has, the plan that is best at the test poses. `approximate` is the task's
/// approximate design for them. Where there is no plan for a criterion, its entry says why.
pub fn compare_criteria(
    task: &Task,
    approximate: &ApproximateDesign,
    for_test_poses: &Plan,
    seed: u64,
    watch: Watch<'_>,
) -> Vec<CriterionPlan> {
    let judged = |criteria: &[Criterion], plan: Plan, agreeing: Option<usize>| CriterionPlan {
        criteria: criteria.to_vec(),
        rho0_m: rho0_m(task, &posterior(&task.belief, &plan)),
        plan,
        agreeing,
        problem: None,
    };
    let size = PlanSize::of(for_test_poses);
    let mut plans = vec![judged(&[Criterion::TestPose], for_test_poses.clone(), None)];
    for criteria in RIVALS {
        let mut problem = Problem::new(task, criteria[0]);
        problem.effort.searches = SEARCHES;
        let design = exact_design(&problem, approximate, size, seed, watch, &[]);
        plans.push(match design {
            Ok(design) => judged(criteria, design.plan, Some(design.agreeing)),
            Err(error) => CriterionPlan {
                criteria: criteria.to_vec(),
                plan: Plan::default(),
                rho0_m: None,
                agreeing: None,
                problem: Some(error.to_string()),
            },
        });
    }
    plans
}
