//! What springs beside the joints' own, such as a gravity compensator, make of an arm's elastostatics.
//!
//! With their stiffness S at the commanded angles, the joints' own K = k^-1 and a wrench W
//!
//! ```text
//! dt = K_C^-1 W,   K_C = J^-T (K + S) J^-1              deflection, eqs. 1 and 2 with K + S for K
//! d(dt)/dk_j = J~_j J~_j^T W,   J~ = J (I + k S)^-1     column j of A, eq. 4 with J~ for J
//! ```
//!
//! The deflection is no longer linear in k: A holds for changes from the compliances that it was made with, and
//! A k leaves J~ k (J - J~)^T W of it.

use nalgebra::{DMatrix, Vector3};

use super::elements::Elements;
use super::kinematic_state::KinematicState;

impl KinematicState {
    /// Writes what springs beside the joints' own exert at the joint angles `q`; all else is in its place by
    /// then.
    pub(crate) fn feel(&mut self, elements: &Elements, q: &[f64]) {
        if !elements.has_springs() {
            return;
        }
        let joints = self.joints();
        let mut torque = std::mem::take(&mut self.spring_torque);
        let mut stiffness = std::mem::replace(&mut self.spring_stiffness, DMatrix::zeros(0, 0));
        if stiffness.nrows() != joints {
            stiffness = DMatrix::zeros(joints, joints);
        }
        torque.clear();
        torque.resize(joints, 0.0);
        stiffness.fill(0.0);
        elements.exert(q, self, &mut torque, &mut stiffness);
        self.spring_torque = torque;
        self.spring_stiffness = stiffness;
    }

    /// What springs beside the joints' own exert about joint j (N m), and how that grows with joint i's
    /// coordinate (N m/rad).
    pub fn torque_of_springs(&self, joint: usize, by: usize) -> (f64, f64) {
        match self.spring_torque.get(joint) {
            Some(&torque) => (torque, -self.spring_stiffness[(joint, by)]),
            None => (0.0, 0.0),
        }
    }

    /// (I + k S)^-1 for the joints' compliances k and the stiffness S of the springs beside their own: how
    /// the joints move with what their own springs alone would give way. `None` without such springs, and
    /// where they would let the arm buckle.
    pub fn mobility(&self, compliance_rad_per_nm: &[f64]) -> Option<DMatrix<f64>> {
        if self.spring_torque.is_empty() {
            return None;
        }
        let mut system = self.spring_stiffness.clone();
        for (mut row, &compliance) in system.row_iter_mut().zip(compliance_rad_per_nm) {
            row *= compliance;
        }
        for joint in 0..self.joints() {
            system[(joint, joint)] += 1.0;
        }
        system.try_inverse()
    }

    /// Puts J~ = J (I + k S)^-1 in the place of the Jacobian J, for [`Self::mobility`]. The torque of a load
    /// about a joint is then J~^T W.
    pub fn brace(&mut self, mobility: &DMatrix<f64>) {
        let braced = |columns: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            let column = |joint| {
                let terms = columns.iter().zip(mobility.column(joint));
                terms.map(|(column, share)| column * *share).sum()
            };
            (0..columns.len()).map(column).collect()
        };
        self.position_columns = braced(&self.position_columns);
        self.rotation_columns = braced(&self.rotation_columns);
    }

    /// The state as planning needs it, see [`Self::brace`]: itself where there are no springs beside the
    /// joints' own.
    pub fn braced(mut self, compliance_rad_per_nm: &[f64]) -> Self {
        if let Some(mobility) = self.mobility(compliance_rad_per_nm) {
            self.brace(&mobility);
        }
        self
    }
}
