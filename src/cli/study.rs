//! `study`: how good are the scenario's plans over many runs?

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use elastocal::files::{check_writable, make_folder, write_whole};
use elastocal::output::messages::SchemaMessage;
use elastocal::output::study::{StudyPlanMessage, study_csv};
use elastocal::output::study_recording::next_snapshot;
use elastocal::plan::Plan;
use elastocal::plan::search::random_plan;
use elastocal::scenario::{Conditions, Level, Scenario, StudyPlan, StudySource};
use elastocal::study::runner::Runner;
use elastocal::study::summary::Summary;
use elastocal::study::tally::Tally;
use elastocal::study::tally_file::{Header, PlanHeader, TallyFile};
use elastocal::study::{Entry, EntryKind, Setting, repeated};
use indicatif::ProgressStyle;
use serde_json::{Value, json};

use super::plan::design;
use super::progress::bar;
use super::stream::{TARGETS, Target};
use super::study_stream::StudyObserver;
use super::table::{number, table};
use super::{Common, Report, merge, results};

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
    /// Show the study in a rerun viewer while it runs: start one, connect to one, or write a file.
    #[arg(long, value_name = TARGETS)]
    rerun: Option<Target>,
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

/// A tally that can be gone on from is saved after the first blocks, and then every so often (s).
const SAVE_S: f64 = 2.0;

/// Files that could not be written. The results are printed all the same.
#[derive(Debug, Default)]
struct Unwritten {
    problems: Vec<String>,
}

impl Unwritten {
    fn note<E: Display>(&mut self, written: Result<(), E>) {
        if let Err(problem) = written {
            let problem = problem.to_string();
            // A tally is saved many times.
            if !self.problems.contains(&problem) {
                eprintln!("warning: {problem}; going on without it");
                self.problems.push(problem);
            }
        }
    }
}

impl StudyCommand {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let common = &self.common;
        let scenario = common.load()?;
        let folder = common.out.join(&scenario.name);
        // Whether results can be written is found out before the work is done.
        let file = self.rerun.as_ref().and_then(Target::file);
        let paths = [self.tally_out.as_ref(), self.resume.as_ref(), file];
        for path in paths.into_iter().flatten() {
            check_writable(path)?;
        }
        if self.shard.is_none() {
            make_folder(&folder)?;
        }
        let trials = self.trials.unwrap_or(scenario.study.trials);
        let level = self.level.unwrap_or(scenario.study.level);
        let (shard, shards) = self.shard.unwrap_or((1, 1));

