//! Robust fit of deflections: without outliers, with the model discrepancy in the weights.
//!
//! The rules are those of absolute readings: who lies far out is decided by [`outliers`], how large a discrepancy is by
//! [`discrepancy_of`]. Deflections are few and often single ones hold a compliance, so that each is judged by the covariance of what a fit leaves of
//! it, R - A cov A^T, and one that was left out by R + A cov A^T.

use super::case::{Case, Sigma};
use super::discrepancy::{
    ReadingResidual, WEIGHINGS, discrepancy_of, repeats, six_rows, with_discrepancy,
};
use super::equations::rows_of;
use super::error::FitResult;
use super::estimate::{Identification, in_room, two_sided_student};
use super::fit::FitStart;
use super::nominal::UNKNOWN;
use super::outliers::IMPLAUSIBLE;
use super::outliers::{self, LookedOver, RejectedReading, kept};
use crate::measurement::Measurement;
use crate::task::Method;

/// How measurements are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Robustness {
    /// Whether those that lie far out are fitted, too.
    pub keeps_all: bool,
    /// Whether errors count what the model leaves, where residuals are too large for what is believed of them.
    pub counts_discrepancy: bool,
    /// Whether compliances stay nominal of which measurements tell less.
    pub holds_nominal: bool,
}

impl Robustness {
    /// All measurements by what is believed of them alone.
    pub const NONE: Self = Self {
        keeps_all: true,
        counts_discrepancy: false,
        holds_nominal: false,
    };
}

/// What was identified, without what lies far out.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustIdentification {
    /// What all measurements say, as they are.
    pub of_all: Identification,
    /// What the measurements that were not left out say; residuals are of all.
    pub identification: Identification,
    /// Those that were left out, since they lie far out.
    pub rejected: Vec<RejectedReading>,
    /// All measurements, each with the standard deviation that it was weighed with.
    pub weighed: Vec<Measurement>,
    /// The identified joints whose compliances stay nominal, as places in the parameters.
    pub held: Vec<usize>,
}

impl RobustIdentification {
    /// Those of one thing for each measurement that belong to the measurements that were fitted.
    pub fn of_kept<T: Clone>(&self, all: &[T]) -> Vec<T> {
        kept(all, &self.rejected)
    }
}

/// A fit of some measurements, and what it says of all.
struct SomeFitted<'a> {
    identification: Identification,
    over: LookedOver<'a>,
}

impl<'a> Case<'a> {
    /// Identifies what is unknown from the measurements that do not lie far out. Which compliances stay nominal beside gross errors is
    /// decided again without them.
    ///
    /// # Errors
    /// As [`identify`](Self::identify).
    pub fn identify_robustly(&self, robustness: Robustness) -> FitResult<RobustIdentification> {
        let found = self.held_and_robust(robustness, None)?;
        let has_both = found.held.len() > self.held.len() && !found.rejected.is_empty();
        let without = has_both.then(|| self.held_and_robust(robustness, Some(&found.rejected)));
        let without = without.and_then(Result::ok);
        let without = without.filter(|other| other.held.len() < found.held.len());
        Ok(without.unwrap_or(found))
    }

    /// What is identified from all measurements, unless compliances are to stay nominal of which they tell less: then what is identified
    /// beside these. What else is uncertain is in the posterior alone.
    ///
    /// # Errors
    /// As [`identify`](Self::identify).
    pub(super) fn identify_holding(&self, start: &FitStart) -> FitResult<Identification> {
        let fit = |case: &Case<'_>| case.identify_from(&start.holding(case), None);
        self.holding(self.identify_from(start, None), |found| found, fit)
    }

    /// The same with more and more compliances nominal; the gross errors may be given.
    fn held_and_robust(
        &self,
        robustness: Robustness,
        gross: Option<&[RejectedReading]>,
    ) -> FitResult<RobustIdentification> {
        let found = self.robustly(robustness, gross);
        if !robustness.holds_nominal {
            return found;
        }
        let of_all = found.as_ref().ok().map(|each| each.of_all.clone());
        let fit = |case: &Case<'_>| case.robustly(robustness, gross);
        let mut found = self.holding(found, |found| &mut found.identification, fit)?;
        found.of_all = of_all.unwrap_or(found.of_all);
        Ok(found)
    }

