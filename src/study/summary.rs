//! What a tally says: means with intervals, quantiles, and checks against what was predicted.

use super::tally::{Sum, Tally};
use crate::numeric::quantile::TWO_SIDED_95;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

impl Measured {
    /// The 95 % interval.
    pub fn interval95(&self) -> [f64; 2] {
        let half = TWO_SIDED_95 * self.standard_error;
        [self.value - half, self.value + half]
    }
}

/// What many runs of a plan say; distances in m.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Runs that did not fail.
    pub runs: u64,
    /// The mean distance.
    pub mean_m: Measured,
    /// The rms distance.
    pub rms_m: Measured,
    /// The rms distance that the linear model predicts (eq. 20).
    pub predicted_rms_m: f64,
    /// The distances that 5, 50, 95 and 99 % of the runs do not exceed.
    pub quantiles_m: [f64; 4],
    /// The distance that 95 % of the runs do not exceed.
    pub radius95_m: Measured,
    /// The observed minus the predicted mean square, in the standard deviations that the linear
    /// model predicts for it.
    pub z: f64,
    /// The mean of the normalised estimation error squared.
    pub nees: f64,
    /// What is expected for it: the number of combinations of compliances that are determined, in the mean.
    pub nees_expected: f64,
    /// Its deviation from that in standard deviations of a chi-square mean.
    pub nees_z: f64,
    /// The mean distance over that of the reference plan.
    pub ratio_to_random: Option<Measured>,
}

/// The shares of the quantiles of a [`Summary`].
pub const QUANTILES: [f64; 4] = [0.05, 0.5, 0.95, 0.99];

impl Summary {
    /// Sums up a tally whose distances are in units of `sigma_m`; `None` if all runs failed. `reference` is the tally of the plan that this one is compared with.
    pub fn new(tally: &Tally, sigma_m: f64, reference: Option<&Tally>) -> Option<Self> {
        if tally.runs == 0 {
            return None;
        }
        let runs = tally.runs as f64;
        let mean = |which| tally.sum(which) / runs;
        let mean_square = mean(Sum::Square);
        let rms = mean_square.sqrt();
        let square_error = standard_error(mean_square, mean(Sum::Fourth), runs);
        let freedom = tally.freedom as f64 / runs;
        let nees = mean(Sum::Nees);
        // The share of the runs below a quantile is binomial.
        let spread = (0.95 * 0.05 / runs).sqrt();
        let quantile = |share| tally.quantile(share).unwrap_or(f64::NAN) * sigma_m;
        Some(Self {
            runs: tally.runs,
            mean_m: Measured {
                value: mean(Sum::Distance) * sigma_m,
                standard_error: standard_error(mean(Sum::Distance), mean_square, runs) * sigma_m,
            },
            rms_m: Measured {
                value: rms * sigma_m,
                standard_error: square_error / (2.0 * rms) * sigma_m,
            },
            predicted_rms_m: mean(Sum::Expected).sqrt() * sigma_m,
            quantiles_m: QUANTILES.map(quantile),
            radius95_m: Measured {
                value: quantile(0.95),
                standard_error: (quantile((0.95 + spread).min(1.0)) - quantile(0.95 - spread))
                    / 2.0,
            },
            z: (tally.sum(Sum::Square) - tally.sum(Sum::Expected))
                / tally.sum(Sum::Variance).sqrt(),
            nees,
            nees_expected: freedom,
            nees_z: (nees - freedom) / (2.0 * freedom / runs).sqrt(),
            ratio_to_random: reference.and_then(|reference| ratio(tally, reference)),
        })
    }
}

/// The standard error of a mean from the first two moments.
fn standard_error(mean: f64, mean_square: f64, runs: f64) -> f64 {
    ((mean_square - mean * mean).max(0.0) / (runs - 1.0).max(1.0)).sqrt()
}

/// The ratio of two mean distances, by the delta method: the plans see the same noise, so the two
/// means are correlated, and the ratio is better known than either.
fn ratio(tally: &Tally, reference: &Tally) -> Option<Measured> {
    let runs = tally.runs as f64;
    let reference_runs = reference.runs as f64;
    if tally.pairs == 0 {
        return None;
    }
    let one = tally.sum(Sum::Distance) / runs;
    let other = reference.sum(Sum::Distance) / reference_runs;
    let value = one / other;
    let one_variance = tally.sum(Sum::Square) / runs - one * one;
    let other_variance = reference.sum(Sum::Square) / reference_runs - other * other;
    let covariance = tally.sum(Sum::Cross) / tally.pairs as f64 - one * other;
    let variance = one_variance / (one * one) + other_variance / (other * other)
        - 2.0 * covariance / (one * other);
    Some(Measured {
        value,
        standard_error: value * (variance.max(0.0) / (runs - 1.0).max(1.0)).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::normal::{LANES, fill_normals};
    use crate::numeric::random::streams::Stream;
    use crate::study::tally::{Batch, BlockSums};

    /// The length of a vector of three standard normals: mean sqrt(8/pi), mean square 3, median
    /// 1.5382, 95 % quantile 2.7955 (the chi distribution with 3 degrees of freedom).
    #[test]
    fn the_length_of_a_normal_vector() {
        let mut tally = Tally::default();
        let mut block = BlockSums::default();
        let mut normals = [[0.0; LANES]; 3];
        for first in (0..400_000).step_by(LANES) {
            fill_normals(Stream::Noise, 3, first, &mut normals);
            let square =
                std::array::from_fn(|lane| normals.iter().map(|axis| axis[lane].powi(2)).sum());
            let batch = Batch {
                square,
                nees: square,
                expected: [3.0; LANES],
                variance: [6.0; LANES],
                freedom: [3; LANES],
                ..Batch::default()
            };
            tally.add(&mut block, &batch, Some(&batch), LANES);
        }
        tally.close(&mut block);
        let summary = Summary::new(&tally, 2.0, Some(&tally)).expect("there are runs");
        let mean = 2.0 * (8.0 / std::f64::consts::PI).sqrt();
        assert!((summary.mean_m.value - mean).abs() < 4.0 * summary.mean_m.standard_error);
        let error = 2.0 * ((3.0 - 8.0 / std::f64::consts::PI) / 400_000.0).sqrt();
        assert!((summary.mean_m.standard_error / error - 1.0).abs() < 0.01);
        assert!(summary.z.abs() < 4.0 && (summary.nees_z - summary.z).abs() < 1e-6);
        assert!((summary.rms_m.value - 12.0_f64.sqrt()).abs() < 4.0 * summary.rms_m.standard_error);
        // The squares of three normal numbers have a variance of 6, and the root of their mean a derivative of 1 / (2 sqrt(3)).
        let error = 2.0 * (6.0_f64 / 400_000.0).sqrt() / (2.0 * 3.0_f64.sqrt());
        assert!((summary.rms_m.standard_error / error - 1.0).abs() < 0.02);
        for (found, known) in summary.quantiles_m[1..3].iter().zip([1.5382, 2.7955]) {
            assert!((found / 2.0 - known).abs() < 0.01, "{found}, {known}");
        }
        let ratio = summary.ratio_to_random.expect("there is a reference");
        assert!((ratio.value - 1.0).abs() < 1e-12 && ratio.standard_error < 1e-9);
    }
}
