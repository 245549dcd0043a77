//! What a tally says: means with intervals, quantiles, and checks against what was predicted.

use statrs::distribution::{Binomial, DiscreteCDF};

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

    /// The same in another unit.
    pub fn times(&self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            standard_error: self.standard_error * factor,
        }
    }
}

/// A quantile of the runs with its interval of 95 %: from the distance of one rank to that of another, as the number of runs below a
/// quantile is binomial, whatever their distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedQuantile {
    /// The quantile.
    pub value: f64,
    /// The lower end.
    pub lower: f64,
    /// The upper end; so few runs that their largest may well be below the quantile have none.
    pub upper: Option<f64>,
}

impl ObservedQuantile {
    /// The same in another unit.
    pub fn times(&self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            lower: self.lower * factor,
            upper: self.upper.map(|upper| upper * factor),
        }
    }
}

/// The shares of the quantiles that are told of a plan's runs.
pub const QUANTILES: [f64; 4] = [0.05, 0.5, 0.95, 0.99];

/// What a tally says; distances are in its units, sigma.
impl Tally {
    fn mean_of(&self, which: Sum) -> f64 {
        self.sum(which) / self.runs as f64
    }

    /// The share of the runs that failed.
    pub fn failed_share(&self) -> f64 {
        self.failures() as f64 / (self.runs + self.failures()).max(1) as f64
    }

    /// The mean distance.
    pub fn mean(&self) -> Measured {
        let (value, square) = (self.mean_of(Sum::Distance), self.mean_of(Sum::Square));
        Measured {
            value,
            standard_error: standard_error(value, square, self.runs as f64),
        }
    }

    /// The rms distance.
    pub fn rms(&self) -> Measured {
        let square = self.mean_of(Sum::Square);
        let square_error = standard_error(square, self.mean_of(Sum::Fourth), self.runs as f64);
        Measured {
            value: square.sqrt(),
            standard_error: square_error / (2.0 * square.sqrt()),
        }
    }

    /// The rms distance that the linear model predicts (eq. 20).
    pub fn predicted_rms(&self) -> f64 {
        self.mean_of(Sum::Expected).sqrt()
    }

    /// The distance that 95 % of the runs do not exceed; none without runs.
    pub fn radius95(&self) -> Option<ObservedQuantile> {
        let runs = self.runs as f64;
        let below = Binomial::new(0.95, self.runs).ok()?;
        let ranked = |rank: u64| self.quantile(rank as f64 / runs);
        let above = below.inverse_cdf(0.975) + 1;
        Some(ObservedQuantile {
            value: self.quantile(0.95)?,
            lower: ranked(below.inverse_cdf(0.025))?,
            upper: if above <= self.runs {
                ranked(above)
            } else {
                None
            },
        })
    }

    /// The observed minus the predicted mean square, in the standard deviations that the linear model predicts for it.
    pub fn z(&self) -> f64 {
        (self.sum(Sum::Square) - self.sum(Sum::Expected)) / self.sum(Sum::Variance).sqrt()
    }

    /// The mean of the normalised estimation error squared.
    pub fn nees(&self) -> f64 {
        self.mean_of(Sum::Nees)
    }

    /// What is expected for it: the number of combinations of compliances that are determined, in the mean.
    pub fn nees_expected(&self) -> f64 {
        self.freedom as f64 / self.runs as f64
    }

    /// Its deviation from that in standard deviations of a chi-square mean.
    pub fn nees_z(&self) -> f64 {
        let freedom = self.nees_expected();
        (self.nees() - freedom) / (2.0 * freedom / self.runs as f64).sqrt()
    }

    /// The mean distance over that of a reference plan, by the delta method: the plans see the same noise, so the two
    /// means are correlated, and the ratio is better known than either.
    pub fn ratio_to(&self, reference: &Self) -> Option<Measured> {
        if self.pairs == 0 {
            return None;
        }
        let [one, other] = [self, reference].map(|each| each.mean_of(Sum::Distance));
        let value = one / other;
        let one_variance = self.mean_of(Sum::Square) - one * one;
        let other_variance = reference.mean_of(Sum::Square) - other * other;
        let covariance = self.sum(Sum::Cross) / self.pairs as f64 - one * other;
        let variance = one_variance / (one * one) + other_variance / (other * other)
            - 2.0 * covariance / (one * other);
        let runs = (self.runs as f64 - 1.0).max(1.0);
        Some(Measured {
            value,
            standard_error: value * (variance.max(0.0) / runs).sqrt(),
        })
    }
}

/// The standard error of a mean from the first two moments.
fn standard_error(mean: f64, mean_square: f64, runs: f64) -> f64 {
    ((mean_square - mean * mean).max(0.0) / (runs - 1.0).max(1.0)).sqrt()
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
        let (found, rms) = (tally.mean().times(2.0), tally.rms().times(2.0));
        let mean = 2.0 * (8.0 / std::f64::consts::PI).sqrt();
        assert!((found.value - mean).abs() < 4.0 * found.standard_error);
        let error = 2.0 * ((3.0 - 8.0 / std::f64::consts::PI) / 400_000.0).sqrt();
        assert!((found.standard_error / error - 1.0).abs() < 0.01);
        assert!(tally.z().abs() < 4.0 && (tally.nees_z() - tally.z()).abs() < 1e-6);
        assert!((rms.value - 12.0_f64.sqrt()).abs() < 4.0 * rms.standard_error);
        // The squares of three normal numbers have a variance of 6, and the root of their mean a derivative of 1 / (2 sqrt(3)).
        let error = 2.0 * (6.0_f64 / 400_000.0).sqrt() / (2.0 * 3.0_f64.sqrt());
        assert!((rms.standard_error / error - 1.0).abs() < 0.02);
        for (share, known) in QUANTILES[1..3].iter().zip([1.5382, 2.7955]) {
            let found = tally.quantile(*share).expect("there are runs");
            assert!((found - known).abs() < 0.01, "{found}, {known}");
        }
        let ratio = tally.ratio_to(&tally).expect("there is a reference");
        assert!((ratio.value - 1.0).abs() < 1e-12 && ratio.standard_error < 1e-9);
    }

    /// Of 2,000 tallies of 80 lengths each some 95 % have the true quantile in their interval: never less than that, and by whole ranks
    /// 96.5 % (binomial: from rank 72 to 80). Four standard deviations are 1.6 %.
    #[test]
    fn intervals_of_a_quantile_hold_it() {
        let (runs, many) = (80, 2_000);
        let mut normals = [[0.0; LANES]; 3];
        let mut held = 0_u32;
        for tally_number in 0..many {
            let mut tally = Tally::default();
            let mut block = BlockSums::default();
            for first in (0..runs).step_by(LANES) {
                let run = tally_number * runs + first;
                fill_normals(Stream::Noise, 5, run, &mut normals);
                let square =
                    std::array::from_fn(|lane| normals.iter().map(|axis| axis[lane].powi(2)).sum());
                let batch = Batch {
                    square,
                    ..Batch::default()
                };
                tally.add(&mut block, &batch, None, LANES);
            }
            tally.close(&mut block);
            let radius = tally.radius95().expect("there are runs");
            let true_one = 2.795_48;
            let below = radius.upper.is_none_or(|upper| true_one <= upper);
            held += u32::from(radius.lower <= true_one && below);
        }
        let share = f64::from(held) / many as f64;
        assert!((share - 0.965).abs() < 0.016, "{share}");
    }
}
