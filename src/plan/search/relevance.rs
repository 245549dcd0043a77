//! Which error sources a search for plans considers: those with next to no contribution cost it time, and a
//! bound without them is below that with them. What a plan then predicts is judged by all.

use nalgebra::DMatrix;

use super::joints::random_information;
use super::observation::MatrixEvaluator;
use crate::observation::ComplianceColumns;
use crate::task::{Extended, Task};

/// What is left out makes together at most this share of the square of what random plans prediction: half of it in
/// `rho_0`.
pub(super) const SMALL: f64 = 0.01;
/// Plans of the task's size, and of so many times as many measurements, whose predictions hold less noise.
const SIZES: [f64; 2] = [1.0, 10.0];

/// The unknowns that are considered, in ascending order: the identified compliances, and those of the uncertainties that
/// matter.
pub(super) fn relevant(
    task: &Task,
    extended: &Extended,
    sizes: &[f64],
    test_poses: &DMatrix<f64>,
    ranges: &[(f64, f64)],
) -> Vec<usize> {
    let all: Vec<usize> = (0..sizes.len()).collect();
    let precision = task.belief.instrument.precision();
    let joints = &task.belief.parameters;
    let compliances = ComplianceColumns::new(joints, &sizes[..joints.len()], precision);
    let readings = extended.readings(&all, sizes, precision);
    let evaluator = MatrixEvaluator::new(readings, compliances, None);
    let (sum, count) = random_information(evaluator, ranges, task);
    let prior = task.belief.prior_information();
    let groups = extended.shared();
    // The largest share of each uncertainty.
    let mut shares = vec![0.0_f64; groups.len()];
    for size in SIZES {
        let measurements = f64::from(task.design.experiments.max(1)) * size;
        let information = &sum * (measurements / count) + &prior;
        let Some(factor) = information.cholesky() else {
            return all;
        };
        let gain = factor.solve(test_poses).transpose();
        let whole = gain.clone().component_mul(&test_poses.transpose()).sum();
        for (share, (_, places)) in shares.iter_mut().zip(groups) {
            let square = places.iter().map(|&place| {
                let precision = extended.own_precision(place) * sizes[place].powi(2);
                gain.column(place).norm_squared() * precision
            });
            *share = share.max(square.sum::<f64>() / whole);
        }
    }
    let mut order: Vec<usize> = (0..groups.len()).collect();
    order.sort_by(|&one, &other| shares[one].total_cmp(&shares[other]));
    let mut left = SMALL;
    let mut is_considered = vec![true; sizes.len()];
    for group in order {
        left -= shares[group];
        if left.is_nan() || left < 0.0 {
            break;
        }
        for &place in &groups[group].1 {
            is_considered[place] = place < extended.identified();
        }
    }
    all.into_iter()
        .filter(|&index| is_considered[index])
        .collect()
}
