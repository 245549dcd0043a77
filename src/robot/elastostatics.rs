//! Linear elastostatics: eqs. 2 to 4, 7 and 8 of Klimchik et al. 2012.

use nalgebra::Matrix3xX;

use super::kinematic_state::{KinematicState, Load};

/// The observation matrix A = [`J_1` `J_1^T` W, ..., `J_n` `J_n^T` W] (eq. 4), which maps the compliances
/// of the identified joints to the tool's displacement: dt = A k (eq. 3).
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationMatrix {
    /// The position rows A^(p) (eqs. 7 and 8), 3 x p, in m N m/rad.
    pub position: Matrix3xX<f64>,
    /// The rotation rows A^(phi) (eq. 8), 3 x p, in rad N m/rad.
    pub rotation: Matrix3xX<f64>,
}

impl ObservationMatrix {
    /// The observation matrix at a configuration under a load; its p columns belong to the joints
    /// listed in `parameters`.
    pub fn new(state: &KinematicState, load: &Load, parameters: &[usize]) -> Self {
        let mut matrix = Self {
            position: Matrix3xX::zeros(parameters.len()),
            rotation: Matrix3xX::zeros(parameters.len()),
        };
        for (column, &joint) in parameters.iter().enumerate() {
            let torque = state.load_torque(joint, load);
            matrix
                .position
                .set_column(column, &(state.position_column(joint) * torque));
            matrix
                .rotation
                .set_column(column, &(state.rotation_column(joint) * torque));
        }
        matrix
    }
}
