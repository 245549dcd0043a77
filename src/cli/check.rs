//! `check`: is the scenario valid, and is the plan possible?

use std::path::PathBuf;

use clap::Args;
use elastocal::plan::{Feasibility, read_plan};
use serde_json::json;

use super::{Common, Report};

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
                    let problems = [error.to_string()];
                    super::print(&format!(
                        "{}\n",
                        json!({ "ok": false, "problems": problems })
                    ))?;
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
        Ok(Report {
            json: json!({ "ok": problems.is_empty(), "problems": problems }),
            text,
            conditions,
        })
    }
}
