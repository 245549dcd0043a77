//! `compensate`: the joint angles to command at the test poses.

use std::path::PathBuf;

use clap::Args;
use elastocal::calibration::{compensate_poses, pose_conditions};
use elastocal::identification::StoredIdentification;
use elastocal::record::messages::{ProvenanceMessage, TestPoseMessage};
use elastocal::task::Method;
use elastocal::testbed::TrueRobots;
use elastocal::wording::shell_word;
use serde_json::json;

use super::identified::read_identified;
use super::table::{number, table};
use super::{Common, Report, named_by_file, results, without_effect};

/// Arguments of `compensate`.
#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Compensate {
    #[command(flatten)]
    pub common: Common,
    /// What `identify --identified-out` wrote.
    #[arg(long, value_name = "FILE")]
    identified: PathBuf,
    /// How; the scenario's method if not given.
    #[arg(long, value_enum)]
    method: Option<Method>,
}

impl Compensate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let origin = StoredIdentification::origin(&self.identified)?;
        let file = shell_word(&self.identified.to_string_lossy());
        let usage = format!("elastocal compensate SCENARIO --identified {file}");
        let scenario = (self.common).load_for(&self.identified, origin.as_ref(), &usage)?;
        let identified = read_identified(&self.identified, &scenario)?;
        let method = self.method.unwrap_or(scenario.task.belief.method);
        self.common.say("compensating on the virtual robot");
        let (compliance, posterior) = (&identified.compliance_rad_per_nm, &identified.posterior);
        // The robot on which `measure` measures.
        let mut robots = TrueRobots::new(&scenario.task.belief, &scenario.truth)?;
        robots.become_run_of(&scenario.truth, 0, scenario.seed, 0)?;
        let poses = compensate_poses(&scenario.task, &mut robots, compliance, posterior, method)?;
        let mut conditions = identified.conditions;
        conditions.extend(pose_conditions(&scenario.task.belief, &poses));
        let commands = scenario.task.belief.commands();
        let messages: Vec<TestPoseMessage> = (poses.iter())
            .map(|each| TestPoseMessage::new(&commands, each))
            .collect();
        let rows: Vec<Vec<String>> = messages
            .iter()
            .map(|pose| {
                vec![
                    pose.name.clone(),
                    format!("{:.4}", pose.uncompensated_mm),
                    format!("{:.4}", pose.residual_mm),
                    number(pose.rho0_mm, 4),
                    pose.q_commanded_deg
                        .iter()
                        .map(|angle| format!("{angle:.5}"))
                        .collect::<Vec<_>>()
                        .join(" "),
                ]
            })
            .collect();
        let first = &messages[0];
        let provenance =
            ProvenanceMessage::new(&scenario).with_input("identified", &self.identified)?;
        Ok(Report {
            json: results(
                "compensate",
                &provenance,
                json!({
                    "q_commanded_deg": first.q_commanded_deg,
                    "uncompensated_mm": first.uncompensated_mm,
                    "residual_mm": first.residual_mm,
                    "rho0_mm": first.rho0_mm,
                    "test_poses": messages,
                }),
            ),
            text: table(
                &[
                    "test pose",
                    "uncompensated [mm]",
                    "compensated [mm]",
                    "predicted rms [mm]",
                    &format!("commanded angles [{}]", commands.unit()),
                ],
                &rows,
            ),
            conditions,
        })
    }
}
