//! `study` of plans of absolute readings.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use elastocal::experiment::read_candidates;
use elastocal::files::{FileError, hexadecimal, sha256_of};
use elastocal::identification::ParameterGroup;
use elastocal::plan::search::Watch;
use elastocal::record::tally_file::{AbsoluteStudyHeader, Header, TallyFile};
use elastocal::scenario::Scenario;
use elastocal::study::{Level, absolute::AbsoluteRunner};
use elastocal::task::AccuracyKind;
use elastocal::text::wording::counted;
use elastocal::workflow::absolute_study::{AbsoluteStudyWanted, check, entries, explained};
use elastocal::workflow::study::Timing;

use super::results::{Results, write};
use super::{StudyCommand, runs_of};
use crate::cli::interruption::{STOP, ask_work, proceed};
use crate::cli::plan_args::{ANYWHERE, UNKNOWN, refuse_others};
use crate::cli::{Report, plan::DRAWN, written::Written};

/// What a study of absolute readings takes besides.
#[derive(Debug, Args)]
pub struct AbsoluteStudyArgs {
    /// With design.accuracy = "absolute", what is unknown, frames of stations and targets always among it; what the scenario's
    /// robot.parameters name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    parameters: Vec<ParameterGroup>,
    /// With design.accuracy = "absolute", choose plans from these rows alone (CSV: joint angles, loads, targets, stations)
    #[arg(long, value_name = "FILE")]
    candidates: Option<PathBuf>,
    /// With design.accuracy = "absolute" and without --candidates, begin with so many configurations at random [default: 200]
    #[arg(long, value_name = "N", conflicts_with = "candidates", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    draw: Option<u32>,
}

impl AbsoluteStudyArgs {
    /// The file of candidates.
    pub fn path(&self) -> Option<&Path> {
        self.candidates.as_deref()
    }
}

impl StudyCommand {
    /// Refuses options, and keys, that are about plans of the other accuracy.
    pub(super) fn refuse_others(&self, scenario: &Scenario) -> Result<(), FileError> {
        let of_deflections = [
            ("--level model", self.level == Some(Level::Model)),
            ("--rerun", self.rerun.is_some()),
        ];
        let absolute = &self.absolute;
        let of_readings = [
            ("--parameters", !absolute.parameters.is_empty(), UNKNOWN),
            ("--candidates", absolute.candidates.is_some(), ANYWHERE),
            ("--draw", absolute.draw.is_some(), ANYWHERE),
        ];
        refuse_others(scenario, &of_deflections, &of_readings)?;
        match scenario.task.design.accuracy {
            AccuracyKind::Absolute => check(scenario),
            AccuracyKind::Relative => Ok(()),
        }
    }

    /// So many runs of each plan, or a shard of them.
    pub(super) fn absolute_readings(
        &self,
        scenario: &Scenario,
        folder: &Path,
        [trials, shard, shards]: [u64; 3],
    ) -> anyhow::Result<Report> {
        let common = &self.common;
        let given = &self.absolute;
        let rows = (given.candidates.as_ref())
            .map(|path| read_candidates(path, scenario.task.belief.commands()))
            .transpose()?;
        let configurations = given.draw.unwrap_or(DRAWN);
        let groups = &given.parameters;
        let wanted = AbsoluteStudyWanted {
            groups,
            candidates: rows.as_deref(),
            configurations,
        };
        let quiet = |_: usize, _: usize, _: f64| {};
        let watch = |name: &str, readings: u32| {
            let readings = counted(readings.into(), "absolute reading");
            common.say(&format!("designing the plan {name:?} of {readings}"));
            Watch {
                stop: &STOP,
                progress: &quiet,
            }
        };
        let path = given.candidates.as_deref().unwrap_or(&scenario.path);
        let entries =
            entries(scenario, &wanted, &watch).map_err(|error| explained(path, &error))?;
        proceed()?;
        let (task, truth, seed) = (&scenario.task, &scenario.truth, scenario.seed);
        let runner = AbsoluteRunner::new((task, truth), groups, seed, &entries)?;
        let runner = runner.stopped_by(ask_work());
        let absolute = AbsoluteStudyHeader {
            test_poses: task.test_poses.len(),
            groups: groups.clone(),
            candidates_sha256: (given.path().map(sha256_of).transpose()?)
                .map(|hash| hexadecimal(&hash)),
            drawn: given.candidates.is_none().then_some(configurations),
        };
        let sizes = [trials, shards];
        let header = Header::of_absolute(scenario, absolute, sizes, (&entries, &runner));
        let mut part = match &self.resume {
            Some(path) => TallyFile::resume(path, header, shard)?,
            None => TallyFile::empty(header, shard),
        };
        common.say(&format!(
            "{trials} virtual robots for {}",
            part.header.title()
        ));
        let start = Instant::now();
        let done_before = runs_of(&part);
        let mut written = Written::default();
        self.run(&runner, &mut part, None, &mut written)
            .map_err(|error| self.unless_stopped(error, &part))?;
        if let Some(path) = &self.tally_out {
            written.note(path, part.write(path));
        }
        let timing = Timing {
            elapsed_s: start.elapsed().as_secs_f64(),
            runs: runs_of(&part) - done_before,
        };
        let results = Results::new(&part.header, &part.tallies, Some(timing));
        if self.shard.is_none() {
            write(folder, &results, &mut written)?;
        }
        let mut report = self.reported(&results, folder);
        report.conditions.extend(written.conditions());
        Ok(report)
    }
}
