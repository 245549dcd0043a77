//! What a build without the feature `view` does in place of showing: nothing but to say so.

use std::path::{Path, PathBuf};

use elastocal::calibration::Calibration;
use elastocal::experiment::Candidate;
use elastocal::files::FileError;
use elastocal::laboratory::Campaign;
use elastocal::paper::record::ReproductionMessage;
use elastocal::plan::Plan;
use elastocal::plan::search::BudgetPoint;
use elastocal::record::ladder::LadderMessage;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::record::patterns::PatternsMessage;
use elastocal::record::selection::SelectionMessage;
use elastocal::record::tally_file::Header;
use elastocal::scenario::Scenario;
use elastocal::study::runner::Runner;
use elastocal::study::tally::Tally;
use elastocal::study::{Entry, Setting};

use super::{AbsoluteShown, RunShown, StudyShown};
use crate::cli::written::Written;

/// Views of `run` are not written.
pub const RUN_FILES: &[&str] = &[];
/// Nor is the page of a study.
pub const STUDY_PAGE: &[&str] = &[];
/// Nor are its recordings.
pub const STUDY_FILES: &[&str] = &[];
/// Nor is the page of `reproduce`.
pub const REPRODUCTION_PAGE: &[&str] = &[];
/// Nor are the recordings of `replay`.
pub const REPLAY_ENDINGS: &[&str] = &[];

/// What this build lacks.
const NO_VIEWS: &str = "this elastocal was built without recordings, pages and pictures";
/// What to do about it.
const HINT: &str =
    "build it with the feature `view`, which is on by default: `cargo build --release`";

/// What is not there.
pub const MISSING: Option<&str> = Some(NO_VIEWS);

/// Whether an option can be used.
pub fn needed_by(option: &str, path: Option<&PathBuf>) -> Result<(), FileError> {
    path.map_or(Ok(()), |path| Err(lacking(option, path)))
}

fn lacking(option: &str, path: &Path) -> FileError {
    FileError::new(path, format!("{option}: {NO_VIEWS}")).hint(HINT)
}

/// A viewer that cannot be asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerTarget {}

impl std::str::FromStr for ViewerTarget {
    type Err = String;

    fn from_str(_: &str) -> Result<Self, String> {
        Err(format!("{NO_VIEWS}; {HINT}"))
    }
}

impl ViewerTarget {
    pub fn file(&self) -> Option<&PathBuf> {
        match *self {}
    }
}

/// No views of a run.
pub struct RunViews;

#[expect(
    clippy::unnecessary_wraps,
    clippy::unused_self,
    reason = "as with the feature"
)]
impl RunViews {
    pub fn new(_: &RunShown<'_>) -> anyhow::Result<Self> {
        Ok(Self)
    }

    pub fn write(
        &self,
        _folder: &Path,
        _target: Option<&ViewerTarget>,
        _written: &mut Written,
    ) -> anyhow::Result<()> {
        Ok(())
    }
}

/// No views of a replayed run.
pub struct ReplayViews;

#[expect(
    clippy::unnecessary_wraps,
    clippy::unused_self,
    reason = "as with the feature"
)]
impl ReplayViews {
    pub fn new(_: &Scenario, _: &[(String, Calibration)]) -> anyhow::Result<Self> {
        Ok(Self)
    }

    pub fn write(&self, record: &Path, _: &mut Written) -> String {
        format!("Results are in {}\n", record.display())
    }
}

pub fn write_stills(path: &Path, _: &Scenario, _: &Plan) -> Result<(), FileError> {
    Err(lacking("--stills-out", path))
}

pub fn write_stills_of_readings(
    path: &Path,
    _: &Scenario,
    _: &[(&Candidate, u32)],
) -> Result<(), FileError> {
    Err(lacking("--stills-out", path))
}

pub fn write_absolute_page(
    path: &Path,
    _: &AbsoluteShown<'_>,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(Err(lacking("--report-out", path)))
}

/// No sheet.
pub const RUN_SHEET: Option<&str> = None;

pub fn write_run_sheet(path: &Path, _: &Scenario, _: &Plan, _: &Campaign) -> Result<(), FileError> {
    Err(lacking("the run sheet", path))
}

pub fn write_budget_plot(
    path: &Path,
    _: &str,
    _: &[BudgetPoint],
) -> anyhow::Result<Result<(), FileError>> {
    Ok(Err(lacking("--plot-out", path)))
}

pub fn write_ladder_plot(
    path: &Path,
    _: &str,
    _: &LadderMessage,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(Err(lacking("--plot-out", path)))
}

pub fn write_patterns_plot(
    path: &Path,
    _: &str,
    _: &PatternsMessage,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(Err(lacking("--plot-out", path)))
}

pub fn write_selection_plot(
    path: &Path,
    _: &SelectionMessage,
) -> anyhow::Result<Result<(), FileError>> {
    Ok(Err(lacking("--plot-out", path)))
}

#[expect(clippy::unnecessary_wraps, reason = "as with the feature")]
pub fn study_page(_: &StudyShown<'_>) -> anyhow::Result<Option<String>> {
    Ok(None)
}

#[expect(clippy::unnecessary_wraps, reason = "as with the feature")]
pub fn reproduction_page(
    _: &ReproductionMessage,
    _: &ProvenanceMessage,
) -> anyhow::Result<Option<String>> {
    Ok(None)
}

/// Nobody looks on.
pub enum StudyObserver {}

#[expect(clippy::unnecessary_wraps, reason = "as with the feature")]
impl StudyObserver {
    pub fn new(
        _: &Scenario,
        _: &[Setting<'_>],
        _: &Header,
        _: &[Entry],
        _: Option<&ViewerTarget>,
    ) -> anyhow::Result<Option<Self>> {
        Ok(None)
    }

    pub fn next_snapshot(&self, _done: u64) -> u64 {
        match *self {}
    }

    pub fn first_runs(&mut self, _: &Runner<'_>, _: u64) -> anyhow::Result<()> {
        match *self {}
    }

    pub fn observe(&mut self, _: &[Tally]) -> anyhow::Result<()> {
        match *self {}
    }

    pub fn finish(self, _: Option<&Path>, _: Option<&ViewerTarget>, _: &mut Written) {
        match self {}
    }
}
