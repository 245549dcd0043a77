//! `--candidates`: what a plan is chosen from.

use std::path::PathBuf;

use clap::Args;
use elastocal::experiment::read_candidates;
use elastocal::files::FileError;
use elastocal::files::roles::Roles;
use elastocal::plan::search::Candidates;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::task::Task;
use elastocal::text::wording::counted;

/// What a plan is chosen from.
#[derive(Debug, Args)]
pub struct CandidateArgs {
    /// Choose from these rows alone (CSV: joint angles, loads); that no plan of them is better than the bound is proved by
    /// looking at all
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["prove", "prove_time", "no_proof", "proof_out", "prove_exchanges"]
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
        let candidates = Candidates::new(task, &rows)
            .map_err(|error| FileError::new(path, error.to_string()).hint(error.hint()))?;
        Ok(Some(candidates))
    }

    /// The file as one that is read.
    pub fn role<'a>(&self, roles: &'a mut Roles) -> &'a mut Roles {
        if let Some(path) = &self.candidates {
            roles.reads("the candidates", path);
        }
        roles
    }

    /// The provenance of what depends on the file.
    pub fn of(&self, provenance: ProvenanceMessage) -> Result<ProvenanceMessage, FileError> {
        match &self.candidates {
            Some(path) => provenance.with_input("candidates", path),
            None => Ok(provenance),
        }
    }
}

/// What the bound is about, and which candidates are not possible.
pub fn told(candidates: &Candidates) -> String {
    let mut text = format!(
        "The bound is about plans of these {}, all of which were looked at.\n",
        counted(candidates.experiments.len() as u64, "candidate")
    );
    let left = candidates.offered - candidates.experiments.len();
    if left > 0 {
        text += &format!("Of {}, {left} are left out:\n", candidates.offered);
        for reason in &candidates.left_out {
            text += &format!("  {reason}\n");
        }
    }
    text
}
