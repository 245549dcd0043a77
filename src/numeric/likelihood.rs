//! The likeliest logarithms of variances (and of other sizes) between limits, and the interval of one of them by its profile:
//!
//! ```text
//! l(t) = max of the logarithm of the likelihood over all others,   2 (l_max - l(t)) <= 1.96^2
//! ```
//!
//! (D. J. Venzon, S. H. Moolgavkar, *A method for computing profile-likelihood-based confidence intervals*, Applied Statistics 37, 1988).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::factorisation::inverse_of;
use super::quantile::TWO_SIDED_95;

/// Steps that are tried.
const STEPS: usize = 60;
/// A step is damped as if so many numbers determined each value, and less where that goes well; the last gains no more than this (of the
/// logarithm of the likelihood): from anywhere, and from near the likeliest.
const FROM_ANYWHERE: [f64; 2] = [1.0, 1e-4];
const FROM_NEAR: [f64; 2] = [NEXT_TO_NOTHING, 1e-2];
const DAMPED: [f64; 2] = [0.25, 8.0];
const NEXT_TO_NOTHING: f64 = 0.1;
/// A value with less information may as well be at its lower limit.
const HARDLY_KNOWN: f64 = 1.0;
/// An interval that reaches less far than this to either side is that of the curvature.
const SYMMETRIC: f64 = 0.2;
/// Ends of intervals are looked for until they are so near, in standard errors, at most so many times.
const NEAR: f64 = 0.05;
const TRIES: usize = 20;

/// A likelihood at some values.
#[derive(Debug, Clone)]
pub struct Likelihood {
    /// Its logarithm.
    pub logarithm: f64,
    /// How that grows with each value.
    pub gradient: DVector<f64>,
    /// The information: how the gradient falls, expected or averaged.
    pub curvature: DMatrix<f64>,
}

/// The likeliest values.
#[derive(Debug, Clone)]
pub struct Likeliest {
    /// The values.
    pub at: DVector<f64>,
    /// Their likelihood.
    pub found: Likelihood,
}

/// A likelihood of logarithms, each between a lower limit, where a variance is next to nothing, and an upper one.
pub struct LimitedLikelihood<F> {
    /// The likelihood; none where there is none.
    pub of: F,
    /// The lower limits, and the upper ones.
    pub limits: [DVector<f64>; 2],
}

impl<F: Fn(&DVector<f64>) -> Option<Likelihood>> LimitedLikelihood<F> {
    /// The likeliest values, from a start within the limits on.
    pub fn likeliest(&self, start: DVector<f64>) -> Option<Likeliest> {
        let mut best = self.climbed(start, &self.limits, FROM_ANYWHERE)?;
        // A logarithm of a variance that is next to nothing moves nothing, and stays where it is.
        for (place, &nothing) in self.limits[0].iter().enumerate() {
            let information = best.found.curvature[(place, place)];
            if information < HARDLY_KNOWN && best.found.gradient[place] < 0.0 {
                let mut at = best.at.clone();
                at[place] = nothing;
                let found = (self.of)(&at).filter(|of| of.logarithm >= best.found.logarithm);
                best = found.map_or(best, |found| Likeliest { at, found });
            }
        }
        Some(best)
    }

    /// Newton's steps by the information, damped as Levenberg and Marquardt do.
    fn climbed(
        &self,
        start: DVector<f64>,
        [low, high]: &[DVector<f64>; 2],
        [mut damping, least_gain]: [f64; 2],
    ) -> Option<Likeliest> {
        let mut at = start;
        let mut found = (self.of)(&at)?;
        for _ in 0..STEPS {
            let (mut curvature, mut gradient) = (found.curvature.clone(), found.gradient.clone());
            for place in 0..at.len() {
                let is_kept = (at[place] <= low[place] && gradient[place] < 0.0)
                    || (at[place] >= high[place] && gradient[place] > 0.0)
                    || low[place] >= high[place];
                if is_kept {
                    gradient[place] = 0.0;
                    curvature.row_mut(place).fill(0.0);
                    curvature.column_mut(place).fill(0.0);
                }
            }
            let step = |damping: f64| {
                let damped = &curvature + DMatrix::identity(at.len(), at.len()) * damping;
                Some(Cholesky::new(damped)?.solve(&gradient))
            };
            if 0.5 * gradient.dot(&step(NEXT_TO_NOTHING)?) < least_gain {
                break;
            }
            let next = (&at + step(damping)?).zip_zip_map(low, high, f64::clamp);
            let better = (self.of)(&next).filter(|next| next.logarithm > found.logarithm);
            damping *= DAMPED[usize::from(better.is_none())];
            if let Some(better) = better {
                (at, found) = (next, better);
            }
        }
        Some(Likeliest { at, found })
    }

