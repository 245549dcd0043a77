//! Readings of one command pose as a mixed model has them.

use nalgebra::{Cholesky, DMatrix, DVector, UnitQuaternion};

use super::super::joint_errors::among;
use super::{MixedSolution, MixedVariances, PoseReadings, VisitEquations};
use crate::experiment::{is_one_configuration, together};

impl PoseReadings {
    /// What is determined of the parameters (m x r), weighed as it was fitted.
    pub(super) fn weighed(&self) -> Option<DMatrix<f64>> {
        let mut by = self.own.clone();
        for (row, column, _) in self.pairs().filter(|(.., is_one_visit)| *is_one_visit) {
            by[(row, column)] += self.assumed[row];
        }
        Some(Cholesky::new(by)?.solve(&self.fixed))
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
        of_visit
            .into_iter()
            .chain(of_poses.map(|first| first + part))
    }

    /// Whether it is of several visits.
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
            fixed: &turn * &self.fixed,
            joints: &turn * &self.joints,
            waves: &turn * &self.waves,
            own: &turn * &self.own * turn.transpose(),
            ..self.clone()
        }
    }

    /// The same with a visit more of its pose.
    fn with(self, other: &Self) -> Self {
        let other = other.turned(&(self.axes.inverse() * other.axes));
        let (rows, more) = (self.coordinates.len(), other.coordinates.len());
        let stacked = |own: DMatrix<f64>, below: &DMatrix<f64>| {
            let mut both = own.resize_vertically(rows + more, 0.0);
            both.rows_mut(rows, more).copy_from(below);
            both
        };
        let mut residual = self.residual.resize_vertically(rows + more, 0.0);
        residual.rows_mut(rows, more).copy_from(&other.residual);
        let mut own = self.own.resize(rows + more, rows + more, 0.0);
        own.view_mut((rows, rows), (more, more))
            .copy_from(&other.own);
        let next = self.visits.last().map_or(0, |last| last + 1);
        let labels = other.visits.iter().map(|visit| next + visit);
        Self {
            residual,
            fixed: stacked(self.fixed, &other.fixed),
            joints: stacked(self.joints, &other.joints),
            waves: stacked(self.waves, &other.waves),
            own,
            coordinates: [self.coordinates, other.coordinates].concat(),
            visits: self.visits.into_iter().chain(labels).collect(),
            assumed: [self.assumed, other.assumed].concat(),
            ..self
        }
    }

    pub(super) fn local(&self, variances: &MixedVariances, offsets: &[usize]) -> VisitEquations {
        let fixed = self.fixed.ncols();
        let mut index: Vec<usize> = (0..fixed).collect();
        let columns = fixed + 2 * self.angles.len() + self.waves.ncols();
        let mut matrix = self.fixed.clone().resize_horizontally(columns, 0.0);
        let mut covariance = self.own.clone();
        for (row, column, is_one_visit) in self.pairs() {
            let shared = self.shared_by(row, is_one_visit, variances.of_poses);
            covariance[(row, column)] += shared.map(|place| variances.all[place]).sum::<f64>();
        }
        let mut spare = Vec::new();
        for (joint, process) in variances.process.iter().enumerate() {
            let between = process.between(self.angles[joint]);
            let moved = self.joints.column(joint);
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                matrix.column_mut(index.len()).copy_from(&(moved * weight));
                index.push(offsets[joint] + knot);
            }
            let own = variances.all[2 + joint] * between.spare;
            covariance.ger(own, &moved, &moved, 1.0);
            spare.push(between.spare);
        }
        let first = offsets[variances.process.len()];
        for (wave, moved) in self.waves.column_iter().enumerate() {
            matrix.column_mut(index.len()).copy_from(&moved);
            index.push(first + wave);
        }
        VisitEquations {
            index,
            matrix,
            covariance,
            spare,
        }
    }

    /// Adds to the sums that improve the variances of what is new at visits and of joints' errors.
    pub(super) fn improve(
        &self,
        local: &VisitEquations,
        of_poses: Option<usize>,
        solved: &MixedSolution,
        sums: &mut [[f64; 2]],
    ) -> Option<()> {
        let weight = Cholesky::new(local.covariance.clone())?.inverse();
        let left = &weight * local.left(self, solved);
        let projected = &weight - &weight * local.known(solved) * &weight;
        for (row, column, is_one_visit) in self.pairs() {
            for place in self.shared_by(row, is_one_visit, of_poses) {
                let sum = &mut sums[place];
                sum[0] += left[row] * left[column];
                sum[1] += projected[(row, column)];
            }
        }
        for (joint, spare) in local.spare.iter().enumerate() {
            let moved = self.joints.column(joint);
            let sum = &mut sums[2 + joint];
            sum[0] += spare * moved.dot(&left).powi(2);
            sum[1] += spare * moved.dot(&(&projected * moved));
        }
        Some(())
    }
}

/// Visits of one command pose together.
pub(super) fn by_pose(visits: &[PoseReadings]) -> Vec<PoseReadings> {
    let pose = |place: usize| {
        (
            &visits[place].commanded_rad,
            visits[place].approach.as_ref(),
        )
    };
    let is_same = |one, other| is_one_configuration(pose(one), pose(other));
    let groups = together(visits.len(), |place| pose(place).0, is_same);
    let joined = |group: Vec<usize>| {
        let first = visits[group[0]].clone();
        let others = group[1..].iter().map(|&place| &visits[place]);
        others.fold(first, PoseReadings::with)
    };
    groups.into_iter().map(joined).collect()
}

impl VisitEquations {
    /// What is left of the readings.
    pub(super) fn left(&self, visit: &PoseReadings, solved: &MixedSolution) -> DVector<f64> {
        let mean = self.index.iter().map(|&at| solved.mean[at]);
        &visit.residual - &self.matrix * DVector::from_iterator(self.index.len(), mean)
    }

    /// The covariance of what is predicted.
    pub(super) fn known(&self, solved: &MixedSolution) -> DMatrix<f64> {
        let among = among(&solved.covariance, &self.index);
        &self.matrix * among * self.matrix.transpose()
    }
}
