//! Recordings, pages and pictures: what the commands show of their results.

mod study;
mod target;

use std::path::{Path, PathBuf};

use crate::text::wording::{joined, shell_word};
use crate::view::rerun_file::{log_recording, write_rerun};
use crate::view::{mcap_file::write_mcap, recording::Recording};

use crate::cli::written::{Written, warn};

pub use study::{StudyObserver, carried_out};
pub use target::ViewerTarget;

/// The names of the targets of `--rerun`, for the help.
pub const TARGETS: &str = "spawn|connect[=URL]|save=FILE";
/// What `run` writes beside its results.
pub const RUN_FILES: &[&str] = &["run.mcap", "run.rrd", "stills.svg", "report.html"];
/// The page of a study.
pub const STUDY_PAGE: &str = "study.html";
/// The recordings of a study.
pub const STUDY_FILES: &[&str] = &["study.mcap", "study.rrd"];

/// Shows what run.rrd holds.
pub fn show(
    target: &ViewerTarget,
    recording: &Recording,
    written: &mut Written,
) -> anyhow::Result<()> {
    if let Some(path) = target.file() {
        written.note(path, write_rerun(path, recording));
    }
    if let Some(viewer) = target.open() {
        log_recording(viewer.stream(), recording)?;
        if let Some(problem) = viewer.finish() {
            warn(&problem, None);
        }
    }
    Ok(())
}

/// Writes a recording to files that differ from a record's in their ending; returns the one to look at.
pub fn write_recording(recording: &Recording, record: &Path, written: &mut Written) -> PathBuf {
    let [mcap, rerun] = ["mcap", "rrd"].map(|ending| record.with_extension(ending));
    written.note(&mcap, write_mcap(&mcap, recording));
    written.note(&rerun, write_rerun(&rerun, recording));
    rerun
}

/// The sheet of a campaign.
pub const RUN_SHEET: &str = "run_sheet.html";

/// The command that was given, as a shell takes it.
pub fn command_line() -> String {
    let given = std::env::args_os().skip(1);
    let words = given.map(|each| shell_word(&each.to_string_lossy()));
    joined(["elastocal".to_owned()].into_iter().chain(words), " ")
}
