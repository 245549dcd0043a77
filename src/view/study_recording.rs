//! What the recordings of a study show: the robot in each plan's experiments and in the test poses,
//! and what the runs so far say.

use schemars::JsonSchema;
use serde::Serialize;

use super::recording::Recording;
use crate::record::{study::StudyPlanMessage, tally_file::Header};
use crate::study::snapshots::FIRST_RUNS;

/// A study, before its runs.
#[derive(Debug, Clone)]
pub struct StudyRecording {
    /// What its numbers depend on.
    pub header: Header,
    /// One calibration with each plan that can be shown.
    pub arms: Recording,
}

/// What the runs so far say.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Snapshot {
    /// How many runs.
    pub runs: u64,
    /// What they say of each plan.
    pub plans: Vec<StudyPlanMessage>,
}

impl StudyRecording {
    /// The numbers of runs of [`FIRST_RUNS`] that are less than the first block.
    pub fn first_runs(&self) -> impl Iterator<Item = u64> + use<> {
        let block = self.header.block_runs().min(self.header.trials);
        FIRST_RUNS.into_iter().filter(move |runs| *runs < block)
    }
}
