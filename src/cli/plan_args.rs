//! Which absolute readings may be planned, of a file of candidates or at sampled configurations; and what `plan` and `evaluate` take alike.

use crate::experiment::{Candidate, read_candidates};
use crate::identification::ParameterGroup;
use crate::plan::absolute::{DrawnWanted, ReadingsWanted};
use crate::plan::search::{Candidates, OfferedCandidates};
use crate::quantities::limits::MOST_NAMED;
use crate::robot::Load;
use crate::task::{Task, TestPose};
use clap::Arg;

use super::command_prelude::*;
use super::has_task;
use super::proof::ProofArgs;
use super::uncertainty_budget::BudgetArgs;

/// So many configurations are drawn where nothing else is said.
const DRAWN: u32 = 200;

/// What absolute readings are planned from.
#[derive(Debug, Args)]
pub struct ReadingsArgs {
    /// Choose absolute readings from these rows (CSV), with design.accuracy = "absolute".
    #[arg(long, value_name = "FILE")]
    pub candidates: Option<PathBuf>,
    /// Sample so many configurations in the region, where there are no --candidates, with design.accuracy = "absolute".
    #[arg(long, value_name = "N", conflicts_with = "candidates", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    draw: Option<u32>,
    /// What is unknown, with design.accuracy = "absolute": frames of stations and targets always; what the scenario's
    /// robot.parameters name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    pub parameters: Vec<ParameterGroup>,
}

impl ReadingsArgs {
    /// How many configurations are sampled where no file has candidates.
    pub fn configurations(&self) -> u32 {
        self.draw.unwrap_or(DRAWN)
    }

    /// The candidates of the file, where one was given.
    pub fn candidates(&self, scenario: &Scenario) -> Result<Option<Vec<Candidate>>, FileError> {
        let read = |path: &PathBuf| read_candidates(path, scenario.task.belief.commands());
        self.candidates.as_ref().map(read).transpose()
    }

    /// What plans are made of, from these candidates or where there are none.
    pub fn wanted<'a>(
        &'a self,
        scenario: &'a Scenario,
        candidates: Option<&'a [Candidate]>,
    ) -> ReadingsWanted<'a> {
        ReadingsWanted {
            groups: &self.parameters,
            measured: &[],
            candidates,
            path: self.candidates.as_deref().unwrap_or(&scenario.path),
            configurations: self.configurations(),
        }
    }
}

/// What `plan` and `evaluate` take alike.
#[derive(Debug, Args)]
pub struct PlanArgs {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub proof: ProofArgs,
    #[command(flatten)]
    pub readings: ReadingsArgs,
    /// Be accurate at these poses, of a path or a region, in place of the scenario's (CSV: joint angles, and loads at the
    /// machining tool; without loads, that of the scenario's first test pose)
    #[arg(long, value_name = "FILE")]
    test_poses: Option<PathBuf>,
    #[command(flatten)]
    pub budget: BudgetArgs,
    /// Where to write a page about the plan (HTML), with design.accuracy = "absolute".
    #[arg(long, value_name = "FILE")]
    pub report_out: Option<PathBuf>,
}

/// The option for candidates of a command that takes them of deflections, too.
pub fn of_any_plan(candidates: Arg) -> Arg {
    let help = "Choose from these rows alone (CSV: joint angles, loads); that no plan of them is better than the bound is proved by \
                looking at all";
    let bounds = ["prove", "prove_time", "no_proof", "proof_out"];
    candidates.help(help).conflicts_with_all(bounds)
}

impl PlanArgs {
    /// The scenario, with the test poses that are asked for.
    pub fn load(&self) -> anyhow::Result<Scenario> {
        let mut scenario = self.common.load()?;
        self.common.check_files(&scenario, None)?;
        self.replace_test_poses(&mut scenario.task)?;
        has_task(&scenario)?;
        Ok(scenario)
    }

