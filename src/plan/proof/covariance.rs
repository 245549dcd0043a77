//! The covariance of a reading over boxes, in units of the instrument's noise, and what is weighed with it.

use super::geometry::BoxGeometry;
use super::question::{Question, ReadingSpread};
use super::taylor::{ModelVector, ModelWorkspace, TaylorModel};
use super::vectors::{NOWHERE, cross};
use super::weighted::{SpreadColumns, WeightedRow};

/// A joint's share of a row is told by its return where that moves the stretched arm by more than this many of the deviations that
/// are everywhere: where it is less, the torque times so large a factor has the larger remainder.
const NOTABLE: f64 = 0.5;

/// R, in the frame of the middle.
pub(super) fn covariance(
    workspace: &mut ModelWorkspace,
    spread: &ReadingSpread,
    geometry: &BoxGeometry,
    levers: &[ModelVector],
    [force, torque]: &[ModelVector; 2],
) -> SpreadColumns {
    let mut columns: Vec<ModelVector> = Vec::new();
    for (lever, deviation) in levers.iter().zip(&spread.joint_repeatability) {
        if *deviation > 0.0 {
            columns.push(lever.map(|part| workspace.sum().add(*deviation, part).end()));
        }
    }
    if spread.turned > 0.0 {
        let by_turn: Vec<ModelVector> = (levers.iter().zip(&geometry.axis))
            .map(|(lever, axis)| {
                let [one, other] = [(force, lever), (torque, axis)]
                    .map(|(one, other)| cross(workspace, one, other));
                std::array::from_fn(|k| workspace.sum().add(1.0, one[k]).add(1.0, other[k]).end())
            })
            .collect();
        columns.extend(followed(workspace, spread, spread.turned, levers, &by_turn));
    }
    if spread.shifted > 0.0 {
        let by_shift: Vec<ModelVector> = (geometry.axis.iter())
            .take(levers.len())
            .map(|axis| cross(workspace, force, axis))
            .collect();
        let deviation = spread.shifted;
        columns.extend(followed(workspace, spread, deviation, levers, &by_shift));
    }
    SpreadColumns {
        everywhere: spread.everywhere,
        columns,
    }
}

/// For what changes the load by a small vector with a deviation, and a joint's torque by its product with a vector of each
/// joint's: the deflections that follow its three parts.
fn followed(
    workspace: &mut ModelWorkspace,
    spread: &ReadingSpread,
    deviation: f64,
    levers: &[ModelVector],
    torques: &[ModelVector],
) -> [ModelVector; 3] {
    let compliant: Vec<ModelVector> = (levers.iter().zip(&spread.compliance_rad_per_nm))
        .map(|(lever, k)| lever.map(|part| workspace.times_rounded(k * deviation, part)))
        .collect();
    std::array::from_fn(|part| {
        std::array::from_fn(|axis| {
            let mut sum = workspace.sum();
            for (lever, torque) in compliant.iter().zip(torques) {
                sum = sum.product(1.0, lever[axis], torque[part]);
            }
            sum.end()
        })
    })
}

/// The joints whose shares are told by their returns.
pub(super) fn notable_returns(question: &Question) -> Vec<bool> {
    let Some(spread) = &question.spread else {
        return Vec::new();
    };
    let least = NOTABLE * spread.everywhere.sqrt();
    let reaches = question.reaches_m();
    let pairs = spread.joint_repeatability.iter().zip(reaches);
    pairs
        .map(|(deviation, reach)| deviation * reach > least)
        .collect()
}

/// The rows of a question as `v_0` + G a, with the torques about its parameters' joints that there are: a joint's share is its
/// torque times its lever, of which a column of G is a multiple where it returns notably.
pub(super) fn weighted_rows(
    workspace: &mut ModelWorkspace,
    question: &Question,
    is_notable: &[bool],
    (levers, torques): (&[ModelVector], &[Option<TaylorModel>]),
    columns: usize,
) -> Vec<WeightedRow> {
    let deviations: &[f64] =
        (question.spread.as_ref()).map_or(&[], |spread| &spread.joint_repeatability);
    let mut next = 0;
    let mut place = vec![None; question.arm.joints.len()];
    for (joint, deviation) in deviations.iter().enumerate().take(levers.len()) {
        if *deviation > 0.0 {
            place[joint] = is_notable[joint].then_some(next);
            next += 1;
        }
    }
    let parameters = &question.parameters;
    let shares: Vec<ModelVector> = (parameters.iter().zip(torques))
        .map(|(&joint, torque)| match (torque, place[joint]) {
            (Some(torque), None) => workspace.scaled(&levers[joint], *torque),
            _ => NOWHERE,
        })
        .collect();
    let row = |row: &Vec<f64>| {
        let mut factors = vec![TaylorModel::ZERO; columns];
        for ((factor, &joint), torque) in row.iter().zip(parameters).zip(torques) {
            if let (Some(torque), Some(place)) = (torque, place[joint]) {
                factors[place] = workspace.times_rounded(factor / deviations[joint], *torque);
            }
        }
        let rest = std::array::from_fn(|axis| {
            let mut sum = workspace.sum();
            for (factor, share) in row.iter().zip(&shares) {
                sum = sum.add(*factor, share[axis]);
            }
            sum.end()
        });
        WeightedRow { rest, factors }
    };
    question.rows.iter().map(row).collect()
}
