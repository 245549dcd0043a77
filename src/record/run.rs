//! A plan that was carried out once on the virtual robot, as a record.

use serde::{Serialize, Serializer};
use serde_json::json;

use super::length::LengthField;
use super::messages::{MeasurementMessage, PlanRowMessage, TestPoseMessage, plan_messages};
use crate::calibration::{Calibration, CalibrationError, pose_conditions};
use crate::codes::Condition;
use crate::identification::{AbsoluteMessage, IdentificationMessage, MeasurementResidual};
use crate::measurement::AbsoluteReading;
use crate::study::carried_out::CarriedOut;
use crate::task::Task;
use crate::testbed::{RunTruth, Truth};
use crate::text::wording::naming;

/// One run from plan to compensated test poses.
#[derive(Debug, Clone, Serialize)]
pub struct RunMessage {
    /// The plan's name.
    pub name: String,
    /// The plan.
    pub plan: Vec<PlanRowMessage>,
    /// What was measured, and what was identified from that.
    #[serde(flatten)]
    pub measured: MeasuredMessage,
    /// The simulated truth of the run.
    pub truth: RunTruth,
    /// What is achieved at each test pose.
    pub test_poses: Vec<TestPoseMessage>,
    /// What must be looked at, of the identification and of what is commanded.
    #[serde(skip)]
    pub conditions: Vec<Condition>,
    /// What the robot did, for those who show it.
    #[serde(skip)]
    pub did: CarriedOut,
}

/// What was measured in a run, and what was identified from that.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
pub enum MeasuredMessage {
    /// Deflections.
    Deflections {
        /// The measurements.
        measurements: Vec<MeasurementMessage>,
        /// What was identified.
        identification: Box<IdentificationMessage>,
        /// Each measurement's residual, standardised.
        residuals: Vec<MeasurementResidual>,
    },
    /// Absolute readings.
    Readings {
        /// The readings.
        #[serde(serialize_with = "as_shown")]
        measurements: Vec<AbsoluteReading>,
        /// What was identified.
        identification: Box<AbsoluteMessage>,
    },
}

impl RunMessage {
    /// The record of a calibration by deflections in a run under a seed, under the name of its plan.
    ///
    /// # Errors
    /// See [`CalibrationError`]; none that the calibration did not have already.
    pub fn of_deflections(
        task: &Task,
        truth: &Truth,
        seed: u64,
        name: &str,
        calibration: &Calibration,
    ) -> Result<Self, CalibrationError> {
        let belief = &task.belief;
        let (commands, found) = (&belief.commands(), &calibration.identification);
        let mut conditions = found.conditions();
        conditions.extend(pose_conditions(belief, &calibration.poses));
        let measurements = calibration.measurements.iter();
        let poses = calibration.poses.iter();
        let nominal_rad_per_nm = &belief.nominal.compliance_rad_per_nm;
        Ok(Self {
            name: name.to_owned(),
            plan: plan_messages(commands, &calibration.plan),
            measured: MeasuredMessage::Deflections {
                measurements: measurements
                    .map(|each| MeasurementMessage::new(commands, each))
                    .collect(),
                identification: Box::new(IdentificationMessage::new(found, nominal_rad_per_nm)),
                residuals: calibration.residuals.clone(),
            },
            truth: calibration.truth.clone(),
            test_poses: poses
                .map(|each| TestPoseMessage::new(commands, each))
                .collect(),
            conditions,
            did: CarriedOut::of_deflections(task, truth, seed, calibration)?,
        })
    }

    /// How often something was read.
    pub const fn readings(&self) -> usize {
        match &self.measured {
            MeasuredMessage::Deflections { measurements, .. } => measurements.len(),
            MeasuredMessage::Readings { measurements, .. } => measurements.len(),
        }
    }

    /// What a row of the plan, numbered from 1, is.
    pub fn row_title(&self, number: usize) -> String {
        let rows = self.plan.len();
        let row = self.plan.get(number - 1);
        let Some(reads) = row.and_then(|row| row.reads.as_ref()) else {
            return format!("experiment {number} of {rows}");
        };
        let target = naming(&reads.target, ": {}");
        let station = naming(&reads.station, " from {}");
        format!("row {number} of {rows}{target}{station}")
    }
}

/// What an instrument said (mm), in its own frame.
fn as_shown<S: Serializer>(readings: &[AbsoluteReading], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(readings.iter().map(|each| {
        if each.length.is_some() {
            return json!(LengthField(each.length));
        }
        let position_mm: [f64; 3] = (each.position_m * 1e3).into();
        json!({ "position_mm": position_mm, "quaternion": quaternion(each) })
    }))
}

/// The orientation of a pose, real part first, in the instrument's frame.
pub fn quaternion(reading: &AbsoluteReading) -> Option<[f64; 4]> {
    (reading.rotation).map(|turned| [turned.w, turned.i, turned.j, turned.k])
}
