//! The covariance of a reading over boxes, in units of the instrument's noise.

use super::geometry::BoxGeometry;
use super::question::ReadingSpread;
use super::rounding::UNIT;
use super::taylor::{ModelVector, ModelWorkspace, TaylorModel, TermSign};
use super::vectors::cross;
use super::weighted::SpreadColumns;

/// The sum of the squares of vectors' parts.
pub(super) fn squares(workspace: &mut ModelWorkspace, vectors: &[ModelVector]) -> TaylorModel {
    let mut sum = workspace.sum();
    for part in vectors.iter().flatten() {
        sum = sum.square(*part);
    }
    sum.end()
}

/// R, in the frame of the middle.
pub(super) fn covariance(
    workspace: &mut ModelWorkspace,
    spread: &ReadingSpread,
    geometry: &BoxGeometry,
    levers: &[ModelVector],
    [force, torque]: &[ModelVector; 2],
) -> SpreadColumns {
    let mut columns: Vec<ModelVector> = Vec::new();
    for (lever, deviation) in levers.iter().zip(&spread.joint_return) {
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
        columns.extend(followed(
            workspace,
            spread,
            spread.shifted,
            levers,
            &by_shift,
        ));
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
        .map(|(lever, k)| {
            let factor = k * deviation;
            lever.map(|part| {
                let sum = workspace.sum();
                sum.add_constant(factor, UNIT * factor.abs(), part).end()
            })
        })
        .collect();
    std::array::from_fn(|part| {
        std::array::from_fn(|axis| {
            let mut sum = workspace.sum();
            for (lever, torque) in compliant.iter().zip(torques) {
                sum = sum.product(TermSign::Plus, lever[axis], torque[part]);
            }
            sum.end()
        })
    })
}
