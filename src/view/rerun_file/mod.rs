//! The stream for the rerun viewer (.rrd).

mod blueprint;
mod curves;
mod scene;
pub mod study;
mod text;
pub mod viewer;

use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;

use re_sdk::blueprint::components::PlayState;
use re_sdk::blueprint::{ContainerLike, Horizontal, Tabs, Vertical};
use re_sdk::log::ChunkBatcherConfig;
use re_sdk::{RecordingStream, RecordingStreamBuilder, RecordingStreamError, entity_path};
use thiserror::Error;

use super::markup::PageError;
use super::recording::Recording;
use crate::files::{FileError, output::write_whole};
use crate::record::run::MeasuredMessage;
use blueprint::{Clock, Layout};
use curves::{DEFLECTION, READING, RESIDUAL, log_curves, shown};

/// Something could not be logged.
#[derive(Debug, Error)]
#[error(transparent)]
pub enum LogError {
    /// The stream does not take it.
    Stream(#[from] RecordingStreamError),
    /// A text could not be made.
    Text(#[from] PageError),
}

/// Whether a stream took what was logged.
pub type Logged<T = ()> = Result<T, LogError>;

/// The timeline of steps: experiments and test poses, numbered from 1.
const STEP: &str = "step";
/// The timeline of measurements, repeats counted, numbered from 1.
const MEASUREMENT: &str = "measurement";

/// Writes a recording for the rerun viewer.
pub fn write_rerun(path: &Path, recording: &Recording) -> Result<(), FileError> {
    write_stream(path, |stream| log_recording(stream, recording))
}

/// What streams have in common: in whatever environment, and without the time of day.
fn new_stream() -> RecordingStreamBuilder {
    (RecordingStreamBuilder::new("elastocal").enabled(true)).send_properties(false)
}

/// Writes what is logged to a file, whole or not at all: the SDK's own files keep their errors to themselves.
fn write_stream(
    path: &Path,
    log: impl FnOnce(&RecordingStream) -> Logged,
) -> Result<(), FileError> {
    let encode = || {
        let builder = new_stream().batcher_config(ChunkBatcherConfig::NEVER);
        let (stream, memory) = builder.memory()?;
        let logged = log(&stream);
        let bytes = memory.drain_as_bytes();
        // A stream and its memory hold each other.
        stream.disconnect();
        logged?;
        Ok(bytes?)
    };
    let bytes = encode().map_err(|error: Box<dyn Error>| {
        FileError::new(path, format!("cannot be written: {error}"))
    })?;
    write_whole(path, &bytes)
}

/// Begins a recording: its name, and how the viewer lays it out.
fn begin(
    stream: &RecordingStream,
    recording: &Recording,
    clock: &Clock,
    root: impl FnOnce(&mut Layout) -> ContainerLike,
) -> Logged {
    stream.set_log_time_enabled(false);
    stream.send_recording_name(recording.provenance.scenario.as_str())?;
    let mut layout = Layout {
        clock,
        eye_m: recording.eye_m(),
        properties: Vec::new(),
    };
    let root = root(&mut layout);
    layout.send(root, stream)
}

fn root(recording: &Recording, layout: &mut Layout) -> ContainerLike {
    let first = recording.calibrations.first();
    let readings = match first.map(|first| &first.record.measured) {
        Some(MeasuredMessage::Readings { .. }) => ("readings [mm]", READING),
        _ => ("deflections [mm]", DEFLECTION),
    };
    let curves = [("residuals [mm]", RESIDUAL), readings]
        .map(|(name, group)| layout.curves(name, entity_path!["measurements", group]));
    let results = [
        blueprint::text("results", "text/results"),
        blueprint::text("all plans", "text/overview"),
    ];
    let beside = Vertical::new([
        blueprint::text("step", "text/step"),
        Tabs::new(results).into(),
        Tabs::new(curves).into(),
    ]);
    Horizontal::new([
        layout.space(),
        beside.with_row_shares([1.05, 1.4, 0.8]).into(),
    ])
    .with_column_shares([2.2, 1.0])
    .into()
}

/// Logs a recording with its layout, for a file or a viewer.
pub fn log_recording(stream: &RecordingStream, recording: &Recording) -> Logged {
    let steps = recording.steps().count();
    let clock = Clock {
        timeline: STEP,
        // The legend has its place behind the last step.
        range: [0, steps + steps / 6 + 1],
        per_second: 0.5,
        play_state: PlayState::Playing,
    };
    begin(stream, recording, &clock, |layout| root(recording, layout))?;
    scene::log_bodies(stream, recording)?;
    stream.log_static("text/overview", &text::overview(recording)?)?;
    log_steps(stream, recording)
}

fn log_steps(stream: &RecordingStream, recording: &Recording) -> Logged {
    let mut named = None;
    let mut measurement = 0;
    let mut styled = BTreeSet::new();
    for (number, calibration, step) in recording.steps() {
        stream.set_time_sequence(STEP, number);
        if named != Some(&calibration.record.name) {
            stream.log("text/results", &text::results(recording, calibration)?)?;
            named = Some(&calibration.record.name);
        }
        scene::log_step(stream, recording, calibration, step)?;
        for read in calibration.read_in(step) {
            measurement += 1;
            stream.set_time_sequence(MEASUREMENT, measurement);
            for shown in shown(&read) {
                log_curves(stream, &shown, &mut styled)?;
            }
        }
        stream.disable_timeline(MEASUREMENT);
    }
    Ok(())
}
