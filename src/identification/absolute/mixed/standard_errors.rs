//! Standard errors of parameters from variance components, with degrees of freedom after Satterthwaite.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{HIDDEN_WAVES, MixedModel, MixedSolution, PoseReadings};
use crate::numeric::factorisation::inverse_of;

/// The covariance (p x p) of parameters that were fitted with readings weighed as independent.
pub(in super::super) struct CovarianceParts {
    /// The first part is of what is known before and of the readings themselves, then one of each variance,
    parts: Vec<DMatrix<f64>>,
    /// with how many numbers told it.
    told: Vec<f64>,
}

impl CovarianceParts {
    /// All of it.
    pub fn whole(&self) -> DMatrix<f64> {
        self.parts.iter().sum()
    }

    /// The standard error of a sum of parameters, each with its factor, and the degrees of freedom of its square, after F. E. Satterthwaite
    /// (*An approximate distribution of estimates of variance components*, Biometrics Bulletin 2, 1946): no end of them where all is known,
    /// and one at least where it is not.
    pub fn of_sum(&self, sum: &[(usize, f64)]) -> [f64; 2] {
        let of_part = |part: &DMatrix<f64>| {
            let pairs = sum
                .iter()
                .flat_map(|one| sum.iter().map(move |other| (one, other)));
            let terms = pairs.map(|(one, other)| one.1 * other.1 * part[(one.0, other.0)]);
            // Where little is left of it, rounding may leave less than nothing.
            terms.sum::<f64>().max(0.0)
        };
        let parts: Vec<f64> = self.parts.iter().map(of_part).collect();
        let variance: f64 = parts.iter().sum();
        let estimated = parts.iter().skip(1).zip(&self.told);
        let spread = estimated.map(|(part, told)| part * part / told.max(1.0));
        let spread: f64 = spread.sum();
        let known = if spread > 0.0 {
            variance * variance / spread
        } else {
            f64::INFINITY
        };
        [variance.sqrt(), known]
    }
}

/// Sums over visits: the curvature of the fit (r x r), the parts of the variance of its gradient (r x r each) that visits have for
/// themselves, and how waves and knots move that (r x k).
struct GradientSums {
    curvature: DMatrix<f64>,
    parts: Vec<DMatrix<f64>>,
    through: DMatrix<f64>,
}

impl MixedModel {
    /// The covariance of a fit that took readings of different visits as independent with this discrepancy, where the variances are the
    /// likeliest: H^-1 (sum A^T V A) H^-1. None where the numbers have no factorisation.
    pub fn covariance_parts(&self) -> Option<CovarianceParts> {
        let solved = self.likeliest()?;
        let (_, told) = self.improved(&solved)?;
        let MixedSolution {
            variances, offsets, ..
        } = &solved;
        let fixed = self.units.ncols();
        let of_visits = |visits: &[Arc<PoseReadings>]| {
            let mut sums = GradientSums {
                curvature: DMatrix::zeros(fixed, fixed),
                parts: vec![DMatrix::zeros(fixed, fixed); 1 + variances.all.len()],
                through: DMatrix::zeros(fixed, offsets.last()? - fixed),
            };
            for visit in visits {
                sums.add(visit, &solved)?;
            }
            Some(sums)
        };
        let mut sums = self.sum_of(of_visits, |sums, piece| {
            sums.curvature += piece.curvature;
            sums.through += piece.through;
            for (sum, own) in sums.parts.iter_mut().zip(piece.parts) {
                *sum += own;
            }
        })?;
        sums.curvature += &self.prior;
        sums.parts[0] += &self.pulls;
        for (joint, process) in variances.process.iter().enumerate() {
            let count = process.states();
            let own = sums.through.columns(offsets[joint] - fixed, count);
            let among = DMatrix::from_fn(count, count, |row, column| {
                variances.all[2 + joint] * process.covariance(row, column)
            });
            sums.parts[3 + joint] += own * among * own.transpose();
        }
        for joint in 0..self.waving.len() {
            let count = 2 * HIDDEN_WAVES;
            let own = sums.through.columns(joint * count, count);
            let place = 2 + self.joints.len() + joint;
            sums.parts[1 + place] = own * own.transpose() * variances.all[place];
        }
        let inverse = &self.units * inverse_of(&Cholesky::new(sums.curvature)?);
        let parts = sums.parts.iter();
        Some(CovarianceParts {
            parts: (parts.map(|part| &inverse * part * inverse.transpose())).collect(),
            told,
        })
    }
}

impl GradientSums {
    fn add(&mut self, visit: &PoseReadings, solved: &MixedSolution) -> Option<()> {
        let MixedSolution {
            variances, offsets, ..
        } = solved;
        let fixed = self.curvature.ncols();
        let weighed = visit.weighed(fixed)?;
        self.curvature += weighed.tr_mul(&visit.dense.columns(0, fixed));
        self.parts[0] += weighed.tr_mul(&(&visit.own * &weighed));
        for coordinate in 0..6 {
            let part = coordinate / 3;
            let rows = (weighed.row_iter().zip(&visit.coordinates)).zip(&visit.visits);
            let rows = rows.filter(|((_, each), _)| **each == coordinate);
            let mut of_visits: BTreeMap<usize, DVector<f64>> = BTreeMap::new();
            for ((row, _), visit) in rows {
                let sum = of_visits.entry(*visit);
                *sum.or_insert_with(|| DVector::zeros(fixed)) += row.transpose();
            }
            for shared in of_visits.values() {
                self.parts[1 + part].ger(variances.all[part], shared, shared, 1.0);
            }
            // Positions alone have no rotations.
            let shared = of_visits.into_values().reduce(|sum, each| sum + each);
            if let (Some(first), Some(shared)) = (variances.of_poses, shared) {
                let place = first + part;
                self.parts[1 + place].ger(variances.all[place], &shared, &shared, 1.0);
            }
        }
        let waves = visit.dense.columns_range(fixed..);
        let mut of_waves = self.through.columns_mut(0, waves.ncols());
        of_waves += weighed.tr_mul(&waves);
        for (joint, between) in visit.between(variances).iter().enumerate() {
            let moved = weighed.tr_mul(&visit.joints.column(joint));
            let variance = variances.all[2 + joint] * between.spare;
            self.parts[3 + joint].ger(variance, &moved, &moved, 1.0);
            let returns = variances.returns() + joint;
            for moved in visit.moved_at_visits(joint) {
                let moved = weighed.tr_mul(&moved);
                self.parts[1 + returns].ger(variances.all[returns], &moved, &moved, 1.0);
            }
            for (knot, weight) in between.terms() {
                let mut sum = self.through.column_mut(offsets[joint] + knot - fixed);
                sum.axpy(weight, &moved, 1.0);
            }
        }
        Some(())
    }
}
