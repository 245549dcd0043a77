//! Which absolute readings may be planned: of a file of candidates, or at sampled configurations.

use std::path::PathBuf;

use clap::Args;
use elastocal::experiment::{Candidate, read_candidates};
use elastocal::files::FileError;
use elastocal::identification::ParameterGroup;
use elastocal::plan::absolute::ReadingsWanted;
use elastocal::scenario::Scenario;

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
