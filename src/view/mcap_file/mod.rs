//! The MCAP file: plan, measurements and results as JSON with schemas, and the robot in Foxglove's
//! message types, as its SDK writes them.
//!
//! Time is that of the laboratory from the recording's beginning, as long as its `[laboratory]` says: a move, the readings without a
//! load, the load, the readings with it. The times are no times of day, and the same recording gives the same bytes.

mod scene;
pub mod study;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::Duration;

use foxglove::messages::{JointState, JointStates};
use foxglove::{Encode, Schema};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions, Writer};
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::Value;

use super::recording::{RecordedCalibration, Recording, Step};
use crate::files::{FileError, output::Output};
use crate::laboratory::Costs;
use crate::record::messages::{ProvenanceMessage, thousandfold};
use crate::record::run::{
    IdentificationRecord, IdentifiedReadings, MeasuredMessage, PlanRows, ReadOnce, RunMessage,
};
use crate::robot::Load;
use crate::study::carried_out::AtRest;
use scene::stamp;

/// Where messages of one type are.
struct Topic(&'static str, &'static str);

const PROVENANCE: Topic = Topic("/provenance", "elastocal.Provenance");
const PLAN: Topic = Topic("/plan", "elastocal.Plan");
const STEPS: Topic = Topic("/steps", "elastocal.Step");
const MEASUREMENTS: Topic = Topic("/measurements", "elastocal.Measurement");
const IDENTIFICATION: Topic = Topic("/identification", "elastocal.Identification");
// Topics have one type each: a file is of deflections or of absolute readings.
const READINGS: Topic = Topic("/measurements", "elastocal.Reading");
const IDENTIFIED_READINGS: Topic = Topic("/identification", "elastocal.IdentifiedReadings");
const TEST_POSES: Topic = Topic("/test_poses", "elastocal.TestPose");
// Of Foxglove's types.
const JOINTS: &str = "/joint_states";
const TRANSFORMS: &str = "/tf";
const SCENE: &str = "/scene";

/// A message about a plan.
#[derive(Debug, Serialize, JsonSchema)]
struct OfPlan<'a, T> {
    /// The plan's name.
    calibration: &'a str,
    /// What is said of it.
    #[serde(flatten)]
    said: T,
}

/// What the virtual robot does in a step.
#[derive(Debug, Serialize, JsonSchema)]
struct StepRecord {
    /// What it is, in words.
    title: String,
    /// The commanded joint angles (deg).
    q_commanded_deg: Vec<f64>,
    /// The joint angles without load (deg).
    q_unloaded_deg: Vec<f64>,
    /// The joint angles under the load (deg).
    q_loaded_deg: Vec<f64>,
    /// Force (N) and torque (N m) in the world frame at the tool.
    wrench: [f64; 6],
    /// Loaded minus unloaded position of the tool in the world frame (mm).
    displacement_mm: [f64; 3],
    /// How many times the joints' deflections are enlarged in the scene.
    enlargement: f64,
}

/// Writes a recording that any MCAP tool can read.
pub fn write_mcap(path: &Path, recording: &Recording) -> Result<(), FileError> {
    write_file(path, &recording.provenance, |channels| {
        channels.write_recording(recording)
    })
}

/// Writes a file, whole or not at all.
fn write_file(
    path: &Path,
    provenance: &ProvenanceMessage,
    write: impl FnOnce(&mut Channels) -> Result<(), McapError>,
) -> Result<(), FileError> {
    let mut output = Output::create(path)?;
    let options = WriteOptions::new()
        .compression(Some(Compression::Zstd))
        // The number of threads would decide on how chunks are cut for compression.
        .compression_threads(0)
        .library(format!("elastocal {}", provenance.version));
    let written = options
        .create(BufWriter::new(output.file()))
        .and_then(|writer| {
            let mut channels = Channels {
                writer,
                ids: BTreeMap::new(),
                sequence: 0,
            };
            write(&mut channels)?;
            channels.writer.finish()?;
            Ok(channels.writer.into_inner().flush()?)
        });
    match written {
        Ok(()) => output.publish(),
        Err(McapError::Io(error)) => Err(output.error(&error)),
        Err(error) => Err(FileError::new(path, format!("cannot be written: {error}"))),
    }
}

