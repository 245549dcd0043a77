//! Optimality criteria: the test pose's `rho_0` (eq. 20) and those of Table 1.
//!
//! All are functions of the information matrix M (p x p) in relative units: each compliance is
//! divided by its nominal value and each deflection by sigma, so that M^-1 is the covariance of
//! relative errors and unlike joints compare. (D-optimal and `O1`-optimal plans do not depend on that
//! scaling; for the others the literature asks for it, Sun and Hollerbach, ICRA 2008.)
//!
//! Table 1 has two misprints: `O3`, the smallest singular value, is to be maximised; and the
//! G row needs the diagonal of cov(k).

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, Dyn, SMatrix, SymmetricEigen};
use serde::{Deserialize, Serialize};

use crate::numeric::factorisation::finite_eigen;

use super::factorisation::{
    LANES, half_solve_unrolled, inverse_determinant, solve_transposed, sum_of_squares,
    traces_of_sums,
};

/// So small a share of what one experiment gives makes the information of others regular that leave something open: far above
/// rounding, and less than searches tell apart.
const OPEN: f64 = 1e-4;

/// What makes a plan good.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    Deserialize,
    schemars::JsonSchema,
    Serialize,
    clap::ValueEnum,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Criterion {
    /// The rms distance `rho_0` that compensation leaves at the test poses (m), eq. 20; minimised.
    #[default]
    TestPose,
    /// A: the trace of the covariance; minimised.
    A,
    /// D: the determinant of the information matrix; maximised.
    D,
    /// E: the smallest eigenvalue of the information matrix; maximised.
    E,
    /// G: the largest variance of a compliance; minimised.
    G,
    /// `O1`: the geometric mean of the singular values of the observation matrix (Borm and Menq);
    /// maximised.
    O1,
    /// `O2`: the condition number of the observation matrix (Driels and Pathre); minimised.
    O2,
    /// `O3`: its smallest singular value (Nahvi et al.); maximised.
    O3,
    /// `O4`: the noise amplification index, smallest squared over largest (Nahvi and Hollerbach);
    /// maximised.
    O4,
    /// `O5`: the sum of the inverse singular values (Sun and Hollerbach); minimised.
    O5,
}

impl Criterion {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether larger values are better.
    pub const fn is_maximised(self) -> bool {
        matches!(self, Self::D | Self::E | Self::O1 | Self::O3 | Self::O4)
    }

    /// The criterion whose approximate design and bound are this one's, too: that of which this is a power. `None` for
    /// criteria that plans over a region are not optimised by, whose costs take eigenvalues or are the worst of several.
    ///
    /// Those that are returned follow from a factorisation of M, are smooth, and have a cost that is convex in M and goes
    /// with its inverse, cost(c M) = cost(M) / c, see [`Self::value_of_cost`].
    pub const fn bounded_as(self) -> Option<Self> {
        match self {
            Self::TestPose | Self::A | Self::D => Some(self),
            Self::O1 => Some(Self::D),
            Self::E | Self::G | Self::O2 | Self::O3 | Self::O4 | Self::O5 => None,
        }
    }

    /// The criterion's value, as [`CriterionFunction::value`] has it, of the cost of [`Self::bounded_as`], which goes with
    /// the inverse of M: `rho_0`^2, A, and the inverse of D, also for O1.
    pub fn value_of_cost(self, cost: f64) -> f64 {
        match self {
            Self::O1 => Self::D.value_of_own_cost(cost).sqrt(),
            _ => self.value_of_own_cost(cost),
        }
    }

    /// The same of its own cost, as [`CriterionFunction::cost`] has it.
    pub(super) fn value_of_own_cost(self, cost: f64) -> f64 {
        match self {
            Self::TestPose => cost.sqrt(),
            maximised if maximised.is_maximised() => cost.recip(),
            _ => cost,
        }
    }

    /// Whether it follows from a factorisation of M, without eigenvalues: then it is smooth, and cheap
    /// to judge for many plans.
    pub const fn is_factored(self) -> bool {
        self.bounded_as().is_some()
    }
}

/// A criterion made ready for a problem: a cost to be minimised, with its derivative.
#[derive(Debug, Clone)]
pub struct CriterionFunction {
    criterion: Criterion,
    /// C^T (p x r) with C the test poses' matrices stacked, each times the root of its weight, in m:
    /// `rho_0`^2 = trace(C M^-1 C^T). For other criteria the unit matrix.
    right: DMatrix<f64>,
    /// Room for M and its factors.
    work: DMatrix<f64>,
    /// Room for M^-1 C^T.
    solved: DMatrix<f64>,
    /// Room for both of several matrices.
    side_by_side: Vec<[f64; LANES]>,
}

