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

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::{
    ComponentIntervals, LEAST, MixedModel, MixedVariances, PoseReadings, VarianceComponents,
};
use crate::numeric::factorisation::inverse_of;
use crate::numeric::likelihood::{Likeliest, Likelihood, LimitedLikelihood};
use crate::numeric::markov::{Correlation, FIRST_LENGTH};
use crate::numeric::quantile::TWO_SIDED_95;
use crate::numeric::tolerance::ends;
use crate::parameter::JointFunction;

/// Parts of the poses have no more of these, and no more rows.
const SPARSE: usize = 100;
const ROWS: usize = 900;
/// A logarithm that is nearer to the edge of what is looked for is at it, and an interval that reaches further says nothing.
const EDGE: f64 = 1e-3;
/// A deviation (m, rad), or a length, no larger than this is none.
const NOTHING: f64 = 1.001e-9;
const MOST_REACH: f64 = 7.0;
/// An interval of the logarithm of a function's variance that reaches so far is asked whether there may be no function.
const DOUBTFUL: f64 = 1.0;
/// Another correlation than the first is taken where the logarithm of its likelihood is larger by this: seven times as likely.
const CLEARLY: f64 = 2.0;

impl MixedModel {
    /// The likeliest variance components of parts that are as sparse as plans (every k-th pose), all the same, with the likeliest of the
    /// correlations.
    ///
    /// A real joint's error is no process of one length: read densely it looks smoother than the few poses of a plan find it, and
    /// predictions from them are too good. Where poses are visited again, what is new at a pose is told from what is new at a visit.
    pub fn components(&self) -> Option<(VarianceComponents, ComponentIntervals)> {
        let rows: usize = (self.visits.iter()).map(|visit| visit.residual.len()).sum();
        let count = (self.visits.len().div_ceil(SPARSE)).max(rows.div_ceil(ROWS));
        let parts: Vec<Self> = (0..count)
            .map(|part| self.of_visits(|visit| visit % count == part))
            .collect();
        let first = self.first();
        let found = Correlation::ALL.map(|correlation| {
            let likelihood = likelihood_of(&parts, &first, correlation);
            let best = likelihood.likeliest(first.start())?;
            Some((best, likelihood, correlation))
        });
        // Few poses may by chance look smoother than they are.
        let logarithm = |best: &Likeliest, correlation: Correlation| {
            let is_first = correlation == Correlation::ALL[0];
            best.found.logarithm - if is_first { 0.0 } else { CLEARLY }
        };
        let (best, likelihood, correlation) =
            (found.into_iter().flatten()).max_by(|one, other| {
                logarithm(&one.0, one.2).total_cmp(&logarithm(&other.0, other.2))
            })?;
        let found = first.at(&best.at, correlation);
        let intervals = self.intervals(&best, &likelihood, &found, parts.len());
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
        let ends = |place: usize, power: f64| {
            let ends = intervals[place]?.map(|end: f64| (power * end).exp());
            Some(ends.map(|end| if end > NOTHING { end } else { 0.0 }))
        };
        let deviation = |place: usize| ends(place, 0.5);
        let joints = 0..self.joints.len();
        let of_rest = found.of_poses.unwrap_or(0);
        let intervals = ComponentIntervals {
            deviations: joints.clone().map(|place| deviation(2 + place)).collect(),
            lengths: joints
                .clone()
                .map(|place| ends(found.all.len() + place, 1.0))
                .collect(),
            repeatabilities: joints
                .map(|place| deviation(found.returns() + place))
                .collect(),
            rest_of_positions: deviation(of_rest),
        };
        let components = VarianceComponents {
            functions: self.joints.iter().enumerate().map(function).collect(),
            rest: [rest(0).sqrt(), rest(1).sqrt()],
        };
        Some((components, intervals))
    }

