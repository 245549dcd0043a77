//! What a plan promises: the accuracy at the test poses, standard errors, criteria, violations.

use nalgebra::{DMatrix, DVector};

use super::search::{Bound, NoBound, Problem};
use super::{Criterion, ExperimentModel, Feasibility, Plan, Violation};
use crate::compensation::{predicted_error, test_pose_matrix};
use crate::least_squares::LeastSquares;
use crate::scenario::Scenario;

/// A plan judged against a scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// The number m of measurements.
    pub experiments: u32,
    /// The predicted rms distance `rho_0` over the test poses (m), eq. 20; `None` where the
    /// compensation needs a compliance that the plan does not determine.
    pub rho0_m: Option<f64>,
    /// The standard error of each compliance (rad/(N m)), eq. 13; `None` where the plan does not
    /// determine it.
    pub standard_errors: Vec<Option<f64>>,
    /// The value of each criterion of Table 1, see [`Criterion`]; `None` for a singular plan.
    pub criteria: Vec<(Criterion, Option<f64>)>,
    /// No plan of the bound's class with as many measurements has a smaller `rho_0` (m), or why there is
    /// no bound for this plan; `None` where no bound was given.
    pub lower_bound_m: Option<Result<f64, NoBound>>,
    /// What makes the plan impossible.
    pub violations: Vec<Violation>,
}

impl Assessment {
    /// Judges a plan, beside the bound of the scenario's plans where it is given.
    #[must_use]
    pub fn new(scenario: &Scenario, plan: &Plan, bound: Option<&Bound>) -> Self {
        // One is about what matters at the test poses, the other ones about all compliances.
        let test_pose = Problem::new(scenario, Criterion::TestPose);
        let all = Problem::new(scenario, Criterion::A);
        let informations = [&test_pose, &all].map(|problem| problem.information(plan));
        let value = |criterion| match criterion {
            Criterion::TestPose => test_pose.cost().value(&informations[0]),
            other => all.cost_of(other).value(&informations[1]),
        };
        let least_squares = solve(scenario, plan);
        let sigma_m = scenario.instrument.sigma_m;
        let errors = |index: usize| {
            least_squares.determined[index]
                .then(|| least_squares.covariance[(index, index)].sqrt() * sigma_m)
        };
        let experiments = plan.measurements();
        Self {
            experiments,
            rho0_m: predicted(scenario, &least_squares),
            standard_errors: (0..scenario.parameters.len()).map(errors).collect(),
            criteria: Criterion::ALL
                .iter()
                .map(|&criterion| (criterion, value(criterion)))
                .collect(),
            lower_bound_m: bound.map(|bound| bound.of_plan(plan)),
            violations: Feasibility::new(scenario).violations(plan),
        }
    }

    /// The lower bound (m), if there is one for this plan.
    #[must_use]
    pub fn bound_m(&self) -> Option<f64> {
        self.lower_bound_m.as_ref()?.as_ref().ok().copied()
    }

    /// Why there is no bound for this plan, where one was asked for.
    #[must_use]
    pub fn no_bound(&self) -> Option<&NoBound> {
        self.lower_bound_m.as_ref()?.as_ref().err()
    }

    /// Lower bound over `rho_0`: 1 for the best plan that there can be.
    #[must_use]
    pub fn efficiency(&self) -> Option<f64> {
        Some(self.bound_m()? / self.rho0_m?)
    }

    /// The indices of the parameters that the plan does not determine.
    #[must_use]
    pub fn undetermined(&self) -> Vec<usize> {
        (0..self.standard_errors.len())
            .filter(|&index| self.standard_errors[index].is_none())
            .collect()
    }
}

/// The least-squares problem of the plan for sigma = 1.
fn solve(scenario: &Scenario, plan: &Plan) -> LeastSquares {
    let model = ExperimentModel::new(scenario);
    let parameters = scenario.parameters.len();
    // A plan without experiments tells as much as one that tells nothing.
    let mut matrix = DMatrix::zeros(3 * plan.experiments.len().max(1), parameters);
    for (index, experiment) in plan.experiments.iter().enumerate() {
        let block = model.observation_matrix(experiment) * f64::from(experiment.repeats).sqrt();
        matrix.rows_mut(3 * index, 3).copy_from(&block);
    }
    let typical: Vec<f64> = scenario
        .parameters
        .iter()
        .map(|&joint| scenario.nominal.compliance_rad_per_nm[joint])
        .collect();
    LeastSquares::solve(&matrix, &DVector::zeros(matrix.nrows()), &typical)
}

fn predicted(scenario: &Scenario, least_squares: &LeastSquares) -> Option<f64> {
    let covariance = &least_squares.covariance * scenario.instrument.sigma_m.powi(2);
    let mut sum = 0.0;
    for pose in &scenario.test_poses {
        let matrix = test_pose_matrix(
            &scenario.nominal.chain,
            &scenario.machining_tool,
            pose,
            &scenario.parameters,
        );
        let largest = matrix.amax();
        let needs = |index: usize| matrix.column(index).amax() > 1e-9 * largest;
        if (0..matrix.ncols()).any(|index| needs(index) && !least_squares.determined[index]) {
            return None;
        }
        sum += pose.weight * predicted_error(&matrix, &covariance).powi(2);
    }
    Some(sum.sqrt())
}
