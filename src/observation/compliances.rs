//! Readings that are planned where compliances alone are to be found and only the instrument's noise disturbs: the
//! observation matrix of one experiment with its derivatives, without allocation.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Matrix6xX, Vector3};

use super::reading::DeflectionPrecision;
use crate::robot::{KinematicState, Load, SerialChain, Tool};

/// An arm with a tool, of which compliances alone may be unknown.
#[derive(Debug, Clone, Copy)]
pub struct BareArm<'a> {
    /// The chain.
    pub chain: &'a SerialChain,
    /// The nominal compliances of all joints (rad/(N m)).
    pub compliance_rad_per_nm: &'a [f64],
    /// The tool.
    pub tool: &'a Tool,
}

/// A change of a joint's column of the Jacobian, position and rotation rows, is worth so much.
#[derive(Debug, Clone, Copy, Default)]
struct ColumnWorth {
    position: Vector3<f64>,
    rotation: Vector3<f64>,
}

/// Compliances that are to be found, and what their columns of the observation matrix are multiplied by.
#[derive(Debug, Clone)]
pub struct ComplianceColumns {
    /// The joints whose compliances they are.
    joints: Vec<usize>,
    /// Size over sigma, one for each compliance.
    scale: Vec<f64>,
    /// The same over the sigma of rotations, where they are read.
    rotation_scale: Option<Vec<f64>>,
}

impl ComplianceColumns {
    /// The compliances of some joints in units of their `sizes`, read so precisely.
    pub fn new(joints: &[usize], sizes: &[f64], precision: DeflectionPrecision) -> Self {
        let over = |sigma: f64| sizes.iter().map(|size| size / sigma).collect();
        Self {
            joints: joints.to_vec(),
            scale: over(precision.sigma_m),
            rotation_scale: precision.rotation_sigma_rad.map(over),
        }
    }

    /// The matrix Q (3 x 3) with sum(B * A) for B = A G equal to F^T Q F: the information that a
    /// force F gives in the directions G (p x p, symmetric) where the arm has this geometry, with its springs at
    /// work, for loads without torque. Its largest eigenvector is the best direction of the force.
    pub fn force_form(&self, state: &KinematicState, directions: &DMatrix<f64>) -> Matrix3<f64> {
        let mut form = Matrix3::zeros();
        let columns = || {
            (self.joints.iter().enumerate())
                .map(|(index, &joint)| (index, state.position_column(joint)))
        };
        let axis = |index: usize| state.rotation_column(self.joints[index]);
        for (one, j_one) in columns() {
            for (other, j_other) in columns() {
                let mut weight = directions[(one, other)]
                    * self.scale[one]
                    * self.scale[other]
                    * j_one.dot(&j_other);
                if let Some(scale) = &self.rotation_scale {
                    weight += directions[(one, other)]
                        * scale[one]
                        * scale[other]
                        * axis(one).dot(&axis(other));
                }
                form += j_one * j_other.transpose() * weight;
            }
        }
        (form + form.transpose()) * 0.5
    }
}

/// An arm's deflections, and rotations beside them, to first order in compliance. The arm has no springs beside the joints' own.
#[derive(Debug, Clone)]
pub struct ComplianceRows {
    columns: ComplianceColumns,
    sizes: Vec<f64>,
    /// Room for what changes of the Jacobian's columns are worth.
    worth: Vec<ColumnWorth>,
}

impl ComplianceRows {
    /// The compliances of some joints, by their places among all of an arm. Derivatives are in units of their `sizes` (p).
    pub fn new(
        all: usize,
        joints: &[usize],
        sizes: &[f64],
        precision: DeflectionPrecision,
    ) -> Self {
        Self {
            worth: vec![ColumnWorth::default(); all],
            columns: ComplianceColumns::new(joints, sizes, precision),
            sizes: sizes.to_vec(),
        }
    }

    /// Writes the derivatives of a reading (6 x p), position above rotation: the columns of A (eqs. 4 and 8).
    pub fn derivatives(&self, state: &KinematicState, load: &Load, matrix: &mut Matrix6xX<f64>) {
        for (index, (&joint, size)) in self.columns.joints.iter().zip(&self.sizes).enumerate() {
            let angle = state.load_torque(joint, load) * size;
            let mut column = matrix.column_mut(index);
            column
                .fixed_rows_mut::<3>(0)
                .copy_from(&(state.position_column(joint) * angle));
            column
                .fixed_rows_mut::<3>(3)
                .copy_from(&(state.rotation_column(joint) * angle));
        }
    }

