//! Variance components that are estimated for plans: the likeliest (REML), of functions of either smoothness.
//!
//! With V = sum of v_i D_i + R over the variances v, and P as in [`super`], the likelihood of the logarithms t of variances and lengths has
//!
//! ```text
//! gradient     1/2 (a^T dV_t a - trace(P dV_t)),   a = P y
//! curvature    1/2 a^T dV_s P dV_t a               the average information
//! ```
//!
//! (A. R. Gilmour, R. Thompson, B. R. Cullis, *Average information REML*, Biometrics 51, 1995). No knots are needed: parts are as
//! sparse as plans are.

use nalgebra::{Cholesky, DMatrix, DMatrixViewMut, DVector, Dyn};
use rayon::prelude::*;

use super::{LEAST, MixedModel, MixedVariances, VarianceComponents, by_pose};
use crate::numeric::factorisation::inverse_of;
use crate::numeric::markov::{Correlation, FIRST_LENGTH, Kernel, MarkovProcess};
use crate::parameter::JointFunction;

/// Parts of the poses have no more of these, and no more rows.
const SPARSE: usize = 100;
const ROWS: usize = 900;
/// Steps that are tried; one that gains less (of the logarithm of the likelihood) is the last.
const STEPS: usize = 60;
const GAIN: f64 = 0.05;
/// A step is damped as if so many numbers told each logarithm what it is, and less where that goes well.
const DAMPING: f64 = 1.0;
const DAMPED: [f64; 2] = [0.25, 8.0];
/// Where no angle is near.
const FAR: f64 = 1e9;

/// What readings say of the logarithms of variances and lengths.
struct Told {
    likelihood: f64,
    gradient: DVector<f64>,
    curvature: DMatrix<f64>,
}

impl MixedModel {
    /// The likeliest variance components of parts that are as sparse as plans (every k-th pose), all the same, with the likeliest of the
    /// correlations. Of joints that turn.
    ///
    /// A real joint's error is no process of one length: read densely it looks smoother than the few poses of a plan find it, and
    /// predictions from them are too good. Where poses are visited again, what is new at a pose is told from what is new at a visit.
    pub fn components(&self, turns: &[bool]) -> Option<VarianceComponents> {
        let all = Self {
            visits: by_pose(&self.visits),
            ..self.clone()
        };
        let rows: usize = (all.visits.iter()).map(|visit| visit.residual.len()).sum();
        let count = (all.visits.len().div_ceil(SPARSE)).max(rows.div_ceil(ROWS));
        let parts: Vec<Self> = (0..count)
            .map(|part| all.of_visits(|visit| visit % count == part))
            .collect();
        let mut best: Option<(f64, MixedVariances)> = None;
        for correlation in Correlation::ALL {
            let found = all.likeliest_components(&parts, correlation);
            best = (best.into_iter().chain(found)).reduce(|one, other| match other.0 > one.0 {
                true => other,
                false => one,
            });
        }
        let (_, found) = best?;
        let joints = self.joints.iter().enumerate().zip(turns);
        let functions = joints.filter_map(|(joint, turns)| turns.then_some(joint));
        let function = |(place, &joint): (usize, &usize)| JointFunction {
            joint,
            deviation_rad: found.all[2 + place].sqrt(),
            kernel: found.process[place].kernel,
            repeatability_rad: found.all[found.returns() + place].sqrt(),
        };
        let rest = |part: usize| match found.of_poses {
            Some(first) => found.all[first + part],
            None => found.all[part] + self.within[part],
        };
        Some(VarianceComponents {
            functions: functions.map(function).collect(),
            rest: [rest(0).sqrt(), rest(1).sqrt()],
        })
    }

