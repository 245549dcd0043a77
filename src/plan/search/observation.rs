//! The observation matrix of one experiment with its derivatives, without allocation.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Vector3};

use super::braced::{BracedArm, ColumnWorth};
use crate::observation::PlannedReadings;
use crate::plan::ExperimentModel;
use crate::robot::{KinematicState, Kinematics, Load};
use crate::task::Extended;

/// Computes A^(p) of experiments, and where rotations are measured A^(phi) beside it, in units that make
/// them dimensionless: compliances relative to typical ones, deflections and rotations relative to sigma.
///
/// A matrix has three rows and p columns; where rotations are measured p more, so that the rows of A^(phi)
/// stand beside those of A^(p). What is called [`blocks`](Self::blocks) are these one or two parts.
#[derive(Debug, Clone)]
pub struct MatrixEvaluator<'a> {
    model: ExperimentModel<'a>,
    /// The joints whose compliances are the parameters.
    parameters: Vec<usize>,
    /// The parameters by ascending joints.
    order: Vec<usize>,
    /// Typical compliance over sigma, one for each parameter.
    scale: Vec<f64>,
    /// The same over the sigma of rotations, where they are measured.
    rotation_scale: Option<Vec<f64>>,
    /// Where the parameters are combinations of the joints' relative compliances: these, as columns.
    basis: Option<DMatrix<f64>>,
    /// The arm's geometry at the last configuration.
    pub state: KinematicState,
    /// The same where springs beside the joints' own brace the arm.
    braced: Option<Box<BracedArm>>,
    /// What multiplies the derivatives of the columns, one for each parameter.
    adjoint: Vec<Vector3<f64>>,
    twist: Vec<Vector3<f64>>,
    /// Where more is uncertain: derivatives with respect to that, too, whitened with the reading's covariance.
    extended: Option<PlannedReadings<'a>>,
}

