//! Tallies as files: shards of a study to join, and interrupted studies to go on from.
//!
//! Shard i of n has the blocks i - 1, i - 1 + n, ... in this order. The integers of the sums are
//! decimal strings, since JSON's numbers are floats to many readers.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::messages::ProvenanceMessage;
use crate::codes::ErrorCode;
use crate::files::{FileError, hexadecimal, is_plain_name, read_text};
use crate::files::{output::write_whole, schema::check_version, typed::from_json};
use crate::gate::Gate;
use crate::identification::ParameterGroup;
use crate::plan::{Experiment, Plan, absolute::PredictedAccuracy, posterior, quantile95_m};
use crate::robot::Load;
use crate::scenario::Scenario;
use crate::study::absolute::{AbsoluteEntry, AbsoluteRunner, BLOCK_RUNS};
use crate::study::tally::{BINS, Failure, SUMS, Tally};
use crate::study::{Conditions, Entry, Level, Setting, runner};
use crate::study::{account::Account, tally_check::within};

/// What a study's numbers depend on; tallies of different headers do not add.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Program, scenario and seed.
    #[serde(flatten)]
    pub provenance: ProvenanceMessage,
    /// The number of runs of the whole study.
    pub trials: u64,
    /// What the runs are made of.
    pub level: Level,
    /// What a study of absolute readings depends on besides; nothing in one of deflections.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absolute: Option<AbsoluteStudyHeader>,
    /// The names of the compliances.
    pub parameters: Vec<String>,
    /// The number of all unknowns, where more than these compliances is uncertain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unknowns: Option<usize>,
    /// The plans.
    pub plans: Vec<PlanHeader>,
    /// The number n of shards.
    pub shards: u64,
    /// How much worse results may get: no number depends on it.
    pub gate: Gate,
}

/// What the numbers of a study of absolute readings depend on besides.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AbsoluteStudyHeader {
    /// The number of test poses.
    pub test_poses: usize,
    /// What was named as unknown besides what the scenario names.
    pub groups: Vec<ParameterGroup>,
    /// SHA-256 of the file that plans were chosen from, where there was one.
    pub candidates_sha256: Option<String>,
    /// How many configurations were drawn where there was none.
    pub drawn: Option<u32>,
}

/// What a plan's numbers depend on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanHeader {
    /// Its name.
    pub name: String,
    /// The number M of measurements in each run.
    pub experiments: u32,
    /// The instrument's standard deviation (m).
    pub sigma_m: f64,
    /// How many times the loads are those of the scenario and the plan.
    pub load_scale: f64,
    /// The plan that it is compared with, as an index.
    pub reference: Option<usize>,
    /// SHA-256 of the plan; null where every run has its own.
    pub sha256: Option<String>,
    /// What it predicts and what its errors are made of, where the scenario lists uncertainties; nothing where every run has
    /// a plan of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub account: Option<Account>,
    /// The distance (m) that it predicts 95 % of the runs to stay below; nothing where every run has a plan of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub predicted_quantile95_m: Option<f64>,
}

impl PlanHeader {
    /// The conditions of its runs.
    pub const fn conditions(&self) -> Conditions {
        Conditions {
            sigma_m: self.sigma_m,
            experiments: self.experiments,
            load_scale: self.load_scale,
        }
    }
}

