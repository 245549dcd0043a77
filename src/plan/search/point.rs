//! An experiment as the search sees it: its load, and the information that it gives.

use nalgebra::{DMatrix, DVector, Matrix3xX, Vector3};

use crate::experiment::Experiment;
use crate::robot::Load;

/// A force of a direction (unit vector) and a size (N).
pub(super) fn force(direction: &Vector3<f64>, size: f64) -> Load {
    let [x, y, z] = (direction * size).into();
    Load::force(x, y, z)
}

/// A configuration, a load and a gauge's direction with the observation matrix that they give.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The joint angles (rad).
    pub q: Vec<f64>,
    /// The load.
    pub load: Load,
    /// The direction that a gauge reads along.
    pub direction: Option<Vector3<f64>>,
    /// The scaled observation matrix, 3 x p a block, see [`super::observation::MatrixEvaluator`].
    pub matrix: Matrix3xX<f64>,
    /// The number of its blocks.
    pub blocks: usize,
}

impl Point {
    /// The scaled information A^T A, summed over the blocks, p x p.
    pub fn information(&self) -> DMatrix<f64> {
        let size = self.matrix.ncols() / self.blocks;
        let mut sum = DMatrix::zeros(size, size);
        for block in 0..self.blocks {
            let rows = self.matrix.columns(block * size, size);
            sum += rows.tr_mul(&rows);
        }
        sum
    }

    /// The point as an experiment of a plan.
    pub fn experiment(&self, repeats: u32) -> Experiment {
        experiment(&self.q, self.load, self.direction, repeats)
    }
}

/// An experiment at joint angles (rad), repeated so often.
pub(super) fn experiment(
    q: &[f64],
    load: Load,
    direction: Option<Vector3<f64>>,
    repeats: u32,
) -> Experiment {
    Experiment {
        configuration_rad: DVector::from_column_slice(q),
        load,
        repeats,
        approach: None,
        direction,
    }
}

/// Adds `weight` A^T A to an information matrix.
pub(super) fn add_information(
    information: &mut DMatrix<f64>,
    matrix: &Matrix3xX<f64>,
    weight: f64,
) {
    let size = information.nrows();
    for columns in matrix.as_slice().chunks_exact(3 * size) {
        let sums = information.as_mut_slice().chunks_exact_mut(size);
        for (sums, one) in sums.zip(columns.chunks_exact(3)) {
            let [x, y, z] = [one[0] * weight, one[1] * weight, one[2] * weight];
            for (sum, other) in sums.iter_mut().zip(columns.chunks_exact(3)) {
                *sum += x * other[0] + y * other[1] + z * other[2];
            }
        }
    }
}

/// trace(A G A^T), summed over the blocks: the information of an experiment in the directions G.
pub(super) fn information_in(matrix: &Matrix3xX<f64>, directions: &DMatrix<f64>) -> f64 {
    let size = directions.nrows();
    let mut sum = 0.0;
    for columns in matrix.as_slice().chunks_exact(3 * size) {
        let rows = directions.as_slice().chunks_exact(size);
        for (row, one) in rows.zip(columns.chunks_exact(3)) {
            for (weight, other) in row.iter().zip(columns.chunks_exact(3)) {
                sum += weight * (one[0] * other[0] + one[1] * other[1] + one[2] * other[2]);
            }
        }
    }
    sum
}

/// A G for every block A of an observation matrix, times a factor.
pub(super) fn in_directions(
    product: &mut Matrix3xX<f64>,
    factor: f64,
    matrix: &Matrix3xX<f64>,
    directions: &DMatrix<f64>,
) {
    let size = directions.nrows();
    let blocks = matrix.as_slice().chunks_exact(3 * size);
    let products = product.as_mut_slice().chunks_exact_mut(3 * size);
    for (columns, product) in blocks.zip(products) {
        let rows = directions.as_slice().chunks_exact(size);
        for (sum, row) in product.chunks_exact_mut(3).zip(rows) {
            sum.fill(0.0);
            for (weight, column) in row.iter().zip(columns.chunks_exact(3)) {
                let weight = factor * weight;
                sum[0] += weight * column[0];
                sum[1] += weight * column[1];
                sum[2] += weight * column[2];
            }
        }
    }
}