        let settings = Setting::all(&scenario);
        let entries = entries(common, &scenario, &settings)?;
        let runner = Runner::new(&settings, level, &entries)?;
        let header = Header::new(&scenario, &settings, level, trials, shards, &entries);
        let mut part = match &self.resume {
            Some(path) => TallyFile::resume(path, header, shard)?,
            None => TallyFile::empty(header, shard),
        };
        common.say(&format!(
            "{trials} runs of {}, {}",
            part.header.title(),
            describe_level(level)
        ));
        let target = self.rerun.as_ref();
        let mut observer = if self.shard.is_none() || target.is_some() {
            Some(StudyObserver::new(
                &settings,
                &part.header,
                &entries,
                target,
            )?)
        } else {
            None
        };
        let start = Instant::now();
        let done_before: u64 = runs_of(&part);
        let mut unwritten = Unwritten::default();
        self.run(&runner, &mut part, observer.as_mut(), &mut unwritten)?;
        let elapsed_s = start.elapsed().as_secs_f64();
        if let Some(path) = &self.tally_out {
            unwritten.note(part.write(path));
        }
        let timing = Timing {
            elapsed_s,
            runs: runs_of(&part) - done_before,
        };
        let results = Results::new(&part.header, &part.tallies, Some(timing))?;
        let own_folder = self.shard.is_none().then_some(&*folder);
        if let Some(folder) = own_folder {
            unwritten.note(write(folder, &results));
        }
        if let Some(observer) = observer {
            unwritten.note(observer.finish(own_folder, target));
        }
        let mut report = results.report(&folder);
        if self.shard.is_some() {
            report.text = format!(
                "shard {shard} of {shards}:\n{}",
                describe(&results.messages)
            );
            merge(
                &mut report.json,
                json!({ "schema": SchemaMessage::new("shard"), "shard": shard, "shards": shards }),
            );
        }
        report.conditions.extend(unwritten.problems);
        Ok(report)
    }

    /// Makes what is left of the shard's blocks, and saves and shows it from time to
    /// time.
    fn run(
        &self,
        runner: &Runner<'_>,
        part: &mut TallyFile,
        mut observer: Option<&mut StudyObserver>,
        unwritten: &mut Unwritten,
    ) -> anyhow::Result<()> {
        let (trials, step) = (part.header.trials, part.header.shards);
        let all = part.header.blocks_of(part.shard);
        let bar = bar(self.common.quiet, "runs");
        let template = "{prefix} {bar:30} {human_pos}/{human_len} {per_sec}, {eta} left";
        bar.set_style(ProgressStyle::with_template(template)?);
        bar.set_length((all * runner.block_runs()).min(trials));
        bar.set_position(part.blocks_done * runner.block_runs());
        bar.reset_eta();
        if let Some(observer) = &mut observer {
            bar.suspend(|| match part.blocks_done {
                0 => observer.first_runs(runner, part.shard - 1),
                _ => observer.observe(&part.tallies),
            })?;
        }
        // Rounds of blocks, as long as it takes to be worth saving, or to the next snapshot.
        let mut round = if self.resume.is_some() { 16 } else { all };
        let mut saved: Option<Instant> = None;
        while part.blocks_done < all {
            let snapshot = match observer {
                Some(_) => next_snapshot(part.blocks_done).min(all),
                None => all,
            };
            let count = round.min(snapshot - part.blocks_done);
            let first = part.shard - 1 + part.blocks_done * step;
            let end = first + (count - 1) * step + 1;
            let tallies = runner.run(trials, first..end, step, &|runs| bar.inc(runs))?;
            for (all, new) in part.tallies.iter_mut().zip(&tallies) {
                all.merge(new);
            }
            part.blocks_done += count;
            if let Some(path) = &self.resume {
                let is_fresh = |saved: Instant| saved.elapsed().as_secs_f64() < SAVE_S;
                if part.blocks_done == all || !saved.is_some_and(is_fresh) {
                    unwritten.note(part.write(path));
                    saved = Some(Instant::now());
                } else {
                    round = round.saturating_mul(2);
                }
            }
            if let Some(observer) = &mut observer
                && part.blocks_done == snapshot
            {
                bar.suspend(|| observer.observe(&part.tallies))?;
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
        let messages = plan_messages(header, tallies)?;
        let reference = header.plans.iter().find_map(|plan| plan.reference);
        let mut json = json!({
            "gate": header.gate,
            "trials": header.trials,
            "level": header.level,
            "parameters": header.parameters,
            "reference": reference.map(|index| &header.plans[index].name),
            "plans": messages,
        });
        json = results("study", &header.provenance, json);
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
        let took = self.timing.map_or_else(String::new, |timing| {
            format!(", in {:.2} s", timing.elapsed_s)
        });
        Report {
            json: self.json.clone(),
            text: format!(
                "{}\n{}{} runs of each plan, {}{took}. Results are in {}\n",
                describe(&self.messages),
                sentence(&self.messages, &self.header),
                self.header.trials,
                describe_level(self.header.level),
                folder.display()
            ),
            conditions: self.messages.iter().filter_map(condition).collect(),
        }
    }
}

/// What the tallies say of each plan.
pub fn plan_messages(header: &Header, tallies: &[Tally]) -> anyhow::Result<Vec<StudyPlanMessage>> {
    let parameters = header.parameters.len();
    let message = |(plan, tally): (&PlanHeader, &Tally)| {
        let conditions = plan.conditions().context("the conditions are damaged")?;
        let reference = plan.reference.and_then(|other| tallies.get(other));
        let reference = reference.filter(|&other| !std::ptr::eq(other, tally));
        let summary = Summary::new(tally, conditions.sigma_m, parameters, reference);
        let (name, summary) = (&plan.name, summary.as_ref());
        Ok(StudyPlanMessage::new(
            name,
            &conditions,
            parameters,
            tally,
            summary,
        ))
    };
    header.plans.iter().zip(tallies).map(message).collect()
}

/// Writes study.json and study.csv.
pub fn write(folder: &Path, results: &Results) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(&results.json)? + "\n";
    write_whole(&folder.join("study.json"), text.as_bytes())?;
    write_whole(
        &folder.join("study.csv"),
        study_csv(&results.messages).as_bytes(),
    )?;
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

/// The plans of a study, under all conditions for which whole repetitions make up the measurements.
pub fn entries(
    common: &Common,
    scenario: &Scenario,
    settings: &[Setting],
) -> anyhow::Result<Vec<Entry>> {
    let mut entries: Vec<Entry> = Vec::new();
    for (index, setting) in settings.iter().enumerate() {
        for plan in &scenario.study.plans {
            if !plan.source.fits(setting.conditions.experiments) {
                continue;
            }
            // Sigma changes no plan.
            let known = entries.iter().find(|entry| {
                let conditions = &settings[entry.setting].conditions;
                let sigma_m = setting.conditions.sigma_m;
                entry.name == plan.name
                    && Conditions {
                        sigma_m,
                        ..*conditions
                    } == setting.conditions
            });
            let kind = match known {
                Some(entry) => entry.kind.clone(),
                None => entry_kind(common, setting, plan)?,
            };
            entries.push(Entry {
                name: plan.name.clone(),
                setting: index,
                kind,
            });
        }
    }
    Ok(entries)
}

/// Reads, designs or draws a plan, and repeats it as a whole.
fn entry_kind(common: &Common, setting: &Setting, plan: &StudyPlan) -> anyhow::Result<EntryKind> {
    let (scenario, conditions) = (&setting.scenario, &setting.conditions);
    let whole = |plan: &Plan| {
        let found = plan.measurements();
        repeated(plan, conditions.experiments).with_context(|| {
            let wanted = conditions.experiments;
            format!("{found} measurements do not make up {wanted} by whole repetitions")
        })
    };
    Ok(match &plan.source {
        StudySource::File(plan) => {
            let mut plan = whole(plan)?;
            for experiment in &mut plan.experiments {
                experiment.load = experiment.load.scaled(conditions.load_scale);
            }
            EntryKind::Fixed(plan)
        }
        StudySource::Optimal {
            criterion,
            configurations,
            experiments,
        } => {
            let experiments = experiments.unwrap_or(conditions.experiments);
            common.say(&format!(
                "designing the plan {:?} of {experiments} measurements",
                plan.name
            ));
            let designed = design(common, scenario, *criterion, experiments, *configurations)?;
            EntryKind::Fixed(whole(&designed.exact.plan)?)
        }
        StudySource::Random => EntryKind::Random(random_plan(scenario, conditions.experiments, 0)?),
        StudySource::RandomEach => EntryKind::RandomEach,
    })
}

/// The table for a person, with a column for each condition that varies.
fn describe(messages: &[StudyPlanMessage]) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let swept: Vec<_> = SWEPT
        .into_iter()
        .filter(|(_, value)| {
            messages
                .iter()
                .any(|each| value(each) != value(&messages[0]))
        })
        .collect();
    let row = |message: &StudyPlanMessage| {
        let interval = message.mean_ci95_mm.map_or_else(
            || "-".to_owned(),
            |[low, high]| format!("{:.3} to {:.3}", low * 1e3, high * 1e3),
        );
        let mut row = vec![message.name.clone()];
        row.extend(swept.iter().map(|(_, value)| value(message)));
        row.extend([
            micro(message.mean_mm),
            interval,
            micro(message.rms_mm),
            micro(message.predicted_rms_mm),
            number(message.z, 1),
            micro(message.quantiles_mm.map(|quantiles| quantiles[2])),
            number(message.nees, 3),
            message.failed.to_string(),
        ]);
        row
    };
    let mut header = vec!["plan"];
    header.extend(swept.iter().map(|(name, _)| name));
    header.extend([
        "mean [um]",
        "95 % interval [um]",
        "rms [um]",
        "predicted rms [um]",
        "z",
        "95 % below [um]",
        "NEES",
        "failed",
    ]);
    table(&header, &messages.iter().map(row).collect::<Vec<_>>())
}