    /// What was found, or what is `fit` with more and more compliances nominal, until none is to be.
    fn holding<Found>(
        &self,
        mut found: FitResult<Found>,
        of: fn(&mut Found) -> &mut Identification,
        fit: impl Fn(&Case<'_>) -> FitResult<Found>,
    ) -> FitResult<Found> {
        let mut held = self.held.to_vec();
        let mut stays_nominal = Vec::new();
        loop {
            let mut linear;
            let now = if let Ok(found) = &mut found {
                of(found)
            } else {
                // Noise may drive weak compliances to where no robot stands: to first order it is seen which these are.
                linear = self.linearised().identify()?;
                &mut linear
            };
            let more = self.places_to_hold(now);
            if more.is_empty() {
                return found;
            }
            held.extend(&more);
            stays_nominal.extend(more.iter().map(|&place| now.parameters[place].clone()));
            let held = &held;
            let Ok(mut other) = fit(&Case { held, ..*self }) else {
                // Where none remain, their values tell more of what is wrong.
                let sizes = now.posterior.estimable.typical();
                now.is_all_weak = more.iter().any(|&place| {
                    let estimate = now.parameters[place].estimate;
                    estimate.is_some_and(|each| each.standard_error > UNKNOWN * sizes[place])
                });
                return found;
            };
            (of(&mut other).stays_nominal).clone_from(&stays_nominal);
            found = Ok(other);
        }
    }

    fn linearised(self) -> Self {
        Self {
            method: Method::Linear,
            ..self
        }
    }

    fn robustly(
        &self,
        robustness: Robustness,
        gross: Option<&[RejectedReading]>,
    ) -> FitResult<RobustIdentification> {
        let known = Case {
            sigma: Sigma::Known(self.sigma.weight_m()),
            ..*self
        };
        let (of_all, mut fitted) = match (gross, self.identify()) {
            (Some(gross), of_all) => {
                let of_all = of_all.or_else(|_| self.linearised().identify())?;
                let near = &of_all.posterior.mean;
                let fitted = known.fitted(self.measurements, gross, near)?;
                (of_all, fitted)
            }
            (None, of_all) => {
                let begun = of_all.and_then(|of_all| {
                    let near = &of_all.posterior.mean;
                    let fitted = match self.sigma {
                        Sigma::Known(_) => {
                            known.looked_at_all(of_all.clone(), self.measurements, &[])?
                        }
                        Sigma::FromResiduals(_) => known.fitted(self.measurements, &[], near)?,
                    };
                    let others = (!robustness.keeps_all)
                        .then(|| known.without(&fitted, fitted.over.suspects()?));
                    Ok((of_all, others.flatten().unwrap_or(fitted)))
                });
                match begun {
                    Err(error) if !robustness.keeps_all => known.begun_linearly().ok_or(error)?,
                    begun => begun?,
                }
            }
        };
        let mut weighed = self.measurements.to_vec();
        let rejected = fitted.over.rejected.clone();
        let mut identification = match self.sigma {
            Sigma::Known(_) => fitted.identification.clone(),
            Sigma::FromResiduals(_) if rejected.is_empty() => of_all.clone(),
            Sigma::FromResiduals(_) => self.with(&kept(self.measurements, &rejected)).identify()?,
        };
        let is_implausible = (identification.consistency).is_some_and(|each| each < IMPLAUSIBLE);
        if robustness.counts_discrepancy && is_implausible {
            let plain = identification;
            let own = kept(&self.covariances(), &rejected);
            let mut discrepancy = None;
            for _ in 0..WEIGHINGS {
                let left = kept(&fitted.over.left, &rejected);
                let found = discrepancy_of(&left, &own, fitted.over.spare);
                weighed = with_discrepancy(found, self.measurements, self.sigma.weight_m());
                discrepancy = Some(found);
                let near = &fitted.identification.posterior.mean;
                fitted = known.fitted(&weighed, &rejected, near)?;
            }
            identification = fitted.identification.clone();
            identification.discrepancy = discrepancy;
            // Intervals as wide as they are where the variance is known from so many degrees of freedom only.
            let quantile = two_sided_student(fitted.over.freedom);
            for each in &mut identification.parameters {
                each.estimate = each.estimate.map(|estimate| estimate.within(quantile));
            }
            // How far residuals are from what is believed is told of that.
            identification.sigma_m = plain.sigma_m;
            identification.residual_sigma_m = plain.residual_sigma_m;
            identification.consistency = plain.consistency;
            identification.consistency_lower = plain.consistency_lower;
        }
        if identification.discrepancy.is_some() || !rejected.is_empty() {
            let left = self.measurements.iter().zip(&fitted.over.left);
            let left = left.map(|(of, left)| in_room(of, &left.position_m));
            identification.residuals_m = left.flat_map(<[f64; 3]>::from).collect();
        }
        Ok(RobustIdentification {
            of_all,
            identification,
            rejected,
            weighed,
            held: self.held.to_vec(),
        })
    }

    /// Where there is no fit of all: what all say to first order, and a fit without the measurements that lie far out of that.
    fn begun_linearly(self) -> Option<(Identification, SomeFitted<'a>)> {
        let linear = self.linearised();
        let of_all = linear.identify().ok()?;
        let first = (linear.looked_at_all(of_all.clone(), self.measurements, &[])).ok()?;
        let first = linear.without(&first, first.over.suspects()?)?;
        let rejected = first.over.rejected.clone();
        Some((of_all, self.without(&first, rejected)?))
    }

    /// Fits those of `weighed` that are not rejected, and looks at what that leaves of all.
    fn fitted(
        self,
        weighed: &[Measurement],
        rejected: &[RejectedReading],
        near: &[f64],
    ) -> FitResult<SomeFitted<'a>> {
        let of_kept = kept(weighed, rejected);
        let identification = self.with(&of_kept).identify_near(Some(near))?;
        self.looked_at_all(identification, weighed, rejected)
    }

