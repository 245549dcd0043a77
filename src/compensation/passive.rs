//! Compensation of arms with passive joints, which cannot be commanded: the other joints make up for them.

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector6};

use crate::robot::{
    EquilibriumError, EquilibriumSolver, KinematicState, Load, SerialChain, Tool, commands_for,
    made_up, rotation_vector,
};
use crate::task::TestPose;

/// Newton's method needs three or four steps.
const MAXIMUM_ITERATIONS: usize = 30;
/// The last step is no larger than this (rad, m).
const CONVERGED: f64 = 1e-12;
/// To first order in compliance: the commanded joints take back their own deflection, and what those of
/// the passive joints move the tool by. Springs beside the joints' own give way to a command as they do to a
/// load, so that their part in the deflections needs no other commands.
pub(super) fn linear(
    chain: &SerialChain,
    state: &KinematicState,
    compliance: &[f64],
    (q0, load): (&DVector<f64>, &Load),
) -> DVector<f64> {
    let deflections: Vec<f64> = (compliance.iter().enumerate())
        .map(|(joint, k)| k * state.load_torque(joint, load))
        .collect();
    let jacobian = state.clone().braced(compliance).jacobian();
    let made_up = made_up(chain, &jacobian, &deflections);
    let mut command = q0.clone();
    for joint in chain.commanded() {
        command[joint] += made_up.as_ref().map_or(0.0, |all| all[joint]) - deflections[joint];
    }
    command
}

/// The commands with which the loaded tool rests where the unloaded one does at the pose's own, and the load there: one that is given
/// in the tool's frame turns with what the commanded joints cannot make up for.
pub(super) fn nonlinear(
    chain: &SerialChain,
    tool: &Tool,
    compliance: &[f64],
    pose: &TestPose,
    unloaded: &KinematicState,
) -> Result<(DVector<f64>, Load), EquilibriumError> {
    let mut arm = chain.at(tool);
    let mut solver = EquilibriumSolver::new(chain.len());
    let (wanted_m, wanted_axes) = (unloaded.tool_position, unloaded.tool_rotation);
    let mut load = pose.load_at(&wanted_axes);
    let mut command = linear(
        chain,
        unloaded,
        compliance,
        (&pose.configuration_rad, &load),
    );
    let commanded: Vec<usize> = chain.commanded().collect();
    let mut response = DMatrix::zeros(chain.len(), 6);
    for _ in 0..MAXIMUM_ITERATIONS {
        solver.solve(&mut arm, compliance, command.as_slice(), &load)?;
        solver.response(compliance, None, &mut response);
        let state = solver.state();
        load = pose.load_at(&state.tool_rotation);
        let apart_m = wanted_m - state.tool_position;
        let turned = rotation_vector(&(wanted_axes * state.tool_rotation.transpose()));
        let motion = Vector6::new(
            apart_m.x, apart_m.y, apart_m.z, turned.x, turned.y, turned.z,
        );
        let jacobian = Matrix6xX::from_fn(chain.len(), |row, joint| response[(joint, row)]);
        let step = commands_for(&jacobian, &commanded, &motion);
        for (&joint, step) in commanded.iter().zip(&step) {
            command[joint] += step;
        }
        if step.amax() <= CONVERGED {
            break;
        }
    }
    Ok((command, load))
}