    /// The intervals of 95 % of the likeliest logarithms, which are these variances and lengths, from so many parts; none where the
    /// readings do not say.
    fn intervals(
        &self,
        best: &Likeliest,
        likelihood: &LimitedLikelihood<impl Fn(&DVector<f64>) -> Option<Likelihood>>,
        likeliest: &MixedVariances,
        parts: usize,
    ) -> Vec<Option<[f64; 2]>> {
        let (at, [low, high]) = (&best.at, &likelihood.limits);
        // At the edge of what is looked for nothing says how far the other side is.
        let inner: Vec<usize> = (0..at.len())
            .filter(|&place| low[place] + EDGE < at[place] && at[place] < high[place] - EDGE)
            .collect();
        let curvature = best.found.curvature.select_rows(&inner);
        let curvature = curvature.select_columns(&inner);
        let mut intervals = vec![None; at.len()];
        // Parts see the same functions: of those no number of readings shows more than their own course.
        let again = 1.0 - 1.0 / parts as f64;
        let of_course = |place: usize| {
            let joints = self.joints.len();
            let of = |first: usize| place.checked_sub(first).filter(|joint| *joint < joints);
            of(2).or_else(|| of(likeliest.all.len())).map(|joint| {
                let [low, high] = ends(self.angles(joint).into_iter());
                likeliest.process[joint]
                    .kernel
                    .variance_of_course(high - low)
            })
        };
        if let Some(factor) = Cholesky::new(curvature) {
            for (&place, variance) in inner.iter().zip(&inverse_of(&factor).diagonal()) {
                let whole = variance + again * of_course(place).unwrap_or(0.0);
                let reach = TWO_SIDED_95 * whole.sqrt();
                let is_function = (2..2 + self.joints.len()).contains(&place);
                let is_doubtful = is_function && reach > DOUBTFUL;
                let may_be_none = is_doubtful && likelihood.may_be_nothing(best, place);
                let lower = if may_be_none {
                    low[place]
                } else {
                    at[place] - reach
                };
                intervals[place] = (reach < MOST_REACH).then_some([lower, at[place] + reach]);
            }
        }
        // What else is new somewhere may be next to nothing: that is told by how much less likely it is, and not by a curvature.
        for place in (0..likeliest.all.len()).filter(|&place| of_course(place).is_none()) {
            intervals[place] = likelihood.interval95(best, place);
        }
        intervals
    }

    /// What the readings say, all poses together.
    fn likelihood(&self, variances: &MixedVariances) -> Option<Likelihood> {
        let each = |of: &dyn Fn(&PoseReadings) -> DMatrix<f64>| {
            let all: Vec<_> = self.visits.iter().map(|visit| of(visit)).collect();
            in_blocks(&all)
        };
        let rows: Vec<_> = (self.visits.iter())
            .flat_map(|visit| visit.dense.row_iter())
            .collect();
        let all = DMatrix::from_rows(&rows);
        let fixed = all.columns(0, self.units.ncols()).into_owned();
        let residual = self.visits.iter().flat_map(|visit| &visit.residual);
        let residual = DVector::from_iterator(rows.len(), residual.copied());
        // How V changes with each logarithm, that of a variance and then that of a length: of what is new at a visit or a pose in
        // blocks, of a joint's error everywhere.
        let alone = |place: usize| {
            let mut alone = variances.clone();
            alone.all.fill(0.0);
            alone.all[place] = variances.all[place];
            each(&|visit| visit.local(&alone).covariance - &visit.own)
        };
        let mut changes: Vec<DMatrix<f64>> = (0..variances.all.len()).map(alone).collect();
        for (joint, process) in variances.process.iter().enumerate() {
            let moved = each(&|visit| visit.joints.columns(joint, 1).into_owned());
            let angle = |visit: usize| self.visits[visit].angles[joint];
            let mut shared = [(); 2].map(|()| DMatrix::zeros(moved.ncols(), moved.ncols()));
            for one in 0..moved.ncols() {
                for other in 0..=one {
                    let apart = (angle(one) - angle(other)).abs();
                    let both = process.kernel.correlation(apart);
                    for (shared, value) in shared.iter_mut().zip(both) {
                        shared[(one, other)] = variances.all[2 + joint] * value;
                        shared[(other, one)] = shared[(one, other)];
                    }
                }
            }
            let [by_size, by_length] = shared.map(|shared| &moved * (shared * moved.transpose()));
            changes[2 + joint] = by_size;
            changes.push(by_length);
        }
        let mut covariance = each(&|visit| visit.own.clone());
        for change in &changes[..variances.all.len()] {
            covariance += change;
        }
        let factor = Cholesky::new(covariance)?;
        let inverse = inverse_of(&factor);
        let weighed = &inverse * &fixed;
        let information = Cholesky::new(fixed.tr_mul(&weighed) + &self.prior)?;
        let pull = weighed.tr_mul(&residual) + &self.pull;
        let values = information.solve(&pull);
        let own = &inverse * &residual;
        let square = residual.dot(&own) - pull.dot(&values);
        let determinants = [&factor, &information].map(|factor| {
            let roots = factor.l_dirty().diagonal();
            2.0 * roots.map(f64::ln).sum()
        });
        let left = own - &weighed * values;
        let projected = inverse - &weighed * information.solve(&weighed.transpose());
        let moved: Vec<DVector<f64>> = changes.iter().map(|change| change * &left).collect();
        let gradient = moved.iter().zip(&changes);
        let gradient = gradient.map(|(moved, change)| left.dot(moved) - projected.dot(change));
        let moved = DMatrix::from_columns(&moved);
        Some(Likelihood {
            logarithm: -0.5 * (determinants.iter().sum::<f64>() + square),
            gradient: DVector::from_iterator(changes.len(), gradient) * 0.5,
            curvature: moved.tr_mul(&(projected * &moved)) * 0.5,
        })
    }
}

