//! Readings of one command pose as a mixed model has them.

use std::borrow::Borrow;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, UnitQuaternion, stack};

use super::{MixedSolution, MixedVariances, PoseReadings};
use crate::experiment::together;
use crate::numeric::markov::Between;

/// A visit's equations at some variances: the knots that move it by each joint's error, and the covariance of what they leave.
pub(super) struct VisitEquations {
    pub between: Vec<Between>,
    pub covariance: DMatrix<f64>,
}

impl PoseReadings {
    /// What is determined of the parameters (m x r), weighed as it was fitted.
    pub(super) fn weighed(&self, parameters: usize) -> Option<DMatrix<f64>> {
        let mut by = self.own.clone();
        for (row, column, _) in self.pairs().filter(|(.., is_one_visit)| *is_one_visit) {
            by[(row, column)] += self.assumed[row];
        }
        Some(Cholesky::new(by)?.solve(&self.dense.columns(0, parameters)))
    }

    /// Rows of one coordinate in pairs, and whether they are of one visit.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize, bool)> {
        let count = self.coordinates.len();
        let all = (0..count).flat_map(move |row| (0..count).map(move |column| (row, column)));
        all.filter(|&(row, column)| self.coordinates[row] == self.coordinates[column])
            .map(|(row, column)| (row, column, self.visits[row] == self.visits[column]))
    }

    /// Where the variances are of what two rows of one coordinate share.
    fn shared_by(
        &self,
        row: usize,
        is_one_visit: bool,
        of_poses: Option<usize>,
    ) -> impl Iterator<Item = usize> + use<> {
        let part = self.coordinates[row] / 3;
        let of_visit = is_one_visit.then_some(part);
        (of_visit.into_iter()).chain(of_poses.map(|first| first + part))
    }

    /// How a joint's error moves the rows of each visit alone (m).
    pub(super) fn moved_at_visits(&self, joint: usize) -> impl Iterator<Item = DVector<f64>> {
        let moved = self.joints.column(joint);
        let visits = 0..=self.visits.last().copied().unwrap_or(0);
        visits.map(move |visit| {
            let own = |row: usize| f64::from(u8::from(self.visits[row] == visit));
            DVector::from_fn(moved.len(), |row, _| own(row) * moved[row])
        })
    }

    pub(super) fn is_visited_again(&self) -> bool {
        self.visits.last().is_some_and(|&last| last > 0)
    }

    /// The same in axes that this turns into their own.
    fn turned(&self, by: &UnitQuaternion<f64>) -> Self {
        let by = by.to_rotation_matrix();
        let size = self.coordinates.len();
        let turn = DMatrix::from_fn(size, size, |row, column| {
            let is_one = row - self.coordinates[row] % 3 == column - self.coordinates[column] % 3;
            if is_one {
                by[(self.coordinates[row] % 3, self.coordinates[column] % 3)]
            } else {
                0.0
            }
        });
        Self {
            residual: &turn * &self.residual,
            dense: &turn * &self.dense,
            joints: &turn * &self.joints,
            own: &turn * &self.own * turn.transpose(),
            ..self.clone()
        }
    }

    /// The same with a visit more of its pose.
    fn with(self, other: &Self) -> Self {
        let mut other = other.turned(&(self.axes.inverse() * other.axes));
        let next = self.visits.last().map_or(0, |last| last + 1);
        other.visits.iter_mut().for_each(|visit| *visit += next);
        self.above(other)
    }

    /// The same with other readings below, of the visits that these say.
    pub(super) fn above(self, other: Self) -> Self {
        Self {
            residual: stack![self.residual; other.residual],
            dense: stack![self.dense; other.dense],
            joints: stack![self.joints; other.joints],
            own: stack![self.own, 0; 0, other.own],
            coordinates: [self.coordinates, other.coordinates].concat(),
            visits: [self.visits, other.visits].concat(),
            assumed: [self.assumed, other.assumed].concat(),
            ..self
        }
    }

    /// The knots that move it by each joint's error.
    pub(super) fn between(&self, variances: &MixedVariances) -> Vec<Between> {
        let processes = variances.process.iter().zip(&self.angles);
        processes.map(|(each, &at)| each.between(at)).collect()
    }

    pub(super) fn local(&self, variances: &MixedVariances) -> VisitEquations {
        let mut covariance = self.own.clone();
        for (row, column, is_one_visit) in self.pairs() {
            let shared = self.shared_by(row, is_one_visit, variances.of_poses);
            covariance[(row, column)] += shared.map(|place| variances.all[place]).sum::<f64>();
        }
        let between = self.between(variances);
        for (joint, between) in between.iter().enumerate() {
            let moved = self.joints.column(joint);
            let own = variances.all[2 + joint] * between.spare;
            covariance.ger(own, &moved, &moved, 1.0);
            let returns = variances.all[variances.returns() + joint];
            for moved in self.moved_at_visits(joint) {
                covariance.ger(returns, &moved, &moved, 1.0);
            }
        }
        VisitEquations {
            between,
            covariance,
        }
    }

    /// Derivatives by parameters, waves and joints, and what is left, side by side.
    fn columns(&self) -> DMatrix<f64> {
        let each = [&self.dense, &self.joints].map(DMatrix::as_slice);
        let all = [each[0], each[1], self.residual.as_slice()].concat();
        DMatrix::from_vec(self.residual.len(), all.len() / self.residual.len(), all)
    }

    /// Adds to the sums that improve the variances of what is new at visits and of joints' errors. `by_dense` are the derivatives by
    /// parameters and waves times the covariance of these.
    pub(super) fn improve(
        &self,
        local: &VisitEquations,
        solved: &MixedSolution,
        by_dense: &DMatrix<f64>,
        sums: &mut [[f64; 2]],
    ) -> Option<()> {
        let weight = Cholesky::new(local.covariance.clone())?.inverse();
        let (left, known) = self.beside_known(local, solved, by_dense);
        let left = &weight * left;
        let projected = &weight - &weight * known * &weight;
        for (row, column, is_one_visit) in self.pairs() {
            for place in self.shared_by(row, is_one_visit, solved.variances.of_poses) {
                let sum = &mut sums[place];
                sum[0] += left[row] * left[column];
                sum[1] += projected[(row, column)];
            }
        }
        for (joint, Between { spare, .. }) in local.between.iter().enumerate() {
            let moved = self.joints.column(joint);
            let sum = &mut sums[2 + joint];
            sum[0] += spare * moved.dot(&left).powi(2);
            sum[1] += spare * moved.dot(&(&projected * moved));
            let returns = sums.len() - local.between.len();
            for moved in self.moved_at_visits(joint) {
                let sum = &mut sums[returns + joint];
                sum[0] += moved.dot(&left).powi(2);
                sum[1] += moved.dot(&(&projected * &moved));
            }
        }
        Some(())
    }

    /// What is left of the readings, and the covariance of what is predicted.
    pub(super) fn beside_known(
        &self,
        local: &VisitEquations,
        solved: &MixedSolution,
        by_dense: &DMatrix<f64>,
    ) -> (DVector<f64>, DMatrix<f64>) {
        let (dense, offsets) = (&self.dense, &solved.offsets);
        let joints = self.angles.len();
        let at = |joint: usize| {
            let terms = local.between[joint].terms();
            terms.map(move |(state, weight)| (offsets[joint] + state, weight))
        };
        // The joints' errors there, and their covariance with parameters and waves, and with each other.
        let errors = DVector::from_fn(joints, |joint, _| {
            (at(joint).map(|(knot, weight)| weight * solved.mean[knot])).sum()
        });
        let mut with_dense = DMatrix::zeros(offsets[0], joints);
        for (joint, mut column) in with_dense.column_iter_mut().enumerate() {
            for (knot, weight) in at(joint) {
                let own = solved.covariance.view((0, knot), (offsets[0], 1));
                column.axpy(weight, &own.column(0), 1.0);
            }
        }
        let together = DMatrix::from_fn(joints, joints, |one, other| {
            let pairs = at(one).flat_map(|one| at(other).map(move |other| (one, other)));
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

/// Visits of one command pose together; distances, each along a line of its own, are apart.
pub(super) fn by_pose(visits: &[PoseReadings]) -> Vec<PoseReadings> {
    let pose = |place: usize| {
        let visit = &visits[place];
        (&visit.commanded_rad, visit.approach.as_ref())
    };
    let has_axes = |visit: usize| visits[visit].coordinates.len() > 1;
    let groups = together(visits.len(), pose, |one, other| {
        has_axes(one) && has_axes(other)
    });
    let joined = |group: Vec<usize>| {
        let first = visits[group[0]].clone();
        let others = group[1..].iter().map(|&place| &visits[place]);
        others.fold(first, PoseReadings::with)
    };
    groups.into_iter().map(joined).collect()
}

/// The information of some visits and its pull, in its upper triangle.
pub(super) fn sums_of(
    visits: &[Arc<PoseReadings>],
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
            for (knot, weight) in between.terms() {
                let to = offsets[joint] + knot;
                let own = by_joints.column(joint);
                let mut column = information.column_mut(to);
                let mut column = column.rows_mut(0, first);
                column.axpy(weight, &own.rows(0, first), 1.0);
                gradient[to] += weight * own[own.len() - 1];
                for (other, beside) in local.between.iter().enumerate() {
                    for (knot, beside) in beside.terms() {
                        information[(offsets[other] + knot, to)] +=
                            weight * beside * own[first + other];
                    }
                }
            }
        }
        let count = visit.residual.len();
        (dense.rows_mut(at, count)).copy_from(&columns.columns(0, first));
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
    pub(super) fn of_dense(&self, visits: &[impl Borrow<PoseReadings>]) -> DMatrix<f64> {
        let first = self.offsets[0];
        let rows = visits
            .iter()
            .flat_map(|visit| visit.borrow().dense.row_iter());
        DMatrix::from_rows(&rows.collect::<Vec<_>>()) * self.covariance.view((0, 0), (first, first))
    }
}
