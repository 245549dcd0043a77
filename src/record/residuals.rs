//! Residuals by measurement and likely input errors, the record of `identify`.

use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::identification::MeasurementResidual;
use crate::identification::input_errors::LikelyInputError;

/// A measurement's residual with the measurement's number, from 1.
#[derive(Serialize)]
struct NumberedResidual<'a> {
    measurement: usize,
    #[serde(flatten)]
    residual: &'a MeasurementResidual,
}

fn numbered(residuals: &[MeasurementResidual]) -> impl Iterator<Item = NumberedResidual<'_>> {
    let number = |(measurement, residual)| NumberedResidual {
        measurement,
        residual,
    };
    (1..).zip(residuals).map(number)
}

/// Writes the residuals of measurements in their order, numbered.
pub(super) fn written<S: Serializer>(
    residuals: &[MeasurementResidual],
    to: S,
) -> Result<S::Ok, S::Error> {
    to.collect_seq(numbered(residuals))
}

/// What `identify` says of residuals and input errors.
pub fn residuals_json(residuals: &[MeasurementResidual], likely: &[LikelyInputError]) -> Value {
    json!({
        "residuals": numbered(residuals).collect::<Vec<_>>(),
        "diagnoses": likely,
    })
}
