//! Standard errors of parameters from variance components, with degrees of freedom after Satterthwaite.

use nalgebra::{Cholesky, DMatrix, DVectorView};
use rayon::prelude::*;

use super::{HIDDEN_WAVES, ImprovedVariances, MixedModel, MixedVariances};

/// The variances of some sums of parameters, and how well they are known.
pub(in super::super) struct SumVariances {
    /// The variance of each.
    pub variances: Vec<f64>,
    /// Degrees of freedom of each, after F. E. Satterthwaite (*An approximate distribution of estimates of variance components*,
    /// Biometrics Bulletin 2, 1946).
    pub degrees: Vec<f64>,
}

impl MixedModel {
    /// The variances of sums of parameters (p x n) that were fitted with readings weighed as independent. None where the numbers have no
    /// factorisation.
    pub fn of_sums(&self, sums: &DMatrix<f64>) -> Option<SumVariances> {
        let (variances, solved) = self.likeliest()?;
        let parts = self.parts(&variances, sums)?;
        let ImprovedVariances { told, .. } = self.improved(&variances, &solved)?;
        let (variances, degrees) = parts
            .column_iter()
            .map(|parts| satterthwaite(parts, &told))
            .unzip();
        Some(SumVariances { variances, degrees })
    }

    /// The covariance (p x p) of parameters that were fitted with readings weighed as independent, with the degrees of freedom of each
    /// variance. None where the numbers have no factorisation.
    pub fn of_parameters(&self) -> Option<(DMatrix<f64>, Vec<f64>)> {
        let (variances, solved) = self.likeliest()?;
        let each = DMatrix::identity(self.units.nrows(), self.units.nrows());
        let ImprovedVariances { told, .. } = self.improved(&variances, &solved)?;
        let parts = self.parts(&variances, &each)?;
        let degrees = parts
            .column_iter()
            .map(|parts| satterthwaite(parts, &told).1);
        Some((self.sandwich(&variances)?, degrees.collect()))
    }

    /// The covariance (p x p) of a fit that took readings of different visits as independent with this discrepancy, where the
    /// variances are these: H^-1 (sum A^T V A) H^-1.
    fn sandwich(&self, variances: &MixedVariances) -> Option<DMatrix<f64>> {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let knots = offsets.last()? - fixed;
        let pieces: Vec<Option<[DMatrix<f64>; 3]>> = (self.pieces())
            .map(|visits| {
                let mut sums = [
                    DMatrix::zeros(fixed, fixed),
                    DMatrix::zeros(fixed, fixed),
                    DMatrix::zeros(fixed, knots),
                ];
                for visit in visits {
                    let local = visit.local(variances, &offsets);
                    let weighed = visit.weighed()?;
                    sums[0] += weighed.tr_mul(&visit.fixed);
                    sums[1] += weighed.tr_mul(&(&local.covariance * &weighed));
                    let through = weighed.tr_mul(&local.matrix);
                    for (column, &to) in local.index.iter().enumerate().skip(fixed) {
                        let mut sum = sums[2].column_mut(to - fixed);
                        sum += through.column(column);
                    }
                }
                Some(sums)
            })
            .collect();
        let mut curvature = self.prior.clone();
        let mut square = self.prior.clone();
        let mut through = DMatrix::zeros(fixed, knots);
        for piece in pieces {
            let [one, other, joints] = piece?;
            curvature += one;
            square += other;
            through += joints;
        }
        for (joint, process) in variances.process.iter().enumerate() {
            let count = process.knots.len();
            let own = through.columns(offsets[joint] - fixed, count);
            let among = DMatrix::from_fn(count, count, |row, column| {
                variances.joints[joint] * process.correlation(row, column)
            });
            square += own * among * own.transpose();
        }
        let first = offsets[variances.process.len()] - fixed;
        for wave in 0..self.waves() {
            let own = through.column(first + wave);
            square += own * variances.of_wave(wave) * own.transpose();
        }
        let inverse = &self.units * Cholesky::new(curvature)?.inverse();
        Some(&inverse * square * inverse.transpose())
    }

    /// The parts of the variances of sums (p x n) of parameters: what is known before and of the readings themselves, what is new at
    /// stands, of positions and of rotations, and each joint's error.
    fn parts(&self, variances: &MixedVariances, sums: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let offsets = self.offsets(variances);
        let fixed = self.units.ncols();
        let mut curvature = self.prior.clone();
        for visit in &self.visits {
            curvature += visit.weighed()?.tr_mul(&visit.fixed);
        }
        let sums = Cholesky::new(curvature)?.solve(&self.units.tr_mul(sums));
        let joints = variances.process.len();
        let mut parts = DMatrix::zeros(3 + joints + variances.waves.len(), sums.ncols());
        let mut through = DMatrix::zeros(sums.ncols(), offsets.last()? - fixed);
        for visit in &self.visits {
            let local = visit.local(variances, &offsets);
            let gains = visit.weighed()? * &sums;
            let moved = gains.tr_mul(&local.matrix);
            for (column, &to) in local.index.iter().enumerate().skip(fixed) {
                let mut sum = through.column_mut(to - fixed);
                sum += moved.column(column);
            }
            for (at, gain) in gains.column_iter().enumerate() {
                parts[(0, at)] += gain.dot(&(&visit.own * gain));
                for coordinate in 0..6 {
                    let rows = visit.coordinates.iter().zip(gain.iter());
                    let shared = rows.filter(|(each, _)| **each == coordinate);
                    let shared = shared.map(|(_, gain)| gain).sum::<f64>();
                    let part = coordinate / 3;
                    parts[(1 + part, at)] += variances.rest[part] * shared * shared;
                }
                for joint in 0..joints {
                    let own = variances.joints[joint] * local.spare[joint];
                    parts[(3 + joint, at)] += own * gain.dot(&visit.joints.column(joint)).powi(2);
                }
            }
        }
        for (at, sum) in sums.column_iter().enumerate() {
            parts[(0, at)] += sum.dot(&(&self.prior * sum));
            for (joint, process) in variances.process.iter().enumerate() {
                let count = process.knots.len();
                let own = through.view((at, offsets[joint] - fixed), (1, count));
                let among = DMatrix::from_fn(count, count, |row, column| {
                    variances.joints[joint] * process.correlation(row, column)
                });
                parts[(3 + joint, at)] += (own * among * own.transpose())[(0, 0)];
            }
            for wave in 0..self.waves() {
                let own = through[(at, offsets[joints] - fixed + wave)];
                let part = 3 + joints + wave / (2 * HIDDEN_WAVES);
                parts[(part, at)] += variances.of_wave(wave) * own * own;
            }
        }
        Some(parts)
    }
}

/// The sum of a variance's parts, the first of them known and the others told by so many numbers, by one at least, and its degrees
/// of freedom: no end of them where all is known.
fn satterthwaite(parts: DVectorView<'_, f64>, told: &[f64]) -> (f64, f64) {
    let variance = parts.sum();
    let estimated = parts.iter().skip(1).zip(told);
    let spread: f64 = estimated
        .filter(|(part, _)| **part > 0.0)
        .map(|(part, told)| part * part / told.max(1.0))
        .sum();
    let freedom = if spread > 0.0 {
        variance * variance / spread
    } else {
        f64::INFINITY
    };
    (variance, freedom)
}
