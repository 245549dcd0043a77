//! Residuals of deflections in the form in which patterns are looked for.

use nalgebra::{Matrix6xX, Vector3};

use super::super::discrepancy::joint_space_blocks;
use super::super::equations::setup_of;
use super::super::{Case, RobustIdentification};
use super::{BLOCKS, LookedAt, ReadingRows};
use crate::observation::{ObservationModel, ReadingKind};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};

/// The positions' residuals of what was identified (m), each over its own standard deviation, of the measurements that were fitted.
pub fn looked_at(case: &Case<'_>, robust: &RobustIdentification) -> LookedAt {
    let identification = &robust.identification;
    let measurements = robust.of_kept(case.measurements);
    let left_m: Vec<[f64; 3]> = robust.of_kept(identification.residuals_m.as_chunks().0);
    let configurations: Vec<_> = (measurements.iter())
        .map(|each| &each.configuration_rad)
        .collect();
    let blocks = joint_space_blocks(&configurations, BLOCKS.min(configurations.len() / 2));
    let (belief, chain) = (case.belief, &case.belief.nominal.chain);
    let mut compliances = belief.nominal.compliance_rad_per_nm.clone();
    for (&joint, parameter) in belief.parameters.iter().zip(&identification.parameters) {
        if let Some(estimate) = parameter.estimate {
            compliances[joint] = estimate.value;
        }
    }
    let arm = ElasticArm::new(
        chain.clone(),
        compliances,
        vec![belief.calibration_tool.clone()],
    );
    let joints = chain.len();
    let compliances = (0..joints).map(|joint| (ParameterKind::JointCompliance { joint }, None));
    let all =
        compliances.chain((0..joints).map(|joint| (ParameterKind::JointZero { joint }, None)));
    let set = ParameterSet::new(&arm, all).unwrap_or_else(|_| ParameterSet::empty());
    let mut model = ObservationModel::new(&set, &arm, set.prior().mean.as_slice());
    let mut rows = Matrix6xX::zeros(set.len());
    let readings = measurements.iter().enumerate().map(|(index, each)| {
        let (setup, _) = setup_of(each);
        model.predict_as_planned(None, &setup, ReadingKind::Deflection, &mut rows);
        let moved = rows.columns(0, joints).into_owned();
        model.predict_as_planned(None, &setup, ReadingKind::Pose, &mut rows);
        let sigma = (each.sigma_m).unwrap_or_else(|| Vector3::repeat(identification.sigma_m));
        let mut whitened = Matrix6xX::zeros(moved.ncols());
        let mut placed = Matrix6xX::zeros(5);
        let mut residual = nalgebra::Vector6::zeros();
        let axes = match each.direction {
            Some(direction) => vec![direction],
            None => vec![Vector3::x(), Vector3::y(), Vector3::z()],
        };
        for (row, axis) in axes.iter().enumerate() {
            let along = moved.fixed_rows::<3>(0).tr_mul(axis).transpose();
            whitened.set_row(row, &(along / sigma[row]));
            (placed.fixed_view_mut::<1, 3>(row, 0)).copy_from(&(axis.transpose() / sigma[row]));
            residual[row] = axis.dot(&Vector3::from(left_m[index])) / sigma[row];
        }
        let jacobian = rows.columns(joints, joints);
        let torques = jacobian.column_iter().map(|column| {
            let (moves, turns) = (column.fixed_rows::<3>(0), column.fixed_rows::<3>(3));
            moves.dot(&each.load.force_n) + turns.dot(&each.load.torque_nm)
        });
        ReadingRows {
            residual,
            fitted: whitened.select_columns(&belief.parameters),
            bent: whitened.clone(),
            moved: whitened,
            placed,
            angles: each.configuration_rad.clone(),
            torques: torques.collect(),
            approach: None,
            range_m: None,
            time_s: None,
            temperature_c: None,
            count: axes.len(),
            block: blocks[index],
        }
    });
    LookedAt::new(chain, readings.collect(), true)
}