impl Header {
    /// The header of a study in so many shards.
    pub fn new(
        scenario: &Scenario,
        settings: &[Setting<'_>],
        level: Level,
        trials: u64,
        shards: u64,
        entries: &[Entry],
    ) -> Self {
        let plan = |(entry, reference): (&Entry, Option<usize>)| {
            let conditions = &settings[entry.setting].conditions;
            PlanHeader {
                name: entry.name.clone(),
                experiments: conditions.experiments,
                sigma_m: conditions.sigma_m,
                load_scale: conditions.load_scale,
                reference,
                sha256: entry.kind.plan().map(fingerprint),
                account: (entry.kind.plan())
                    .filter(|_| scenario.truth.leaves_more_than_noise())
                    .and_then(|plan| {
                        let setting = &settings[entry.setting];
                        Account::new(&setting.task, setting.truth, plan)
                    }),
                predicted_quantile95_m: (entry.kind.plan())
                    .and_then(|plan| {
                        let task = &settings[entry.setting].task;
                        quantile95_m(task, &posterior(&task.belief, plan))
                    })
                    .map(to_ten_digits),
            }
        };
        Self {
            provenance: ProvenanceMessage::new(scenario),
            trials,
            level,
            absolute: None,
            parameters: scenario.task.belief.parameter_names(),
            unknowns: (scenario.task.belief.uncertain.as_ref()).map(|all| all.set().len()),
            plans: (entries.iter().zip(runner::references(entries)))
                .map(plan)
                .collect(),
            shards,
            gate: scenario.gate.clone(),
        }
    }

    /// The same of a study of absolute readings, on virtual robots.
    pub fn of_absolute(
        scenario: &Scenario,
        absolute: AbsoluteStudyHeader,
        [trials, shards]: [u64; 2],
        (entries, runner): (&[AbsoluteEntry<'_>], &AbsoluteRunner<'_>),
    ) -> Self {
        let conditions = Conditions::plain(&scenario.task, 0);
        let header = Self::new(scenario, &[], Level::Robot, trials, shards, &[]);
        let plan = |((entry, prediction), reference): ((&AbsoluteEntry<'_>, _), _)| {
            let prediction: &PredictedAccuracy = prediction;
            PlanHeader {
                name: entry.name.clone(),
                experiments: prediction.readings,
                sigma_m: conditions.sigma_m,
                load_scale: conditions.load_scale,
                reference,
                sha256: Some(fingerprint_of_readings(entry)),
                account: Account::of_absolute(&scenario.task, &scenario.truth, entry, prediction),
                predicted_quantile95_m: prediction.quantile95_m.map(to_ten_digits),
            }
        };
        Self {
            absolute: Some(absolute),
            plans: (entries.iter().zip(runner.predictions()))
                .zip(runner.references())
                .map(plan)
                .collect(),
            ..header
        }
    }

    /// The number of runs of a block.
    pub const fn block_runs(&self) -> u64 {
        match self.absolute {
            Some(_) => BLOCK_RUNS,
            None => runner::block_runs(self.level),
        }
    }

    /// What is determined in a run at most.
    const fn most_freedom(&self, unknowns: usize) -> u64 {
        match &self.absolute {
            Some(absolute) => 3 * absolute.test_poses as u64,
            None => unknowns as u64,
        }
    }

    /// How many 95 % intervals, or regions, a run has at most.
    const fn most_intervals(&self) -> u64 {
        match &self.absolute {
            Some(absolute) => absolute.test_poses as u64,
            None => self.parameters.len() as u64,
        }
    }

    /// The number of all unknowns.
    pub fn unknowns(&self) -> usize {
        self.unknowns.unwrap_or(self.parameters.len())
    }

    /// The plans and how much each measures, for people.
    pub fn title(&self) -> String {
        let mut conditions: Vec<_> = self.plans.iter().map(PlanHeader::conditions).collect();
        conditions.dedup();
        let plans = self.plans.len();
        match (&conditions[..], self.plans.first()) {
            ([_], Some(plan)) => {
                format!("{plans} plans with {} measurements each", plan.experiments)
            }
            _ => format!("{plans} plans under {} conditions", conditions.len()),
        }
    }

    /// A name of its own for each plan, with the conditions where it is studied under several.
    pub fn labels(&self) -> Vec<String> {
        let label = |plan: &PlanHeader| {
            let same = |other: &&PlanHeader| other.name == plan.name;
            match (self.plans.iter().filter(same).count(), plan.conditions()) {
                (2.., conditions) => format!(
                    "{}, {} measurements, sigma {:.4} mm, load {}",
                    plan.name,
                    conditions.experiments,
                    conditions.sigma_m * 1e3,
                    conditions.load_scale
                ),
                _ => plan.name.clone(),
            }
        };
        self.plans.iter().map(label).collect()
    }

    /// The number of blocks of shard `shard`, from 1.
    pub const fn blocks_of(&self, shard: u64) -> u64 {
        let blocks = self.trials.div_ceil(self.block_runs());
        (blocks + self.shards).saturating_sub(shard) / self.shards
    }

    /// What differs in another header.
    fn difference(&self, other: &Self) -> Option<String> {
        let fields = |header: &Self| serde_json::to_value(header).ok();
        let (mine, theirs) = (fields(self)?, fields(other)?);
        let (mine, theirs) = (mine.as_object()?, theirs.as_object()?);
        // Other plans are often the consequence of another difference, which says more. A cluster may
        // have several kinds of machine: where that matters, it shows in the plans.
        (mine.iter())
            .filter(|(key, _)| !["gate", "platform"].contains(&key.as_str()))
            .filter(|(key, value)| theirs.get(*key) != Some(value))
            .min_by_key(|(key, _)| *key == "plans")
            .map(|(key, value)| {
                let found = theirs.get(key).unwrap_or(&Value::Null);
                format!("is of another study: {key} is {found} and not {value}")
            })
    }
}

/// Machines of a cluster differ in last digits.
fn to_ten_digits(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

fn fingerprint(plan: &Plan) -> String {
    let mut hash = Sha256::new();
    for experiment in &plan.experiments {
        for angle in experiment.configuration_rad.iter() {
            hash.update(angle.to_le_bytes());
        }
        for component in experiment.load.wrench().iter() {
            hash.update(component.to_le_bytes());
        }
        hash.update(experiment.repeats.to_le_bytes());
    }
    hexadecimal(&hash.finalize())
}

/// The same of a plan of absolute readings.
fn fingerprint_of_readings(entry: &AbsoluteEntry<'_>) -> String {
    let experiments = entry.plan.iter().map(|&(place, repeats)| {
        let row = &entry.planning.candidates[place];
        Experiment {
            configuration_rad: row.configuration_rad.clone(),
            load: row.load.unwrap_or(Load::NONE),
            repeats,
            approach: None,
        }
    });
    let mut words = fingerprint(&Plan {
        experiments: experiments.collect(),
    });
    for &(place, _) in &entry.plan {
        let row = &entry.planning.candidates[place];
        words += &format!("{:?}", (&row.target, &row.station, &row.approach));
    }
    hexadecimal(&Sha256::digest(words))
}

/// A part of a study: the first blocks of one shard.
#[derive(Debug, Clone, PartialEq)]
pub struct TallyFile {
    /// The study.
    pub header: Header,
    /// The shard's number, from 1.
    pub shard: u64,
    /// How many of the shard's blocks are done.
    pub blocks_done: u64,
    /// What they gave, by plan.
    pub tallies: Vec<Tally>,
}

/// The file as it is written.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenTallyFile {
    /// The version of this format.
    elastocal_tally: u32,
    study: Header,
    shard: u64,
    blocks_done: u64,
    tallies: Vec<StoredTally>,
}

/// What tallies of all versions say.
#[derive(Deserialize)]
struct Version {
    elastocal_tally: Value,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredTally {
    runs: u64,
    freedom: u64,
    /// 95 % intervals of compliances, and how many of them hold the true one.
    intervals: [u64; 2],
    pairs: u64,
    failed: Vec<u64>,
    /// Fixed-point integers.
    sums: Vec<String>,
    /// The bins that are not empty: index and count.
    histogram: Vec<(usize, u64)>,
}

const FORMAT: u32 = 3;

impl TallyFile {
    /// A shard of which nothing is done.
    pub fn empty(header: Header, shard: u64) -> Self {
        Self {
            shard,
            blocks_done: 0,
            tallies: vec![Tally::default(); header.plans.len()],
            header,
        }
    }

    /// Whether all blocks of the shard are done.
    pub const fn is_complete(&self) -> bool {
        self.blocks_done == self.header.blocks_of(self.shard)
    }

    /// Writes the file, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let stored = WrittenTallyFile {
            elastocal_tally: FORMAT,
            study: self.header.clone(),
            shard: self.shard,
            blocks_done: self.blocks_done,
            tallies: self.tallies.iter().map(store).collect(),
        };
        let text = serde_json::to_string(&stored).map_err(|error| {
            FileError::new(path, format!("cannot be written: {error}")).code(ErrorCode::NotWritable)
        })?;
        write_whole(path, (text + "\n").as_bytes())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It is not a tally, or what it says cannot be.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::read_tally(path).map_err(|wrong| wrong.or_code(ErrorCode::Tally))
    }

    fn read_tally(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let no_tally = |wrong: FileError| {
            let problem = format!("is not a tally: {}", wrong.problem);
            FileError { problem, ..wrong }.hint(
                "the file must be one that `elastocal study` wrote with --tally-out or --resume",
            )
        };
        // Another version may have other keys.
        let key = "elastocal_tally";
        let Version { elastocal_tally } = from_json(path, &text).map_err(no_tally)?;
        let readable = FORMAT.into()..=FORMAT.into();
        check_version(path, key, &elastocal_tally, readable, "elastocal study")?;
        let stored: WrittenTallyFile = from_json(path, &text).map_err(no_tally)?;
        let file = stored.restore().map_err(|(key, problem)| {
            FileError::new(path, problem)
                .at(key)
                .hint("the tally is damaged: delete it and make its part of the study again")
        })?;
        // It names the folder for the results.
        let name = &file.header.provenance.scenario;
        if is_plain_name(name) {
            Ok(file)
        } else {
            let problem = format!("found {name:?}; it must be the plain name of a file");
            Err(FileError::new(path, problem).at("study.scenario"))
        }
    }

    /// Reads the file of the same shard of the same study to go on from; nothing is done yet where
    /// there is no file.
    ///
    /// # Errors
    /// The file is of another study, and what differs.
    pub fn resume(path: &Path, header: Header, shard: u64) -> Result<Self, FileError> {
        if !path.exists() {
            return Ok(Self::empty(header, shard));
        }
        let found = Self::read(path)?;
        found.check(path, &header)?;
        if found.shard != shard {
            let problem = format!("is of shard {} and not {shard}", found.shard);
            return Err(wrong_tally(path, problem));
        }
        Ok(Self { header, ..found })
    }

    fn check(&self, path: &Path, expected: &Header) -> Result<(), FileError> {
        match expected.difference(&self.header) {
            Some(problem) => Err(wrong_tally(path, problem)),
            None => Ok(()),
        }
    }
}

/// What is wrong with a tally among others.
fn wrong_tally(path: &Path, problem: String) -> FileError {
    FileError::new(path, problem).code(ErrorCode::Tally)
}

/// Joins the complete shards of a study: its header and its tallies.
///
/// # Errors
/// A file cannot be read, is of another study, is not complete or comes twice; or a shard is
/// missing.
pub fn join<P: AsRef<Path>>(paths: &[P]) -> Result<Option<(Header, Vec<Tally>)>, FileError> {
    let mut joined: Option<(Header, Vec<Tally>)> = None;
    let mut seen = Vec::new();
    for path in paths {
        let path = path.as_ref();
        let part = TallyFile::read(path)?;
        if let Some((header, _)) = &joined {
            part.check(path, header)?;
        }
        if !part.is_complete() {
            let all = part.header.blocks_of(part.shard);
            let problem = format!("has {} of its {all} blocks", part.blocks_done);
            return Err(
                wrong_tally(path, problem).hint("finish it with the same command and --resume")
            );
        }
        if seen.contains(&part.shard) {
            let problem = format!("is shard {}, which another file is too", part.shard);
            return Err(wrong_tally(path, problem));
        }
        seen.push(part.shard);
        match &mut joined {
            None => joined = Some((part.header, part.tallies)),
            Some((_, tallies)) => {
                for (all, part) in tallies.iter_mut().zip(&part.tallies) {
                    all.merge(part);
                }
            }
        }
    }
    if let (Some((header, _)), Some(path)) = (&joined, paths.first())
        && let Some(missing) = (1..=header.shards).find(|shard| !seen.contains(shard))
    {
        let problem = format!(
            "is one of {} shards, and number {missing} is missing",
            header.shards
        );
        return Err(wrong_tally(path.as_ref(), problem));
    }
    Ok(joined)
}

fn store(tally: &Tally) -> StoredTally {
    StoredTally {
        runs: tally.runs,
        freedom: tally.freedom,
        intervals: tally.intervals,
        pairs: tally.pairs,
        failed: tally.failed.to_vec(),
        sums: tally.sums.iter().map(ToString::to_string).collect(),
        histogram: (tally.bins.iter().copied().enumerate())
            .filter(|(_, count)| *count > 0)
            .collect(),
    }
}

impl WrittenTallyFile {
    /// What is written, if it can be.
    fn restore(self) -> Result<TallyFile, (String, String)> {
        if self.elastocal_tally != FORMAT {
            let problem = format!(
                "found {}; this elastocal ({}) reads {FORMAT}",
                self.elastocal_tally,
                crate::VERSION
            );
            return Err(("elastocal_tally".to_owned(), problem));
        }
        let header = self.study;
        header.check()?;
        within("shard", self.shard, [1, header.shards])?;
        let blocks = header.blocks_of(self.shard);
        within("blocks_done", self.blocks_done, [0, blocks])?;
        let (found, plans) = (self.tallies.len(), header.plans.len());
        if found != plans {
            let problem = format!("found {found}; there are {plans} plans");
            return Err(("tallies".to_owned(), problem));
        }
        let tallies: Vec<Tally> = (self.tallies.iter().enumerate())
            .map(|(index, stored)| {
                restore(stored)
                    .map_err(|(key, problem)| (format!("tallies[{index}].{key}"), problem))
            })
            .collect::<Result<_, _>>()?;
        let runs = header.runs_of(self.shard, self.blocks_done);
        for (index, (tally, plan)) in tallies.iter().zip(&header.plans).enumerate() {
            let reference = plan.reference.and_then(|other| tallies.get(other));
            tally
                .check(runs, reference)
                .map_err(|(key, problem)| (format!("tallies[{index}].{key}"), problem))?;
            // Each run determines so many combinations at most.
            let most = (tally.runs).saturating_mul(header.most_freedom(header.unknowns()));
            within(
                &format!("tallies[{index}].freedom"),
                tally.freedom,
                [0, most],
            )?;
            let [all, holding] = tally.intervals;
            let most = tally.runs.saturating_mul(header.most_intervals());
            within(&format!("tallies[{index}].intervals[0]"), all, [0, most])?;
            within(&format!("tallies[{index}].intervals[1]"), holding, [0, all])?;
        }
        Ok(TallyFile {
            header,
            shard: self.shard,
            blocks_done: self.blocks_done,
            tallies,
        })
    }
}

fn restore(stored: &StoredTally) -> Result<Tally, (&'static str, String)> {
    let (found, reasons) = (stored.failed.len(), Failure::ALL.len());
    let failed = (stored.failed.as_slice().try_into()).map_err(|_| {
        (
            "failed",
            format!("found {found} numbers; {reasons} are allowed"),
        )
    })?;
    let sums: Option<Vec<i128>> = stored.sums.iter().map(|text| text.parse().ok()).collect();
    let sums = (sums.and_then(|sums| sums.try_into().ok()))
        .ok_or_else(|| ("sums", format!("{SUMS} whole numbers as text are allowed")))?;
    let mut bins = vec![0; BINS];
    for &(index, count) in &stored.histogram {
        match bins.get_mut(index) {
            Some(bin) if *bin == 0 && count > 0 => *bin = count,
            _ => {
                let problem = format!(
                    "found {count} in bin {index}; each of the bins 0 to {} may come once with what it counts",
                    BINS - 1
                );
                return Err(("histogram", problem));
            }
        }
    }
    Ok(Tally {
        runs: stored.runs,
        freedom: stored.freedom,
        intervals: stored.intervals,
        pairs: stored.pairs,
        failed,
        sums,
        bins,
    })
}