    /// The likeliest variances and lengths for all parts together, with the logarithm of their likelihood.
    fn likeliest_components(
        &self,
        parts: &[Self],
        correlation: Correlation,
    ) -> Option<(f64, MixedVariances)> {
        let first = self.first();
        let lengths = first.process.iter().map(|each| each.kernel.length);
        let longest: Vec<f64> = lengths.map(f64::ln).collect();
        let sizes = first.all.len();
        let mut low = DVector::from_element(sizes + longest.len(), LEAST.ln());
        low.rows_mut(sizes, longest.len()).fill(FIRST_LENGTH.ln());
        let starts = longest
            .iter()
            .map(|each| f64::midpoint(FIRST_LENGTH.ln(), *each));
        let starts = first.all.iter().map(|each| each.ln()).chain(starts);
        let mut at = DVector::from_iterator(low.len(), starts);
        let high = DVector::from_iterator(low.len(), (0..sizes).map(|_| 0.0).chain(longest));
        let variances = |at: &DVector<f64>| {
            let process = at.rows_range(sizes..).map(f64::exp);
            let process = process.iter().map(|&length| MarkovProcess {
                knots: vec![FAR],
                kernel: Kernel {
                    correlation,
                    length,
                },
            });
            MixedVariances {
                all: at.rows(0, sizes).iter().map(|each| each.exp()).collect(),
                of_poses: first.of_poses,
                process: process.collect(),
            }
        };
        let told = |at: &DVector<f64>| {
            let variances = variances(at);
            let each: Vec<Option<Told>> = (parts.par_iter())
                .map(|part| part.told_of(&variances))
                .collect();
            each.into_iter().reduce(|sum, one| {
                let (sum, one) = (sum?, one?);
                Some(Told {
                    likelihood: sum.likelihood + one.likelihood,
                    gradient: sum.gradient + one.gradient,
                    curvature: sum.curvature + one.curvature,
                })
            })?
        };
        let mut found = told(&at)?;
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            let mut curvature = found.curvature.clone();
            let mut gradient = found.gradient.clone();
            for place in 0..at.len() {
                let is_kept = (at[place] <= low[place] && gradient[place] < 0.0)
                    || (at[place] >= high[place] && gradient[place] > 0.0);
                if is_kept {
                    gradient[place] = 0.0;
                    curvature.row_mut(place).fill(0.0);
                    curvature.column_mut(place).fill(0.0);
                }
                curvature[(place, place)] += damping;
            }
            let step = Cholesky::new(curvature)?.solve(&gradient);
            let next = (&at + step).zip_zip_map(&low, &high, f64::clamp);
            let better = told(&next).filter(|next| next.likelihood > found.likelihood);
            damping *= DAMPED[usize::from(better.is_none())];
            if let Some(better) = better {
                let gain = better.likelihood - found.likelihood;
                (at, found) = (next, better);
                if gain < GAIN {
                    break;
                }
            }
        }
        Some((found.likelihood, variances(&at)))
    }

    /// What the readings say of variances with processes whose knots are far: each pose alone has all of each joint's error then, and what
    /// two poses share is told by the kernels.
    fn told_of(&self, variances: &MixedVariances) -> Option<Told> {
        let readings = Stacked::new(self);
        let shared: Vec<[DMatrix<f64>; 2]> = (0..self.joints.len())
            .map(|joint| self.shared(joint, variances))
            .collect();
        let mut covariance = DMatrix::zeros(readings.residual.len(), readings.residual.len());
        for (one, visit) in self.visits.iter().enumerate() {
            let own = visit.local(variances).covariance;
            readings
                .block_mut(&mut covariance, one, one)
                .copy_from(&own);
            for (other, beside) in self.visits.iter().enumerate().take(one) {
                let by = shared.iter().map(|[shared, _]| shared[(one, other)]);
                let by = DMatrix::from_diagonal(&DVector::from_iterator(shared.len(), by));
                let block = &visit.joints * by * beside.joints.transpose();
                readings
                    .block_mut(&mut covariance, one, other)
                    .copy_from(&block);
            }
        }
        covariance.fill_upper_triangle_with_lower_triangle();
        let factor = Cholesky::new(covariance)?;
        let inverse = inverse_of(&factor);
        let weighed = &inverse * &readings.fixed;
        let information = Cholesky::new(readings.fixed.tr_mul(&weighed) + &self.prior)?;
        let pull = weighed.tr_mul(&readings.residual) + &self.pull;
        let values = information.solve(&pull);
        let square = readings.residual.dot(&(&inverse * &readings.residual)) - pull.dot(&values);
        let determinants = ln_determinant(&factor) + ln_determinant(&information);
        let left = &inverse * &readings.residual - &weighed * values;
        let projected = inverse - &weighed * information.solve(&weighed.transpose());
        let of_change = self.changes(&readings, variances, &shared, (&projected, &left));
        let gradient = of_change.iter().map(|(gradient, _)| *gradient);
        let columns: Vec<DVector<f64>> = of_change.iter().map(|(_, moved)| moved.clone()).collect();
        let moved = DMatrix::from_columns(&columns);
        Some(Told {
            likelihood: -0.5 * (determinants + square),
            gradient: DVector::from_iterator(of_change.len(), gradient),
            curvature: moved.tr_mul(&(projected * &moved)) * 0.5,
        })
    }

    /// What two poses share of a joint's error, and the derivative of that by the logarithm of the length; nothing for each by itself.
    fn shared(&self, joint: usize, variances: &MixedVariances) -> [DMatrix<f64>; 2] {
        let kernel = variances.process[joint].kernel;
        let angle = |visit: usize| self.visits[visit].angles[joint];
        let count = self.visits.len();
        [0, 1].map(|which| {
            DMatrix::from_fn(count, count, |one, other| {
                let of = kernel.correlation((angle(one) - angle(other)).abs())[which];
                variances.all[2 + joint] * if one == other { 0.0 } else { of }
            })
        })
    }

    /// For each logarithm the gradient, and dV a.
    fn changes(
        &self,
        readings: &Stacked,
        variances: &MixedVariances,
        shared: &[[DMatrix<f64>; 2]],
        (projected, left): (&DMatrix<f64>, &DVector<f64>),
    ) -> Vec<(f64, DVector<f64>)> {
        let of_size = |place: usize| {
            let mut alone = variances.clone();
            alone.all.fill(0.0);
            alone.all[place] = variances.all[place];
            let mut moved = DVector::zeros(left.len());
            let mut gradient = 0.0;
            for (number, visit) in self.visits.iter().enumerate() {
                let change = visit.local(&alone).covariance - &visit.own;
                let (at, count) = readings.span(number);
                let own = left.rows(at, count);
                let by = &change * own;
                gradient += own.dot(&by);
                gradient -= projected.view((at, at), (count, count)).dot(&change);
                moved.rows_mut(at, count).copy_from(&by);
            }
            (0.5 * gradient, moved)
        };
        let mut all: Vec<_> = (0..variances.all.len()).map(of_size).collect();
        for (joint, shared) in shared.iter().enumerate() {
            let moves = readings.moved_by(self, joint);
            let seen = moves.tr_mul(left);
            let told = moves.tr_mul(&(projected * &moves)) - &seen * seen.transpose();
            let [by_size, by_length] = shared.each_ref().map(|shared| {
                let gradient = -0.5 * shared.dot(&told);
                (gradient, &moves * (shared * &seen))
            });
            all[2 + joint].0 += by_size.0;
            all[2 + joint].1 += by_size.1;
            all.push(by_length);
        }
        all
    }
}