/// A condition that a sweep can vary: what it is called, and its value as text.
type Swept = (&'static str, fn(&StudyPlanMessage) -> String);

const SWEPT: [Swept; 3] = [
    ("measurements", |message| message.experiments.to_string()),
    ("load scale", |message| message.load_scale.to_string()),
    ("sigma [mm]", |message| format!("{:.4}", message.sigma_mm)),
];

/// What it comes to under one set of conditions: the best plan against a random one.
fn sentence(messages: &[StudyPlanMessage], header: &Header) -> String {
    let reference = header.plans.iter().find_map(|plan| plan.reference);
    let plans = || messages.iter().enumerate();
    let best = plans()
        .filter(|(index, _)| Some(*index) != reference)
        .filter_map(|(_, message)| Some((message, message.mean_mm?)))
        .min_by(|one, other| one.1.total_cmp(&other.1));
    let is_swept =
        (header.plans.iter()).any(|plan| plan.conditions() != header.plans[0].conditions());
    let (Some((best, mean_mm)), false) = (best, is_swept) else {
        return String::new();
    };
    let mut text = format!(
        "After calibration with the plan {:?}, compensation leaves {:.2} um on average",
        best.name,
        mean_mm * 1e3
    );
    let random = reference.and_then(|index| messages[index].mean_mm);
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