    /// What was identified from those of `weighed` that are not rejected, with what it leaves of all.
    fn looked_at_all(
        self,
        identification: Identification,
        weighed: &[Measurement],
        rejected: &[RejectedReading],
    ) -> FitResult<SomeFitted<'a>> {
        let measurements = kept(weighed, rejected);
        let posterior = &identification.posterior;
        let all = self.with(weighed);
        let rows = all.against(&posterior.mean)?;
        // What repeats share is spread over their rows: the fit's own are whitened without those that were left out.
        let own_rows = match rejected {
            [] => rows.matrix.clone(),
            _ => self.with(&measurements).against(&posterior.mean)?.matrix,
        };
        // Repeats share what the model leaves.
        let numbers: f64 = (measurements.iter().zip(repeats(&measurements)))
            .map(|(each, [deflections, rotations])| {
                let rotation = each.rotation.map_or(0.0, |_| 3.0 / rotations);
                rows_of(each).min(3) as f64 / deflections + rotation
            })
            .sum();
        let used = (&own_rows * &posterior.covariance)
            .component_mul(&own_rows)
            .sum();
        let freedom = (numbers - used).max(1.0);
        let (mut left, mut known) = (Vec::new(), Vec::new());
        for own in all.rows_of_each() {
            let residual = rows.own_left.rows_range(own.clone()).into_owned();
            left.push(ReadingResidual::of_rows(&residual));
            let own = rows.own_matrix.rows_range(own);
            known.push(six_rows(&(own * &posterior.covariance * own.transpose())));
        }
        let ratio = (identification.residual_sigma_m).map(|left| left / identification.sigma_m);
        let angles = self.measurements.iter();
        let own = self.covariances();
        let over = LookedOver {
            left,
            weighed: own.clone(),
            own,
            known,
            rejected: rejected.to_vec(),
            angles: (angles.map(|each| each.configuration_rad.as_slice())).collect(),
            spare: freedom / numbers,
            freedom,
            is_drawn: true,
            plausible: ratio
                .and_then(|ratio| outliers::plausible(identification.consistency, ratio * ratio)),
        };
        Ok(SomeFitted {
            identification,
            over,
        })
    }

    /// Fits without the measurements that lie far out of a first fit, or without some in place of these, until the same do. None where none
    /// does, where too many do, or where the others tell less than all.
    fn without(
        self,
        first: &SomeFitted<'a>,
        rejected: Vec<RejectedReading>,
    ) -> Option<SomeFitted<'a>> {
        let first = &first.identification;
        let (rejected, mut fitted) = outliers::until_the_same(
            rejected,
            |fitted: &SomeFitted<'_>| fitted.over.far_out(),
            |rejected, _| {
                let fitted = self.fitted(self.measurements, rejected, &first.posterior.mean);
                let rank = |found: &Identification| found.posterior.estimable.rank();
                (fitted.ok()).filter(|each| rank(&each.identification) >= rank(first))
            },
        )?;
        fitted.over.rejected = rejected;
        Some(fitted)
    }
}
