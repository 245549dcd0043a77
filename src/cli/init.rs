//! `init`: a first scenario for a model.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::files::FileError;
use elastocal::files::output::{check_writable, write_whole};
use elastocal::record::json::merge;
use elastocal::record::messages::SchemaMessage;
use elastocal::record::platform::platform;
use elastocal::record::understanding::UnderstandingMessage;
use elastocal::workflow::init::draft;
use serde_json::json;

use super::Report;

/// Arguments of `init`.
#[derive(Debug, Args)]
pub struct Init {
    /// The robot's model: MJCF or URDF.
    model: PathBuf,
    /// Where to write the scenario; the model's name with .toml in the current folder if not given. A file
    /// that is there is never replaced.
    #[arg(long, value_name = "FILE")]
    scenario_out: Option<PathBuf>,
    /// The body or site at the arm's end, where the model has several arms.
    #[arg(long, value_name = "NAME")]
    tip: Option<String>,
    /// Print results as JSON.
    #[arg(long)]
    pub json: bool,
    /// Say nothing on stderr but errors.
    #[arg(long)]
    pub quiet: bool,
}

impl Init {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let path = match &self.scenario_out {
            Some(path) => path.clone(),
            None => {
                Path::new(self.model.file_stem().unwrap_or("robot".as_ref())).with_extension("toml")
            }
        };
        if path.exists() {
            let wrong = FileError::new(&path, "is there already, and is not replaced");
            return Err(wrong
                .hint("give another file with --scenario-out, or move this one away")
                .into());
        }
        check_writable(&path)?;
        let draft = draft(&self.model, &path, self.tip.as_deref())?;
        if !self.quiet {
            for warning in &draft.understanding.warnings {
                elastocal::text::diagnostics::say(&format!("warning: {warning}"));
            }
        }
        write_whole(&path, draft.text.as_bytes())?;
        let mut text = super::check::describe(&draft.understanding);
        for sentence in &draft.found {
            text += &format!("{sentence}\n");
        }
        let shown = path.display();
        text += &format!(
            "wrote {shown}: give your numbers where it says GUESS, then elastocal check {shown} and elastocal plan {shown}\n"
        );
        let mut json = json!({
            "schema": SchemaMessage::new("init"),
            "provenance": {
                "version": elastocal::VERSION, "commit": elastocal::COMMIT, "platform": platform(),
            },
            "scenario_file": path,
            "found": draft.found,
        });
        merge(
            &mut json,
            serde_json::to_value(UnderstandingMessage::new(&draft.understanding))?,
        );
        Ok(Report {
            json,
            text,
            conditions: Vec::new(),
        })
    }
}
