//! Residuals by measurement and likely input errors, the record of `identify`.

use serde::{Deserialize, Serialize};

use crate::identification::MeasurementResidual;
use crate::identification::input_errors::LikelyInputError;

/// The residual of one measurement against its own uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ResidualMessage {
    /// The measurement's number, from 1.
    pub measurement: usize,
    /// The residual's coordinates x, y, z (of a rotation, too, where it is measured) over their own
    /// standard deviations; null where the fit goes through the measurement.
    pub standardised: Vec<Option<f64>>,
    /// How many of its coordinates the fit takes up (the trace of its block of the hat matrix): over all measurements the
    /// effective number of parameters.
    #[serde(default)]
    pub leverage: f64,
    /// The Mahalanobis distance of the residual.
    pub distance: f64,
    /// The number of independent coordinates in that.
    pub degrees_of_freedom: usize,
    /// The probability of a distance at least as large by chance.
    pub probability: Option<f64>,
}

impl ResidualMessage {
    /// The records of measurements' residuals in their order.
    pub fn of(residuals: &[MeasurementResidual]) -> Vec<Self> {
        let message = |(measurement, each): (usize, &MeasurementResidual)| Self {
            measurement,
            standardised: each.standardised.clone(),
            leverage: each.leverage,
            distance: each.distance,
            degrees_of_freedom: each.freedom,
            probability: each.probability,
        };
        (1..).zip(residuals).map(message).collect()
    }
}

/// A likely input error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct InputErrorMessage {
    /// What kind of error.
    pub kind: String,
    /// What may be wrong, what shows it and what to do.
    pub text: String,
    /// The natural logarithm of how many times more probable the measurements are with this error than without.
    pub log_evidence_ratio: f64,
}

/// What `identify` says of residuals and input errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ResidualsMessage {
    /// Each measurement's residual.
    pub residuals: Vec<ResidualMessage>,
    /// Likely input errors.
    pub diagnoses: Vec<InputErrorMessage>,
}

impl ResidualsMessage {
    /// The record of residuals and likely input errors.
    pub fn new(residuals: &[MeasurementResidual], likely: &[LikelyInputError]) -> Self {
        Self {
            residuals: ResidualMessage::of(residuals),
            diagnoses: likely.iter().map(Into::into).collect(),
        }
    }
}

impl From<&LikelyInputError> for InputErrorMessage {
    fn from(likely: &LikelyInputError) -> Self {
        Self {
            kind: likely.error.kind().to_owned(),
            text: likely.text.clone(),
            log_evidence_ratio: likely.log_evidence_ratio,
        }
    }
}
