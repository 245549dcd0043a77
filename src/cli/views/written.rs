//! Pages, pictures and recordings as files.

use std::path::Path;

use elastocal::calibration::Calibration;
use elastocal::scenario::Scenario;
use elastocal::text::wording::shell_word;
use elastocal::view::report::{RunRecord, run_page};
use elastocal::view::rerun_file::{messages, write_rerun};
use elastocal::view::{mcap_file::write_mcap, recording::Recording, stills::Stills};

use crate::cli::written::{Written, warn};

pub use super::study::StudyObserver;
pub use super::target::ViewerTarget;

/// What `run` writes beside its results.
pub const RUN_FILES: &[&str] = &["run.mcap", "run.rrd", "stills.svg", "report.html"];
/// The page of a study.
pub const STUDY_PAGE: &str = "study.html";
/// The recordings of a study.
pub const STUDY_FILES: &[&str] = &["study.mcap", "study.rrd"];
/// The page of `reproduce`.
pub const REPRODUCTION_PAGE: &str = "reproduction.html";
/// How the recordings of `replay` end.
pub const REPLAY_ENDINGS: &[&str] = &["mcap", "rrd"];

/// The views of a run, ready to be written.
pub struct RunViews {
    recording: Recording,
    stills: String,
    page: String,
}

impl RunViews {
    /// Of the plans' names and calibrations, the designed plan first.
    pub fn new(
        run: &RunRecord<'_>,
        calibrations: &[(String, Calibration)],
    ) -> anyhow::Result<Self> {
        Ok(Self {
            recording: Recording::new(run.scenario, calibrations)?,
            stills: Stills::of_plan(run.scenario, &calibrations[0].1.plan).sheet(),
            page: run_page(run)?,
        })
    }

    /// Writes the files, and shows the recording where it is asked for.
    pub fn write(
        &self,
        folder: &Path,
        target: Option<&ViewerTarget>,
        written: &mut Written,
    ) -> anyhow::Result<()> {
        let [mcap, rerun, svg, html] =
            ["run.mcap", "run.rrd", "stills.svg", "report.html"].map(|name| folder.join(name));
        written.save(&svg, &self.stills);
        written.save(&html, &self.page);
        written.note(&mcap, write_mcap(&mcap, &self.recording));
        written.note(&rerun, write_rerun(&rerun, &self.recording));
        target.map_or(Ok(()), |target| show(target, &self.recording, written))
    }
}

/// Shows what run.rrd holds.
fn show(target: &ViewerTarget, recording: &Recording, written: &mut Written) -> anyhow::Result<()> {
    if let Some(path) = target.file() {
        written.note(path, write_rerun(path, recording));
    }
    if let Some(mut viewer) = target.open() {
        let problem = viewer
            .send(messages(recording).map_err(anyhow::Error::msg)?)
            .or_else(|| viewer.finish());
        if let Some(problem) = problem {
            warn(&problem, None);
        }
    }
    Ok(())
}

/// The recording of a replayed run, ready to be written.
pub struct ReplayViews(Recording);

impl ReplayViews {
    pub fn new(
        scenario: &Scenario,
        calibrations: &[(String, Calibration)],
    ) -> anyhow::Result<Self> {
        Ok(Self(Recording::new(scenario, calibrations)?))
    }

    /// Writes files that differ from the record's in their ending; says which one to look at.
    pub fn write(&self, record: &Path, written: &mut Written) -> String {
        let [mcap, rerun] = ["mcap", "rrd"].map(|ending| record.with_extension(ending));
        written.note(&mcap, write_mcap(&mcap, &self.0));
        written.note(&rerun, write_rerun(&rerun, &self.0));
        format!("recorded in {}, .mcap and .json\n", rerun.display())
    }
}

/// The sheet of a campaign.
pub const RUN_SHEET: &str = "run_sheet.html";

/// The command that was given, as a shell takes it.
pub fn command_line() -> String {
    let given = std::env::args_os().skip(1);
    let words = given.map(|each| shell_word(&each.to_string_lossy()));
    let words: Vec<String> = std::iter::once("elastocal".to_owned())
        .chain(words)
        .collect();
    words.join(" ")
}
