//! The predicted accuracy of a plan: the posterior before any reading, and the residual error after compensation.

use nalgebra::{DMatrix, DVector};

use super::{ExperimentModel, Plan, as_repeats};
use crate::compensation::{predicted_error, test_pose_rows, weighted_rows};
use crate::numeric::estimable::Estimable;
use crate::numeric::least_squares::LeastSquares;
use crate::numeric::posterior::Posterior;
use crate::numeric::tolerance::length_quantile;
use crate::task::{Belief, Task};

/// What is known of the unknowns after the plan, whatever is read.
pub fn posterior(belief: &Belief, plan: &Plan) -> Posterior {
    let model = ExperimentModel::new(belief);
    let plan = &*as_repeats(plan, &belief.uncertain);
    // A plan without experiments tells as much as one that tells nothing.
    let rows = model.rows();
    let before = belief.uncertain.prior_rows();
    let known = rows * plan.experiments.len().max(1);
    let mut matrix = DMatrix::zeros(known + before.nrows(), belief.unknowns());
    let matrices = model.observation_matrices(plan);
    for (index, (experiment, own)) in plan.experiments.iter().zip(matrices).enumerate() {
        let block = own * f64::from(experiment.repeats).sqrt();
        matrix.rows_mut(rows * index, rows).copy_from(&block);
    }
    let sigma_m = belief.instrument.sigma_m;
    (matrix.rows_mut(known, before.nrows())).copy_from(&(before * sigma_m));
    let typical = belief.sizes();
    let estimable = Estimable::of_equations(&(&matrix / sigma_m), &typical);
    let nothing_read = DVector::zeros(matrix.nrows());
    let least_squares = LeastSquares::solve(&matrix, &nothing_read, &estimable);
    Posterior {
        names: belief.unknown_names(),
        mean: belief.values(),
        covariance: least_squares.covariance * sigma_m.powi(2),
        estimable,
    }
}

/// C (3 m x p): what compensation leaves at all m test poses by the unknowns' errors, each times the root of its weight.
pub fn task_rows(task: &Task) -> DMatrix<f64> {
    let belief = &task.belief;
    weighted_rows(&task.test_poses, belief.unknowns(), &|pose| {
        test_pose_rows(belief, pose)
    })
}

/// The distance (m) that compensation leaves less of in 95 % of the draws of what is uncertain, from what is known
/// after a plan; over several test poses, the rms over them. `None` where a test pose needs what is not determined.
pub fn quantile95_m(task: &Task, posterior: &Posterior) -> Option<f64> {
    let rows = task_rows(task);
    posterior.variance_of(&rows).ok()?;
    length_quantile(&(&rows * &posterior.covariance * rows.transpose()), 0.95)
}

/// The rms distance `rho_0` (m) that compensation leaves at the test poses (eqs. 18 to 20), from what is known after a
/// plan. `None` where a test pose needs what is not determined.
pub fn rho0_m(task: &Task, posterior: &Posterior) -> Option<f64> {
    let mut sum = 0.0;
    for pose in &task.test_poses {
        let matrix = test_pose_rows(&task.belief, pose);
        sum += pose.weight * predicted_error(&matrix, posterior).ok()?.powi(2);
    }
    Some(sum.sqrt())
}
