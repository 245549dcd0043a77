//! Whether estimates agree with what was known before of them.
//!
//! Where both are right, an estimate of variance c is off the mean of its prior of variance p by a normal number of variance p - c: readings
//! have told the rest.

use nalgebra::{Cholesky, DMatrix};
use statrs::distribution::{ContinuousCDF, Normal};

use super::outliers::IMPLAUSIBLE;
use crate::codes::{Condition, ConditionCode};
use crate::numeric::factorisation::inverse_of;
use crate::numeric::posterior::Posterior;
use crate::parameter::ParameterSet;
use crate::text::wording::p_value;

/// Of what readings tell less, as a share of the prior's variance, nothing is said.
const TOLD: f64 = 0.02;

/// The condition that some estimates are further from their priors than both explain; none where all agree, or nothing was known before.
pub(super) fn far_from_priors(set: &ParameterSet, posterior: &Posterior) -> Option<Condition> {
    let prior = set.prior();
    let known: Vec<usize> = (0..set.len())
        .filter(|&place| prior.precision[(place, place)] > 0.0)
        .collect();
    let precision = prior.precision.select_rows(&known).select_columns(&known);
    let before: DMatrix<f64> = inverse_of(&Cholesky::new(precision)?);
    let far = known.iter().enumerate().filter_map(|(row, &place)| {
        let (value, mean) = (posterior.mean[place], prior.mean[place]);
        let error = posterior.standard_error(place)?;
        let (off, before, error) = match prior.ratio_of(place) {
            Some(deviation) => ((value / mean).ln(), deviation.powi(2), error / value),
            None => (value - mean, before[(row, row)], error),
        };
        let told = before - error.powi(2);
        (told > TOLD * before).then(|| (place, off.abs() / told.sqrt()))
    });
    let far: Vec<(usize, f64)> = far.collect();
    // Of the farthest of so many.
    let probability = |deviations: f64| 2.0 * far.len() as f64 * Normal::standard().sf(deviations);
    let named = far.iter().filter(|each| probability(each.1) < IMPLAUSIBLE);
    let mut named: Vec<(usize, f64)> = named.copied().collect();
    named.sort_by(|one, other| other.1.total_cmp(&one.1));
    let words: Vec<String> = (named.iter())
        .map(|(place, off)| format!("{} ({off:.1})", set.parameters()[*place].name))
        .collect();
    let (_, most) = named.first()?;
    let p = p_value(probability(*most));
    let words = words.join(", ");
    Some(ConditionCode::FarFromPrior.with(format!(
        "estimates far from their priors, in standard deviations of the difference: {words}; {p}"
    )))
}
