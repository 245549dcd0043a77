//! Whether a prediction holds: decided here, for deflections and for absolute readings alike.

use serde::Serialize;

use super::summary::Measured;

/// More standard errors than this are not chance ...
pub const STANDARD_ERRORS: f64 = 3.0;
/// ... nor are they what linear propagation leaves out, beyond this share.
const LINEAR: f64 = 0.02;

/// How a prediction came off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kept {
    /// Within three standard errors and 2 %.
    Holds,
    /// More is left.
    Exceeded,
    /// Less is left.
    Conservative,
}

impl Kept {
    /// What the rms distance that was seen (m) says of the one that was predicted.
    pub fn of(predicted_m: f64, seen_m: Measured) -> Self {
        let room = STANDARD_ERRORS * seen_m.standard_error + LINEAR * predicted_m;
        if seen_m.value > predicted_m + room {
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
    /// So few runs tell neither.
    Undecided,
}

impl MonteCarloOutcome {
    /// The comparison of JCGM 101, clause 8, of the radius that 95 % of the runs stay below (m) with the predicted one. The runs must
    /// know theirs to the tolerance, by two standard errors, before anything is validated by them.
    pub fn of(predicted_m: f64, observed_m: Measured, tolerance_m: f64) -> Self {
        let apart = (predicted_m - observed_m.value).abs();
        let room = 2.0 * observed_m.standard_error;
        if apart > tolerance_m + room {
            Self::NotValidated
        } else if apart <= tolerance_m && room <= tolerance_m {
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
        let of = |value, standard_error| {
            let observed = Measured {
                value,
                standard_error,
            };
            MonteCarloOutcome::of(10.0, observed, 0.5)
        };
        assert_eq!(of(10.4, 0.25), MonteCarloOutcome::Validated);
        assert_eq!(of(10.4, 0.26), MonteCarloOutcome::Undecided);
        assert_eq!(of(10.6, 0.1), MonteCarloOutcome::Undecided);
        assert_eq!(of(10.71, 0.1), MonteCarloOutcome::NotValidated);
    }

    #[test]
    fn a_prediction_has_room_on_both_sides() {
        let of = |value, standard_error| {
            Kept::of(
                1.0,
                Measured {
                    value,
                    standard_error,
                },
            )
        };
        assert_eq!(of(1.019, 0.0), Kept::Holds);
        assert_eq!(of(0.981, 0.0), Kept::Holds);
        assert_eq!(of(1.021, 0.0), Kept::Exceeded);
        assert_eq!(of(0.979, 0.0), Kept::Conservative);
        assert_eq!(of(1.049, 0.01), Kept::Holds);
        assert_eq!(of(1.051, 0.01), Kept::Exceeded);
    }
}
