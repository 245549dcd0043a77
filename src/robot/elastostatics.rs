//! Linear elastostatics: eqs. 1 to 4, 7 and 8 of Klimchik et al. 2012.

use nalgebra::{Matrix3xX, Matrix6, Matrix6xX};

use super::kinematic_state::{KinematicState, Load};
use crate::numeric::factorisation::finite_eigen;

/// The Cartesian stiffness matrix `K_C` = J^-T `K_theta` J^-1 (eq. 1), 6 x 6, in the world frame at the
/// tool: rows force (N) and torque (N m), columns displacement (m) and rotation (rad).
///
/// `compliance_rad_per_nm` are the joints' compliances. `None` where the compliance matrix
/// J `k_theta` J^T is singular: fewer than six elastic joints, or a singular configuration.
pub fn cartesian_stiffness(
    state: &KinematicState,
    compliance_rad_per_nm: &[f64],
) -> Option<Matrix6<f64>> {
    let jacobian = state.jacobian();
    let mut scaled = jacobian.clone();
    for (mut column, &compliance) in scaled.column_iter_mut().zip(compliance_rad_per_nm) {
        column *= compliance;
    }
    let compliance = Matrix6::from_iterator((&scaled * jacobian.transpose()).iter().copied());
    // Whether it is singular must not depend on the units of length and angle.
    let size = compliance.diagonal().map(f64::sqrt);
    let relative =
        Matrix6::from_fn(|row, column| compliance[(row, column)] / (size[row] * size[column]));
    let smallest = finite_eigen(&relative)?.eigenvalues.min();
    (smallest > SINGULAR).then(|| compliance.try_inverse())?
}

/// Rounding alone leaves the smallest eigenvalue of a singular matrix with a diagonal of ones below
/// this.
const SINGULAR: f64 = 1e-13;

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

    /// All six rows, position above rotation (eq. 8).
    pub fn rows(&self) -> Matrix6xX<f64> {
        let mut rows = Matrix6xX::zeros(self.position.ncols());
        rows.fixed_rows_mut::<3>(0).copy_from(&self.position);
        rows.fixed_rows_mut::<3>(3).copy_from(&self.rotation);
        rows
    }
}
