//! Compliances whose standard errors exceed their nominal values, which are kept.
//!
//! A compliance is positive, and its nominal value is right to a factor. One that a fit leaves uncertain by more than its nominal value, or
//! makes negative, is better guessed by that: it stays nominal, and the others are fitted beside it.

use nalgebra::DMatrix;

use super::{Case, Identification, ParameterFit};
use crate::numeric::posterior::Posterior;
use crate::parameter::{ParameterKind, ParameterSet};

/// A compliance that is uncertain by more of its nominal value than this is not determined, errors of the readings independent ...
pub const UNKNOWN: f64 = 1.0;
/// ... and where they are not, which is known less well: series that contradict each other are told by what each says.
pub(super) const UNKNOWN_TOGETHER: f64 = 10.0;

/// The places of those of `free` that are to stay nominal, by what is known of all unknowns with this covariance. The least
/// certain is held first, since others may be certain beside it; negative ones where all are certain.
fn to_hold(
    mut free: Vec<usize>,
    posterior: &Posterior,
    mut covariance: DMatrix<f64>,
    unknown: f64,
) -> Vec<usize> {
    let (scales, mut held) = (posterior.estimable.typical(), Vec::new());
    let uncertain = |covariance: &DMatrix<f64>, place: usize| {
        covariance[(place, place)] / scales[place].powi(2)
    };
    while let Some(index) = (0..free.len()).max_by(|&one, &other| {
        uncertain(&covariance, free[one]).total_cmp(&uncertain(&covariance, free[other]))
    }) {
        let place = free[index];
        if uncertain(&covariance, place) <= unknown * unknown {
            break;
        }
        free.swap_remove(index);
        held.push(place);
        // What is known of the others once this one is given.
        let column = covariance.column(place).into_owned();
        covariance.ger(-column[place].recip(), &column, &column, 1.0);
    }
    if held.is_empty() {
        held.extend((free.into_iter()).filter(|&place| posterior.mean[place] < 0.0));
    }
    held
}

/// The set of a fit in which such compliances stay nominal, by a covariance of its parameters in their units; none where there are none
/// besides those that do already.
pub(super) fn with_nominal(
    ParameterFit { set, posterior, .. }: &ParameterFit,
    covariance: &DMatrix<f64>,
    unknown: f64,
) -> Option<ParameterSet> {
    let free = (0..set.len()).filter(|place| {
        let kind = set.parameters()[*place].kind;
        matches!(kind, ParameterKind::JointCompliance { .. })
            && set.prior().precision[(*place, *place)] <= 0.0
            && !set.nominal().contains(place)
    });
    let held = to_hold(free.collect(), posterior, covariance.clone(), unknown);
    (!held.is_empty()).then(|| set.clone().with_nominal(&held))
}

impl Case<'_> {
    /// Those of its compliances that are to stay nominal besides those that do, by what was identified; their places.
    pub(super) fn places_to_hold(self, found: &Identification) -> Vec<usize> {
        let posterior = &found.posterior;
        let precision = self.belief.precision();
        let is_free = |place: &usize| {
            found.parameters[*place].estimate.is_some() && precision[(*place, *place)] <= 0.0
        };
        let free = (0..self.belief.parameters.len()).filter(is_free).collect();
        to_hold(free, posterior, posterior.covariance.clone(), UNKNOWN)
    }
}