/// The file's writer, with a channel for each topic that has messages.
struct Channels<'a> {
    writer: Writer<BufWriter<&'a mut File>>,
    ids: BTreeMap<&'static str, u16>,
    sequence: u32,
}

impl Channels<'_> {
    fn write_recording(&mut self, recording: &Recording) -> Result<(), McapError> {
        let provenance = serde_json::to_value(&recording.provenance);
        let provenance = provenance.map_err(std::io::Error::from)?;
        let entries = provenance.as_object().into_iter().flatten();
        let text = |value: &Value| {
            let word = value.as_str().map(str::to_owned);
            word.unwrap_or_else(|| value.to_string())
        };
        self.writer.write_metadata(&Metadata {
            name: "provenance".to_owned(),
            metadata: (entries.map(|(key, value)| (key.clone(), text(value)))).collect(),
        })?;
        let start = Duration::ZERO;
        self.write(&PROVENANCE, start, &recording.provenance)?;
        for each in &recording.calibrations {
            let plan = &each.record.plan;
            self.write_of(&PLAN, start, &each.record.name, PlanRows { plan })?;
        }
        if recording.shows_robot() {
            self.draw(SCENE, start, &scene::scenery(recording, start))?;
        }
        self.write_steps(recording)
    }

    fn write_steps(&mut self, recording: &Recording) -> Result<(), McapError> {
        let costs = &recording.costs;
        let mut now = Duration::ZERO;
        for calibration in &recording.calibrations {
            for step in &calibration.steps {
                now += minutes(costs.move_min);
                if step.changes_tool {
                    let change = scene::change_tool(recording, step.tool, now);
                    self.draw(SCENE, now, &change)?;
                }
                let (commands, did) = (&recording.commands, &step.did);
                let [unloaded, loaded] = &did.rests;
                let record = StepRecord {
                    title: step.title.clone(),
                    q_commanded_deg: commands.numbers(did.commanded_rad.as_slice()),
                    q_unloaded_deg: commands.all_numbers(&unloaded.q_rad),
                    q_loaded_deg: commands.all_numbers(&loaded.q_rad),
                    wrench: did.load.wrench().into(),
                    displacement_mm: thousandfold(&step.did.displacement_m()),
                    enlargement: step.enlargement,
                };
                let name = &calibration.record.name;
                self.write_of(&STEPS, now, name, record)?;
                self.draw(TRANSFORMS, now, &scene::transforms(recording, step, now))?;
                let annotations = scene::annotations(recording, calibration, step, now);
                self.draw(SCENE, now, &annotations)?;
                self.draw(JOINTS, now, &joints(recording, unloaded, now))?;
                now += minutes(before_load(calibration, step, costs));
                self.draw(JOINTS, now, &joints(recording, loaded, now))?;
                // One reading after the other; at a test pose one that is no message.
                if step.number.is_none() {
                    now += minutes(costs.reading_min);
                }
                for read in calibration.read_in(step) {
                    now += minutes(costs.reading_min);
                    match read {
                        ReadOnce::Deflection(each) => {
                            self.write_of(&MEASUREMENTS, now, name, each)?;
                        }
                        ReadOnce::Position(each) => self.write_of(&READINGS, now, name, each)?,
                    }
                }
            }
            self.write_results(&calibration.record, now)?;
        }
        Ok(())
    }

    /// Results come with the last step of their calibration.
    fn write_results(&mut self, all: &RunMessage, now: Duration) -> Result<(), McapError> {
        match &all.measured {
            MeasuredMessage::Deflections { identification, .. } => {
                let record = IdentificationRecord {
                    identification,
                    true_compliance_rad_per_nm: &all.truth.compliance_rad_per_nm,
                };
                self.write_of(&IDENTIFICATION, now, &all.name, record)?;
            }
            MeasuredMessage::Readings { identification, .. } => {
                let unknowns = all.truth.unknowns.iter().flatten();
                let record = IdentifiedReadings {
                    identification,
                    true_values: unknowns.map(|each| each.value).collect(),
                };
                self.write_of(&IDENTIFIED_READINGS, now, &all.name, record)?;
            }
        }
        for pose in &all.test_poses {
            self.write_of(&TEST_POSES, now, &all.name, pose)?;
        }
        Ok(())
    }

    /// A message about a plan.
    fn write_of<T: Serialize + JsonSchema>(
        &mut self,
        topic: &Topic,
        now: Duration,
        calibration: &str,
        said: T,
    ) -> Result<(), McapError> {
        self.write(topic, now, &OfPlan { calibration, said })
    }

    /// A message as JSON.
    fn write<T: Serialize + JsonSchema>(
        &mut self,
        Topic(topic, name): &Topic,
        now: Duration,
        message: &T,
    ) -> Result<(), McapError> {
        let data = serde_json::to_vec(message).map_err(std::io::Error::from)?;
        self.write_data(topic, now, ("json", || json_schema::<T>(name)), &data)
    }

    /// A message of a type that Foxglove's viewer draws.
    fn draw<T: Encode>(
        &mut self,
        topic: &'static str,
        now: Duration,
        message: &T,
    ) -> Result<(), McapError> {
        let mut data = Vec::new();
        let encoded = message.encode(&mut data);
        encoded.map_err(|error| std::io::Error::other(error.to_string()))?;
        let encoding = T::get_message_encoding();
        self.write_data(topic, now, (&encoding, T::get_schema), &data)
    }

    fn write_data(
        &mut self,
        topic: &'static str,
        now: Duration,
        (encoding, schema): (&str, impl FnOnce() -> Option<Schema>),
        data: &[u8],
    ) -> Result<(), McapError> {
        let channel_id = if let Some(id) = self.ids.get(topic) {
            *id
        } else {
            let schema = schema().map(|each| {
                let writer = &mut self.writer;
                writer.add_schema(&each.name, &each.encoding, &each.data)
            });
            let (schema, writer) = (schema.transpose()?, &mut self.writer);
            writer.add_channel(schema.unwrap_or(0), topic, encoding, &BTreeMap::new())?
        };
        self.ids.insert(topic, channel_id);
        let time_ns = u64::try_from(now.as_nanos()).unwrap_or(u64::MAX);
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.sequence += 1;
        self.writer.write_to_known_channel(&header, data)
    }
}

