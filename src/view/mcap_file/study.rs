//! The MCAP file of a study: one calibration with each plan of deflections as in a run's file, then what the runs
//! say. Snapshot k is at minute k, and the final record comes with the last one.

use std::path::Path;
use std::time::Duration;

use schemars::JsonSchema;
use serde::Serialize;

use super::{Topic, minutes, write_file};
use crate::files::FileError;
use crate::record::study::StudyPlanMessage;
use crate::study::Level;
use crate::view::study_recording::{Snapshot, StudyRecording};

const PROGRESS: Topic = Topic("/study/progress", "elastocal.StudyProgress");
const STUDY: Topic = Topic("/study", "elastocal.Study");

/// What the study comes to.
#[derive(Debug, Serialize, JsonSchema)]
struct StudyRecord<'a> {
    /// The number of runs of the whole study.
    trials: u64,
    /// `model` or `robot`: what the runs are made of.
    level: Level,
    /// The names of the compliances.
    parameters: &'a [String],
    /// The plan that others are compared with.
    reference: Option<&'a str>,
    /// The plans.
    plans: &'a [StudyPlanMessage],
}

/// Writes a study with its snapshots.
pub fn write_study_mcap(
    path: &Path,
    study: &StudyRecording,
    snapshots: &[Snapshot],
) -> Result<(), FileError> {
    write_file(path, &study.header.provenance, |channels| {
        channels.write_recording(&study.arms)?;
        let mut now = Duration::ZERO;
        for snapshot in snapshots {
            now += minutes(1.0);
            channels.write(&PROGRESS, now, snapshot)?;
        }
        if let Some(last) = snapshots.last() {
            let header = &study.header;
            let record = StudyRecord {
                trials: header.trials,
                level: header.level,
                parameters: &header.parameters,
                reference: header.reference(),
                plans: &last.plans,
            };
            channels.write(&STUDY, now, &record)?;
        }
        Ok(())
    })
}
