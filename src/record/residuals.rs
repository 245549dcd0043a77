//! Residuals by measurement and likely mistakes, the record of `identify`.

use serde::{Deserialize, Serialize};

use crate::identification::diagnoses::{Diagnosis, Mistake};
use crate::identification::{MeasurementResidual, Residuals};

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

/// The measurement that fits least, and what would be without it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct SuspectMessage {
    /// The measurement's number, from 1.
    pub measurement: usize,
    /// The probability that chance alone puts any of the measurements as far out.
    pub probability_of_any: f64,
    /// The change of each compliance without it, in standard errors.
    pub compliance_change_standard_errors: Vec<Option<f64>>,
    /// The consistency of the others.
    pub consistency_without: Option<f64>,
}

/// A likely mistake.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisMessage {
    /// What kind of mistake.
    pub kind: String,
    /// What may be wrong, what shows it and what to do.
    pub text: String,
    /// The natural logarithm of how many times more probable the measurements are with the mistake
    /// than without; null for what the file itself shows.
    pub log_evidence_ratio: Option<f64>,
}

/// What `identify` says of residuals and mistakes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ResidualsMessage {
    /// Each measurement's residual.
    pub residuals: Vec<ResidualMessage>,
    /// The measurement that fits least.
    pub most_suspicious: Option<SuspectMessage>,
    /// Likely mistakes.
    pub diagnoses: Vec<DiagnosisMessage>,
}

impl ResidualsMessage {
    /// The record of residuals and diagnoses.
    pub fn new(residuals: &Residuals, diagnoses: &[Diagnosis]) -> Self {
        Self {
            residuals: ResidualMessage::of(&residuals.measurements),
            most_suspicious: residuals.suspect.as_ref().map(|suspect| SuspectMessage {
                measurement: suspect.measurement + 1,
                probability_of_any: suspect.probability_of_any,
                compliance_change_standard_errors: suspect.change.clone(),
                consistency_without: suspect.consistency,
            }),
            diagnoses: diagnoses.iter().map(Into::into).collect(),
        }
    }
}

impl From<&Diagnosis> for DiagnosisMessage {
    fn from(diagnosis: &Diagnosis) -> Self {
        Self {
            kind: kind(&diagnosis.mistake).to_owned(),
            text: diagnosis.text.clone(),
            log_evidence_ratio: diagnosis.log_evidence_ratio,
        }
    }
}

const fn kind(mistake: &Mistake) -> &'static str {
    match mistake {
        Mistake::SignsReversed => "signs_reversed",
        Mistake::LoadUnit(_) => "load_unit",
        Mistake::DeflectionUnit(_) => "deflection_unit",
        Mistake::AngleUnit(_) => "angle_unit",
        Mistake::JointSigns(_) => "joint_signs",
        Mistake::JointsSwapped(_) => "joints_swapped",
        Mistake::Frame(_) => "frame",
        Mistake::DeflectionsInToolFrame => "deflections_in_tool_frame",
        Mistake::LoadsInToolFrame => "loads_in_tool_frame",
        Mistake::AnglesOutsideRange { .. } => "angles_outside_range",
        Mistake::IdenticalRows(_) => "identical_rows",
        Mistake::IdenticalReadings(_) => "identical_readings",
    }
}