/// The schema of JSON messages of a type.
fn json_schema<T: JsonSchema>(name: &str) -> Option<Schema> {
    // Viewers do not follow references inside schemas.
    let settings = SchemaSettings::draft07()
        .for_serialize()
        .with(|settings| settings.inline_subschemas = true);
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    schema.insert("title".to_owned(), name.into());
    let text = serde_json::to_vec(&schema).ok()?;
    Some(Schema::new(name, "jsonschema", text))
}

/// The minutes of readings without a load, which absolute ones do not have, and of hanging it where there is one.
fn before_load(calibration: &RecordedCalibration, step: &Step, costs: &Costs) -> f64 {
    let readings = match (&calibration.record.measured, step.number) {
        (_, None) => 1,
        (MeasuredMessage::Readings { .. }, _) => 0,
        _ => step.did.readings.len(),
    };
    let hung = [costs.load_change_min, 0.0][usize::from(step.did.load == Load::NONE)];
    costs.reading_min * readings as f64 + hung
}

/// So much time in the laboratory.
fn minutes(count: f64) -> Duration {
    Duration::from_secs_f64(60.0 * count)
}

fn joints(recording: &Recording, rest: &AtRest, now: Duration) -> JointStates {
    let joints = recording.joints.iter().zip(&rest.q_rad);
    let joint = |(name, position): (&String, &f64)| JointState {
        name: name.clone(),
        position: Some(*position),
        ..JointState::default()
    };
    JointStates {
        timestamp: stamp(now),
        joints: joints.map(joint).collect(),
    }
}
