//! `replay`: one run of the study on the virtual robot, recorded.

use clap::Args;
use elastocal::calibration::{Calibration, calibrate};
use elastocal::files::make_folder;
use elastocal::plan::{Plan, search::random_plan};
use elastocal::record::messages::{CalibrationMessage, ProvenanceMessage};
use elastocal::scenario::Scenario;
use elastocal::study::{Conditions, Entry, EntryKind, Setting};
use elastocal::view::recording::Recording;
use serde_json::json;

use super::interruption::proceed;
use super::study::entries;
use super::table::table_of;
use super::views::{REPLAY_ENDINGS, write_recording};
use super::written::Written;
use super::{Common, Report, inputs, results};

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub struct Replay {
    #[command(flatten)]
    pub common: Common,
    /// The number of the run, from 0.
    #[arg(long, value_name = "R")]
    run: u64,
}

impl Replay {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let mut scenario = common.load_relative()?;
        let folder = common.folder(&scenario);
        let record = format!("replay_{}.json", self.run);
        let mut roles = inputs(&scenario);
        roles.writes_to(&folder, &[&record]);
        for ending in REPLAY_ENDINGS {
            roles.writes_to(&folder, &[&format!("replay_{}.{ending}", self.run)]);
        }
        roles.check()?;
        make_folder(&folder)?;
        // The first conditions of a sweep stand for all.
        scenario.study.conditions.truncate(1);
        let settings = scenario.settings();
        let entries = entries(common, &scenario, &settings)?;
        proceed()?;
        let Setting {
            conditions, task, ..
        } = settings[0].clone();
        scenario.task = task;
        common.say(&format!(
            "replaying run {} with {} plans on the virtual robot",
            self.run,
            entries.len()
        ));
        let calibrations = (entries.iter())
            .map(|entry| {
                let plan = self.plan(&scenario, conditions, entry)?;
                Ok((
                    entry.name.clone(),
                    calibrate(
                        &scenario.task,
                        &scenario.truth,
                        &plan,
                        scenario.seed,
                        self.run,
                    )?,
                ))
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
        let commands = scenario.task.belief.commands();
        let messages: Vec<_> = (calibrations.iter())
            .map(|(name, calibration)| CalibrationMessage::new(&commands, name, calibration))
            .collect();
        let keys = json!({ "run": self.run, "plans": messages });
        let json = results("replay", &ProvenanceMessage::new(&scenario), keys);
        let text = serde_json::to_string_pretty(&json)? + "\n";
        let recording = Recording::new(&scenario, &calibrations)?;
        let mut written = Written::default();
        let record = folder.join(record);
        written.save(&record, &text);
        let shown = write_recording(&recording, &record, &mut written);
        let mut text = describe(&scenario, &calibrations);
        text += &format!("recorded in {}, .mcap and .json\n", shown.display());
        Ok(Report::new(json, text, written.conditions()))
    }

    /// What an entry measures in the run.
    fn plan(
        &self,
        scenario: &Scenario,
        conditions: Conditions,
        entry: &Entry,
    ) -> anyhow::Result<Plan> {
        Ok(match &entry.kind {
            EntryKind::Fixed(plan) | EntryKind::Random(plan) => plan.clone(),
            EntryKind::RandomEach => random_plan(
                &scenario.task,
                conditions.experiments,
                scenario.seed,
                self.run,
            )?,
        })
    }
}

/// The distance that each plan leaves at each test pose.
fn describe(scenario: &Scenario, calibrations: &[(String, Calibration)]) -> String {
    let mut header = vec!["plan".to_owned()];
    header.extend((scenario.task.test_poses.iter()).map(|pose| format!("{} [um]", pose.name)));
    let row = |(name, calibration): &(String, Calibration)| {
        let distance = |pose: &elastocal::calibration::CompensatedPose| {
            format!("{:.3}", pose.seen.residual_m.norm() * 1e6)
        };
        let mut row = vec![name.clone()];
        row.extend(calibration.poses.iter().map(distance));
        row
    };
    table_of(&header, calibrations.iter().map(row))
}
