//! `study`: how good are the scenario's plans over many runs?

pub mod results;

use std::time::Instant;

use crate::experiment::Candidate;
use crate::files::{hexadecimal, sha256_of};
use crate::plan::search::Watch;
use crate::quantities::limits::{MOST_SHARDS, MOST_TRIALS};
use crate::record::messages::SchemaMessage;
use crate::record::tally_file::{AbsoluteStudyHeader, Header, PlanHeader, TallyFile};
use crate::study::runner::Runner;
use crate::study::snapshots::next_snapshot;
use crate::study::{Entry, Level, Setting, StudyError};
use crate::task::Task;
use crate::text::diagnostics::say;
use crate::workflow::design::Wanted;
use crate::workflow::study::{self, Timing, foreign_loads};
use indicatif::ProgressStyle;

use self::results::{Results, describe, write};
use super::command_prelude::*;
use super::interruption::{Interrupted, STOP, ask_work, keeps, proceed};
use super::plan::design;
use super::plan_args::ReadingsArgs;
use super::progress::bar;
use super::proof::ProofArgs;
use super::views::{self, StudyObserver, TARGETS, ViewerTarget};
use super::written::Written;

#[derive(Debug, Args)]
pub struct StudyCommand {
    #[command(flatten)]
    pub common: Common,
    /// The number of runs; the scenario's if not given.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_TRIALS))]
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
    rerun: Option<ViewerTarget>,
    #[command(flatten)]
    readings: ReadingsArgs,
}

impl ReadingsArgs {
    /// The plans of a study, designed with a word and a progress bar; of absolute readings among candidates, where there are some.
    pub fn entries<'a>(
        &'a self,
        common: &Common,
        scenario: &'a Scenario,
        settings: &'a [Setting<'_>],
        candidates: Option<&'a [Candidate]>,
    ) -> anyhow::Result<Vec<Entry<'a>>> {
        let say = |name: &str, of: String| {
            common.say(&format!("designing the plan {name:?} of {of}"));
        };
        let designer = |task: &Task, name: &str, wanted: Wanted| {
            say(
                name,
                counted(wanted.size.measurements.into(), "measurement"),
            );
            let designed = design(common, task, scenario.seed, wanted, &ProofArgs::NONE, &STOP);
            designed.map(|(designed, _)| designed)
        };
        let watch = |name: &str, readings: u32| {
            say(name, counted(readings.into(), "absolute reading"));
            Watch::quiet(&STOP)
        };
        let wanted = self.wanted(scenario, candidates);
        study::entries(scenario, settings, &wanted, (&designer, &watch))
    }

    /// What the numbers of a study of absolute readings depend on besides.
    fn header(&self, scenario: &Scenario) -> Result<Option<AbsoluteStudyHeader>, FileError> {
        if scenario.task.design.accuracy == AccuracyKind::Relative {
            return Ok(None);
        }
        let hash = self.candidates.as_deref().map(sha256_of).transpose()?;
        Ok(Some(AbsoluteStudyHeader {
            test_poses: scenario.task.test_poses.len(),
            groups: self.parameters.clone(),
            candidates_sha256: hash.map(|hash| hexadecimal(&hash)),
            drawn: (hash.is_none()).then(|| self.configurations()),
        }))
    }
}

fn parse_shard(text: &str) -> Result<(u64, u64), String> {
    let parsed = text
        .split_once('/')
        .and_then(|(shard, shards)| Some((shard.parse().ok()?, shards.parse().ok()?)));
    match parsed {
        Some((shard, shards)) if (1..=shards).contains(&shard) && shards <= MOST_SHARDS => {
            Ok((shard, shards))
        }
        _ => Err("1/4 is the first part of four".to_owned()),
    }
}

/// A tally that can be gone on from is saved after the first blocks, and then every so often (s).
const SAVE_S: f64 = 2.0;
/// The runs that an interruption costs take about so long (s).
const ROUND_S: f64 = 0.5;

