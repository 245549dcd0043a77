//! The best weights for criteria that are the worst of several: E, the smallest eigenvalue, and G, the largest
//! variance of a compliance. Where several meet, as they do in optimal designs, there is no derivative, and steps
//! along that of any one of them do not converge.
//!
//! With M(w) = M0 + sum of `w_i` `B_i` the weights follow the central path of
//!
//! ```text
//! E: maximise t,  t I <= M(w):                    -kappa t - log det(M - t I) - sum log w_i -> min
//! G: minimise s,  (M^-1)_jj <= s for every j:      kappa s - sum_j log(s - (M^-1)_jj) - sum log w_i -> min
//! ```
//!
//! by Newton's method for growing kappa (Boyd and Vandenberghe 2004, section 11). What bounds every plan
//! falls out: W = (M - t I)^-1 / kappa for E, and for G weights 1/(kappa (s - (M^-1)_jj)) of the variances, both of sum 1,
//! are subgradients over all that meet; no weights on these experiments are better by more than the (p + n)/kappa of p
//! parameters and n experiments.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::numeric::factorisation::finite_eigen;
use crate::plan::Criterion;

/// Newton steps for one kappa, at most.
const STEPS: usize = 50;
/// What a step may still promise (the objective's own unit) when kappa grows.
const CENTRED: f64 = 1e-3;
/// By what kappa grows.
const GROWTH: f64 = 20.0;
/// A step ends this share before a weight would vanish.
const INSIDE: f64 = 0.95;
/// Halvings of a step, at most.
const HALVINGS: usize = 40;

/// A criterion that is the worst of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum WorstOfSeveral {
    /// E.
    SmallestEigenvalue,
    /// G.
    LargestVariance,
}

/// The weighted sum with its bound, t for E and s for G.
struct WeighedBound {
    weights: DVector<f64>,
    bound: f64,
}

/// What is needed at a place.
struct BarrierSlack {
    /// The objective's part without kappa and weights.
    barrier: f64,
    /// (M - t I)^-1, or M^-1.
    inverse: DMatrix<f64>,
    /// 1/(s - (M^-1)_jj).
    shares: DVector<f64>,
}

impl WorstOfSeveral {
    pub fn of(criterion: Criterion) -> Option<Self> {
        match criterion {
            Criterion::E => Some(Self::SmallestEigenvalue),
            Criterion::G => Some(Self::LargestVariance),
            _ => None,
        }
    }

    /// Finds weights no worse than the best by more than a share, and returns their cost (1/t or s) with
    /// minus its derivative with respect to M, a subgradient; `None` where M is singular.
    pub fn weigh(
        self,
        blocks: &[DMatrix<f64>],
        beside: Option<&DMatrix<f64>>,
        weights: &mut [f64],
        tolerance: f64,
    ) -> Option<(f64, DMatrix<f64>)> {
        let size = blocks.first()?.nrows();
        // All in units of about one.
        let sum = total(blocks, beside, weights);
        let unit = sum.trace() / size as f64;
        if !(unit.is_finite() && unit > 0.0) {
            return None;
        }
        let blocks: Vec<DMatrix<f64>> = blocks.iter().map(|block| block / unit).collect();
        let beside = beside.map(|beside| beside / unit);
        let mut place = WeighedBound {
            weights: DVector::from_column_slice(weights),
            bound: self.beyond(&(sum / unit))?,
        };
        let many = (size + blocks.len()) as f64;
        let mut kappa = many / place.bound;
        loop {
            self.centre(&blocks, beside.as_ref(), kappa, &mut place);
            if many / kappa <= tolerance * place.bound {
                break;
            }
            kappa *= GROWTH;
        }
        weights.copy_from_slice(place.weights.as_slice());
        let information = total(&blocks, beside.as_ref(), weights);
        let slack = self.slack(&information, place.bound)?;
        let (cost, directions) = match self {
            Self::SmallestEigenvalue => {
                let least = finite_eigen(&information)?.eigenvalues.min();
                let trace = slack.inverse.trace();
                (least.recip(), slack.inverse / (trace * least * least))
            }
            Self::LargestVariance => {
                let shares = &slack.shares / slack.shares.sum();
                let inverse = slack.inverse;
                let cost = inverse.diagonal().dot(&shares);
                (cost, &inverse * DMatrix::from_diagonal(&shares) * &inverse)
            }
        };
        (cost.is_finite() && cost > 0.0).then(|| (cost / unit, directions / (unit * unit)))
    }

