//! A plan that was carried out once on the virtual robot, as a record; and what recordings hold of it, message by message: the plan, what
//! was read once with what identification leaves of it, and what was identified.

use std::ops::Range;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use serde_json::json;

use super::messages::{
    LengthField, MeasurementMessage, PlanRowMessage, TestPoseMessage, plan_messages, thousandfold,
};
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

/// A plan.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PlanRows<'a> {
    /// The experiments, or the rows of absolute readings.
    pub plan: &'a [PlanRowMessage],
}

/// What was identified with a plan.
#[derive(Debug, Serialize, JsonSchema)]
pub struct IdentificationRecord<'a> {
    /// The results.
    #[serde(flatten)]
    pub identification: &'a IdentificationMessage,
    /// The virtual robot's compliances in this run; identification does not see them.
    pub true_compliance_rad_per_nm: &'a [f64],
}

/// What was identified with a plan of absolute readings.
#[derive(Debug, Serialize, JsonSchema)]
pub struct IdentifiedReadings<'a> {
    /// The results.
    #[serde(flatten)]
    pub identification: &'a AbsoluteMessage,
    /// The simulated truth of the unknowns in this run, in their order; null where a run does not say it.
    pub true_values: Vec<Option<f64>>,
}

/// A reading of a run.
#[derive(Debug)]
pub enum ReadOnce<'a> {
    /// A deflection.
    Deflection(Box<MeasurementRecord>),
    /// A position, a pose or a length.
    Position(Box<ReadingRecord<'a>>),
}

/// An absolute reading in its place in the plan.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ReadingRecord<'a> {
    /// The number of the row in the plan, from 1.
    pub row: usize,
    /// The number of the repeat, from 1.
    pub repeat: usize,
    /// The site that is read.
    pub target: Option<&'a str>,
    /// Where the instrument stands.
    pub station: Option<&'a str>,
    /// The position that was read (mm), in the instrument's frame; null of lengths.
    pub position_mm: Option<[f64; 3]>,
    /// The orientation that was read of a pose, real part first, in the instrument's frame.
    pub quaternion: Option<[f64; 4]>,
    /// The length that was read, of lengths.
    #[serde(flatten)]
    pub length: LengthField,
    /// Read less predicted position (mm), in the instrument's frame; null of lengths.
    pub residual_mm: Option<[f64; 3]>,
    /// Read less predicted orientation of a pose, as a rotation vector (mrad), in the instrument's frame.
    pub rotation_residual_mrad: Option<[f64; 3]>,
    /// Read less predicted length (mm), of lengths.
    pub length_residual_mm: Option<f64>,
}

/// A measurement in its place in the plan.
#[derive(Debug, Serialize, JsonSchema)]
pub struct MeasurementRecord {
    /// The number of the experiment in the plan, from 1.
    pub experiment: usize,
    /// The number of the repeat, from 1.
    pub repeat: usize,
    /// The measurement; its deflection is null where a gauge reads.
    #[serde(flatten)]
    pub measurement: MeasurementMessage,
    /// What a gauge reads, positive along its direction (mm).
    pub displacement_mm: Option<f64>,
    /// The standard deviation of that, where it is of its own (mm).
    pub displacement_std_mm: Option<f64>,
    /// The virtual robot's deflection, without the instrument's errors (mm); identification does not see it.
    pub true_deflection_mm: Option<[f64; 3]>,
    /// What of that is along a gauge's direction (mm).
    pub true_displacement_mm: Option<f64>,
    /// Measured minus modelled deflection (mm); null where a gauge reads.
    pub residual_mm: Option<[f64; 3]>,
    /// Measured minus modelled displacement (mm), where a gauge reads.
    pub displacement_residual_mm: Option<f64>,
}

impl RunMessage {
    /// What was read in a row of the plan, numbered from 1: these of all readings.
    pub fn read_in(&self, row: usize, these: Range<usize>) -> impl Iterator<Item = ReadOnce<'_>> {
        (1..)
            .zip(these)
            .map_while(move |(repeat, index)| self.read_once(row, repeat, index))
    }

    /// What was read for the `repeat`-th time in a row, and is the `index`-th of all; nothing where there are not as many.
    fn read_once(&self, row: usize, repeat: usize, index: usize) -> Option<ReadOnce<'_>> {
        match &self.measured {
            MeasuredMessage::Deflections {
                measurements,
                identification,
                ..
            } => {
                let mut measurement = measurements.get(index)?.clone();
                let along = measurement.direction.map(Vector3::from);
                let read = |vector_mm| as_read(vector_mm, along);
                let displacement_mm;
                (measurement.deflection_mm, displacement_mm) = read(measurement.deflection_mm);
                let own_mm = (measurement.deflection_std_mm).take_if(|_| along.is_some());
                let true_deflection_mm = self.truth.deflections_m.get(index).map(thousandfold);
                let (residual_mm, displacement_residual_mm) =
                    read(identification.residuals_mm.get(index).copied());
                Some(ReadOnce::Deflection(Box::new(MeasurementRecord {
                    experiment: row,
                    repeat,
                    measurement,
                    displacement_mm,
                    displacement_std_mm: own_mm.map(|[each, ..]| each),
                    true_deflection_mm,
                    true_displacement_mm: read(true_deflection_mm).1,
                    residual_mm,
                    displacement_residual_mm,
                })))
            }
            MeasuredMessage::Readings {
                measurements,
                identification,
            } => {
                let reading = measurements.get(index)?;
                // The first number of a length is all that is read.
                let length = reading.length.map(|_| Vector3::x());
                let read = |vector_mm| as_read(vector_mm, length);
                let (position_mm, _) = read(Some(thousandfold(&reading.position_m)));
                let residual_mm = identification.residuals_mm.get(index).copied();
                let (residual_mm, length_residual_mm) = read(residual_mm);
                Some(ReadOnce::Position(Box::new(ReadingRecord {
                    row,
                    repeat,
                    target: reading.target.as_deref(),
                    station: reading.station.as_deref(),
                    position_mm,
                    quaternion: quaternion(reading),
                    length: LengthField(reading.length),
                    residual_mm,
                    rotation_residual_mrad: identification.rotation_residual_mrad(index),
                    length_residual_mm,
                })))
            }
        }
    }
}

/// A vector of a reading (mm) as far as it is read: whole, or what is along a gauge's direction or is a length.
fn as_read(
    whole_mm: Option<[f64; 3]>,
    along: Option<Vector3<f64>>,
) -> (Option<[f64; 3]>, Option<f64>) {
    match along {
        Some(along) => {
            let along = |whole_mm| along.dot(&Vector3::from(whole_mm));
            (None, whole_mm.map(along))
        }
        None => (whole_mm, None),
    }
}
