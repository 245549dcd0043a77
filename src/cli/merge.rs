//! `merge`: the shards of a study become one result.

use crate::files::{make_folder, roles::Roles};
use crate::record::tally_file::join;

use super::command_prelude::*;
use super::study::results::{FILES, Results, write};
use super::views::STUDY_PAGE;
use super::{Accepted, Said};

#[derive(Debug, Args)]
pub struct Merge {
    /// What `study --shard i/n --tally-out FILE` wrote, one file for each shard.
    #[arg(required = true, value_name = "FILES")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    pub said: Said,
    /// The folder for results.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    #[command(flatten)]
    pub accepted: Accepted,
}

impl Merge {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let (header, tallies) =
            join(&self.files)?.ok_or_else(|| anyhow::anyhow!("there is no file to merge"))?;
        let folder = self.out.join(&header.provenance.scenario);
        let mut roles = Roles::default();
        for file in &self.files {
            roles.reads("a tally", file);
        }
        roles.writes_to(&folder, &FILES);
        roles.writes_to(&folder, &[STUDY_PAGE]).check()?;
        make_folder(&folder)?;
        let results = Results::new(&header, &tallies, None);
        let mut report = results.report(&folder)?;
        write(&folder, &results, &mut report.written)?;
        Ok(report)
    }
}
