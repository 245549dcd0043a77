//! `study`: how good are the scenario's plans over many runs?

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use elastocal::files::{check_writable, make_folder, write_whole};
use elastocal::output::report::{StudyRecord, study_page};
use elastocal::output::study::{StudyPlanMessage, study_csv};
use elastocal::plan::Plan;
use elastocal::plan::search::random_plan;
use elastocal::scenario::{Level, Scenario, StudyPlan, StudySource};
use elastocal::study::runner::Runner;
use elastocal::study::summary::Summary;
use elastocal::study::tally::Tally;
use elastocal::study::tally_file::{Header, TallyFile};
use elastocal::study::{Entry, EntryKind, repeated};
use indicatif::ProgressStyle;
use serde_json::{Value, json};

use super::evaluate::merge;
use super::plan::design;
use super::progress::bar;
use super::table::{number, table};
use super::{Common, Report, command_line};

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
    /// Make only part i of n of the runs, for `elastocal merge`.
    #[arg(long, value_name = "I/N", value_parser = parse_shard, requires = "tally_out")]
    shard: Option<(u64, u64)>,
    /// Where to write the tally, for `elastocal merge`.
    #[arg(long, value_name = "FILE")]
    tally_out: Option<PathBuf>,
    /// Keep the tally in this file while running, and go on from it if it is there.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
}

fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    let parsed = text
        .split_once('/')
        .and_then(|(shard, shards)| Some((shard.parse().ok()?, shards.parse().ok()?)));
    match parsed {
        Some((shard, shards)) if (1..=shards).contains(&shard) && shards <= 1_000_000 => {
            Ok((shard, shards))
        }
        _ => Err("1/4 is the first part of four".to_owned()),
    }
}

/// A tally that can be gone on from is saved so often (s).
const SAVE_S: f64 = 5.0;

impl StudyCommand {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.load()?;
        let folder = common.out.join(&scenario.name);
        // Whether results can be written is found out before the work is done.
        for path in [&self.tally_out, &self.resume].into_iter().flatten() {
            check_writable(path)?;
        }
        if self.shard.is_none() {
            make_folder(&folder)?;
        }
        let trials = self.trials.unwrap_or(scenario.study.trials);
        let level = self.level.unwrap_or(scenario.study.level);
        let (shard, shards) = self.shard.unwrap_or((1, 1));

        let entries = (scenario.study.plans.iter())
            .map(|plan| entry(common, &scenario, plan))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let experiments = scenario.study.experiments;
        let runner = Runner::new(&scenario, level, experiments, &entries)?;
        let header = Header::new(&scenario, level, trials, shards, &entries);
        let mut part = match &self.resume {
            Some(path) => TallyFile::resume(path, header, shard)?,
            None => TallyFile::empty(header, shard),
        };
        common.say(&format!(
            "{trials} runs of {} plans with {experiments} measurements each, {}",
            entries.len(),
            describe_level(level)
        ));
        let start = Instant::now();
        let done_before: u64 = runs_of(&part);
        self.run(&runner, &mut part)?;
        let elapsed_s = start.elapsed().as_secs_f64();
        if let Some(path) = &self.tally_out {
            part.write(path)?;
        }
        let timing = Timing {
            elapsed_s,
            runs: runs_of(&part) - done_before,
        };
        let results = Results::new(&part.header, &part.tallies, Some(timing))?;
        if self.shard.is_some() {
            let mut report = results.report(&folder);
            report.text = format!(
                "shard {shard} of {shards}:\n{}",
                describe(&results.messages)
            );
            merge(
                &mut report.json,
                json!({ "shard": shard, "shards": shards }),
            );
            return Ok(report);
        }
        write(&folder, &results)?;
        Ok(results.report(&folder))
    }

    /// Makes what is left of the shard's blocks, and saves it from time to time.
    fn run(&self, runner: &Runner<'_>, part: &mut TallyFile) -> anyhow::Result<()> {
        let (trials, step) = (part.header.trials, part.header.shards);
        let all = part.header.blocks_of(part.shard);
        let bar = bar(self.common.quiet, "runs");
        let template = "{prefix} {bar:30} {human_pos}/{human_len} {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(template)?);
        bar.set_length((all * runner.block_runs()).min(trials));
        bar.set_position(part.blocks_done * runner.block_runs());
        bar.reset_eta();
        // Rounds of blocks, as long as it takes to be worth saving.
        let mut round = if self.resume.is_some() { 16 } else { all };
        while part.blocks_done < all {
            let start = Instant::now();
            let count = round.min(all - part.blocks_done);
            let first = part.shard - 1 + part.blocks_done * step;
            let end = first + (count - 1) * step + 1;
            let tallies = runner.run(trials, first..end, step, &|runs| bar.inc(runs))?;
            for (all, new) in part.tallies.iter_mut().zip(&tallies) {
                all.merge(new);
            }
            part.blocks_done += count;
            let elapsed_s = start.elapsed().as_secs_f64();
            if let Some(path) = &self.resume {
                if elapsed_s > SAVE_S / 2.0 || part.blocks_done == all {
                    part.write(path)?;
                } else {
                    round *= 2;
                }
            }
        }
        bar.finish_and_clear();
        Ok(())
    }
}

