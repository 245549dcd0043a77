//! Measurements judged against a tolerance with a guard band (JCGM 106).

use crate::gate::{Decision, DistanceTolerance, JudgedDistance};
use crate::quantities::plausible::{ACCURACY, TOLERANCE};
use nalgebra::{Matrix3, Vector3};

use super::command_prelude::*;

/// What an identified robot must keep.
#[derive(Debug, Args)]
pub struct ToleranceArgs {
    /// How far measurements may be from what is predicted: each is accepted, rejected or inconclusive.
    #[arg(long, value_name = "UM", requires = "measurements", value_parser = |text: &str| ACCURACY.parse(text))]
    tolerance_um: Option<f64>,
    /// The guard band of --tolerance-um, as so many times the expanded uncertainty (95 %) of the measurement.
    #[arg(long, value_name = "TIMES", requires = "tolerance_um", default_value_t = 1.0, value_parser = |text: &str| TOLERANCE.parse(text))]
    guard_band: f64,
}

impl ToleranceArgs {
    /// The tolerance, where one is given.
    pub fn tolerance(&self) -> Option<DistanceTolerance> {
        self.tolerance_um.map(|tolerance_um| DistanceTolerance {
            tolerance_m: tolerance_um * 1e-6,
            guard_band: self.guard_band,
        })
    }
}

/// Judges measurements by their differences (m), each with the covariance of its reading (m^2), and adds that to a report.
pub fn report_judged(
    report: &mut Report,
    tolerance: DistanceTolerance,
    each: impl Iterator<Item = (Vector3<f64>, Matrix3<f64>)>,
) {
    let each = each.map(|(difference_m, reading_m2)| tolerance.judge(&difference_m, &reading_m2));
    let each: Vec<JudgedDistance> = each.collect();
    let [accepted, inconclusive, rejected] =
        [Decision::Accept, Decision::Inconclusive, Decision::Reject]
            .map(|decision| each.iter().filter(|each| each.decision == decision).count());
    // That of all together: the worst of each.
    let decision = each.iter().map(|each| each.decision).max();
    let decision = decision.unwrap_or(Decision::Inconclusive);
    let largest = |of: fn(&JudgedDistance) -> f64| each.iter().map(of).fold(0.0, f64::max) * 1e6;
    report.text += &format!(
        "Tolerance {:.1} um, guard band {} U (U at most {:.1} um): {accepted} accepted, {inconclusive} inconclusive, {rejected} rejected; the largest distance \
         is {:.1} um: {}.\n",
        tolerance.tolerance_m * 1e6,
        tolerance.guard_band,
        largest(|each| each.expanded_uncertainty_m),
        largest(|each| each.distance_m),
        decision
    );
    let all = each.len();
    report.conditions.extend(match decision {
        Decision::Accept => None,
        Decision::Inconclusive => Some(ConditionCode::Inconclusive.with(format!(
            "the tolerance is within the guard band of {inconclusive} of {all} measurements"
        ))),
        Decision::Reject => Some(ConditionCode::ToleranceExceeded.with(format!(
            "{rejected} of {all} measurements are beyond the tolerance by more than their guard band"
        ))),
    });
    let measurement = |each: &JudgedDistance| {
        json!({
            "distance_um": each.distance_m * 1e6,
            "expanded_uncertainty_um": each.expanded_uncertainty_m * 1e6,
            "decision": each.decision,
        })
    };
    report.json["tolerance"] = json!({
        "tolerance_um": tolerance.tolerance_m * 1e6,
        "guard_band": tolerance.guard_band,
        "decision": decision,
        "measurements": each.iter().map(measurement).collect::<Vec<_>>(),
    });
}