/// Readings, one pose below the other.
struct Stacked {
    starts: Vec<usize>,
    residual: DVector<f64>,
    fixed: DMatrix<f64>,
}

impl Stacked {
    fn new(model: &MixedModel) -> Self {
        let mut starts = vec![0];
        for visit in &model.visits {
            starts.push(starts[starts.len() - 1] + visit.residual.len());
        }
        let rows = starts[model.visits.len()];
        let mut stacked = Self {
            starts,
            residual: DVector::zeros(rows),
            fixed: DMatrix::zeros(rows, model.units.ncols()),
        };
        for (number, visit) in model.visits.iter().enumerate() {
            let (at, count) = stacked.span(number);
            (stacked.residual.rows_mut(at, count)).copy_from(&visit.residual);
            stacked.fixed.rows_mut(at, count).copy_from(&visit.fixed);
        }
        stacked
    }

    /// Where the rows of a pose begin, and how many there are.
    fn span(&self, visit: usize) -> (usize, usize) {
        (
            self.starts[visit],
            self.starts[visit + 1] - self.starts[visit],
        )
    }

    fn block_mut<'a>(
        &self,
        matrix: &'a mut DMatrix<f64>,
        one: usize,
        other: usize,
    ) -> DMatrixViewMut<'a, f64> {
        let [(row, rows), (column, columns)] = [one, other].map(|visit| self.span(visit));
        matrix.view_mut((row, column), (rows, columns))
    }

    /// How a joint's error at each pose moves all rows.
    fn moved_by(&self, model: &MixedModel, joint: usize) -> DMatrix<f64> {
        let mut moved = DMatrix::zeros(self.residual.len(), model.visits.len());
        for (number, visit) in model.visits.iter().enumerate() {
            let (at, count) = self.span(number);
            let mut own = moved.view_mut((at, number), (count, 1));
            own.copy_from(&visit.joints.column(joint));
        }
        moved
    }
}

fn ln_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().map(f64::ln).sum() * 2.0
}
