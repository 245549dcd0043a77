//! Which error sources a search for plans considers: those with next to no contribution cost it time, and a
//! bound without them is below that with them. What a plan then predicts is judged by all.

use nalgebra::DMatrix;

use super::joints::random_information;
use super::observation::MatrixEvaluator;
use crate::observation::ComplianceColumns;
use crate::plan::{Plan, parameter_shares};
use crate::task::{Extended, Task};

/// What is left out makes together at most this share of the square of what random plans prediction: half of it in
/// `rho_0`.
const SMALL: f64 = 0.01;
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
    let mut all: Vec<usize> = (0..sizes.len()).collect();
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
    let small = small(shares.into_iter().enumerate().collect());
    let is_small = |place: &usize| small.iter().any(|&group| groups[group].1.contains(place));
    all.retain(|place| *place < extended.identified() || !is_small(place));
    all
}

/// What is considered in place of these unknowns, if what they leave out makes more than [`SMALL`] of the square of what a plan
/// predicts: so many sources more, those with the largest contributions, that the rest makes less.
pub(super) fn relevant_in(
    task: &Task,
    extended: &Extended,
    plan: &Plan,
    considered: &[usize],
) -> Option<Vec<usize>> {
    let groups = extended.shared();
    let shares = parameter_shares(task, plan)?;
    let is_out = |group: usize| {
        groups[group]
            .1
            .iter()
            .all(|place| !considered.contains(place))
    };
    let out: Vec<(usize, f64)> = (shares.into_iter().enumerate())
        .filter(|&(group, _)| is_out(group))
        .collect();
    let small = small(out.clone());
    let counting = out.iter().filter(|(group, _)| !small.contains(group));
    let more: Vec<usize> = counting
        .flat_map(|&(group, _)| groups[group].1.clone())
        .collect();
    let is_considered = |place: &usize| considered.contains(place) || more.contains(place);
    (!more.is_empty()).then(|| {
        (0..extended.set().parameters().len())
            .filter(is_considered)
            .collect()
    })
}

/// Of groups with their shares, the smallest, which make at most [`SMALL`] together.
fn small(mut shares: Vec<(usize, f64)>) -> Vec<usize> {
    shares.sort_by(|(_, one), (_, other)| one.total_cmp(other));
    let mut left = SMALL;
    let is_small = |&(_, share): &(usize, f64)| {
        left -= share;
        left >= 0.0
    };
    shares
        .into_iter()
        .take_while(is_small)
        .map(|(group, _)| group)
        .collect()
}
