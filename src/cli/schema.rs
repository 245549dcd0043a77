//! `schema`: the scenario's JSON schema.

use crate::scenario::scenario_schema;
use clap::Args;

use super::Report;

#[derive(Debug, Args)]
pub struct Schema {}

impl Schema {
    /// It is JSON, whether or not results are wanted as such.
    #[expect(clippy::unused_self, reason = "as every command")]
    pub fn execute(&self) -> anyhow::Result<Report> {
        let json = scenario_schema();
        let text = serde_json::to_string_pretty(&json)? + "\n";
        Ok(Report::new(json, text, Vec::new()))
    }
}