/// A matrix R (p x r) or, where r > p, a smaller one with the same R R^T: many test poses cost no more than a
/// few.
pub fn no_wider_than_high(right: DMatrix<f64>) -> DMatrix<f64> {
    if right.ncols() <= right.nrows() {
        return right;
    }
    right.transpose().qr().r().transpose()
}

impl CriterionFunction {
    /// The criterion for test poses given by C^T (p x r), in relative units.
    pub fn new(criterion: Criterion, test_poses: DMatrix<f64>) -> Self {
        let size = test_poses.nrows();
        let right = match criterion {
            Criterion::TestPose => no_wider_than_high(test_poses),
            _ => DMatrix::identity(size, size),
        };
        Self {
            criterion,
            work: DMatrix::zeros(size, size),
            solved: right.clone(),
            side_by_side: Vec::new(),
            right,
        }
    }

    /// The cost of an information matrix, to be minimised, and minus its derivative, into
    /// `directions`: the information in these directions is worth most. The cost is infinite for a
    /// singular matrix.
    ///
    /// It is `rho_0`^2 (m^2) for the test pose; A, G, O2 and O5 as they are; and the inverse of those
    /// that are maximised (for D, of the p-th root of the determinant).
    pub fn cost(&mut self, information: &DMatrix<f64>, directions: &mut DMatrix<f64>) -> f64 {
        if self.criterion.is_factored() {
            self.factored_cost(information, directions)
        } else {
            self.spectral_cost(information, directions)
        }
    }

    fn factored_cost(&mut self, information: &DMatrix<f64>, directions: &mut DMatrix<f64>) -> f64 {
        self.work.copy_from(information);
        let size = self.work.nrows();
        let (work, _) = self.work.as_mut_slice().as_chunks_mut::<1>();
        let (solved, _) = self.solved.as_mut_slice().as_chunks_mut::<1>();
        let [trace] = half_solve_unrolled(size, work, self.right.as_slice(), solved);
        if trace.is_infinite() {
            return trace;
        }
        solve_transposed(self.work.as_slice(), self.solved.as_mut_slice());
        let Some(power) = self.power_of_determinant() else {
            sum_of_squares(self.solved.as_slice(), directions.as_mut_slice());
            return trace;
        };
        let (work, _) = self.work.as_slice().as_chunks::<1>();
        let cost = inverse_determinant(size, work)[0].powf(power);
        // The derivative of det(M)^-a is -a det(M)^-a M^-1.
        directions.copy_from(&self.solved);
        *directions *= power * cost;
        cost
    }

    /// The a of costs that are det(M)^-a.
    fn power_of_determinant(&self) -> Option<f64> {
        let size = f64::from(u32::try_from(self.right.nrows()).unwrap_or(u32::MAX));
        match self.criterion {
            Criterion::D => Some(size.recip()),
            Criterion::O1 => Some(0.5 / size),
            _ => None,
        }
    }

    /// The costs alone of `rest` plus `weight` times each of [`LANES`] blocks (all p x p), whose
    /// numbers stand side by side; by criteria that follow from a factorisation ([`Criterion::is_factored`]).
    pub(in crate::plan) fn costs_of_sums(
        &mut self,
        rest: &DMatrix<f64>,
        blocks: &[[f64; LANES]],
        weight: f64,
    ) -> [f64; LANES] {
        debug_assert!(self.criterion.is_factored());
        let power = self.power_of_determinant();
        let room = &mut self.side_by_side;
        room.resize(2 * blocks.len().max(self.right.len()), [0.0; LANES]);
        let Some(power) = power else {
            return traces_of_sums(rest, blocks, weight, self.right.as_slice(), room);
        };
        let zero_if_regular = traces_of_sums(rest, blocks, weight, &[], room);
        let inverse = inverse_determinant(rest.nrows(), room);
        std::array::from_fn(|lane| match zero_if_regular[lane] {
            infinite if infinite > 0.0 => infinite,
            _ => inverse[lane].powf(power),
        })
    }

