//! Information of low rank: a covariance that follows what is added and taken away, and what each would change.
//!
//! With P = M^-1, N the weight of what is wanted, Q = P N P, and rows W (r x p, few of their columns not zero)
//!
//! ```text
//! (M + W^T W)^-1 = P - P W^T (1 + W P W^T)^-1 W P                          (Woodbury)
//! trace(N P) falls by trace((1 + W P W^T)^-1 W Q W^T)
//! ```
//!
//! and the same with the opposite signs where W^T W is taken away: without a factorisation of M for each.

use nalgebra::{Cholesky, DMatrix};

/// What stands for nothing known, by typical sizes.
const FAINT: f64 = 1e-6;

/// Whitened rows of few unknowns: they inform by W^T W.
#[derive(Debug, Clone, PartialEq)]
pub struct LowRankInformation {
    /// The unknowns, by their places among all.
    pub columns: Vec<usize>,
    /// Their rows (r x the number of these unknowns).
    pub rows: DMatrix<f64>,
}

/// What is known before, what is wanted, and a list of what may inform.
#[derive(Debug, Clone, PartialEq)]
pub struct LowRankList {
    /// M0 (p x p), in typical sizes.
    before: DMatrix<f64>,
    /// N (p x p): the mean square of what is wanted is trace(N P), in its unit squared.
    wanted: DMatrix<f64>,
    /// What may inform.
    pub candidates: Vec<LowRankInformation>,
}

/// A covariance, with what is wanted of it.
#[derive(Debug, Clone)]
pub struct UpdatedCovariance {
    covariance: DMatrix<f64>,
    /// Q = P N P.
    weighed: DMatrix<f64>,
    /// trace(N P).
    pub cost: f64,
}

impl LowRankInformation {
    /// W A W^T for a symmetric A (p x p).
    fn between(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let count = self.columns.len();
        let mut own = DMatrix::zeros(count, count);
        for (mut to, &column) in own.column_iter_mut().zip(&self.columns) {
            let from = matrix.column(column);
            for (to, &row) in to.iter_mut().zip(&self.columns) {
                *to = from[row];
            }
        }
        &self.rows * own * self.rows.transpose()
    }

    /// A W^T (p x r) for a symmetric A.
    fn through(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        let mut product = DMatrix::zeros(matrix.nrows(), self.rows.nrows());
        for (place, &column) in self.columns.iter().enumerate() {
            for (mut to, weight) in product.column_iter_mut().zip(&self.rows.column(place)) {
                to.axpy(*weight, &matrix.column(column), 1.0);
            }
        }
        product
    }

    /// Adds W^T W, so many times.
    fn add_to(&self, matrix: &mut DMatrix<f64>, times: f64) {
        let own = self.rows.tr_mul(&self.rows) * times;
        for (column, &to) in self.columns.iter().enumerate() {
            for (row, &from) in self.columns.iter().enumerate() {
                matrix[(from, to)] += own[(row, column)];
            }
        }
    }
}

impl LowRankList {
    /// Without candidates. A faint knowledge of everything keeps what is known before regular.
    pub fn new(mut before: DMatrix<f64>) -> Self {
        let size = before.nrows();
        for place in 0..size {
            before[(place, place)] += FAINT;
        }
        Self {
            wanted: DMatrix::zeros(size, size),
            before,
            candidates: Vec::new(),
        }
    }

    /// Wants the mean square of rows, with this share of the whole.
    pub fn want(&mut self, rows: &LowRankInformation, share: f64) {
        rows.add_to(&mut self.wanted, share);
    }

    /// The covariance where some of the candidates inform; none where the numbers have no factorisation.
    pub fn informed(&self, chosen: &[usize]) -> Option<UpdatedCovariance> {
        let mut information = self.before.clone();
        for &candidate in chosen {
            self.candidates[candidate].add_to(&mut information, 1.0);
        }
        let covariance = Cholesky::new(information)?.inverse();
        let half = &self.wanted * &covariance;
        Some(UpdatedCovariance {
            cost: half.trace(),
            weighed: &covariance * half,
            covariance,
        })
    }
}

impl UpdatedCovariance {
    /// By how much the cost falls where this informs, too.
    pub fn gain(&self, information: &LowRankInformation) -> f64 {
        let mut own = information.between(&self.covariance);
        add_one(&mut own);
        let weighed = information.between(&self.weighed);
        Cholesky::new(own).map_or(0.0, |factor| factor.solve(&weighed).trace())
    }

    /// Informs, or takes that away.
    pub fn update(&mut self, information: &LowRankInformation, is_added: bool) {
        let sign = if is_added { 1.0 } else { -1.0 };
        let through = information.through(&self.covariance);
        let weighed = information.through(&self.weighed);
        let mut own = information.between(&self.covariance) * sign;
        let within = information.between(&self.weighed);
        add_one(&mut own);
        let Some(inverse) = own.try_inverse() else {
            return;
        };
        self.cost -= (&inverse * &within).trace() * sign;
        // P' = P - Y S Y^T, and Q' = P' N P' with Y = P W^T, Q W^T = P N Y.
        let gain = &through * inverse * sign;
        self.covariance.gemm(-1.0, &gain, &through.transpose(), 1.0);
        self.weighed.gemm(-1.0, &gain, &weighed.transpose(), 1.0);
        self.weighed.gemm(-1.0, &weighed, &gain.transpose(), 1.0);
        (self.weighed).gemm(1.0, &(&gain * within), &gain.transpose(), 1.0);
    }
}

fn add_one(matrix: &mut DMatrix<f64>) {
    for place in 0..matrix.nrows() {
        matrix[(place, place)] += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list() -> LowRankList {
        let value = |seed: usize| ((seed * 37 % 101) as f64 / 101.0) - 0.4;
        let mut list = LowRankList::new(DMatrix::identity(6, 6) * 0.3);
        for each in 0..8 {
            let columns: Vec<usize> = (0..6).filter(|place| (place + each) % 3 != 0).collect();
            let rows = DMatrix::from_fn(2, columns.len(), |row, column| {
                value(7 * each + 3 * row + 11 * column + 1)
            });
            let information = LowRankInformation { columns, rows };
            list.want(&information, 0.25);
            list.candidates.push(information);
        }
        list
    }

    /// What updates give is what a factorisation gives, and so is what each would change.
    #[test]
    fn updates_are_factorisations() {
        let list = list();
        let mut updated = list.informed(&[0, 3]).expect("regular");
        let gain = updated.gain(&list.candidates[5]);
        let before = updated.cost;
        updated.update(&list.candidates[5], true);
        assert!((before - updated.cost - gain).abs() < 1e-12 * before);
        updated.update(&list.candidates[3], false);
        let direct = list.informed(&[0, 5]).expect("regular");
        assert!((updated.cost / direct.cost - 1.0).abs() < 1e-12);
        for (one, other) in [
            (&updated.covariance, &direct.covariance),
            (&updated.weighed, &direct.weighed),
        ] {
            assert!((one - other).amax() < 1e-11 * other.amax());
        }
    }
}
