//! Readings of one visit, and what visits say together.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{MixedSolution, MixedVariances};
use crate::numeric::ornstein_uhlenbeck::Between;

/// Readings that share what is new at a visit.
#[derive(Debug, Clone)]
pub(in super::super) struct VisitReadings {
    /// Read less predicted (m).
    pub residual: DVector<f64>,
    /// Derivatives by what is determined of the parameters (m x r).
    pub fixed: DMatrix<f64>,
    /// Derivatives by each joint's angle (m x k).
    pub joints: DMatrix<f64>,
    /// The same by waves of those joints' errors that have them (m x w).
    pub waves: DMatrix<f64>,
    /// The readings' own covariance.
    pub own: DMatrix<f64>,
    /// Which coordinate each row is, from 0 to 5.
    pub coordinates: Vec<usize>,
    /// The commanded angles of the joints.
    pub angles: Vec<f64>,
    /// Variances of what is new at it, of positions and of rotations, that its readings were weighed with.
    pub assumed: [f64; 2],
}

/// A visit's equations at some variances: the knots that move it by each joint's error, and the covariance of what they leave.
pub(super) struct VisitEquations {
    pub between: Vec<Between>,
    pub covariance: DMatrix<f64>,
}

impl VisitReadings {
    /// What is determined of the parameters (m x r), weighed as it was fitted.
    pub fn weighed(&self) -> Option<DMatrix<f64>> {
        let mut by = self.own.clone();
        self.add_shared(&mut by, &self.assumed);
        Some(Cholesky::new(by)?.solve(&self.fixed))
    }

    /// Adds what is new at the visit: variances of positions and rotations.
    pub fn add_shared(&self, covariance: &mut DMatrix<f64>, variances: &[f64]) {
        for (row, one) in self.coordinates.iter().enumerate() {
            for (column, other) in self.coordinates.iter().enumerate() {
                if one == other {
                    covariance[(row, column)] += variances[one / 3];
                }
            }
        }
    }

    pub(super) fn local(&self, variances: &MixedVariances) -> VisitEquations {
        let mut covariance = self.own.clone();
        self.add_shared(&mut covariance, &variances.all);
        let processes = variances.process.iter().zip(&self.angles);
        let between: Vec<Between> = processes.map(|(each, &at)| each.between(at)).collect();
        for (joint, between) in between.iter().enumerate() {
            let moved = self.joints.column(joint);
            let own = variances.all[2 + joint] * between.spare;
            covariance.ger(own, &moved, &moved, 1.0);
        }
        VisitEquations {
            between,
            covariance,
        }
    }

    /// Derivatives by parameters, waves and joints, and what is left, side by side.
    fn columns(&self) -> DMatrix<f64> {
        let each = [&self.fixed, &self.waves, &self.joints].map(DMatrix::as_slice);
        let all = [each[0], each[1], each[2], self.residual.as_slice()].concat();
        DMatrix::from_vec(self.residual.len(), all.len() / self.residual.len(), all)
    }

    /// Adds to the sums that improve the variances of what is new at visits and of joints' errors. `by_dense` are the derivatives by
    /// parameters and waves times the covariance of these.
    pub(super) fn improve(
        &self,
        local: &VisitEquations,
        offsets: &[usize],
        (solved, by_dense): (&MixedSolution, &DMatrix<f64>),
        sums: &mut [[f64; 2]],
    ) -> Option<()> {
        let weight = Cholesky::new(local.covariance.clone())?.inverse();
        let (left, known) = self.beside_known(local, offsets, solved, by_dense);
        let left = &weight * left;
        let projected = &weight - &weight * known * &weight;
        for (row, one) in self.coordinates.iter().enumerate() {
            for (column, other) in self.coordinates.iter().enumerate() {
                if one == other {
                    let sum = &mut sums[one / 3];
                    sum[0] += left[row] * left[column];
                    sum[1] += projected[(row, column)];
                }
            }
        }
        for (joint, Between { spare, .. }) in local.between.iter().enumerate() {
            let moved = self.joints.column(joint);
            let sum = &mut sums[2 + joint];
            sum[0] += spare * moved.dot(&left).powi(2);
            sum[1] += spare * moved.dot(&(&projected * moved));
        }
        Some(())
    }

