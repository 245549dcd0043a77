//! Whether a prediction holds: decided here, for deflections and for absolute readings alike.

use serde::Serialize;

use super::summary::{Measured, ObservedQuantile};

/// More standard errors than this are not chance ...
pub const STANDARD_ERRORS: f64 = 3.0;
/// ... nor are they what linear propagation leaves out, beyond this share.
const LINEAR: f64 = 0.02;
/// Normal errors of one coordinate scatter most: the standard error of an rms value r of n runs is r over the root of 2 n. Where it is more
/// than so many times that, a few runs have errors that are not predicted, and their scatter excuses nothing.
const SCATTER: f64 = 2.0;
/// Fewer runs, alike by chance, know their scatter less than normal errors tell it.
const FEW: u64 = 10;
/// Where more of the runs fail, the others are no sample of what was predicted: softer robots fail first.
const FAILED: f64 = 0.01;

/// How a prediction came off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kept {
    /// Within three standard errors and 2 %, if these are such as normal errors have.
    Holds,
    /// More is left.
    Exceeded,
    /// Less is left.
    Conservative,
    /// Too many runs failed.
    Undecided,
}

impl Kept {
    /// What the rms distance of so many runs that was seen (m) says of the one that was predicted, where such a share of the runs failed.
    pub fn of(predicted_m: f64, seen_m: Measured, runs: u64, failed_share: f64) -> Self {
        let normal = predicted_m / (2.0 * runs as f64).sqrt();
        let least = if runs < FEW { normal } else { 0.0 };
        let standard_error = (seen_m.standard_error.max(least)).min(SCATTER * normal);
        let room = STANDARD_ERRORS * standard_error + LINEAR * predicted_m;
        if failed_share > FAILED {
            Self::Undecided
        } else if seen_m.value > predicted_m + room {
            Self::Exceeded
        } else if seen_m.value < predicted_m - room {
            Self::Conservative
        } else {
            Self::Holds
        }
    }
}

/// What a Monte Carlo study says of a predicted expanded uncertainty U.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, strum::Display)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum MonteCarloOutcome {
    /// They differ by the numerical tolerance at most.
    Validated,
    /// They differ by more.
    #[serde(rename = "not validated")]
    #[strum(serialize = "not validated")]
    NotValidated,
    /// So few runs tell neither, or too many failed.
    Undecided,
}

impl MonteCarloOutcome {
    /// The comparison of JCGM 101, clause 8, of the radius that 95 % of the runs stay below (m) with the predicted one, by its whole
    /// interval: validated where all of it is within the tolerance, not validated where none is.
    pub fn of(
        predicted_m: f64,
        observed_m: ObservedQuantile,
        tolerance_m: f64,
        failed_share: f64,
    ) -> Self {
        let upper_m = observed_m.upper.unwrap_or(f64::INFINITY);
        let (least_m, most_m) = (predicted_m - tolerance_m, predicted_m + tolerance_m);
        if failed_share > FAILED {
            Self::Undecided
        } else if observed_m.lower > most_m || upper_m < least_m {
            Self::NotValidated
        } else if observed_m.lower >= least_m && upper_m <= most_m {
            Self::Validated
        } else {
            Self::Undecided
        }
    }
}

/// The numerical tolerance delta of a standard uncertainty of two significant digits (JCGM 101, 7.9.2): half of the last one's unit.
pub fn numerical_tolerance(standard_uncertainty: f64) -> f64 {
    let text = format!("{standard_uncertainty:.1e}");
    let exponent = text
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse::<i32>().ok());
    exponent.map_or(f64::NAN, |exponent| 0.5 * 10.0_f64.powi(exponent - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of JCGM 101, 7.9.2, and a number that rounds up to the next power of ten.
    #[test]
    fn a_numerical_tolerance_is_half_of_the_last_digit() {
        for (uncertainty, tolerance) in [
            (0.000_35, 0.000_005),
            (2.0, 0.05),
            (40.696, 0.5),
            (9.96, 0.5),
        ] {
            let found = numerical_tolerance(uncertainty);
            assert!(
                (found / tolerance - 1.0_f64).abs() < 1e-12,
                "{uncertainty}: {found}"
            );
        }
    }

    #[test]
    fn few_runs_validate_nothing() {
        let of = |lower, upper| {
            let observed = ObservedQuantile {
                value: 10.1,
                lower,
                upper,
            };
            MonteCarloOutcome::of(10.0, observed, 0.5, 0.0)
        };
        assert_eq!(of(9.6, Some(10.4)), MonteCarloOutcome::Validated);
        assert_eq!(of(9.4, Some(10.4)), MonteCarloOutcome::Undecided);
        assert_eq!(of(9.6, Some(10.6)), MonteCarloOutcome::Undecided);
        assert_eq!(of(9.6, None), MonteCarloOutcome::Undecided);
        assert_eq!(of(10.6, None), MonteCarloOutcome::NotValidated);
        assert_eq!(of(9.0, Some(9.4)), MonteCarloOutcome::NotValidated);
    }

    #[test]
    fn a_prediction_has_room_on_both_sides() {
        let judged = |value, standard_error, failed_share| {
            let observed = Measured {
                value,
                standard_error,
            };
            Kept::of(1.0, observed, 200, failed_share)
        };
        let of = |value, standard_error| judged(value, standard_error, 0.01);
        assert_eq!(of(1.019, 0.0), Kept::Holds);
        assert_eq!(of(0.981, 0.0), Kept::Holds);
        assert_eq!(of(1.021, 0.0), Kept::Exceeded);
        assert_eq!(of(0.979, 0.0), Kept::Conservative);
        assert_eq!(of(1.049, 0.01), Kept::Holds);
        assert_eq!(of(1.051, 0.01), Kept::Exceeded);
        assert_eq!(judged(1.0, 0.0, 0.011), Kept::Undecided);
        // One of 200 runs is 100 times as far off as the others: its own scatter is no excuse.
        assert_eq!(of(7.1, 3.5), Kept::Exceeded);
        assert_eq!(of(1.31, 0.1), Kept::Holds);
        assert_eq!(of(1.33, 0.15), Kept::Exceeded);
        // Two runs that are alike by chance.
        let of_two = |value| {
            let observed = Measured {
                value,
                standard_error: 1e-3,
            };
            Kept::of(1.0, observed, 2, 0.0)
        };
        assert_eq!(of_two(0.2), Kept::Holds);
        assert_eq!(of_two(1.8), Kept::Holds);
        assert_eq!(of_two(2.6), Kept::Exceeded);
    }
}
