//! Wrong readings: fits without what lies far out, until the same lies far out.
//!
//! The yardstick is the median of the squares that are left, which half of the readings being wrong does not spoil, so that a
//! few readings that are wrong by much, all to one side too, hide neither themselves nor others. Readings within five
//! standard deviations count fully, those beyond not at all.

use nalgebra::Matrix6;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::misfit::{Misfit, ReadingResidual};

/// Beyond so many standard deviations no correct reading lies: the probability is 5.7e-7, one in 1.7 million.
const FAR_OUT: f64 = 5.0;
/// That probability.
const BY_CHANCE: f64 = 5.733_031e-7;
/// The square of three coordinates that is as improbable.
const FAR_SQUARE: f64 = 31.812_3;
/// A median tells as much of a variance as about so many of the residuals do by their squares.
const OF_A_MEDIAN: f64 = 0.5;
/// Half of the squares of three coordinates lie below.
const MEDIAN_SQUARE: f64 = 2.365_973_884_375_34;
/// Fits that are made; the first few leave out nearly all.
const ROUNDS: usize = 12;
/// A larger share of readings is not wrong: the model is.
const MOST: f64 = 0.25;

/// A reading that was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RejectedReading {
    /// Its index, from 0.
    pub reading: usize,
    /// How far out it lies: standard deviations of one coordinate with that probability.
    pub deviations: f64,
}

impl RejectedReading {
    /// Why it was left out, in words.
    #[must_use]
    pub fn reason(&self) -> String {
        format!(
            "it lies {:.1} standard deviations from what the other readings say, and {FAR_OUT} are the most",
            self.deviations
        )
    }

    /// The condition that readings were left out, each named with how far out it lies; none where none was.
    #[must_use]
    pub fn condition(rejected: &[Self], noun: &str) -> Option<String> {
        let rows: Vec<String> = (rejected.iter())
            .map(|each| format!("{} ({:.1})", each.reading + 1, each.deviations))
            .collect();
        let [lies, is] = match rows.len() {
            0 => return None,
            1 => [format!("1 {noun} lies"), "is".to_owned()],
            count => [format!("{count} {noun}s lie"), "are".to_owned()],
        };
        Some(format!(
            "{lies} beyond {FAR_OUT} standard deviations of what the others leave, and {is} left out: {}",
            rows.join(", ")
        ))
    }
}

/// The readings that lie far out of what a fit leaves of all. `square_of` is what is left of a reading over a covariance, of position
/// or of rotation the larger; `spare` as in [`Misfit::of`]. Where a misfit comes from residuals of few degrees of freedom, larger
/// squares are as improbable. None where so many lie there that nothing can be said of single ones.
pub(super) fn far_out(
    left: &[ReadingResidual],
    own: &[Matrix6<f64>],
    (spare, freedom): (f64, f64),
    square_of: impl Fn(usize, &Matrix6<f64>) -> f64,
) -> Option<Vec<RejectedReading>> {
    let misfit = robust_misfit(left, own, spare);
    let is_known = misfit.position_m.max(misfit.rotation_rad) <= 0.0;
    let far = if is_known {
        FAR_SQUARE
    } else {
        far_square(freedom)
    };
    let misfit = misfit.covariance();
    let found: Vec<RejectedReading> = (own.iter().enumerate())
        .filter_map(|(reading, own)| {
            let square = square_of(reading, &(own + misfit));
            (square > far).then(|| RejectedReading {
                reading,
                deviations: FAR_OUT * (square / far).sqrt(),
            })
        })
        .collect();
    (found.len() as f64 <= MOST * left.len() as f64).then_some(found)
}

/// The square of three coordinates over a variance from so many degrees of freedom that is as improbable.
fn far_square(freedom: f64) -> f64 {
    if freedom.is_infinite() {
        return FAR_SQUARE;
    }
    FisherSnedecor::new(3.0, OF_A_MEDIAN * freedom).map_or(f64::INFINITY, |distribution| {
        (3.0 * distribution.inverse_cdf(1.0 - BY_CHANCE)).max(FAR_SQUARE)
    })
}

/// Fits anew without what lies far out, until the same does; what was left out, with the last fit. `rejected` lies far out of a first
/// fit to all. None where nothing does, where too much does, or where there is no other fit.
pub(super) fn until_the_same<Fit>(
    mut rejected: Vec<RejectedReading>,
    far_out: impl Fn(&Fit) -> Option<Vec<RejectedReading>>,
    fit_without: impl Fn(&[RejectedReading]) -> Option<Fit>,
) -> Option<(Vec<RejectedReading>, Fit)> {
    let mut found = None;
    for _ in 0..ROUNDS {
        if rejected.is_empty() {
            return None;
        }
        let fit = fit_without(&rejected)?;
        let next = far_out(&fit)?;
        let readings = |all: &[RejectedReading]| -> Vec<usize> {
            all.iter().map(|each| each.reading).collect()
        };
        if readings(&next) == readings(&rejected) {
            return Some((next, fit));
        }
        found = Some((rejected, fit));
        rejected = next;
    }
    found
}

/// Those of one thing for each reading that belong to readings that were not rejected.
pub(super) fn kept<T: Clone>(all: &[T], rejected: &[RejectedReading]) -> Vec<T> {
    let is_kept = |index: usize| rejected.iter().all(|each| each.reading != index);
    let all = all.iter().enumerate();
    all.filter(|(index, _)| is_kept(*index))
        .map(|(_, each)| each.clone())
        .collect()
}

/// What is unexplained of most readings.
fn robust_misfit(left: &[ReadingResidual], own: &[Matrix6<f64>], spare: f64) -> Misfit {
    let positions = left.iter().map(|each| each.position_m.norm_squared());
    let rotations = left
        .iter()
        .filter_map(|each| Some(each.rotation_rad?.norm_squared()));
    let of = |squares: Vec<f64>, first: usize| {
        let own = own
            .iter()
            .map(|covariance| (covariance.fixed_view::<3, 3>(first, first).trace()) / 3.0);
        let all = median(squares).unwrap_or(0.0) / MEDIAN_SQUARE;
        (all / spare - median(own.collect()).unwrap_or(0.0))
            .max(0.0)
            .sqrt()
    };
    Misfit {
        position_m: of(positions.collect(), 0),
        rotation_rad: of(rotations.collect(), 3),
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