    /// The interval of 95 % of one of the likeliest values: where the likelihood, all others at their likeliest, is not less than a normal
    /// one would be there. An end is at a limit where it is more even there; none where the likelihood does not depend on it.
    pub fn interval95(&self, best: &Likeliest, place: usize) -> Option<[f64; 2]> {
        if best.found.curvature[(place, place)] == 0.0 {
            return None;
        }
        let [low, high] = &self.limits;
        let inner: Vec<usize> = (0..best.at.len())
            .filter(|&each| low[each] < best.at[each] && best.at[each] < high[each])
            .collect();
        let curvature = best.found.curvature.select_rows(&inner);
        let errors = Cholesky::new(curvature.select_columns(&inner)).map(|own| inverse_of(&own));
        let own = inner.iter().position(|&each| each == place);
        let reach = own.zip(errors).map_or(1.0, |(own, errors)| {
            TWO_SIDED_95 * errors[(own, own)].sqrt()
        });
        let value = best.at[place];
        let is_free = low[place] < value - reach && value + reach < high[place];
        if reach < SYMMETRIC && is_free {
            return Some([value - reach, value + reach]);
        }
        Some([
            self.lower_end(best, place)?,
            self.upper_end(best, place, reach)?,
        ])
    }

    /// How much further than 95 % a value is off, in standard errors, all others at their likeliest from these on, which are then those.
    fn beyond(
        &self,
        best: &Likeliest,
        (place, value): (usize, f64),
        at: &mut DVector<f64>,
    ) -> Option<f64> {
        let mut limits = self.limits.clone();
        for limit in &mut limits {
            limit[place] = value;
        }
        at[place] = value;
        let likeliest = self.climbed(at.clone(), &limits, FROM_NEAR)?;
        *at = likeliest.at;
        let less = best.found.logarithm - likeliest.found.logarithm;
        Some((2.0 * less.max(0.0)).sqrt() - TWO_SIDED_95)
    }

    /// Whether a value at its lower limit, all others at their likeliest, is not much less likely.
    pub fn may_be_nothing(&self, best: &Likeliest, place: usize) -> bool {
        let limit = self.limits[0][place];
        let beyond = self.beyond(best, (place, limit), &mut best.at.clone());
        best.at[place] <= limit || beyond.is_some_and(|beyond| beyond <= NEAR)
    }

    /// Between the lower limit and the estimate.
    fn lower_end(&self, best: &Likeliest, place: usize) -> Option<f64> {
        let (limit, value) = (self.limits[0][place], best.at[place]);
        let mut at = best.at.clone();
        if value <= limit {
            return Some(limit);
        }
        let beyond = self.beyond(best, (place, limit), &mut at)?;
        if beyond <= NEAR {
            return Some(limit);
        }
        let near = (value, -TWO_SIDED_95);
        self.between(best, place, near, (limit, beyond), best.at.clone())
    }

    /// Beyond the estimate: by twice as much each time, and then back.
    fn upper_end(&self, best: &Likeliest, place: usize, reach: f64) -> Option<f64> {
        let limit = self.limits[1][place];
        let (mut at, mut step) = (best.at.clone(), reach);
        let mut near = (best.at[place], -TWO_SIDED_95);
        while near.0 < limit {
            let from = at.clone();
            let value = limit.min(near.0 + step);
            let beyond = self.beyond(best, (place, value), &mut at)?;
            if beyond > NEAR {
                return self.between(best, place, near, (value, beyond), from);
            }
            near = (value, beyond);
            step *= 2.0;
        }
        Some(limit)
    }