    /// Writes the derivatives of the whitened reading: 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, state: &KinematicState, load: &Load, matrix: &mut Matrix3xX<f64>) {
        for (index, &joint) in self.columns.joints.iter().enumerate() {
            let torque = state.load_torque(joint, load);
            let column = state.position_column(joint);
            matrix.set_column(index, &(column * (torque * self.columns.scale[index])));
        }
        let Some(scale) = &self.columns.rotation_scale else {
            return;
        };
        for (index, &joint) in self.columns.joints.iter().enumerate() {
            let torque = state.load_torque(joint, load);
            let axis = state.rotation_column(joint);
            matrix.set_column(scale.len() + index, &(axis * (torque * scale[index])));
        }
    }

    /// Adds the derivative of sum(B * A), taken element by element, with respect to the joint angles
    /// to `gradient` (n values), in one sweep over the joints.
    ///
    /// Column n of A is `J_n` (`J_n` . F + `z_n` . T). With `v_n` = (`J_n` . F + `z_n` . T) `B_n` + (`B_n` . `J_n`) F
    /// and `dJ_n/dq_j` = `z_j` x `J_n` (j <= n) or `z_n` x `J_j` (j > n), the sum over n becomes
    /// `z_j` . sum_{n >= j} (`J_n` x `v_n` + (`B_n` . `J_n`) `z_n` x T) + `J_j` . sum_{n < j} (`v_n` x `z_n`).
    /// Where rotations are measured, with their part `C_n` of B, (`C_n` . `z_n`) F adds to `v_n`, and
    /// `z_n` x ((`J_n` . F + `z_n` . T) `C_n` + (`C_n` . `z_n`) T) to the first sum.
    pub fn pull_back(
        &mut self,
        state: &KinematicState,
        load: &Load,
        factor: &Matrix3xX<f64>,
        gradient: &mut [f64],
    ) {
        let mut worth = std::mem::take(&mut self.worth);
        self.weigh(state, load, factor, &mut worth);
        sweep(state, &mut worth, gradient);
        self.worth = worth;
    }

    /// What changes of a Jacobian's columns are worth in sum(B * A): `v_n`, and what stands beside `z_n` in the first sum.
    fn weigh(
        &self,
        state: &KinematicState,
        load: &Load,
        factor: &Matrix3xX<f64>,
        worth: &mut [ColumnWorth],
    ) {
        worth.fill(ColumnWorth::default());
        let columns = &self.columns;
        for (index, &joint) in columns.joints.iter().enumerate() {
            let torque = state.load_torque(joint, load);
            let b = factor.column(index) * columns.scale[index];
            let mut along = b.dot(&state.position_column(joint));
            let mut rotation = Vector3::zeros();
            if let Some(scale) = &columns.rotation_scale {
                let c = factor.column(scale.len() + index) * scale[index];
                along += c.dot(&state.rotation_column(joint));
                rotation = c * torque;
            }
            worth[joint].position += b * torque + load.force_n * along;
            worth[joint].rotation += rotation + load.torque_nm * along;
        }
    }

    /// The derivative of sum(B * A) with respect to the force F, whatever that is.
    pub fn force_gradient(&self, state: &KinematicState, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        let columns = &self.columns;
        (columns.joints.iter().enumerate())
            .map(|(index, &joint)| {
                let column = state.position_column(joint);
                let mut weight = factor.column(index).dot(&column) * columns.scale[index];
                if let Some(scale) = &columns.rotation_scale {
                    let axis = state.rotation_column(joint);
                    weight += factor.column(scale.len() + index).dot(&axis) * scale[index];
                }
                column * weight
            })
            .sum()
    }
}

/// Adds what turning each joint is worth by the columns of the Jacobian, which become their adjoints.
fn sweep(state: &KinematicState, worth: &mut [ColumnWorth], gradient: &mut [f64]) {
    let mut outer = Vector3::zeros();
    for (joint, each) in worth.iter_mut().enumerate() {
        let (column, axis) = (state.position_column(joint), state.rotation_column(joint));
        let adjoint = column.cross(&each.position) + axis.cross(&each.rotation);
        outer += adjoint;
        // What is beyond the joint and turns with it, and what it carries.
        (each.rotation, each.position) = (adjoint, each.position.cross(&axis));
    }
    let mut inner = Vector3::zeros();
    for (joint, (slope, each)) in gradient.iter_mut().zip(worth).enumerate() {
        *slope +=
            state.rotation_column(joint).dot(&outer) + state.position_column(joint).dot(&inner);
        outer -= each.rotation;
        inner += each.position;
    }
}

#[cfg(test)]
mod tests;
