//! Compensation of the deflection at a test pose: eqs. 14 and 15, and their non-linear form.

mod absolute;
mod passive;
mod static_compliance;
mod targets;

pub use absolute::{AbsoluteTarget, InverseKinematics, Unreachable};
pub use static_compliance::{KnownArm, StaticCompliance};
pub use targets::{TargetRow, read_targets};

use nalgebra::{DMatrix, DVector, Matrix3xX};

use crate::numeric::posterior::{NotDetermined, Posterior};
use crate::observation::{NOTHING_READ, PlannedReadings};
use crate::parameter::{ElasticArm, ParameterSet};
use crate::robot::{
    EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load, SerialChain, Tool,
};
use crate::task::{Belief, Method, TestPose};

/// As [`compensate_arm`], of a chain whose joints stand where they are commanded, with the load as it acts then: in the axes of the tool
/// where it must stand.
fn under_load(
    chain: &SerialChain,
    tool: &Tool,
    compliance_rad_per_nm: &[f64],
    pose: &TestPose,
    method: Method,
) -> Result<(DVector<f64>, Load), EquilibriumError> {
    let mut arm = chain.at(tool);
    let q0 = &pose.configuration_rad;
    let state = match method {
        Method::Linear => {
            let mut state = KinematicState::new(chain.len());
            arm.update(q0.as_slice(), &mut state);
            state
        }
        Method::Nonlinear => {
            let mut solver = EquilibriumSolver::new(chain.len());
            solver.solve(&mut arm, compliance_rad_per_nm, q0.as_slice(), &Load::NONE)?;
            solver.state().clone()
        }
    };
    let load = pose.load_at(&state.tool_rotation);
    let has_passive_joints = chain.commanded().count() < chain.len();
    let commanded_rad = match method {
        Method::Linear if has_passive_joints => {
            passive::linear(chain, &state, compliance_rad_per_nm, (q0, &load))
        }
        Method::Nonlinear if has_passive_joints => {
            return passive::nonlinear(chain, tool, compliance_rad_per_nm, pose, &state);
        }
        Method::Linear | Method::Nonlinear => DVector::from_fn(q0.len(), |joint, _| {
            q0[joint] - compliance_rad_per_nm[joint] * state.load_torque(joint, &load)
        }),
    };
    Ok((commanded_rad, load))
}

/// The joint angles to command (rad) so that one of the loaded arm's tools stands where the unloaded tool stands
/// at the test pose's own configuration `q_0`.
///
/// Linear (eq. 15): q = `q_0` - J_0^-1 K_C^-1 W = `q_0` - k `J_0^T` W, with the Jacobian at `q_0`; the
/// second form needs no inverse and holds for any number of joints. Non-linear: the torque is taken
/// at the unloaded equilibrium `q_u` of `q_0` under gravity. The loaded equilibrium of
/// q = `q_0` - k `J(q_u)^T` W is then `q_u` itself, so that the compensation is exact for true
/// compliances, in position and orientation. Joints that are passive cannot be commanded: the others make up
/// for them, in position and orientation where six are commanded.
///
/// # Errors
/// The unloaded robot has no equilibrium at the test pose, or a joint cannot hold what it carries.
pub fn compensate_arm(
    arm: &ElasticArm,
    tool: usize,
    pose: &TestPose,
    method: Method,
) -> Result<DVector<f64>, EquilibriumError> {
    // Both are approached with all joints turning positively.
    let offsets = |load: &Load| {
        let q = pose.configuration_rad.as_slice();
        let offsets = arm.held_offsets_rad(q, tool, load);
        (offsets.map(DVector::from_vec)).map_err(|joint| arm.gives_way(joint))
    };
    let standing = TestPose {
        configuration_rad: &pose.configuration_rad + offsets(&Load::NONE)?,
        ..pose.clone()
    };
    let compliance = &arm.compliance_rad_per_nm;
    let tool = &arm.tools[tool];
    let (commanded_rad, load) = under_load(&arm.chain, tool, compliance, &standing, method)?;
    let mut commanded_rad = commanded_rad - offsets(&load)?;
    if !arm.gear_waves.is_empty() {
        // Gears are off by what they are off by where the joints are commanded now.
        for (joint, commanded) in commanded_rad.iter_mut().enumerate() {
            let at_pose = arm.transmission_error_rad(joint, pose.configuration_rad[joint]);
            *commanded = arm.before_gear(joint, *commanded + at_pose);
        }
    }
    Ok(commanded_rad)
}