impl<'a> MatrixEvaluator<'a> {
    /// An evaluator for a model; `parameters` are joints among the model's, `typical_rad_per_nm` their
    /// typical compliances. With a `basis`, the parameters are the coordinates in it of the relative
    /// compliances.
    #[must_use]
    pub fn new(
        model: ExperimentModel<'a>,
        parameters: &[usize],
        typical_rad_per_nm: &[f64],
        basis: Option<&DMatrix<f64>>,
    ) -> Self {
        let count = parameters.len();
        let over = |sigma: f64| typical_rad_per_nm.iter().map(|k| k / sigma).collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&index| parameters[index]);
        Self {
            order,
            parameters: parameters.to_vec(),
            scale: over(model.sigma_m),
            rotation_scale: model.rotation_sigma_rad.map(over),
            basis: basis.cloned(),
            state: KinematicState::new(model.chain.len()),
            braced: None,
            adjoint: vec![Vector3::zeros(); count],
            twist: vec![Vector3::zeros(); count],
            extended: None,
            model,
        }
    }

    /// The same for some unknowns of an extended vector, in units of their `sizes` (p); the parameters are the
    /// identified ones, which are the first of them.
    #[must_use]
    pub fn extended(mut self, extended: &'a Extended, unknowns: &[usize], sizes: &[f64]) -> Self {
        self.extended = Some(extended.readings(unknowns, sizes, self.model.precision()));
        self
    }

    /// Experiments are from now on repeated so often: what their repeats share, they do not average.
    pub fn set_repeats(&mut self, repeats: u32) {
        if let Some(extended) = &mut self.extended {
            extended.set_repeats(repeats);
        }
    }

    /// The number of unknowns, of which the parameters may be combinations.
    fn unknowns(&self) -> usize {
        (self.extended.as_ref()).map_or(self.scale.len(), PlannedReadings::parameters)
    }

    /// The number p of parameters.
    #[must_use]
    pub fn parameters(&self) -> usize {
        (self.basis.as_ref()).map_or(self.unknowns(), DMatrix::ncols)
    }

    /// 1, or 2 where rotations are measured.
    #[must_use]
    pub const fn blocks(&self) -> usize {
        if self.rotation_scale.is_some() { 2 } else { 1 }
    }

    /// A matrix to write to.
    #[must_use]
    pub fn matrix(&self) -> Matrix3xX<f64> {
        Matrix3xX::zeros(self.blocks() * self.parameters())
    }

    /// The acceleration of gravity (m/s^2).
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        self.model.chain.gravity_m_s2
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        self.model
            .chain
            .at(self.model.tool)
            .update(q, &mut self.state);
        if self.model.chain.elements.has_springs() {
            self.braced = BracedArm::new(&self.model, &self.state, q).map(Box::new);
        }
        if let Some(extended) = &mut self.extended {
            extended.stand(q, &self.state);
        }
    }

    /// The state whose Jacobian tells what the tool is moved by.
    fn seen(&self) -> &KinematicState {
        (self.braced.as_ref()).map_or(&self.state, |braced| &braced.state)
    }

    /// Writes the scaled observation matrix, 3 x p a block, at the last configuration.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.basis {
            None => self.observe_joints(load, matrix),
            Some(basis) => {
                let mut joints = Matrix3xX::zeros(self.blocks() * self.unknowns());
                self.observe_joints(load, &mut joints);
                times(&joints, basis, matrix);
            }
        }
    }

    fn observe_joints(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        if let Some(extended) = &self.extended {
            return extended.observe(load, matrix);
        }
        let state = self.seen();
        for (index, &joint) in self.parameters.iter().enumerate() {
            let torque = state.load_torque(joint, load);
            let column = state.position_column(joint);
            matrix.set_column(index, &(column * (torque * self.scale[index])));
        }
        let Some(scale) = &self.rotation_scale else {
            return;
        };
        for (index, &joint) in self.parameters.iter().enumerate() {
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
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        if let Some(basis) = &self.basis {
            let mut of_joints = Matrix3xX::zeros(self.blocks() * self.unknowns());
            times(factor, &basis.transpose(), &mut of_joints);
            self.pull_back_joints(load, &of_joints, gradient);
        } else {
            self.pull_back_joints(load, factor, gradient);
        }
    }

    fn pull_back_joints(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        if let Some(extended) = &mut self.extended {
            extended.pull_back(load, factor, gradient);
            return;
        }
        if let Some(braced) = &self.braced {
            let worth = self.worth_of_columns(&braced.state, load, factor);
            braced.pull_back(&self.model, &self.state, &worth, gradient);
            return;
        }
        let parameters = &self.parameters;
        for (index, &joint) in parameters.iter().enumerate() {
            let b = factor.column(index) * self.scale[index];
            let column = self.state.position_column(joint);
            let along = b.dot(&column);
            let v = b * self.state.load_torque(joint, load) + load.force_n * along;
            let axis = self.state.rotation_column(joint);
            self.adjoint[index] = column.cross(&v) + axis.cross(&load.torque_nm) * along;
            self.twist[index] = v.cross(&axis);
        }
        if let Some(scale) = &self.rotation_scale {
            for (index, &joint) in parameters.iter().enumerate() {
                let column = self.state.position_column(joint);
                let axis = self.state.rotation_column(joint);
                let c = factor.column(scale.len() + index) * scale[index];
                let along = c.dot(&axis);
                let v = load.force_n * along;
                let of_axis = c * self.state.load_torque(joint, load) + load.torque_nm * along;
                self.adjoint[index] += column.cross(&v) + axis.cross(&of_axis);
                self.twist[index] += v.cross(&axis);
            }
        }
        let mut index = 0;
        let mut outer: Vector3<f64> = self.adjoint.iter().sum();
        let mut inner = Vector3::zeros();
        for (joint, slope) in gradient.iter_mut().enumerate().take(self.state.joints()) {
            *slope += self.state.rotation_column(joint).dot(&outer)
                + self.state.position_column(joint).dot(&inner);
            if let Some(&next) = self.order.get(index)
                && parameters[next] == joint
            {
                outer -= self.adjoint[next];
                inner += self.twist[next];
                index += 1;
            }
        }
    }

    /// What a change of each parameter's column of a Jacobian is worth in sum(B * A): `v_n`, and what stands
    /// beside `z_n` in the first sum.
    fn worth_of_columns(
        &self,
        state: &KinematicState,
        load: &Load,
        factor: &Matrix3xX<f64>,
    ) -> Vec<ColumnWorth> {
        let worth = |(index, &joint): (usize, &usize)| {
            let torque = state.load_torque(joint, load);
            let b = factor.column(index) * self.scale[index];
            let mut along = b.dot(&state.position_column(joint));
            let mut rotation = Vector3::zeros();
            if let Some(scale) = &self.rotation_scale {
                let c = factor.column(scale.len() + index) * scale[index];
                along += c.dot(&state.rotation_column(joint));
                rotation = c * torque;
            }
            ColumnWorth {
                joint,
                position: b * torque + load.force_n * along,
                rotation: rotation + load.torque_nm * along,
            }
        };
        self.parameters.iter().enumerate().map(worth).collect()
    }

    /// The matrix Q (3 x 3) with sum(B * A) for B = A G equal to F^T Q F: the information that a
    /// force F at the last configuration gives in the directions G (p x p, symmetric), for loads
    /// without torque. Its largest eigenvector is the best direction of the force. Where more is uncertain it
    /// tells of the compliances and the instrument's noise alone, and is a good start.
    #[must_use]
    pub fn force_form(&self, directions: &DMatrix<f64>) -> Matrix3<f64> {
        match &self.basis {
            None => self.force_form_of_joints(directions),
            Some(basis) => self.force_form_of_joints(&(basis * directions * basis.transpose())),
        }
    }

    fn force_form_of_joints(&self, directions: &DMatrix<f64>) -> Matrix3<f64> {
        let state = self.seen();
        let mut form = Matrix3::zeros();
        let columns = || {
            (self.parameters.iter().enumerate())
                .map(|(index, &joint)| (index, state.position_column(joint)))
        };
        let axis = |index: usize| state.rotation_column(self.parameters[index]);
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

    /// The derivative of sum(B * A) with respect to the force F, at the load.
    #[must_use]
    pub fn force_gradient(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        let Some(basis) = &self.basis else {
            return self.force_gradient_of_joints(load, factor);
        };
        let mut of_joints = Matrix3xX::zeros(self.blocks() * self.unknowns());
        times(factor, &basis.transpose(), &mut of_joints);
        self.force_gradient_of_joints(load, &of_joints)
    }

    fn force_gradient_of_joints(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        if let Some(extended) = &mut self.extended {
            return extended.force_gradient(load, factor);
        }
        let state = self.seen();
        (self.parameters.iter().enumerate())
            .map(|(index, &joint)| {
                let column = state.position_column(joint);
                let mut weight = factor.column(index).dot(&column) * self.scale[index];
                if let Some(scale) = &self.rotation_scale {
                    let axis = state.rotation_column(joint);
                    weight += factor.column(scale.len() + index).dot(&axis) * scale[index];
                }
                column * weight
            })
            .sum()
    }
}

/// Writes every block of a matrix times another matrix.
pub(super) fn times(matrix: &Matrix3xX<f64>, other: &DMatrix<f64>, product: &mut Matrix3xX<f64>) {
    let (from, to) = other.shape();
    for block in 0..matrix.ncols() / from {
        let rows = matrix.columns(block * from, from);
        rows.mul_to(other, &mut product.columns_mut(block * to, to));
    }
}
