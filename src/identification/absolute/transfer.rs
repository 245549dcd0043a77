//! A load that acts at one tool, as it acts at another.

use nalgebra::Vector3;

use crate::robot::{KinematicState, Kinematics, Load, SerialChain, Tool};

/// The wrench at a target that stands for a load at another tool further out, at the commanded angles: for all joints that move
/// the target it is the same load.
pub(super) fn transferred(
    chain: &SerialChain,
    acts_at: &Tool,
    target: &Tool,
    q: &[f64],
    load: &Load,
) -> Load {
    if *load == Load::NONE || acts_at == target {
        return *load;
    }
    let place = |tool: &Tool| -> Vector3<f64> {
        let mut state = KinematicState::new(chain.len());
        chain.at(tool).update(q, &mut state);
        state.tool_position
    };
    let lever = place(acts_at) - place(target);
    Load {
        force_n: load.force_n,
        torque_nm: load.torque_nm + lever.cross(&load.force_n),
    }
}
