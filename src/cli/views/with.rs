//! What is shown with the feature `view`.

use std::path::{Path, PathBuf};

use elastocal::calibration::Calibration;
use elastocal::experiment::Candidate;
use elastocal::files::FileError;
use elastocal::files::output::write_whole;
use elastocal::laboratory::Campaign;
use elastocal::paper::record::ReproductionMessage;
use elastocal::plan::Plan;
use elastocal::plan::search::BudgetPoint;
use elastocal::record::ladder::LadderMessage;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::record::patterns::PatternsMessage;
use elastocal::record::selection::SelectionMessage;
use elastocal::scenario::Scenario;
use elastocal::text::wording::shell_word;
use elastocal::view::mcap_file::write_mcap;
use elastocal::view::misfit_plots::{ladder_plot, patterns_plot};
use elastocal::view::plots::budget_plot;
use elastocal::view::recording::Recording;
use elastocal::view::report::{
    AbsolutePageRecord, RunRecord, StudyPageRecord, absolute_page, run_page,
};
use elastocal::view::rerun_file::{messages, write_rerun};
use elastocal::view::run_sheet::run_sheet;
use elastocal::view::selection_plot::selection_plot;
use elastocal::view::stills;

use super::{AbsoluteShown, RunShown, StudyShown};
use crate::cli::written::{Written, warn};

pub use super::study::StudyObserver;
pub use super::target::ViewerTarget;

/// What `run` writes beside its results.
pub const RUN_FILES: &[&str] = &["run.mcap", "run.rrd", "stills.svg", "report.html"];
/// The page of a study.
pub const STUDY_PAGE: &[&str] = &["study.html"];
/// The recordings of a study.
pub const STUDY_FILES: &[&str] = &["study.mcap", "study.rrd"];
/// The page of `reproduce`.
pub const REPRODUCTION_PAGE: &[&str] = &["reproduction.html"];
/// How the recordings of `replay` end.
pub const REPLAY_ENDINGS: &[&str] = &["mcap", "rrd"];

/// What is not there; nothing.
pub const MISSING: Option<&str> = None;

/// Whether an option can be used.
#[expect(clippy::unnecessary_wraps, reason = "without the feature it cannot")]
pub fn needed_by(_option: &str, _path: Option<&PathBuf>) -> anyhow::Result<()> {
    Ok(())
}

/// The views of a run, ready to be written.
pub struct RunViews {
    recording: Recording,
    stills: String,
    page: String,
}

impl RunViews {
    pub fn new(run: &RunShown<'_>) -> anyhow::Result<Self> {
        let stills = stills::sheet(run.scenario, &run.calibrations[0].1.plan);
        let page = run_page(&RunRecord {
            scenario: run.scenario,
            plans: run.records,
            evidence: run.evidence,
            random: run.random,
            conditions: run.conditions,
            command: &command_line(),
            stills: &stills,
        })?;
        Ok(Self {
            recording: Recording::new(run.scenario, run.calibrations)?,
            stills,
            page,
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
        written.note(&svg, write_whole(&svg, self.stills.as_bytes()));
        written.note(&html, write_whole(&html, self.page.as_bytes()));
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

/// Draws the robot in each configuration of a plan.
pub fn write_stills(path: &Path, scenario: &Scenario, plan: &Plan) -> Result<(), FileError> {
    write_whole(path, stills::sheet(scenario, plan).as_bytes())
}

/// The same of a plan of absolute readings, each so often: with what is read, and from where.
pub fn write_stills_of_readings(
    path: &Path,
    scenario: &Scenario,
    readings: &[(&Candidate, u32)],
) -> Result<(), FileError> {
    write_whole(
        path,
        stills::sheet_of_readings(scenario, readings).as_bytes(),
    )
}

/// Writes the page of a plan of absolute readings.
pub fn write_absolute_page(
    path: &Path,
    shown: &AbsoluteShown<'_>,
) -> anyhow::Result<Result<(), FileError>> {
    let stills = stills::sheet_of_readings(shown.scenario, shown.readings);
    let page = absolute_page(&AbsolutePageRecord {
        scenario: shown.scenario,
        plan: shown.plan,
        trials: shown.trials,
        provenance: shown.provenance,
        stills: &stills,
        conditions: shown.conditions,
        command: &command_line(),
    })?;
    Ok(write_whole(path, page.as_bytes()))
}

/// The sheet of a campaign.
pub const RUN_SHEET: Option<&str> = Some("run_sheet.html");

/// Writes the sheet to take along into the laboratory.
pub fn write_run_sheet(
    path: &Path,
    scenario: &Scenario,
    plan: &Plan,
    campaign: &Campaign,
) -> Result<(), FileError> {
    write_whole(path, run_sheet(scenario, plan, campaign).as_bytes())
}

/// Plots accuracy against measurements.
pub fn write_budget_plot(
    path: &Path,
    title: &str,
    points: &[BudgetPoint],
) -> anyhow::Result<Result<(), FileError>> {
    Ok(write_whole(path, budget_plot(title, points)?.as_bytes()))
}

/// Draws a ladder of models.
pub fn write_ladder_plot(
    path: &Path,
    title: &str,
    ladder: &LadderMessage,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(write_whole(path, ladder_plot(title, ladder)?.as_bytes()))
}

/// Draws patterns in residuals.
pub fn write_patterns_plot(
    path: &Path,
    title: &str,
    patterns: &PatternsMessage,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(write_whole(
        path,
        patterns_plot(title, patterns)?.as_bytes(),
    ))
}

/// Draws what came of choices of readings.
pub fn write_selection_plot(
    path: &Path,
    message: &SelectionMessage,
) -> anyhow::Result<Result<(), FileError>> {
    let plot = selection_plot(
        "Calibrated with a few readings, judged on all others",
        message,
    )?;
    Ok(write_whole(path, plot.as_bytes()))
}

/// The page of a study.
pub fn study_page(study: &StudyShown<'_>) -> anyhow::Result<Option<String>> {
    let plans = &study.header.plans;
    let first = &plans[0];
    let page = elastocal::view::report::study_page(&StudyPageRecord {
        provenance: &study.header.provenance,
        trials: study.header.trials,
        experiments: first.experiments,
        level: study.level,
        is_absolute: study.header.absolute.is_some(),
        reference: first.reference.map(|index| &*plans[index].name),
        plans: study.plans,
        conditions: study.conditions,
        command: &command_line(),
    })?;
    Ok(Some(page))
}

/// The page of a reproduction.
pub fn reproduction_page(
    message: &ReproductionMessage,
    provenance: &ProvenanceMessage,
) -> anyhow::Result<Option<String>> {
    let command = command_line();
    let page = elastocal::view::report::reproduction_page(message, provenance, &command)?;
    Ok(Some(page))
}

/// The command that was given, as a shell takes it.
fn command_line() -> String {
    let given = std::env::args_os().skip(1);
    let words = given.map(|each| shell_word(&each.to_string_lossy()));
    let words: Vec<String> = std::iter::once("elastocal".to_owned())
        .chain(words)
        .collect();
    words.join(" ")
}