    /// What is left of the readings, and the covariance of what is predicted.
    pub(super) fn beside_known(
        &self,
        local: &VisitEquations,
        offsets: &[usize],
        solved: &MixedSolution,
        by_dense: &DMatrix<f64>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let columns = self.columns();
        let dense = columns.columns(0, offsets[0]);
        let joints = self.angles.len();
        let at = |joint: usize| {
            let Between { knots, weights, .. } = &local.between[joint];
            [0, 1].map(|end| (offsets[joint] + knots[end], weights[end]))
        };
        // The joints' errors there, and their covariance with parameters and waves, and with each other.
        let errors = DVector::from_fn(joints, |joint, _| {
            at(joint)
                .map(|(knot, weight)| weight * solved.mean[knot])
                .iter()
                .sum()
        });
        let mut with_dense = DMatrix::zeros(offsets[0], joints);
        for (joint, mut column) in with_dense.column_iter_mut().enumerate() {
            for (knot, weight) in at(joint) {
                let own = solved.covariance.view((0, knot), (offsets[0], 1));
                column.axpy(weight, &own.column(0), 1.0);
            }
        }
        let together = DMatrix::from_fn(joints, joints, |one, other| {
            let pairs = at(one)
                .into_iter()
                .flat_map(|one| at(other).map(|other| (one, other)));
            let terms =
                pairs.map(|((row, w), (column, v))| w * v * solved.covariance[(row, column)]);
            terms.sum()
        });
        let crossed = dense * with_dense + &self.joints * together * 0.5;
        let half = crossed * self.joints.transpose();
        let known = by_dense * dense.transpose() + &half + half.transpose();
        let predicted = dense * solved.mean.rows(0, offsets[0]) + &self.joints * errors;
        (&self.residual - predicted, known)
    }
}

/// The information of some visits and its pull, in its upper triangle.
pub(super) fn sums_of(
    visits: &[VisitReadings],
    variances: &MixedVariances,
    offsets: &[usize],
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let (size, first) = (*offsets.last()?, offsets[0]);
    let mut information = DMatrix::zeros(size, size);
    let mut gradient = DVector::zeros(size);
    let rows = visits.iter().map(|each| each.residual.len()).sum();
    let mut dense = DMatrix::zeros(rows, first);
    let mut left = DVector::zeros(rows);
    let mut at = 0;
    for visit in visits {
        let local = visit.local(variances);
        let mut columns = visit.columns();
        let factor = Cholesky::new(local.covariance)?;
        (factor.l_dirty()).solve_lower_triangular_unchecked_mut(&mut columns);
        let joints = columns.columns(first, local.between.len());
        let by_joints = columns.transpose() * joints;
        for (joint, between) in local.between.iter().enumerate() {
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                let to = offsets[joint] + knot;
                let own = by_joints.column(joint);
                let mut column = information.column_mut(to);
                let mut column = column.rows_mut(0, first);
                column.axpy(weight, &own.rows(0, first), 1.0);
                gradient[to] += weight * own[own.len() - 1];
                for (other, beside) in local.between.iter().enumerate() {
                    for (knot, beside) in beside.knots.into_iter().zip(beside.weights) {
                        information[(offsets[other] + knot, to)] +=
                            weight * beside * own[first + other];
                    }
                }
            }
        }
        let count = visit.residual.len();
        dense
            .rows_mut(at, count)
            .copy_from(&columns.columns(0, first));
        left.rows_mut(at, count)
            .copy_from(&columns.column(columns.ncols() - 1));
        at += count;
    }
    let mut own = information.view_mut((0, 0), (first, first));
    own.gemm(1.0, &dense.transpose(), &dense, 1.0);
    gradient.rows_mut(0, first).copy_from(&dense.tr_mul(&left));
    Some((information, gradient))
}

impl MixedSolution {
    /// Visits' derivatives by parameters and waves times the covariance of these, one visit below the other.
    pub fn of_dense(&self, visits: &[VisitReadings], first: usize) -> DMatrix<f64> {
        let rows = visits.iter().map(|each| each.residual.len()).sum();
        let mut dense = DMatrix::zeros(rows, first);
        let mut at = 0;
        for visit in visits {
            let count = visit.residual.len();
            dense
                .rows_mut(at, count)
                .copy_from(&visit.columns().columns(0, first));
            at += count;
        }
        dense * self.covariance.view((0, 0), (first, first))
    }
}
