//! `check`: is the scenario valid, and is the plan possible?

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::Args;
use elastocal::plan::{Feasibility, read_plan};
use elastocal::platform::platform;
use elastocal::record::messages::{ProvenanceMessage, SchemaMessage};
use serde_json::{Value, json};

use super::{Common, Report, results};

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct Check {
    #[command(flatten)]
    pub common: Common,
    /// A plan to check against the scenario.
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
}

impl Check {
    /// An invalid file is an error; a plan that violates the region is a condition.
    pub fn execute(&self) -> anyhow::Result<Report> {
        let checked = self.common.load().and_then(|scenario| {
            let plan = self.plan.as_deref();
            let plan = plan
                .map(|path| read_plan(path, scenario.joints()))
                .transpose()?;
            Ok((scenario, plan))
        });
        let (scenario, plan) = match checked {
            Ok(checked) => checked,
            Err(error) => {
                if self.common.json {
                    let json = self.broken(&error.to_string());
                    super::print(&(serde_json::to_string_pretty(&json)? + "\n"))?;
                }
                return Err(error);
            }
        };
        let problems: Vec<String> = plan
            .map(|plan| Feasibility::new(&scenario).violations(&plan))
            .unwrap_or_default()
            .iter()
            .map(ToString::to_string)
            .collect();
        let text = if problems.is_empty() {
            format!("{} is valid\n", self.common.scenario.display())
        } else {
            format!("{}\n", problems.join("\n"))
        };
        let conditions = if problems.is_empty() {
            Vec::new()
        } else {
            vec![super::evaluate::violated(problems.len())]
        };
        let json = json!({ "ok": problems.is_empty(), "problems": problems });
        Ok(Report {
            json: results("check", &ProvenanceMessage::new(&scenario), json),
            text,
            conditions,
        })
    }

    /// A broken scenario, or one with a broken plan, has neither seed nor hash here.
    fn broken(&self, problem: &str) -> Value {
        let [version, commit] = [elastocal::VERSION, elastocal::COMMIT];
        let scenario = (self.common.scenario.file_stem()).map(OsStr::to_string_lossy);
        json!({
            "schema": SchemaMessage::new("check"),
            "provenance": { "version": version, "commit": commit, "platform": platform(), "scenario": scenario },
            "ok": false,
            "problems": [problem],
        })
    }
}