/// The observation matrix of a test pose for the compliances of some joints, `A_0^(p)` (eq. 23), 3 x p; of it what
/// counts there. Where springs beside the joints' own brace the arm, they do so against what is wrong of the
/// compensation, and not against the load, which is what the joints are commanded back by.
pub fn test_pose_matrix(belief: &Belief, pose: &TestPose, parameters: &[usize]) -> DMatrix<f64> {
    let sizes = vec![1.0; parameters.len()];
    if pose.load_axes.is_some() || belief.nominal.chain.elements.has_springs() {
        let arm = belief.arm();
        if let Ok(set) = ParameterSet::compliances(&arm, parameters) {
            let tool = arm.tools.len() - 1;
            let model = PlannedReadings::at_test_pose(&arm, tool, &set, &sizes);
            return uncompensated_rows(model, pose);
        }
    }
    let arm = belief.arm_with(&belief.machining_tool);
    let model = PlannedReadings::of_compliances(arm, parameters, &sizes, NOTHING_READ);
    uncompensated_rows(model, pose)
}

/// The same for all unknowns of a belief, 3 x p: what compensation leaves at a test pose follows from their
/// errors by these rows (eq. 19, extended).
pub fn test_pose_rows(belief: &Belief, pose: &TestPose) -> DMatrix<f64> {
    if belief.uncertain.has_closed_forms() {
        return test_pose_matrix(belief, pose, &belief.parameters);
    }
    let sizes = vec![1.0; belief.unknowns()];
    uncompensated_rows(belief.uncertain.at_test_pose(&sizes), pose)
}

/// What compensation leaves at a test pose by the unknowns of a model there; of it what counts.
pub fn uncompensated_rows(mut model: PlannedReadings<'_>, pose: &TestPose) -> DMatrix<f64> {
    let size = model.parameters();
    let mut matrix = Matrix3xX::zeros(size);
    model.move_to(pose.configuration_rad.as_slice());
    model.uncompensated(&pose.load, &mut matrix);
    if pose.load_axes.is_some() {
        model.add_turning_load(&pose.load, &mut matrix);
    }
    pose.counted_rows(DMatrix::from_column_slice(3, size, matrix.as_slice()))
}

/// The rows of several test poses (3 x `columns` each), each times the root of its weight, stacked.
pub fn weighted_rows(
    poses: &[TestPose],
    columns: usize,
    rows: &dyn Fn(&TestPose) -> DMatrix<f64>,
) -> DMatrix<f64> {
    let mut stacked = DMatrix::zeros(3 * poses.len(), columns);
    for (index, pose) in poses.iter().enumerate() {
        let matrix = rows(pose) * pose.weight.sqrt();
        stacked.rows_mut(3 * index, 3).copy_from(&matrix);
    }
    stacked
}

/// The predicted rms distance `rho_0` (m) that compensation leaves at a test pose (eqs. 17 to 20; its mean is zero,
/// eq. 16), from what is known of the compliances (rad/(N m)).
///
/// # Errors
/// The test pose depends on compliances that are not determined.
pub fn predicted_error(
    test_pose_matrix: &DMatrix<f64>,
    posterior: &Posterior,
) -> Result<f64, NotDetermined> {
    posterior.variance_of(test_pose_matrix).map(f64::sqrt)
}