impl MixedVariances {
    /// The same with the variances and lengths of these logarithms.
    fn at(&self, at: &DVector<f64>, correlation: Correlation) -> Self {
        let mut variances = self.clone();
        let process = variances.process.iter_mut().map(|each| {
            each.kernel.correlation = correlation;
            &mut each.kernel.length
        });
        for (to, value) in variances.all.iter_mut().chain(process).zip(at) {
            *to = value.exp();
        }
        variances
    }

    /// The logarithms that all begins with, lengths half way to the shortest.
    fn start(&self) -> DVector<f64> {
        let lengths = self.process.iter();
        let lengths = lengths.map(|each| 0.5 * (each.kernel.length * FIRST_LENGTH).ln());
        let sizes = self.all.iter().map(|each| each.ln());
        DVector::from_vec(sizes.chain(lengths).collect())
    }
}

/// The likelihood of logarithms of variances and lengths, of all parts together; lengths are at most the first ones.
fn likelihood_of<'a>(
    parts: &'a [MixedModel],
    first: &'a MixedVariances,
    correlation: Correlation,
) -> LimitedLikelihood<impl Fn(&DVector<f64>) -> Option<Likelihood> + 'a> {
    let limits = |size: f64, lengths: Vec<f64>| {
        let mut limits = vec![size.ln(); first.all.len()];
        limits.extend(lengths.iter().map(|length| length.ln()));
        DVector::from_vec(limits)
    };
    let longest = first.process.iter().map(|each| each.kernel.length);
    let shortest = vec![FIRST_LENGTH; first.process.len()];
    let limits = [limits(LEAST, shortest), limits(1.0, longest.collect())];
    let of = move |at: &DVector<f64>| {
        let variances = first.at(at, correlation);
        let each: Vec<Option<Likelihood>> = (parts.par_iter())
            .map(|part| part.likelihood(&variances))
            .collect();
        each.into_iter().reduce(|sum, one| {
            let (sum, one) = (sum?, one?);
            Some(Likelihood {
                logarithm: sum.logarithm + one.logarithm,
                gradient: sum.gradient + one.gradient,
                curvature: sum.curvature + one.curvature,
            })
        })?
    };
    LimitedLikelihood { of, limits }
}

/// Matrices one behind the other, and each below the one before.
pub(in super::super) fn in_blocks(each: &[DMatrix<f64>]) -> DMatrix<f64> {
    let sum = |of: fn(&DMatrix<f64>) -> usize| each.iter().map(of).sum();
    let mut all = DMatrix::zeros(sum(DMatrix::nrows), sum(DMatrix::ncols));
    let mut at = (0, 0);
    for own in each {
        all.view_mut(at, own.shape()).copy_from(own);
        at = (at.0 + own.nrows(), at.1 + own.ncols());
    }
    all
}