impl StudyCommand {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let scenario = self.common.open("study")?;
        study::refuse_others(&scenario)?;
        self.check_files(&scenario)?;
        keeps(self.kept(None));
        let level = match scenario.task.design.accuracy {
            AccuracyKind::Absolute => Level::Robot,
            AccuracyKind::Relative => (self.level.or(scenario.study.level)).unwrap_or_default(),
        };
        let (shard, shards) = self.shard.unwrap_or((1, 1));
        let sizes = [self.trials.unwrap_or(scenario.study.trials), shards];
        let mut header = Header {
            absolute: self.readings.header(&scenario)?,
            ..Header::new(&scenario, level, sizes, Vec::new())
        };
        if let Some(path) = &self.resume {
            TallyFile::begun(path, &header, shard)?;
        }
        let settings = scenario.settings();
        let candidates = self.readings.candidates(&scenario)?;
        let entries =
            (self.readings).entries(&self.common, &scenario, &settings, candidates.as_deref())?;
        proceed()?;
        let runner = Runner::new(&settings, scenario.seed, level, &entries)?.stopped_by(ask_work());
        header.plans = PlanHeader::of(&runner);
        let part = match &self.resume {
            Some(path) => TallyFile::resume(path, header, shard)?,
            None => TallyFile::empty(header, shard),
        };
        let (trials, title) = (part.header.trials, part.header.title());
        let level = level.words();
        (self.common).say(&format!("{trials} runs of {title}, {level}"));
        let target = self.rerun.as_ref();
        let observer = (self.shard.is_none() || target.is_some())
            .then(|| StudyObserver::new(&scenario, &settings, &part.header, &entries, target))
            .transpose()?;
        self.finish(&scenario, &runner, part, observer)
    }

    /// Nothing is in the way of any file.
    fn check_files(&self, scenario: &Scenario) -> Result<(), FileError> {
        if self.shard.is_some() {
            return self.common.check_files(scenario, None);
        }
        let files = [
            &results::FILES[..],
            &[views::STUDY_PAGE],
            views::STUDY_FILES,
        ];
        (self.common).results_folder(scenario, &files.concat())?;
        Ok(())
    }

    /// Makes what is left of the runs, writes what they come to, and reports it.
    fn finish(
        &self,
        scenario: &Scenario,
        runner: &Runner<'_>,
        mut part: TallyFile,
        mut observer: Option<StudyObserver>,
    ) -> anyhow::Result<Report> {
        let start = Instant::now();
        let done_before = runs_of(&part);
        let mut written = Written::default();
        if let Err(error) = self.run(runner, &mut part, observer.as_mut(), &mut written) {
            return Err(match error.downcast_ref() {
                Some(StudyError::Stopped) => self.interrupted(&part),
                _ => error,
            });
        }
        let timing = Timing {
            elapsed_s: start.elapsed().as_secs_f64(),
            runs: runs_of(&part) - done_before,
        };
        if let Some(path) = &self.tally_out {
            written.note(path, part.write(path));
        }
        let results = Results::new(&part.header, &part.tallies, Some(timing));
        let folder = self.common.folder(scenario);
        let own_folder = self.shard.is_none().then_some(&*folder);
        if let Some(folder) = own_folder {
            write(folder, &results, &mut written)?;
        }
        if let Some(observer) = observer {
            observer.finish(own_folder, self.rerun.as_ref(), &mut written);
        }
        let mut report = results.report(&folder)?;
        if let Some((shard, shards)) = self.shard {
            let table = match part.header.blocks_of(shard) {
                0 => format!(
                    "  no runs: {} runs are fewer blocks of {} than there are shards; `elastocal merge` wants the tally all the same\n",
                    part.header.trials,
                    part.header.block_runs()
                ),
                _ => describe(&results.messages),
            };
            report.text = format!("shard {shard} of {shards}:\n{table}");
            report.json["schema"] = json!(SchemaMessage::new("shard"));
            report.json["shard"] = json!(shard);
            report.json["shards"] = json!(shards);
        }
        if part.header.absolute.is_none() {
            report.conditions.extend(foreign_loads(scenario));
        }
        report.conditions.extend(scenario.of_unknown_origin());
        report.written = written;
        Ok(report)
    }

    /// Makes what is left of the shard's blocks, and saves and shows it from time to
    /// time.
    fn run(
        &self,
        runner: &Runner<'_>,
        part: &mut TallyFile,
        mut observer: Option<&mut StudyObserver>,
        written: &mut Written,
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
        let mut round = match self.resume {
            Some(_) => rayon::current_num_threads() as u64,
            None => all,
        };
        let mut saved: Option<Instant> = None;
        while part.blocks_done < all {
            let snapshot = match &observer {
                Some(_) => next_snapshot(part.blocks_done).min(all),
                None => all,
            };
            let count = round.min(snapshot - part.blocks_done);
            let first = part.shard - 1 + part.blocks_done * step;
            let end = first + (count - 1) * step + 1;
            let start = Instant::now();
            let tallies = runner.run(trials, first..end, step, &|runs| bar.inc(runs))?;
            let took_s = start.elapsed().as_secs_f64();
            for (all, new) in part.tallies.iter_mut().zip(&tallies) {
                all.merge(new);
            }
            part.blocks_done += count;
            if let Some(path) = &self.resume {
                let is_fresh = |saved: Instant| saved.elapsed().as_secs_f64() < SAVE_S;
                if part.blocks_done == all || !saved.is_some_and(is_fresh) {
                    written.note(path, self.save(part, path));
                    saved = Some(Instant::now());
                }
                if count == round && took_s < ROUND_S {
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

    /// Saves the tally that can be gone on from.
    fn save(&self, part: &TallyFile, path: &Path) -> Result<(), FileError> {
        part.write(path)?;
        keeps(self.kept(Some(part)));
        Ok(())
    }

    /// Keeps what is done.
    fn interrupted(&self, part: &TallyFile) -> anyhow::Error {
        // Where it cannot be saved, what was saved before counts.
        let saved = (self.resume.as_ref()).map_or(Ok(()), |path| self.save(part, path));
        if let Err(error) = saved {
            say(&format!("warning: {error}"));
        }
        Interrupted.into()
    }

    /// What is kept if the study is interrupted now.
    fn kept(&self, saved: Option<&TallyFile>) -> String {
        match (&self.resume, saved) {
            (Some(path), Some(part)) => format!(
                "{} keeps {} runs; the same command goes on from there",
                path.display(),
                runs_of(part)
            ),
            (Some(path), None) if path.exists() => format!(
                "{} is as it was; the same command goes on from there",
                path.display()
            ),
            (Some(_), None) => "nothing was done yet; the same command begins anew".to_owned(),
            (None, _) => {
                "nothing was kept; with --resume FILE a study goes on from where it was".to_owned()
            }
        }
    }
}

/// The runs that a tally holds.
fn runs_of(part: &TallyFile) -> u64 {
    (part.tallies.first()).map_or(0, |tally| tally.runs + tally.failures())
}