/// The runs that a tally holds.
fn runs_of(part: &TallyFile) -> u64 {
    (part.tallies.first()).map_or(0, |tally| tally.runs + tally.failures())
}

/// How long how many runs took.
#[derive(Debug, Clone, Copy)]
pub struct Timing {
    elapsed_s: f64,
    runs: u64,
}

/// What a study comes to.
#[derive(Debug)]
pub struct Results {
    header: Header,
    messages: Vec<StudyPlanMessage>,
    json: Value,
    timing: Option<Timing>,
}

impl Results {
    /// Sums up the tallies of a study.
    pub fn new(header: &Header, tallies: &[Tally], timing: Option<Timing>) -> anyhow::Result<Self> {
        let sigma_m: f64 = header.sigma_m.parse()?;
        let parameters = header.parameters.len();
        let message = |(index, tally): (usize, &Tally)| {
            let reference = header
                .reference
                .filter(|&other| other != index)
                .and_then(|other| tallies.get(other));
            let summary = Summary::new(tally, sigma_m, parameters, reference);
            let (name, experiments) = (&header.plans[index], header.experiments);
            StudyPlanMessage::new(
                name,
                experiments,
                parameters,
                sigma_m,
                tally,
                summary.as_ref(),
            )
        };
        let messages: Vec<_> = tallies.iter().enumerate().map(message).collect();
        let mut json = json!({
            "provenance": header.provenance,
            "trials": header.trials,
            "level": header.level,
            "experiments": header.experiments,
            "parameters": header.parameters,
            "reference": header.reference.map(|index| &header.plans[index]),
            "plans": messages,
        });
        if let Some(timing) = timing {
            #[expect(clippy::cast_precision_loss, reason = "far below 2^52 runs")]
            let runs_per_s = timing.runs as f64 / timing.elapsed_s;
            let timing = json!({ "elapsed_s": timing.elapsed_s, "runs_per_s": runs_per_s });
            merge(&mut json, timing);
        }
        Ok(Self {
            header: header.clone(),
            messages,
            json,
            timing,
        })
    }

    /// Results for stdout, and the conditions that did not hold.
    pub fn report(&self, folder: &Path) -> Report {
        let reference = self.reference();
        let took = self.timing.map_or_else(String::new, |timing| {
            format!(", in {:.2} s", timing.elapsed_s)
        });
        Report {
            json: self.json.clone(),
            text: format!(
                "{}{}{} runs of each plan, {}{took}. Results are in {}\n",
                describe(&self.messages),
                sentence(&self.messages, reference),
                self.header.trials,
                describe_level(self.header.level),
                folder.display()
            ),
            conditions: self.conditions(),
        }
    }

    fn reference(&self) -> Option<&str> {
        let index = self.header.reference?;
        Some(&self.header.plans[index])
    }

    fn conditions(&self) -> Vec<String> {
        self.messages.iter().filter_map(condition).collect()
    }

    /// The page to look at.
    fn page(&self) -> anyhow::Result<String> {
        Ok(study_page(&StudyRecord {
            provenance: &self.header.provenance,
            trials: self.header.trials,
            experiments: self.header.experiments,
            level: describe_level(self.header.level),
            reference: self.reference(),
            plans: &self.messages,
            conditions: &self.conditions(),
            command: &command_line(),
        })?)
    }
}

/// Writes study.json, study.csv and study.html.
pub fn write(folder: &Path, results: &Results) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(&results.json)? + "\n";
    write_whole(&folder.join("study.json"), text.as_bytes())?;
    write_whole(
        &folder.join("study.csv"),
        study_csv(&results.messages).as_bytes(),
    )?;
    write_whole(&folder.join("study.html"), results.page()?.as_bytes())?;
    Ok(())
}

/// Failed runs with their reasons.
fn condition(message: &StudyPlanMessage) -> Option<String> {
    let reasons: Vec<String> = (message.failures.iter())
        .map(|(reason, count)| format!("{count}: {reason}"))
        .collect();
    (message.failed > 0).then(|| {
        format!(
            "{} of {} runs failed with the plan {:?} ({})",
            message.failed,
            message.failed + message.runs,
            message.name,
            reasons.join("; ")
        )
    })
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