    /// A bound that the present weights keep strictly.
    fn beyond(self, information: &DMatrix<f64>) -> Option<f64> {
        let bound = match self {
            Self::SmallestEigenvalue => 0.5 * finite_eigen(information)?.eigenvalues.min(),
            Self::LargestVariance => {
                2.0 * Cholesky::new(information.clone())?
                    .inverse()
                    .diagonal()
                    .max()
            }
        };
        (bound.is_finite() && bound > 0.0).then_some(bound)
    }

    fn slack(self, information: &DMatrix<f64>, bound: f64) -> Option<BarrierSlack> {
        let size = information.nrows();
        let log = |factor: &Cholesky<f64, Dyn>| -> f64 {
            let diagonal = factor.l_dirty().diagonal();
            2.0 * diagonal.iter().map(|each| each.ln()).sum::<f64>()
        };
        match self {
            Self::SmallestEigenvalue => {
                let slack = information - DMatrix::identity(size, size) * bound;
                let factor = Cholesky::new(slack)?;
                Some(BarrierSlack {
                    barrier: -log(&factor),
                    inverse: factor.inverse(),
                    shares: DVector::zeros(0),
                })
            }
            Self::LargestVariance => {
                let inverse = Cholesky::new(information.clone())?.inverse();
                let slack = inverse.diagonal().map(|variance| bound - variance);
                (slack.min() > 0.0).then(|| BarrierSlack {
                    barrier: -slack.map(f64::ln).sum(),
                    shares: slack.map(f64::recip),
                    inverse,
                })
            }
        }
    }

    /// The objective; infinite where bound or weights are not kept.
    fn objective(
        self,
        blocks: &[DMatrix<f64>],
        beside: Option<&DMatrix<f64>>,
        kappa: f64,
        place: &WeighedBound,
    ) -> f64 {
        if place.weights.min() <= 0.0 {
            return f64::INFINITY;
        }
        let information = total(blocks, beside, place.weights.as_slice());
        let Some(slack) = self.slack(&information, place.bound) else {
            return f64::INFINITY;
        };
        let sign = match self {
            Self::SmallestEigenvalue => -1.0,
            Self::LargestVariance => 1.0,
        };
        let logs: f64 = place.weights.iter().map(|weight| weight.ln()).sum();
        sign * kappa * place.bound + slack.barrier - logs
    }

    /// Newton's method for one kappa.
    fn centre(
        self,
        blocks: &[DMatrix<f64>],
        beside: Option<&DMatrix<f64>>,
        kappa: f64,
        place: &mut WeighedBound,
    ) {
        let mut present = self.objective(blocks, beside, kappa, place);
        for _ in 0..STEPS {
            let Some((step, promised)) = self.step(blocks, beside, kappa, place) else {
                return;
            };
            if promised < CENTRED {
                return;
            }
            let count = blocks.len();
            let room = (0..count)
                .map(|index| -place.weights[index] / step[index])
                .filter(|room| *room > 0.0)
                .fold(f64::INFINITY, f64::min);
            let mut length = (INSIDE * room).min(1.0);
            let mut better = None;
            for _ in 0..HALVINGS {
                let mut weights = &place.weights + step.rows(0, count) * length;
                weights /= weights.sum();
                let trial = WeighedBound {
                    weights,
                    bound: place.bound + length * step[count],
                };
                let value = self.objective(blocks, beside, kappa, &trial);
                if value < present - 1e-3 * length * promised {
                    better = Some((trial, value));
                    break;
                }
                length *= 0.5;
            }
            let Some((trial, value)) = better else {
                return;
            };
            (*place, present) = (trial, value);
        }
    }

