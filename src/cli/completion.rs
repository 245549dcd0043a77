//! `completion`: what a shell completes.

use clap::{Args, CommandFactory};
use clap_complete::{Shell, generate};

use super::{Arguments, Report};

#[derive(Debug, Args)]
pub struct Completion {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

impl Completion {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let mut script = Vec::new();
        generate(
            self.shell,
            &mut Arguments::command(),
            "elastocal",
            &mut script,
        );
        let text = String::from_utf8(script)?;
        Ok(Report::new(
            serde_json::json!({ "completion": text }),
            text,
            Vec::new(),
        ))
    }
}
