//! `replay`: one run of the study on the virtual robot, recorded.

use crate::record::messages::ProvenanceMessage;
use crate::record::run::RunMessage;
use crate::study::Entry;
use crate::view::recording::Recording;
use crate::workflow::study::refuse_others;

use super::command_prelude::*;
use super::interruption::proceed;
use super::plan_args::ReadingsArgs;
use super::results;
use super::views::{carried_out, write_recording};
use super::written::record_text;

#[derive(Debug, Args)]
pub struct Replay {
    #[command(flatten)]
    pub common: Common,
    /// The number of the run, from 0.
    #[arg(long, value_name = "R")]
    run: u64,
    #[command(flatten)]
    readings: ReadingsArgs,
}

impl Replay {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let mut scenario = common.open("replay")?;
        refuse_others(&scenario)?;
        let [record, mcap, rerun] =
            ["json", "mcap", "rrd"].map(|ending| format!("replay_{}.{ending}", self.run));
        let folder = common.results_folder(&scenario, &[&record, &mcap, &rerun])?;
        // The first conditions of a sweep stand for all.
        let others = scenario.study.conditions.split_off(1);
        let settings = scenario.settings();
        let candidates = self.readings.candidates(&scenario)?;
        let entries =
            (self.readings).entries(common, &scenario, &settings, candidates.as_deref())?;
        proceed()?;
        common.say(&format!(
            "replaying run {} with {} plans on the virtual robot",
            self.run,
            entries.len()
        ));
        let plan = |entry: &Entry<'_>| {
            let plan = entry.plan.as_ref();
            carried_out(&scenario, &settings[0], &entry.name, plan, self.run)
        };
        let plans: Vec<RunMessage> = entries.iter().map(plan).collect::<anyhow::Result<_>>()?;
        let of_setting = Scenario {
            task: settings[0].task.clone(),
            ..scenario.clone()
        };
        let recording = Recording::new(&of_setting, &plans)?;
        let records = recording.calibrations.iter().map(|each| &each.record);
        let records: Vec<&RunMessage> = records.collect();
        let shown = settings[0].conditions;
        let accuracy = scenario.task.design.accuracy;
        let names: Vec<String> = others.iter().map(|each| each.described(accuracy)).collect();
        let of_sweep = (!names.is_empty()).then(|| {
            let (shown, names) = (shown.described(accuracy), names.join("; "));
            format!("the run is shown under the first conditions of study.sweep: {shown}. The others: {names}")
        });
        let notes: Vec<String> = of_sweep.into_iter().collect();
        let keys = json!({
            "run": self.run,
            "experiments": shown.experiments,
            "sigma_mm": shown.sigma_mm(accuracy),
            "load_scale": shown.load_scale,
            "notes": notes,
            "plans": records,
        });
        let json = results("replay", &ProvenanceMessage::new(&scenario), [keys]);
        let said = describe(&scenario, &records) + &noted(&notes);
        let within = |run: &&RunMessage| {
            let plan = format!("plan {:?}", run.name);
            let found = run.conditions.iter();
            found.map(|each| each.within(&plan)).collect::<Vec<_>>()
        };
        let found = records.iter().flat_map(within);
        let mut report = Report::new(json, said, found.collect());
        let (text, record) = (
            record_text(&mut report.json, &report.conditions)?,
            folder.join(record),
        );
        report.written.save(&record, &text);
        let shown = write_recording(&recording, &record, &mut report.written);
        report.text += &format!("recorded in {}, .mcap and .json\n", shown.display());
        Ok(report)
    }
}

/// The distance that each plan leaves at each test pose.
fn describe(scenario: &Scenario, plans: &[&RunMessage]) -> String {
    let mut header = vec!["plan".to_owned()];
    header.extend((scenario.task.test_poses.iter()).map(|pose| format!("{} [um]", pose.name)));
    let row = |plan: &&RunMessage| {
        let residuals = plan.test_poses.iter().map(|pose| pose.residual_mm);
        let residuals = residuals.map(|residual_mm| format!("{:.3}", residual_mm * 1e3));
        [plan.name.clone()].into_iter().chain(residuals).collect()
    };
    aligned(&header, plans.iter().map(row))
}
