//! `study` of plans of absolute readings.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::experiment::read_candidates;
use elastocal::files::{FileError, hexadecimal, sha256_of};
use elastocal::identification::ParameterGroup;
use elastocal::plan::search::Watch;
use elastocal::record::tally_file::{AbsoluteStudyHeader, Header, PlanHeader};
use elastocal::scenario::Scenario;
use elastocal::study::{Level, absolute::AbsoluteRunner};
use elastocal::task::AccuracyKind;
use elastocal::text::wording::counted;
use elastocal::workflow::absolute_study::{AbsoluteStudyWanted, check, entries, explained};

use super::StudyCommand;
use crate::cli::interruption::{STOP, ask_work, proceed};
use crate::cli::plan_args::{ANYWHERE, UNKNOWN, refuse_others};
use crate::cli::{Report, plan::DRAWN};

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

    /// Virtual robots for each plan.
    pub(super) fn absolute_readings(&self, scenario: &Scenario) -> anyhow::Result<Report> {
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
        let watch = |name: &str, readings: u32| {
            let readings = counted(readings.into(), "absolute reading");
            common.say(&format!("designing the plan {name:?} of {readings}"));
            Watch::quiet(&STOP)
        };
        let path = given.path().unwrap_or(&scenario.path);
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
        let plans = PlanHeader::of_absolute(scenario, &entries, &runner);
        let part = self.begun(Header {
            absolute: Some(absolute),
            ..Header::new(scenario, Level::Robot, self.sizes(scenario), plans)
        })?;
        let (trials, title) = (part.header.trials, part.header.title());
        common.say(&format!("{trials} virtual robots for {title}"));
        self.finish(scenario, &runner, part, None)
    }
}
