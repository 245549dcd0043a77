//! Which joints a planning problem is about, seen at random configurations.

use nalgebra::DMatrix;
use rand::RngExt;

use super::observation::MatrixEvaluator;
use super::point::add_information;
use crate::experiment::Loads;
use crate::numeric::random::generator;
use crate::numeric::random::streams::{FIXED_SEED, INDIFFERENT_JOINTS, SHOWN};
use crate::plan::SmoothBound;
use crate::robot::Load;
use crate::task::Task;

/// Random configurations that are looked at for what experiments show.
const CONFIGURATIONS: u32 = 40;

/// The information of random configurations, each under every load and along every direction, in an evaluator's relative units, and how many experiments that
/// are: what it does not determine, no plan does.
pub(super) fn random_information(
    mut evaluator: MatrixEvaluator<'_>,
    ranges: &[(f64, f64)],
    task: &Task,
) -> (DMatrix<f64>, f64) {
    let size = evaluator.parameters();
    let mut matrix = evaluator.matrix();
    let mut information = DMatrix::zeros(size, size);
    let loads = task.loads.samples();
    for q in random_configurations(ranges) {
        evaluator.readings.move_to(&q);
        for direction in &task.directions {
            evaluator.readings.read_along(direction.as_ref());
            for load in &loads {
                evaluator.observe(load, &mut matrix);
                add_information(&mut information, &matrix, 1.0);
            }
        }
    }
    let each = loads.len() * task.directions.len();
    (information, f64::from(CONFIGURATIONS) * each as f64)
}

/// Whether some load has a torque on a joint in one of these configurations.
pub(super) fn is_loaded(
    mut evaluator: MatrixEvaluator<'_>,
    ranges: &[(f64, f64)],
    task: &Task,
    joint: usize,
) -> bool {
    /// Torques below this share of the largest that a load could have are rounding.
    const ROUNDING: f64 = 1e-9;
    let loads = task.loads.samples();
    random_configurations(ranges).any(|q| {
        evaluator.readings.move_to(&q);
        let state = evaluator.readings.state();
        let arm_m = (state.tool_position - state.anchor[state.first_axis]).norm();
        loads.iter().any(|load| {
            let most = load.force_n.norm() * arm_m + load.torque_nm.norm();
            state.load_torque(joint, load).abs() > ROUNDING * most
        })
    })
}

fn random_configurations(ranges: &[(f64, f64)]) -> impl Iterator<Item = Vec<f64>> {
    let mut random = generator(FIXED_SEED, SHOWN);
    (0..CONFIGURATIONS).map(move |_| {
        let draw = |&(low, high): &(f64, f64)| low + (high - low) * random.random::<f64>();
        ranges.iter().map(draw).collect()
    })
}

/// The joints whose angle changes neither what any experiment tells nor the smooth bounds, found by
/// turning each.
pub(super) fn indifferent_joints(
    mut evaluator: MatrixEvaluator<'_>,
    ranges: &[(f64, f64)],
    task: &Task,
    bounds: &[SmoothBound],
) -> Vec<usize> {
    const CONFIGURATIONS: u64 = 8;
    // The joints that turn all forces of space, or a gauge's direction, alike are not worth looking for.
    if matches!(task.loads, Loads::Any { .. }) || task.reads_along() {
        return Vec::new();
    }
    let loads = task.loads.samples();
    let gravity = evaluator.readings.gravity_m_s2();
    let size = evaluator.parameters();
    let mut matrix = evaluator.matrix();
    let mut told = |q: &[f64], load: &Load| {
        evaluator.readings.move_to(q);
        evaluator.observe(load, &mut matrix);
        let margin = |bound: &SmoothBound| bound.margin(evaluator.readings.state(), load, &gravity);
        let mut told: Vec<f64> = bounds.iter().map(margin).collect();
        for first in (0..matrix.ncols()).step_by(size) {
            let rows = matrix.columns(first, size);
            told.extend(rows.tr_mul(&rows).iter());
        }
        told
    };
    let mut random = generator(FIXED_SEED, INDIFFERENT_JOINTS);
    let mut draw = |joint: usize| {
        let (low, high) = ranges[joint];
        low + (high - low) * random.random::<f64>()
    };
    let joints = ranges.len();
    let mut matters = vec![false; joints];
    for _ in 0..CONFIGURATIONS {
        let q: Vec<f64> = (0..joints).map(&mut draw).collect();
        for (joint, matters) in matters.iter_mut().enumerate() {
            let mut turned = q.clone();
            turned[joint] = draw(joint);
            for load in &loads {
                let (before, after) = (told(&q, load), told(&turned, load));
                let size = before
                    .iter()
                    .fold(1.0_f64, |size, value| size.max(value.abs()));
                *matters |= before
                    .iter()
                    .zip(&after)
                    .any(|(one, other)| (one - other).abs() > 1e-9 * size);
            }
        }
    }
    (0..joints).filter(|&joint| !matters[joint]).collect()
}
