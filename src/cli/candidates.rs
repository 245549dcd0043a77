//! `--candidates`: what a plan is chosen from.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::codes::ErrorCode;
use elastocal::experiment::read_candidates;
use elastocal::files::FileError;
use elastocal::plan::search::{Candidates, LeftOutCandidates, SearchError};
use elastocal::quantities::limits::MOST_NAMED;
use elastocal::robot::Load;
use elastocal::task::{Task, TestPose};
use elastocal::text::wording::counted;

/// What a plan is chosen from.
#[derive(Debug, Args)]
pub struct CandidateArgs {
    /// Choose from these rows alone (CSV: joint angles, loads); that no plan of them is better than the bound is proved by
    /// looking at all
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["prove", "prove_time", "no_proof", "proof_out"]
    )]
    candidates: Option<PathBuf>,
}

impl CandidateArgs {
    /// The candidates that a task allows, where a file was given.
    pub fn read(&self, task: &Task) -> Result<Option<Candidates>, FileError> {
        let Some(path) = &self.candidates else {
            return Ok(None);
        };
        let rows = read_candidates(path, task.belief.commands())?;
        let candidates = Candidates::new(task, &rows).map_err(|error| {
            FileError::new(path, error.to_string())
                .code(ErrorCode::CandidateFile)
                .hint(error.hint())
        })?;
        Ok(Some(candidates))
    }

    /// The file.
    pub fn path(&self) -> Option<&Path> {
        self.candidates.as_deref()
    }

    /// Why no plan can be made of the file's rows.
    pub fn wrong(&self, error: SearchError) -> anyhow::Error {
        match &self.candidates {
            Some(path) => FileError::new(path, error.to_string())
                .code(ErrorCode::NoPlan)
                .into(),
            None => error.into(),
        }
    }
}

/// Where the robot must be accurate, in place of the scenario's test poses.
#[derive(Debug, Args)]
pub struct PoseArgs {
    /// Be accurate at these poses, of a path or a region, in place of the scenario's (CSV: joint angles, and loads at the
    /// machining tool; without loads, that of the scenario's first test pose)
    #[arg(long, value_name = "FILE")]
    test_poses: Option<PathBuf>,
}

impl PoseArgs {
    /// The file.
    pub fn path(&self) -> Option<&Path> {
        self.test_poses.as_deref()
    }

    /// Puts the poses of the file in place of a task's, where one was given.
    pub fn replace(&self, task: &mut Task) -> Result<(), FileError> {
        let Some(path) = &self.test_poses else {
            return Ok(());
        };
        let rows = read_candidates(path, task.belief.commands())?;
        if rows.len() > MOST_NAMED {
            let problem = format!(
                "found {} poses; at most {MOST_NAMED} are allowed",
                rows.len()
            );
            return Err(FileError::new(path, problem).code(ErrorCode::CandidateFile));
        }
        let first = task.test_poses.first();
        let load = first.map_or(Load::NONE, |pose| pose.load);
        let turns = first.is_some_and(|pose| pose.load_axes.is_some());
        if turns && rows.iter().any(|row| row.load.is_none()) {
            let problem = "found no loads, and that of the scenario's first test pose is in the tool's frame, which turns with the pose";
            let hint = "give the columns fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm";
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
                let problem = format!("found the column {column:?}, which test poses do not have");
                return Err(FileError::new(path, problem).code(ErrorCode::CandidateFile));
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

/// What the bound is about, and which candidates of a file are not possible.
pub fn told(args: &CandidateArgs, candidates: &Candidates) -> String {
    let mut text = format!(
        "The bound is about plans of these {}, all of which were looked at.\n",
        counted(candidates.experiments.len() as u64, "candidate")
    );
    let left = candidates.offered - candidates.experiments.len();
    let file = (args.path()).map_or_else(String::new, |path| format!(" in {}", path.display()));
    let of = format!("{}{file}", candidates.offered);
    text += &left_out(&of, left, &candidates.left_out);
    text
}

/// How many of so many candidates are left out, and why; nothing where none is.
pub fn left_out(of: &str, left: usize, reasons: &[LeftOutCandidates]) -> String {
    if left == 0 {
        return String::new();
    }
    let mut text = format!("Of {of}, {left} are left out:\n");
    for reason in reasons {
        text += &format!("  {reason}\n");
    }
    text
}