    /// The end of an interval between a value in it and one beyond, from others that are likeliest beside the first: along deviations, with
    /// which the root of the likelihood ratio goes as a straight line. An end that stays counts half, so that both come near.
    fn between(
        &self,
        best: &Likeliest,
        place: usize,
        near: (f64, f64),
        far: (f64, f64),
        mut at: DVector<f64>,
    ) -> Option<f64> {
        let deviation = |(value, beyond): (f64, f64)| ((0.5 * value).exp(), beyond);
        let mut ends = [deviation(near), deviation(far)];
        let mut last = None;
        let mut nearest = near;
        for _ in 0..TRIES {
            let [near, far] = ends;
            let tried = near.0 - near.1 * (far.0 - near.0) / (far.1 - near.1);
            let value = 2.0 * tried.ln();
            let beyond = self.beyond(best, (place, value), &mut at)?;
            if beyond.abs() < nearest.1.abs() {
                nearest = (value, beyond);
            }
            if beyond.abs() < NEAR {
                break;
            }
            let moved = usize::from(beyond > 0.0);
            if last == Some(moved) {
                ends[1 - moved].1 *= 0.5;
            }
            ends[moved] = (tried, beyond);
            last = Some(moved);
        }
        Some(nearest.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The logarithm of a normal variance of which n squares have a sum: n (t - exp(t - s)) / -2 and so on.
    fn of_squares(count: f64, sum: f64) -> impl Fn(&DVector<f64>) -> Option<Likelihood> {
        move |at: &DVector<f64>| {
            let share = sum * (-at[0]).exp();
            Some(Likelihood {
                logarithm: -0.5 * (count * at[0] + share),
                gradient: DVector::from_element(1, 0.5 * (share - count)),
                curvature: DMatrix::from_element(1, 1, 0.5 * count),
            })
        }
    }

    fn limited(
        count: f64,
        sum: f64,
    ) -> LimitedLikelihood<impl Fn(&DVector<f64>) -> Option<Likelihood>> {
        LimitedLikelihood {
            of: of_squares(count, sum),
            limits: [-20.0, 20.0].map(|limit| DVector::from_element(1, limit)),
        }
    }

    /// The likelihood ratio of a variance with n squares is n (r - 1 - ln r), r = estimate / variance: at both ends it is that of 95 %.
    #[test]
    fn intervals_are_those_of_likelihood_ratios() {
        for count in [2.0, 5.0, 20.0, 60.0] {
            let of = limited(count, 3.0 * count);
            let best = of.likeliest(DVector::zeros(1)).expect("a variance");
            assert!((best.at[0] - 3.0_f64.ln()).abs() < 0.02, "{}", best.at[0]);
            for end in of.interval95(&best, 0).expect("an interval") {
                let share = 3.0 * (-end).exp();
                let ratio = (count * (share - 1.0 - share.ln())).sqrt();
                assert!((ratio - TWO_SIDED_95).abs() < 0.06, "{count}: {ratio}");
            }
        }
    }

    /// A variance beside one that is known, and next to nothing: its interval ends where the ratio says, from however far below it is looked for.
    #[test]
    fn what_is_next_to_nothing_has_the_upper_end_of_its_ratio() {
        for lowest in [-60.0, -36.0, -20.0] {
            let (count, sum) = (40.0, 36.0);
            let logarithm =
                |variance: f64| -0.5 * (count * (1.0 + variance).ln() + sum / (1.0 + variance));
            let of = LimitedLikelihood {
                of: |at: &DVector<f64>| {
                    let variance = at[0].exp();
                    let [share, whole] = [variance / (1.0 + variance), 1.0 + variance];
                    Some(Likelihood {
                        logarithm: logarithm(variance),
                        gradient: DVector::from_element(1, 0.5 * share * (sum / whole - count)),
                        curvature: DMatrix::from_element(1, 1, 0.5 * count * share * share),
                    })
                },
                limits: [lowest, 20.0].map(|limit| DVector::from_element(1, limit)),
            };
            let best = of.likeliest(DVector::zeros(1)).expect("a variance");
            let [low, high] = of.interval95(&best, 0).expect("an interval");
            assert!(low <= lowest, "{low}");
            let ratio = (2.0 * (logarithm(0.0) - logarithm(high.exp()))).sqrt();
            assert!(
                (ratio - TWO_SIDED_95).abs() < 0.06,
                "{lowest}: {high}, {ratio}"
            );
        }
    }

    /// Nothing is likeliest where all squares are nothing, and its interval begins there.
    #[test]
    fn what_is_nothing_has_an_upper_end() {
        let of = limited(3.0, 1e-12);
        let best = of.likeliest(DVector::zeros(1)).expect("a variance");
        let [low, high] = of.interval95(&best, 0).expect("an interval");
        assert_eq!(
            [best.at[0], low].map(f64::to_bits),
            [(-20.0_f64).to_bits(); 2]
        );
        let ratio = 2.0 * (best.found.logarithm + 0.5 * 3.0 * high);
        assert!((ratio.sqrt() - TWO_SIDED_95).abs() < 0.06, "{high}");
    }
}
