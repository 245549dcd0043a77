//! Tallies as files: shards of a study to join, and interrupted studies to go on from.
//!
//! Shard i of n has the blocks i - 1, i - 1 + n, ... in this order. A checksum tells whether a file is as it was written.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::messages::ProvenanceMessage;
use super::study::StudyPlanMessage;
use crate::codes::ErrorCode;
use crate::files::{FileError, hexadecimal, is_plain_name, read_text};
use crate::files::{output::write_whole, schema::check_version, typed::from_json};
use crate::gate::Gate;
use crate::identification::ParameterGroup;
use crate::scenario::Scenario;
use crate::study::account::{Account, predicted_quantile95_m};
use crate::study::runner::{PlanInStudy, Runner, block_runs};
use crate::study::{Conditions, Level, TakenPlan, tally::Tally};
use crate::task::AccuracyKind;

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
    /// The conditions of its runs.
    #[serde(flatten)]
    pub conditions: Conditions,
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
    /// The plans of a study.
    pub fn of(runner: &Runner<'_>) -> Vec<Self> {
        let plan = |(plan, reference): (PlanInStudy<'_>, Option<usize>)| {
            let PlanInStudy {
                entry,
                setting,
                prediction,
            } = plan;
            let has_account = prediction.is_some() || setting.truth.leaves_more_than_noise();
            Self {
                name: entry.name.clone(),
                conditions: setting.conditions,
                reference,
                sha256: entry.plan.as_ref().map(|plan| match plan {
                    TakenPlan::Deflections(plan) => fingerprint(plan),
                    TakenPlan::Readings(taken) => {
                        fingerprint(&taken.planning.readings(&taken.plan))
                    }
                }),
                account: has_account.then(|| Account::of_plan(plan)).flatten(),
                // Machines of a cluster differ in last digits.
                predicted_quantile95_m: predicted_quantile95_m(plan)
                    .and_then(|value| format!("{value:.9e}").parse().ok()),
            }
        };
        runner.plans().zip(runner.references()).map(plan).collect()
    }
}

impl Header {
    /// The header of a study of so many runs in so many shards.
    pub fn new(
        scenario: &Scenario,
        level: Level,
        [trials, shards]: [u64; 2],
        plans: Vec<PlanHeader>,
    ) -> Self {
        Self {
            provenance: ProvenanceMessage::new(scenario),
            trials,
            level,
            absolute: None,
            parameters: scenario.task.belief.parameter_names(),
            plans,
            shards,
            gate: scenario.gate.clone(),
        }
    }

    /// The number of runs of a block.
    pub const fn block_runs(&self) -> u64 {
        block_runs(self.accuracy(), self.level)
    }

    /// What must be accurate.
    pub const fn accuracy(&self) -> AccuracyKind {
        match self.absolute {
            Some(_) => AccuracyKind::Absolute,
            None => AccuracyKind::Relative,
        }
    }

    /// The plans and how much each measures, for people.
    pub fn title(&self) -> String {
        let mut conditions: Vec<_> = self.plans.iter().map(|plan| plan.conditions).collect();
        conditions.dedup();
        let plans = self.plans.len();
        match (&conditions[..], self.plans.first()) {
            ([_], Some(plan)) => {
                format!(
                    "{plans} plans with {} measurements each",
                    plan.conditions.experiments
                )
            }
            _ => format!("{plans} plans under {} conditions", conditions.len()),
        }
    }

    /// A name of its own for each plan, with the conditions where it is studied under several.
    pub fn labels(&self) -> Vec<String> {
        let label = |plan: &PlanHeader| {
            let same = |other: &&PlanHeader| other.name == plan.name;
            match (self.plans.iter().filter(same).count(), plan.conditions) {
                (2.., conditions) => {
                    format!("{}, {}", plan.name, conditions.described(self.accuracy()))
                }
                _ => plan.name.clone(),
            }
        };
        self.plans.iter().map(label).collect()
    }

    /// The name of the plan that others are compared with.
    pub fn reference(&self) -> Option<&str> {
        let reference = self.plans.iter().find_map(|plan| plan.reference);
        reference.map(|index| &*self.plans[index].name)
    }

