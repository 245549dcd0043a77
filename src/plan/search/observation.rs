//! The observation matrix of one experiment with its derivatives, in the unknowns of a search.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Vector3};

use crate::experiment::Experiment;
use crate::observation::{ComplianceColumns, PlannedReadings};
use crate::robot::Load;

/// How far joints are moved to see what follows them (rad, m).
const SHIFT: f64 = 1e-5;

/// Planned readings in the unknowns that a search is about, in units that make the observation matrix dimensionless:
/// compliances relative to typical ones, deflections and rotations relative to sigma.
///
/// A matrix has three rows and p columns; where rotations are measured p more, so that the rows of A^(phi)
/// stand beside those of A^(p). What is called [`blocks`](Self::blocks) are these one or two parts.
#[derive(Debug, Clone)]
pub struct MatrixEvaluator<'a> {
    /// The readings in their own unknowns: where and how they are made.
    pub readings: PlannedReadings<'a>,
    /// The identified compliances, of which the best direction of a force is seen.
    compliances: ComplianceColumns,
    /// Where the parameters are combinations of the readings' unknowns: these, as columns.
    basis: Option<DMatrix<f64>>,
}

impl<'a> MatrixEvaluator<'a> {
    /// An evaluator of readings, of whose unknowns the identified `compliances` are the first. With a `basis`, the
    /// parameters are the coordinates in it of these unknowns.
    pub fn new(
        readings: PlannedReadings<'a>,
        compliances: ComplianceColumns,
        basis: Option<&DMatrix<f64>>,
    ) -> Self {
        Self {
            readings,
            compliances,
            basis: basis.cloned(),
        }
    }

    /// The number p of parameters.
    pub fn parameters(&self) -> usize {
        (self.basis.as_ref()).map_or(self.readings.parameters(), DMatrix::ncols)
    }

    /// 1, or 2 where rotations are measured.
    pub fn blocks(&self) -> usize {
        self.readings.rows() / 3
    }

    /// A matrix to write to.
    pub fn matrix(&self) -> Matrix3xX<f64> {
        Matrix3xX::zeros(self.blocks() * self.parameters())
    }

    /// The same for the readings' own unknowns.
    fn matrix_of_unknowns(&self) -> Matrix3xX<f64> {
        Matrix3xX::zeros(self.blocks() * self.readings.parameters())
    }

    /// Writes the scaled observation matrix, 3 x p a block, at the last configuration.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.basis {
            None => self.readings.observe(load, matrix),
            Some(basis) => {
                let mut of_unknowns = self.matrix_of_unknowns();
                self.readings.observe(load, &mut of_unknowns);
                times(&of_unknowns, basis, matrix);
            }
        }
    }

    /// Moves to an experiment, measured so often, and writes its scaled observation matrix.
    pub(super) fn observe_experiment(
        &mut self,
        experiment: &Experiment,
        repeats: u32,
        matrix: &mut Matrix3xX<f64>,
    ) {
        self.readings.set_repeats(repeats);
        self.readings.stand_at(experiment);
        self.observe(&experiment.load, matrix);
    }

    /// What experiments of the last configuration tell together, p x p.
    pub fn told_together(&mut self, experiments: &[&Experiment]) -> DMatrix<f64> {
        let size = self.readings.parameters();
        let rows = self.readings.observe_together(experiments);
        let each = rows.iter().zip(experiments);
        let told = each.fold(DMatrix::zeros(size, size), |sum, (rows, experiment)| {
            sum + rows.tr_mul(rows) * f64::from(experiment.repeats)
        });
        match &self.basis {
            None => told,
            Some(basis) => basis.tr_mul(&told) * basis,
        }
    }

    /// Adds the derivatives of a cost with respect to the joint angles of a configuration in which several experiments share
    /// errors, by differences; the cost's with respect to the information are -G (p x p). Leaves the configuration.
    pub fn gradient_together(
        &mut self,
        q: &[f64],
        experiments: &[&Experiment],
        directions: &DMatrix<f64>,
        gradient: &mut [f64],
    ) {
        let mut moved = q.to_vec();
        for (joint, slope) in gradient.iter_mut().enumerate() {
            let mut at = |shift: f64| {
                moved[joint] = q[joint] + shift;
                self.readings.move_to(&moved);
                self.told_together(experiments).dot(directions)
            };
            *slope -= (at(SHIFT) - at(-SHIFT)) / (2.0 * SHIFT);
            moved[joint] = q[joint];
        }
    }

    /// Adds the derivative of sum(B * A), taken element by element, with respect to the joint angles
    /// to `gradient` (n values).
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        if let Some(basis) = &self.basis {
            let mut of_unknowns = self.matrix_of_unknowns();
            times(factor, &basis.transpose(), &mut of_unknowns);
            self.readings.pull_back(load, &of_unknowns, gradient);
        } else {
            self.readings.pull_back(load, factor, gradient);
        }
    }

    /// The matrix Q (3 x 3) with sum(B * A) for B = A G equal to F^T Q F, see [`ComplianceColumns::force_form`].
    /// Where more is uncertain it tells of the compliances and the instrument's noise alone, and is a good start.
    pub fn force_form(&self, directions: &DMatrix<f64>) -> Matrix3<f64> {
        let (seen, form) = (self.readings.seen(), &self.compliances);
        match &self.basis {
            None => form.force_form(&seen, directions),
            Some(basis) => form.force_form(&seen, &(basis * directions * basis.transpose())),
        }
    }

    /// The derivative of sum(B * A) with respect to the force F, at the load.
    pub fn force_gradient(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        let Some(basis) = &self.basis else {
            return self.readings.force_gradient(load, factor);
        };
        let mut of_unknowns = self.matrix_of_unknowns();
        times(factor, &basis.transpose(), &mut of_unknowns);
        self.readings.force_gradient(load, &of_unknowns)
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
