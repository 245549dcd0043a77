//! Measurements judged against a tolerance with a guard band (JCGM 106).

use clap::Args;
use elastocal::codes::{Condition, ConditionCode};
use elastocal::gate::{Decision, DistanceTolerance, JudgedDistance};
use elastocal::quantities::plausible::{ACCURACY, TOLERANCE};
use elastocal::record::json::merge;
use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

use super::Report;

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

/// Measurements that are judged.
#[derive(Debug)]
pub struct JudgedMeasurements {
    tolerance: DistanceTolerance,
    each: Vec<JudgedDistance>,
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

impl JudgedMeasurements {
    /// Differences (m), each with the covariance of its reading (m^2).
    pub fn new(
        tolerance: DistanceTolerance,
        each: impl Iterator<Item = (Vector3<f64>, Matrix3<f64>)>,
    ) -> Self {
        let each =
            each.map(|(difference_m, reading_m2)| tolerance.judge(&difference_m, &reading_m2));
        Self {
            tolerance,
            each: each.collect(),
        }
    }

    /// That of all together: the worst of each.
    fn decision(&self) -> Decision {
        let each = self.each.iter().map(|each| each.decision);
        each.max().unwrap_or(Decision::Inconclusive)
    }

    fn count(&self, decision: Decision) -> usize {
        (self.each.iter())
            .filter(|each| each.decision == decision)
            .count()
    }

    /// Adds it to a report.
    pub fn report(&self, report: &mut Report) {
        merge(&mut report.json, json!({ "tolerance": self.json() }));
        report.text += &self.describe();
        report.conditions.extend(self.condition());
    }

    /// The record.
    fn json(&self) -> Value {
        let each = self.each.iter().map(|each| {
            json!({
                "distance_um": each.distance_m * 1e6,
                "expanded_uncertainty_um": each.expanded_uncertainty_m * 1e6,
                "decision": each.decision,
            })
        });
        json!({
            "tolerance_um": self.tolerance.tolerance_m * 1e6,
            "guard_band": self.tolerance.guard_band,
            "decision": self.decision(),
            "measurements": each.collect::<Vec<_>>(),
        })
    }

    /// For a person.
    fn describe(&self) -> String {
        let largest =
            |of: fn(&JudgedDistance) -> f64| self.each.iter().map(of).fold(0.0, f64::max) * 1e6;
        format!(
            "Tolerance {:.1} um, guard band {} U (U at most {:.1} um): {} accepted, {} inconclusive, {} rejected; the largest distance \
             is {:.1} um: {}.\n",
            self.tolerance.tolerance_m * 1e6,
            self.tolerance.guard_band,
            largest(|each| each.expanded_uncertainty_m),
            self.count(Decision::Accept),
            self.count(Decision::Inconclusive),
            self.count(Decision::Reject),
            largest(|each| each.distance_m),
            self.decision().name()
        )
    }

    /// The condition that does not hold.
    fn condition(&self) -> Option<Condition> {
        let all = self.each.len();
        match self.decision() {
            Decision::Accept => None,
            Decision::Inconclusive => {
                let count = self.count(Decision::Inconclusive);
                Some(ConditionCode::Inconclusive.with(format!(
                    "the tolerance is within the guard band of {count} of {all} measurements"
                )))
            }
            Decision::Reject => {
                let count = self.count(Decision::Reject);
                Some(ConditionCode::ToleranceExceeded.with(format!(
                    "{count} of {all} measurements are beyond the tolerance by more than their guard band"
                )))
            }
        }
    }
}