    /// Of the plans' runs, those of the smallest mean; not of the plan that others are compared with.
    pub fn best<'a>(&self, plans: &'a [StudyPlanMessage]) -> Option<&'a StudyPlanMessage> {
        let others = (plans.iter()).filter(|plan| Some(&*plan.name) != self.reference());
        let with_mean = others.filter_map(|plan| Some((plan, plan.mean_mm?)));
        let best = with_mean.min_by(|one, other| one.1.total_cmp(&other.1));
        best.map(|(plan, _)| plan)
    }

    /// Whether plans are studied under several conditions.
    pub fn is_swept(&self) -> bool {
        let mut plans = self.plans.windows(2);
        plans.any(|pair| pair[0].conditions != pair[1].conditions)
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
                let word = |value: Option<&Value>| match value {
                    None | Some(Value::Null) => "not given".to_owned(),
                    Some(value) => value.to_string(),
                };
                let [found, wanted] = [theirs.get(key), Some(value)].map(word);
                format!("is of another study: {key} is {found} there, {wanted} here")
            })
    }
}

/// What a change of any digit changes.
fn fingerprint(of: &impl std::fmt::Debug) -> String {
    hexadecimal(&Sha256::digest(format!("{of:?}")))
}

/// A part of a study: the first blocks of one shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TallyFile {
    /// The study.
    #[serde(rename = "study")]
    pub header: Header,
    /// The shard's number, from 1.
    pub shard: u64,
    /// How many of the shard's blocks are done.
    pub blocks_done: u64,
    /// What they gave, by plan.
    pub tallies: Vec<Tally>,
}

/// The file as it is written.
#[derive(Serialize)]
struct WrittenTallyFile<'a> {
    /// The version of this format.
    elastocal_tally: u32,
    /// SHA-256 of the rest.
    sha256: String,
    #[serde(flatten)]
    part: &'a TallyFile,
}

const FORMAT: u32 = 5;

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

    /// What a change of any key changes.
    fn sha256(&self) -> serde_json::Result<String> {
        Ok(hexadecimal(&Sha256::digest(serde_json::to_vec(self)?)))
    }

    /// Writes the file, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let text = || {
            serde_json::to_string(&WrittenTallyFile {
                elastocal_tally: FORMAT,
                sha256: self.sha256()?,
                part: self,
            })
        };
        let text = text().map_err(|error: serde_json::Error| {
            FileError::new(path, format!("cannot be written: {error}")).code(ErrorCode::NotWritable)
        })?;
        write_whole(path, (text + "\n").as_bytes())
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It is not a tally, or was changed since it was written.
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
        let json: BTreeMap<String, Value> = from_json(path, &text).map_err(no_tally)?;
        let Some(version) = json.get(key) else {
            return Err(no_tally(FileError::new(
                path,
                format!("missing field `{key}`"),
            )));
        };
        let readable = FORMAT.into()..=FORMAT.into();
        check_version(path, key, version, readable, "elastocal study")?;
        let file: Self = from_json(path, &text).map_err(no_tally)?;
        // It names the folder for the results.
        let name = &file.header.provenance.scenario;
        if !is_plain_name(name) {
            let problem = format!("found {name:?}; it must be the plain name of a file");
            return Err(FileError::new(path, problem).at("study.scenario"));
        }
        if json.get("sha256").and_then(Value::as_str) != file.sha256().ok().as_deref() {
            let hint = "the tally is damaged: delete it and make its part of the study again";
            return Err(FileError::new(path, "is not as it was written").hint(hint));
        }
        Ok(file)
    }

    /// Reads the file of the same shard of the same study to go on from; nothing is done yet where
    /// there is no file.
    ///
    /// # Errors
    /// The file is of another study, and what differs.
    pub fn resume(path: &Path, header: Header, shard: u64) -> Result<Self, FileError> {
        let Some(found) = Self::begun(path, &header, shard)? else {
            return Ok(Self::empty(header, shard));
        };
        found.check(path, &header)?;
        Ok(Self { header, ..found })
    }

    /// Reads the file of the same shard of the same study, whatever its plans, which take long to design; `None` where there is none.
    ///
    /// # Errors
    /// As [`Self::resume`].
    pub fn begun(path: &Path, header: &Header, shard: u64) -> Result<Option<Self>, FileError> {
        if !path.exists() {
            return Ok(None);
        }
        let found = Self::read(path)?;
        let plans = found.header.plans.clone();
        let expected = Header {
            plans,
            ..header.clone()
        };
        found.check(path, &expected)?;
        if found.shard != shard {
            let problem = format!("is of shard {} and not {shard}", found.shard);
            return Err(wrong_tally(path, problem));
        }
        Ok(Some(found))
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