    /// The candidates of the file that a task allows, where one was given.
    pub fn read_candidates(&self, task: &Task) -> Result<Option<Candidates>, FileError> {
        let Some(path) = &self.readings.candidates else {
            return Ok(None);
        };
        let rows = read_candidates(path, task.belief.commands())?;
        let candidates = Candidates::new(task, &rows).map_err(|error| {
            let wrong = FileError::new(path, error.to_string()).code(ErrorCode::CandidateFile);
            wrong.hinted(error.hint())
        })?;
        Ok(Some(candidates))
    }

    /// What the bound is about, and which candidates of the file are not possible.
    pub fn told(&self, offer: &OfferedCandidates) -> String {
        format!(
            "The bound is about plans of these {}, all of which were looked at.\n{}",
            counted(offer.possible as u64, "candidate"),
            left_out(
                &offer.offered.to_string(),
                self.readings.candidates.as_deref(),
                offer
            )
        )
    }

    /// Puts the poses of the file in place of a task's, where one was given.
    fn replace_test_poses(&self, task: &mut Task) -> Result<(), FileError> {
        let Some(path) = &self.test_poses else {
            return Ok(());
        };
        let wrong = |problem: String| FileError::new(path, problem).code(ErrorCode::CandidateFile);
        let rows = read_candidates(path, task.belief.commands())?;
        if rows.len() > MOST_NAMED {
            let found = rows.len();
            return Err(wrong(format!(
                "found {found} poses; at most {MOST_NAMED} are allowed"
            )));
        }
        let first = task.test_poses.first();
        let load = first.map_or(Load::NONE, |pose| pose.load);
        let turns = first.is_some_and(|pose| pose.load_axes.is_some());
        if turns && rows.iter().any(|row| row.load.is_none()) {
            let problem = "found no loads, and that of the scenario's first test pose is in the tool's frame, which turns with the pose";
            let hint = "give the columns fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm";
            return Err(FileError::new(path, problem).hint(hint));
        }
        if task.test_poses.iter().any(|pose| pose.direction.is_some()) {
            let problem = "found no directions, and the scenario's test poses count the error along directions";
            let hint =
                "list the poses as tables [[test_pose]], or leave the scenario's directions out";
            return Err(FileError::new(path, problem).hint(hint));
        }
        let weight = (rows.len() as f64).recip();
        let mut poses = Vec::new();
        for row in rows {
            let given = [
                ("target", row.target.is_some()),
                ("station", row.station.is_some()),
                ("repeats", row.most.is_some()),
                ("approach", row.approach.is_some()),
            ];
            if let Some((column, _)) = given.iter().find(|(_, is_given)| *is_given) {
                return Err(wrong(format!(
                    "found the column {column:?}, which test poses do not have"
                )));
            }
            poses.push(TestPose {
                name: format!("line {}", row.line),
                configuration_rad: row.configuration_rad,
                load: row.load.unwrap_or(load),
                load_axes: None,
                weight,
                direction: None,
            });
        }
        task.test_poses = poses;
        Ok(())
    }
}

/// What is to be known of the candidates of absolute readings: how they were sampled, and what is not said of others; or which of a file
/// are left out.
pub fn offered(
    sampled: Option<DrawnWanted>,
    file: Option<&Path>,
    offer: &OfferedCandidates,
) -> String {
    let Some(sampled) = sampled else {
        let candidates = counted(offer.offered as u64, "candidate");
        return left_out(&candidates, file, offer);
    };
    format!(
        "The candidates are {} at random (seed {}), without and with a load: {} of {} are possible; and others near those that \
         were chosen. The region has more: the bound is evidence, no proof.\n",
        counted(sampled.configurations.into(), "configuration"),
        sampled.seed,
        offer.possible,
        offer.offered
    )
}

/// How many of the candidates of a file, in words, are left out, and why; nothing where none is.
fn left_out(candidates: &str, file: Option<&Path>, offer: &OfferedCandidates) -> String {
    if offer.left_out.is_empty() {
        return String::new();
    }
    let file = file.map_or_else(String::new, |path| format!(" in {}", path.display()));
    let left = offer.offered - offer.possible;
    let mut text = format!("Of {candidates}{file}, {left} are left out:\n");
    for reason in &offer.left_out {
        text += &format!("  {reason}\n");
    }
    text
}