    /// The step in the weights, which keeps their sum, and in the bound; and by how much it would lower the objective
    /// were that a line.
    ///
    /// The second derivatives are a sum of squares, H = F^T F. Its triangular factor comes from F: near the end of the path
    /// the parts of H are of sizes too different for a sum.
    fn step(
        self,
        blocks: &[DMatrix<f64>],
        beside: Option<&DMatrix<f64>>,
        kappa: f64,
        place: &WeighedBound,
    ) -> Option<(DVector<f64>, f64)> {
        let count = blocks.len();
        let information = total(blocks, beside, place.weights.as_slice());
        let slack = self.slack(&information, place.bound)?;
        let size = slack.inverse.nrows();
        let root = Cholesky::new(slack.inverse.clone())?.unpack();
        let rows = count + size * size;
        let mut gradient = DVector::zeros(count + 1);
        let mut factor = match self {
            Self::SmallestEigenvalue => {
                let mut factor = DMatrix::zeros(rows, count + 1);
                for (index, block) in blocks.iter().enumerate() {
                    let turned = root.tr_mul(block) * &root;
                    gradient[index] = -turned.trace();
                    let mut column = factor.column_mut(index);
                    column
                        .rows_mut(count, size * size)
                        .copy_from_slice(turned.as_slice());
                }
                gradient[count] = slack.inverse.trace() - kappa;
                let square = -root.tr_mul(&root);
                let mut column = factor.column_mut(count);
                column
                    .rows_mut(count, size * size)
                    .copy_from_slice(square.as_slice());
                factor
            }
            Self::LargestVariance => {
                let shares = &slack.shares;
                let mut factor = DMatrix::zeros(rows + size, count + 1);
                let weighed = DMatrix::from_diagonal(&shares.map(|share| (2.0 * share).sqrt()))
                    * &slack.inverse;
                for (index, block) in blocks.iter().enumerate() {
                    let shown = block * &root;
                    let told = (&slack.inverse * block * &slack.inverse).diagonal();
                    gradient[index] = -told.dot(shares);
                    let mut column = factor.column_mut(index);
                    column
                        .rows_mut(count, size * size)
                        .copy_from_slice((&weighed * shown).as_slice());
                    column
                        .rows_mut(rows, size)
                        .copy_from(&told.component_mul(shares));
                }
                gradient[count] = kappa - shares.sum();
                factor.view_mut((rows, count), (size, 1)).copy_from(shares);
                factor
            }
        };
        for index in 0..count {
            let inverse = place.weights[index].recip();
            gradient[index] -= inverse;
            factor[(index, index)] = inverse;
        }
        // Scaled to columns of length one, for weights of every size.
        let scale = DVector::from_iterator(
            count + 1,
            factor.column_iter().map(|column| column.norm().recip()),
        );
        for (mut column, scale) in factor.column_iter_mut().zip(scale.iter()) {
            column *= *scale;
        }
        let triangle = factor.qr().r();
        let solve = |right: &DVector<f64>| {
            let half = triangle.tr_solve_upper_triangular(&right.component_mul(&scale))?;
            let solved = triangle.solve_upper_triangular(&half)?;
            Some(solved.component_mul(&scale))
        };
        let mut sum = DVector::from_element(count + 1, 1.0);
        sum[count] = 0.0;
        let (down, across) = (solve(&gradient)?, solve(&sum)?);
        let step = -(&down - &across * (sum.dot(&down) / sum.dot(&across)));
        let promised = -gradient.dot(&step);
        promised.is_finite().then_some((step, promised))
    }
}

fn total(blocks: &[DMatrix<f64>], beside: Option<&DMatrix<f64>>, weights: &[f64]) -> DMatrix<f64> {
    let size = blocks.first().map_or(0, DMatrix::nrows);
    let mut sum = beside
        .cloned()
        .unwrap_or_else(|| DMatrix::zeros(size, size));
    for (block, weight) in blocks.iter().zip(weights) {
        sum += block * *weight;
    }
    sum
}
