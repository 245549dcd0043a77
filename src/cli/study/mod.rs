//! `study`: how good are the scenario's plans over many runs?

pub mod entries;
pub mod results;
mod stream;

use std::fmt::Display;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use elastocal::files::{check_writable, make_folder};
use elastocal::record::messages::SchemaMessage;
use elastocal::scenario::{Level, Scenario, StudyPlan, StudySource};
use elastocal::study::Setting;
use elastocal::study::runner::Runner;
use elastocal::study::tally_file::{Header, TallyFile};
use elastocal::view::study_recording::next_snapshot;
use indicatif::ProgressStyle;
use serde_json::json;

use self::entries::entries;
use self::results::{Results, Timing, describe, describe_level, write};
use self::stream::StudyObserver;
use super::evaluate::loads_outside;
use super::progress::bar;
use super::stream::{TARGETS, Target};
use super::{Common, Report, merge};

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
        report.conditions.extend(foreign_loads(&scenario));
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

/// What is wrong with the loads of plan files.
fn foreign_loads(scenario: &Scenario) -> impl Iterator<Item = String> {
    let wrong = |plan: &StudyPlan| match &plan.source {
        StudySource::File(file) => loads_outside(scenario, file, Some(&plan.name)),
        _ => None,
    };
    scenario.study.plans.iter().filter_map(wrong)
}

/// The runs that a tally holds.
fn runs_of(part: &TallyFile) -> u64 {
    (part.tallies.first()).map_or(0, |tally| tally.runs + tally.failures())
}
