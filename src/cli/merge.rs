//! `merge`: the shards of a study become one result.

use std::path::PathBuf;

use clap::Args;
use elastocal::files::make_folder;
use elastocal::study::tally_file::join;

use super::Report;
use super::study::results::{Results, write};

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// What `study --shard i/n --tally-out FILE` wrote, one file for each shard.
    #[arg(required = true, value_name = "FILES")]
    files: Vec<PathBuf>,
    /// Print results as JSON.
    #[arg(long)]
    pub json: bool,
    /// The folder for results.
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Say nothing on stderr but errors.
    #[arg(long)]
    pub quiet: bool,
}

impl Merge {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let (header, tallies) =
            join(&self.files)?.ok_or_else(|| anyhow::anyhow!("there is no file to merge"))?;
        let folder = self.out.join(&header.provenance.scenario);
        make_folder(&folder)?;
        let results = Results::new(&header, &tallies, None)?;
        write(&folder, &results)?;
        Ok(results.report(&folder))
    }
}
