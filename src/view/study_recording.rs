//! What the recordings of a study show: the robot in each plan's experiments and in the test poses,
//! and what the runs so far say.

use super::recording::Recording;
use crate::record::{study::StudyPlanMessage, tally_file::Header};

/// A study, before its runs.
#[derive(Debug, Clone)]
pub struct StudyRecording {
    /// What its numbers depend on.
    pub header: Header,
    /// One calibration with each plan that can be shown.
    pub arms: Recording,
}

/// What the runs so far say.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// How many runs, failed ones included.
    pub runs: u64,
    /// What they say of each plan.
    pub plans: Vec<StudyPlanMessage>,
}

/// Snapshots are taken after so many runs within the first block.
pub const FIRST_RUNS: [u64; 7] = [10, 20, 50, 100, 200, 500, 1000];

/// After how many blocks the snapshot that follows the one after `done` is taken: 8 to 16 snapshots
/// while the number doubles, so that any number of runs comes with a few hundred at most, and the
/// threads seldom wait for one another.
pub const fn next_snapshot(done: u64) -> u64 {
    let eighth = done / 8;
    let step = if eighth == 0 { 1 } else { 1 << eighth.ilog2() };
    (done / step + 1) * step
}

impl StudyRecording {
    /// What is studied, in a line.
    pub fn title(&self) -> String {
        let header = &self.header;
        format!(
            "{} runs of {}, {}",
            header.trials,
            header.title(),
            header.level.words()
        )
    }

    /// The numbers of runs of [`FIRST_RUNS`] that are less than the first block.
    pub fn first_runs(&self) -> impl Iterator<Item = u64> + use<> {
        let block = self.header.block_runs().min(self.header.trials);
        FIRST_RUNS.into_iter().filter(move |runs| *runs < block)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snapshots_are_few_and_get_rarer() {
        let mut count = 0;
        let mut done = 0;
        while done < 500_000_000 {
            let next = next_snapshot(done);
            assert!(next > done && next - done <= (done / 8).max(1), "{done}");
            done = next;
            count += 1;
        }
        assert!((200..300).contains(&count), "{count}");
    }
}
