//! The equations of one visit of the robot at some variances.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{MixedSolution, MixedVariances, VarianceImprovement, VisitEquations, VisitReadings};

impl VisitEquations {
    pub(super) fn mean(&self, solved: &MixedSolution) -> DVector<f64> {
        DVector::from_iterator(
            self.index.len(),
            self.index.iter().map(|&at| solved.mean[at]),
        )
    }

    /// The covariance of what is predicted.
    pub(super) fn known(&self, solved: &MixedSolution) -> DMatrix<f64> {
        let index = &self.index;
        let among = DMatrix::from_fn(index.len(), index.len(), |row, column| {
            solved.covariance[(index[row], index[column])]
        });
        &self.matrix * among * self.matrix.transpose()
    }
}

impl VisitReadings {
    /// What is determined of the parameters (m x r), weighed as it was fitted.
    pub(super) fn weighed(&self) -> Option<DMatrix<f64>> {
        let mut by = self.own.clone();
        self.add_shared(&mut by, self.assumed);
        Some(Cholesky::new(by)?.solve(&self.fixed))
    }

    /// Adds what is new at the visit: variances of positions and rotations.
    fn add_shared(&self, covariance: &mut DMatrix<f64>, variances: [f64; 2]) {
        for (row, one) in self.coordinates.iter().enumerate() {
            for (column, other) in self.coordinates.iter().enumerate() {
                if one == other {
                    covariance[(row, column)] += variances[one / 3];
                }
            }
        }
    }

    pub(super) fn local(&self, variances: &MixedVariances, offsets: &[usize]) -> VisitEquations {
        let fixed = self.fixed.ncols();
        let mut index: Vec<usize> = (0..fixed).collect();
        let mut matrix = self
            .fixed
            .clone()
            .resize_horizontally(fixed + 2 * self.angles.len() + self.waves.ncols(), 0.0);
        let mut covariance = self.own.clone();
        self.add_shared(&mut covariance, variances.rest);
        let mut spare = Vec::new();
        for (joint, process) in variances.process.iter().enumerate() {
            let between = process.between(self.angles[joint]);
            let moved = self.joints.column(joint);
            for (knot, weight) in between.knots.into_iter().zip(between.weights) {
                matrix.column_mut(index.len()).copy_from(&(moved * weight));
                index.push(offsets[joint] + knot);
            }
            let own = variances.joints[joint] * between.spare;
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

    pub(super) fn improve(
        &self,
        local: &VisitEquations,
        solved: &MixedSolution,
        sum: &mut VarianceImprovement,
    ) -> Option<()> {
        let weight = Cholesky::new(local.covariance.clone())?.inverse();
        let left = &weight * (&self.residual - &local.matrix * local.mean(solved));
        let projected = &weight - &weight * local.known(solved) * &weight;
        for coordinate in 0..6 {
            let rows: Vec<usize> = (self.coordinates.iter().enumerate())
                .filter(|(_, each)| **each == coordinate)
                .map(|(row, _)| row)
                .collect();
            let part = &mut sum.rest[coordinate / 3];
            part[0] += rows.iter().map(|&row| left[row]).sum::<f64>().powi(2);
            for &row in &rows {
                part[1] += rows
                    .iter()
                    .map(|&other| projected[(row, other)])
                    .sum::<f64>();
            }
        }
        for (joint, part) in sum.joints.iter_mut().enumerate() {
            let moved = self.joints.column(joint);
            part[0] += local.spare[joint] * moved.dot(&left).powi(2);
            part[1] += local.spare[joint] * moved.dot(&(&projected * moved));
        }
        Some(())
    }
}
