//! `init`: a first scenario for a model.

use crate::files::output::{check_writable, write_whole};
use crate::record::messages::{SchemaMessage, merge};
use crate::record::understanding::understanding_json;
use crate::scenario::scenario_schema;
use crate::text::wording::shell_path;
use crate::workflow::init::{SCHEMA_FILE, draft};

use super::command_prelude::*;
use super::{Said, program};

#[derive(Debug, Args)]
pub struct Init {
    /// The robot's model: MJCF or URDF.
    model: PathBuf,
    /// Where to write the scenario; the model's name with .toml in the current folder if not given. The schema that
    /// editors read stands beside it. A file that is there is never replaced.
    #[arg(long, value_name = "FILE")]
    scenario_out: Option<PathBuf>,
    /// The body or site at the arm's end, where the model has several arms, or a joint at the arm's end is taken for a gripper's.
    #[arg(long, value_name = "NAME")]
    tip: Option<String>,
    #[command(flatten)]
    pub said: Said,
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
                .code(ErrorCode::Overwrites)
                .hint("give another file with --scenario-out, or move this one away")
                .into());
        }
        let schema = path.with_file_name(SCHEMA_FILE);
        let is_schema_there = schema.exists();
        check_writable(&path)?;
        if !is_schema_there {
            check_writable(&schema)?;
        }
        let draft = draft(&self.model, &path, self.tip.as_deref())?;
        if !self.said.quiet {
            for warning in &draft.understanding.warnings {
                crate::text::diagnostics::say(&format!("warning: {warning}"));
            }
        }
        write_whole(&path, draft.text.as_bytes())?;
        if !is_schema_there {
            let text = serde_json::to_string_pretty(&scenario_schema())? + "\n";
            write_whole(&schema, text.as_bytes())?;
        }
        let mut text = super::check::describe(&draft.understanding);
        for sentence in &draft.found {
            text += &format!("{sentence}\n");
        }
        let shown = shell_path(&path);
        text += &format!(
            "wrote {}: give your numbers where it says GUESS, then elastocal check {shown} and elastocal plan {shown}\n\
             {SCHEMA_FILE} beside it has editors complete and check keys\n",
            path.display()
        );
        let mut json = json!({
            "schema": SchemaMessage::new("init"),
            "provenance": program(),
            "scenario_file": path,
            "found": draft.found,
        });
        merge(&mut json, understanding_json(&draft.understanding));
        Ok(Report::new(json, text, Vec::new()))
    }
}