    /// Which of some experiments lowers the cost of M = `rest` most, measured `weight` times, by updates of rank K; `rows` are A^T of each,
    /// side by side (p x K n), and `most` the most that one gives of each unknown alone. None where it gives nothing of what M leaves open. With S = 1 + w A M^-1 A^T and G = A M^-1 C^T
    ///
    /// ```text
    /// trace(C (M + w A^T A)^-1 C^T) = trace(C M^-1 C^T) - w trace(G^T S^-1 G),   det(M + w A^T A) = det(M) det(S)
    /// ```
    pub(in crate::plan) fn best_update<const K: usize>(
        &mut self,
        rest: &DMatrix<f64>,
        rows: &DMatrixView<'_, f64>,
        most: &[f64],
        weight: f64,
    ) -> Option<usize> {
        let mut directions = rest.clone();
        let mut rest = rest.clone();
        if self.cost(&rest, &mut directions).is_infinite() {
            // An experiment may determine what the others leave open.
            for (index, most) in most.iter().enumerate() {
                rest[(index, index)] += OPEN * (rest[(index, index)] + weight * most);
            }
            if self.cost(&rest, &mut directions).is_infinite() {
                return None;
            }
        }
        let inverse = Cholesky::new(rest)?.inverse();
        let by_determinant = self.power_of_determinant().is_some();
        let moved = inverse * rows;
        let task = self.solved.transpose() * rows;
        let gain = |index: usize| {
            let at = K * index;
            let own = rows.fixed_columns::<K>(at);
            let sum = own.tr_mul(&moved.fixed_columns::<K>(at)) * weight;
            let factor = Cholesky::new(sum + SMatrix::<f64, K, K>::identity())?;
            if by_determinant {
                return Some(factor.determinant());
            }
            let each = (0..task.nrows()).map(|row| {
                let mut own = task.fixed_view::<1, K>(row, at).transpose();
                // The factor's diagonal is positive.
                factor.l_dirty().solve_lower_triangular_mut(&mut own);
                own.norm_squared()
            });
            Some(each.sum())
        };
        let gains = (0..rows.ncols() / K).map(|index| (index, gain(index).unwrap_or(0.0)));
        let best = gains.max_by(|one, other| one.1.total_cmp(&other.1));
        best.map(|(index, _)| index)
    }

    fn spectral_cost(&self, information: &DMatrix<f64>, directions: &mut DMatrix<f64>) -> f64 {
        let Some(eigen) = positive_eigen(information) else {
            return f64::INFINITY;
        };
        let values = &eigen.eigenvalues;
        let (low, high) = (values.imin(), values.imax());
        // The cost, and its derivatives with respect to the eigenvalues.
        let mut slope = DVector::zeros(values.len());
        // What goes with a power of the largest eigenvalue, and one of the inverse of the smallest.
        let mut of_extremes = |a: f64, b: f64| {
            let cost = values[high].powf(a) * values[low].powf(-b);
            slope[high] += a * cost / values[high];
            slope[low] -= b * cost / values[low];
            cost
        };
        let cost = match self.criterion {
            Criterion::E => of_extremes(0.0, 1.0),
            Criterion::O3 => of_extremes(0.0, 0.5),
            Criterion::O2 => of_extremes(0.5, 0.5),
            Criterion::O4 => of_extremes(0.5, 1.0),
            Criterion::O5 => {
                slope = values.map(|value| -0.5 * value.powf(-1.5));
                values.iter().map(|value| value.powf(-0.5)).sum()
            }
            // G; the others are factored.
            _ => return largest_variance(&eigen, directions),
        };
        let vectors = &eigen.eigenvectors;
        let weighted = vectors * DMatrix::from_diagonal(&-slope);
        directions.gemm(1.0, &weighted, &vectors.transpose(), 0.0);
        cost
    }

    /// The criterion's value as the literature states it: `rho_0` in m, D as the determinant's p-th
    /// root, the others as named. `None` for a singular information matrix.
    pub fn value(&mut self, information: &DMatrix<f64>) -> Option<f64> {
        let mut directions = information.clone();
        let cost = self.cost(information, &mut directions);
        cost.is_finite()
            .then(|| self.criterion.value_of_own_cost(cost))
    }
}

/// The eigenvalues, if all are positive beyond rounding.
fn positive_eigen(information: &DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    let eigen = finite_eigen(information)?;
    let largest = eigen.eigenvalues.max();
    (eigen.eigenvalues.min() > 1e-14 * largest && largest.is_finite()).then_some(eigen)
}

fn largest_variance(eigen: &SymmetricEigen<f64, Dyn>, directions: &mut DMatrix<f64>) -> f64 {
    let inverse = eigen.eigenvalues.map(f64::recip);
    let covariance =
        &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose();
    let variances = covariance.diagonal();
    let worst = variances.imax();
    let column = covariance.column(worst);
    directions.gemm(1.0, &column, &column.transpose(), 0.0);
    covariance[(worst, worst)]
}
