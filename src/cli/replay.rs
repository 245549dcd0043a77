//! `replay`: one run of the study on the virtual robot, recorded.

use clap::Args;
use elastocal::calibration::calibrate;
use elastocal::files::make_folder;
use elastocal::plan::search::random_plan;
use elastocal::record::messages::{CalibrationMessage, ProvenanceMessage};
use elastocal::scenario::Scenario;
use elastocal::study::{Conditions, Entry, EntryKind, Setting};
use elastocal::task::AccuracyKind;
use elastocal::view::recording::{CarriedOutPlan, Recording};
use elastocal::workflow::run_absolute::replay_readings;
use elastocal::workflow::study::refuse_others;
use serde_json::{Value, json};

use super::interruption::proceed;
use super::readings_args::ReadingsArgs;
use super::study::results::noted;
use super::table::table_of;
use super::views::write_recording;
use super::written::Written;
use super::{Common, Report, results};

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

/// A plan's run.
struct ReplayedPlan {
    name: String,
    record: Value,
    /// The distance (mm) at each test pose.
    residuals_mm: Vec<f64>,
    /// What is shown.
    shown: CarriedOutPlan,
}

impl Replay {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let mut scenario = common.open("replay")?;
        refuse_others(&scenario)?;
        let folder = common.folder(&scenario);
        let [record, mcap, rerun] =
            ["json", "mcap", "rrd"].map(|ending| format!("replay_{}.{ending}", self.run));
        common.check_files(&scenario, Some((&folder, &[&record, &mcap, &rerun])))?;
        make_folder(&folder)?;
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
        let plans = (entries.iter())
            .map(|entry| self.replayed(&settings[0], &scenario, entry))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let records: Vec<&Value> = plans.iter().map(|plan| &plan.record).collect();
        let shown = settings[0].conditions;
        let accuracy = scenario.task.design.accuracy;
        let notes: Vec<String> = of_sweep(accuracy, &shown, &others).into_iter().collect();
        let keys = json!({
            "run": self.run,
            "experiments": shown.experiments,
            "sigma_mm": shown.sigma_mm(accuracy),
            "load_scale": shown.load_scale,
            "notes": notes,
            "plans": records,
        });
        let json = results("replay", &ProvenanceMessage::new(&scenario), keys);
        let mut text = describe(&scenario, &plans) + &noted(&notes);
        let mut written = Written::default();
        let record = folder.join(record);
        written.save(&record, &(serde_json::to_string_pretty(&json)? + "\n"));
        let shown: Vec<CarriedOutPlan> = plans.into_iter().map(|plan| plan.shown).collect();
        let scenario = Scenario {
            task: settings[0].task.clone(),
            ..scenario.clone()
        };
        let recording = Recording::new(&scenario, &shown)?;
        let shown = write_recording(&recording, &record, &mut written);
        text += &format!("recorded in {}, .mcap and .json\n", shown.display());
        Ok(Report::new(json, text, written.conditions()))
    }

    /// What an entry gives in the run.
    fn replayed(
        &self,
        setting: &Setting<'_>,
        scenario: &Scenario,
        entry: &Entry<'_>,
    ) -> anyhow::Result<ReplayedPlan> {
        let (task, seed, name) = (&setting.task, scenario.seed, entry.name.clone());
        let plan = match &entry.kind {
            EntryKind::Fixed(plan) | EntryKind::Random(plan) => plan.clone(),
            EntryKind::RandomEach => {
                random_plan(task, setting.conditions.experiments, seed, self.run)?
            }
            EntryKind::Readings(readings) => {
                let studied = (&*name, &**readings);
                let (run, did) = replay_readings(scenario, setting, studied, [seed, self.run])?;
                return Ok(ReplayedPlan {
                    record: run.json()?,
                    residuals_mm: run.test_poses.iter().map(|pose| pose.residual_mm).collect(),
                    name,
                    shown: CarriedOutPlan::Readings(Box::new(run), did),
                });
            }
        };
        let calibration = calibrate(task, setting.truth, &plan, seed, self.run)?;
        let record = CalibrationMessage::new(&task.belief.commands(), &name, &calibration);
        Ok(ReplayedPlan {
            name: name.clone(),
            residuals_mm: (record.test_poses.iter())
                .map(|pose| pose.residual_mm)
                .collect(),
            record: serde_json::to_value(record)?,
            shown: CarriedOutPlan::Deflections(name, Box::new(calibration)),
        })
    }
}

/// Of which conditions of a sweep a run is shown, and of which it is not.
fn of_sweep(accuracy: AccuracyKind, shown: &Conditions, others: &[Conditions]) -> Option<String> {
    let names: Vec<String> = others.iter().map(|each| each.described(accuracy)).collect();
    (!others.is_empty()).then(|| {
        format!(
            "the run is shown under the first conditions of study.sweep: {}. The others: {}",
            shown.described(accuracy),
            names.join("; ")
        )
    })
}

/// The distance that each plan leaves at each test pose.
fn describe(scenario: &Scenario, plans: &[ReplayedPlan]) -> String {
    let mut header = vec!["plan".to_owned()];
    header.extend((scenario.task.test_poses.iter()).map(|pose| format!("{} [um]", pose.name)));
    let row = |plan: &ReplayedPlan| {
        let distances =
            (plan.residuals_mm.iter()).map(|residual_mm| format!("{:.3}", residual_mm * 1e3));
        std::iter::once(plan.name.clone())
            .chain(distances)
            .collect()
    };
    table_of(&header, plans.iter().map(row))
}
