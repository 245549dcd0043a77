//! Residuals by measurement and likely mistakes, the record of `identify`.

use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use crate::identification::diagnoses::{Diagnosis, Mistake};
use crate::identification::{MeasurementResidual, Residuals};

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

/// What `identify` says of residuals and mistakes.
pub fn residuals_json(residuals: &Residuals, diagnoses: &[Diagnosis]) -> Value {
    let diagnosis = |each: &Diagnosis| {
        json!({
            "kind": kind(&each.mistake),
            "text": each.text,
            "log_evidence_ratio": each.log_evidence_ratio,
        })
    };
    json!({
        "residuals": numbered(&residuals.measurements).collect::<Vec<_>>(),
        "most_suspicious": residuals.suspect,
        "diagnoses": diagnoses.iter().map(diagnosis).collect::<Vec<_>>(),
    })
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
