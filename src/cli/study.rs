//! `study`: how good are the scenario's plans over many runs?

use std::time::Instant;

use clap::Args;
use elastocal::files::{make_folder, write_whole};
use elastocal::output::messages::ProvenanceMessage;
use elastocal::output::study::{StudyPlanMessage, study_csv};
use elastocal::plan::Plan;
use elastocal::plan::search::random_plan;
use elastocal::scenario::{Level, Scenario, StudyPlan, StudySource};
use elastocal::study::runner::{Runner, reference};
use elastocal::study::summary::Summary;
use elastocal::study::{Entry, EntryKind, repeated};
use indicatif::ProgressStyle;
use serde_json::json;

use super::plan::design;
use super::progress::bar;
use super::table::{number, table};
use super::{Common, Report};

/// Arguments of `study`.
#[derive(Debug, Args)]
pub struct StudyCommand {
    #[command(flatten)]
    pub common: Common,
    /// The number of runs; the scenario's if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000_000))]
    trials: Option<u64>,
    /// What the runs are made of; the scenario's if not given.
    #[arg(long, value_enum)]
    level: Option<Level>,
}

impl StudyCommand {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.load()?;
        let folder = common.out.join(&scenario.name);
        // Whether results can be written is found out before the work is done.
        make_folder(&folder)?;
        let trials = self.trials.unwrap_or(scenario.study.trials);
        let level = self.level.unwrap_or(scenario.study.level);
        let experiments = scenario.study.experiments;

        let entries = (scenario.study.plans.iter())
            .map(|plan| entry(common, &scenario, plan))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let runner = Runner::new(&scenario, level, experiments, &entries)?;
        common.say(&format!(
            "{trials} runs of {} plans with {experiments} measurements each, {}",
            entries.len(),
            describe_level(level)
        ));
        let bar = bar(common.quiet, "runs");
        let template = "{prefix} {bar:30} {human_pos}/{human_len} {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(template)?);
        bar.set_length(trials);
        let start = Instant::now();
        let tallies = runner.run(trials, 0..runner.blocks(trials), 1, &|runs| bar.inc(runs))?;
        bar.finish_and_clear();
        let elapsed_s = start.elapsed().as_secs_f64();

        let reference = reference(&entries);
        let sigma_m = scenario.instrument.sigma_m;
        let parameters = scenario.parameters.len();
        let messages: Vec<StudyPlanMessage> = entries
            .iter()
            .zip(&tallies)
            .enumerate()
            .map(|(index, (entry, tally))| {
                let reference = reference
                    .filter(|&other| other != index)
                    .map(|other| &tallies[other]);
                let summary = Summary::new(tally, sigma_m, parameters, reference);
                StudyPlanMessage::new(
                    &entry.name,
                    experiments,
                    parameters,
                    tally,
                    summary.as_ref(),
                )
            })
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "far below 2^52 runs")]
        let runs_per_s = trials as f64 / elapsed_s;
        let json = json!({
            "provenance": ProvenanceMessage::new(&scenario),
            "trials": trials,
            "level": level,
            "experiments": experiments,
            "parameters": scenario.parameter_names(),
            "reference": reference.map(|index| &entries[index].name),
            "plans": messages,
            "elapsed_s": elapsed_s,
            "runs_per_s": runs_per_s,
        });
        let text = serde_json::to_string_pretty(&json)? + "\n";
        write_whole(&folder.join("study.json"), text.as_bytes())?;
        write_whole(&folder.join("study.csv"), study_csv(&messages).as_bytes())?;
        let mut text = describe(&messages);
        text += &sentence(
            &messages,
            reference.map(|index| entries[index].name.as_str()),
        );
        text += &format!(
            "{trials} runs of each plan, {}, in {elapsed_s:.2} s. Results are in {}\n",
            describe_level(level),
            folder.display()
        );
        let conditions = messages
            .iter()
            .filter(|message| message.failed > 0)
            .map(|message| {
                let reasons: Vec<String> = (message.failures.iter())
                    .map(|(reason, count)| format!("{count}: {reason}"))
                    .collect();
                format!(
                    "{} of {trials} runs failed with the plan {:?} ({})",
                    message.failed,
                    message.name,
                    reasons.join("; ")
                )
            })
            .collect();
        Ok(Report {
            json,
            text,
            conditions,
        })
    }
}

const fn describe_level(level: Level) -> &'static str {
    match level {
        Level::Model => "by the linear model",
        Level::Robot => "on the virtual robot",
    }
}

/// Reads, designs or draws a plan, and repeats it as a whole.
fn entry(common: &Common, scenario: &Scenario, plan: &StudyPlan) -> anyhow::Result<Entry> {
    let experiments = scenario.study.experiments;
    let whole = |plan: &Plan| {
        let found = plan.measurements();
        repeated(plan, experiments).ok_or_else(|| {
            anyhow::anyhow!(
                "{found} measurements do not make up {experiments} by whole repetitions"
            )
        })
    };
    let kind = match &plan.source {
        StudySource::File(plan) => EntryKind::Fixed(whole(plan)?),
        StudySource::Optimal {
            criterion,
            configurations,
            experiments,
        } => {
            common.say(&format!(
                "designing the plan {:?} of {experiments} measurements",
                plan.name
            ));
            let designed = design(common, scenario, *criterion, *experiments, *configurations)?;
            EntryKind::Fixed(whole(&designed.exact.plan)?)
        }
        StudySource::Random => EntryKind::Random(random_plan(scenario, experiments, 0)?),
        StudySource::RandomEach => EntryKind::RandomEach,
    };
    let name = plan.name.clone();
    Ok(Entry { name, kind })
}

/// The table for a person.
fn describe(messages: &[StudyPlanMessage]) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let rows: Vec<Vec<String>> = messages
        .iter()
        .map(|message| {
            let interval = message.mean_ci95_mm.map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{:.3} to {:.3}", low * 1e3, high * 1e3),
            );
            vec![
                message.name.clone(),
                micro(message.mean_mm),
                interval,
                micro(message.rms_mm),
                micro(message.predicted_rms_mm),
                number(message.z, 1),
                micro(message.quantiles_mm.map(|quantiles| quantiles[2])),
                number(message.nees, 3),
                message.failed.to_string(),
            ]
        })
        .collect();
    let header = [
        "plan",
        "mean [um]",
        "95 % interval [um]",
        "rms [um]",
        "predicted rms [um]",
        "z",
        "95 % below [um]",
        "NEES",
        "failed",
    ];
    table(&header, &rows)
}

/// What it comes to: the best plan against a random one.
fn sentence(messages: &[StudyPlanMessage], reference: Option<&str>) -> String {
    let best = messages
        .iter()
        .filter(|message| Some(message.name.as_str()) != reference)
        .filter_map(|message| Some((message, message.mean_mm?)))
        .min_by(|one, other| one.1.total_cmp(&other.1));
    let Some((best, mean_mm)) = best else {
        return "\n".to_owned();
    };
    let mut text = format!(
        "\nAfter calibration with the plan {:?}, compensation leaves {:.2} um on average",
        best.name,
        mean_mm * 1e3
    );
    let random = (messages.iter())
        .find(|message| Some(message.name.as_str()) == reference)
        .and_then(|message| message.mean_mm);
    if let (Some(random), Some([low, high])) = (random, best.mean_ratio_to_random_ci95) {
        text += &format!(
            "; with a random plan of as many measurements it is {:.2} um, {:.2} times as much ({:.2} to {:.2})",
            random * 1e3,
            random / mean_mm,
            high.recip(),
            low.recip()
        );
    }
    text + ".\n"
}
