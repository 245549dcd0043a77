//! Two results of the same question: what changed, and is it more than the gate allows?
//!
//! - [`record`]: what changed, for machines and for people.
//! - [`results`]: results files as they are compared.
//!
//! Every number of the one file is compared with that of the same name in the other. Results that
//! answer different questions are refused, unless the difference is allowed.

pub mod record;
pub mod results;

use clap::ValueEnum;
use serde::Serialize;
use strum::VariantArray;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::gate::{Decision, Direction, Quantity, Tolerance};
use crate::numeric::quantile::TWO_SIDED_95;
use results::{Answer, Key, ResultNumber, ResultsFile};

/// In what results can differ that makes them answers to different questions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Aspect {
    /// The command, or the version of its results.
    Schema,
    /// The scenario file or its models.
    Scenario,
    /// The seed of the random numbers.
    Seed,
    /// The number of measurements.
    Experiments,
    /// The largest number of different configurations.
    Configurations,
    /// The criterion that a plan was designed for.
    Criterion,
    /// The number of runs of a study.
    Trials,
    /// What the runs of a study are made of.
    Level,
    /// Which plans there are.
    Plans,
    /// Which error sources are counted: the scenario's, or noise alone.
    Errors,
    /// Files that were given beside the scenario, such as test poses and candidates, but for the plan.
    Inputs,
}

/// A difference between the questions, with both answers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// What differs.
    #[serde(rename = "setting")]
    pub aspect: Aspect,
    /// What it is in the one.
    pub base: String,
    /// What it is in the other.
    pub new: String,
}

/// A change by more than so many times is told as itself.
const MOST_TIMES: f64 = 1e6;

/// A number before and now.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// What it is.
    #[serde(flatten)]
    pub key: Key,
    /// The unit of all that follows.
    pub unit: &'static str,
    /// Before.
    pub base: Option<f64>,
    /// Now.
    pub new: Option<f64>,
    /// By how much it has changed.
    pub change: Option<f64>,
    /// The same as a part of the value before; none of zero, or of what is next to nothing.
    pub relative_change: Option<f64>,
    /// How far it may change.
    pub tolerance: f64,
    /// Which changes count.
    pub direction: Direction,
    /// The guard band: so much the change may be from what the numbers say.
    pub guard_band: f64,
    /// What the change says of the tolerance.
    pub decision: Decision,
    /// Whether it is accepted.
    pub ok: bool,
}

/// What comparing two results gives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Whether all changes are within their tolerances.
    pub ok: bool,
    /// Whether every number that both have is the same to the bit.
    pub identical: bool,
    /// Whether both are of the same platform.
    pub same_platform: bool,
    /// Differences that were allowed.
    #[serde(rename = "allowed_differences")]
    pub differences: Vec<Difference>,
    /// The quantities that were compared.
    pub quantities: Vec<Quantity>,
    /// The numbers that both have.
    pub changes: Vec<Change>,
    /// The numbers that only one has.
    pub not_compared: Vec<Key>,
}

impl Aspect {
    /// The name, as on the command line.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// Compares new results with those they are measured by, by the new ones' gate. Differences that are `allowed` are put up with; on
/// the same platform, only a share of a number may change, `within`, either way: zero for not a bit.
///
/// # Errors
/// They differ in a setting that is not allowed to differ, or have nothing in common.
pub fn compare(
    base: &ResultsFile,
    new: &ResultsFile,
    allowed: &[Aspect],
    within: Option<f64>,
) -> Result<Comparison, FileError> {
    let differences = differences(base, new);
    let refused: Vec<&Difference> = (differences.iter())
        .filter(|difference| !allowed.contains(&difference.aspect))
        .collect();
    if !refused.is_empty() {
        return Err(refusal(base, new, &refused));
    }
    let same_platform = base.provenance.platform == new.provenance.platform;
    // So small a share may change, either way.
    let within = within.filter(|_| same_platform);
    let within = within.map(|share| Tolerance {
        relative: share,
        absolute: 0.0,
        direction: Direction::Both,
        guard_band: 0.0,
    });
    let found_in =
        |file: &'_ ResultsFile, key: &Key| file.numbers.iter().position(|each| each.key == *key);
    let mut changes = Vec::new();
    let mut not_compared = Vec::new();
    for before in &base.numbers {
        match found_in(new, &before.key) {
            Some(place) => {
                let quantity = before.key.quantity;
                let tolerance = within.unwrap_or_else(|| new.gate.tolerance(quantity));
                changes.push(judge(before, &new.numbers[place], tolerance));
            }
            None => not_compared.push(before.key.clone()),
        }
    }
    let only_new = (new.numbers.iter()).filter(|each| found_in(base, &each.key).is_none());
    not_compared.extend(only_new.map(|each| each.key.clone()));
    let not_comparable =
        |problem: String| FileError::new(&new.path, problem).code(ErrorCode::NotComparable);
    let missing = (not_compared.iter())
        .find(|key| base.plans.contains(&key.plan) && new.plans.contains(&key.plan));
    let may_miss = allowed.contains(&Aspect::Scenario)
        || differences.iter().any(|each| each.aspect == Aspect::Schema);
    if let (Some(key), false) = (missing, may_miss) {
        let problem = format!("only one of this file and {} has it", base.path.display());
        return Err(not_comparable(problem).at(key.text()));
    }
    if changes.is_empty() {
        let problem = format!("has no number in common with {}", base.path.display());
        return Err(not_comparable(problem));
    }
    let same_bits = |change: &Change| change.base.map(f64::to_bits) == change.new.map(f64::to_bits);
    let is_there = |quantity: &Quantity| changes.iter().any(|each| each.key.quantity == *quantity);
    Ok(Comparison {
        ok: changes.iter().all(|change| change.ok),
        identical: changes.iter().all(same_bits),
        same_platform,
        differences,
        quantities: (Quantity::VARIANTS.iter().copied())
            .filter(is_there)
            .collect(),
        changes,
        not_compared,
    })
}

fn differences(base: &ResultsFile, new: &ResultsFile) -> Vec<Difference> {
    let difference = |&aspect: &Aspect| {
        let [base, new] = [base, new].map(|file| file.answers.get(&aspect));
        let identity = |answer: Option<&Answer>| answer.map(|each| each.identity.clone());
        let shown = |answer: Option<&Answer>| {
            answer.map_or_else(|| "none".to_owned(), |each| each.shown.clone())
        };
        (identity(base) != identity(new)).then(|| Difference {
            aspect,
            base: shown(base),
            new: shown(new),
        })
    };
    let all = Aspect::value_variants().iter();
    all.filter_map(difference).collect()
}

fn refusal(base: &ResultsFile, new: &ResultsFile, refused: &[&Difference]) -> FileError {
    let named: Vec<String> = (refused.iter())
        .map(|each| format!("{} ({}, not {})", each.aspect.name(), each.new, each.base))
        .collect();
    let names: Vec<String> = refused.iter().map(|each| each.aspect.name()).collect();
    let problem = format!(
        "differs from {} in {}",
        base.path.display(),
        named.join(", ")
    );
    let hint = format!(
        "make both in the same way; or --allow-different {} compares them all the same",
        names.join(",")
    );
    let wrong = FileError::new(&new.path, problem).hint(hint);
    wrong.code(ErrorCode::NotComparable)
}

fn judge(before: &ResultNumber, now: &ResultNumber, allowed: Tolerance) -> Change {
    let (base, new) = (before.value, now.value);
    let tolerance = base.map_or(0.0, |base| allowed.relative * base.abs());
    let tolerance = tolerance.max(allowed.absolute);
    // Where both have the same random numbers the change is known better than this.
    let standard = before.standard_error.hypot(now.standard_error);
    let guard_band = allowed.guard_band * TWO_SIDED_95 * standard;
    let decision = match (base, new) {
        (Some(base), Some(new)) if base.to_bits() == new.to_bits() => Decision::Accept,
        (Some(base), Some(new)) => {
            let larger = new - base;
            let worse = if before.key.quantity.larger_is_worse() {
                larger
            } else {
                -larger
            };
            match allowed.direction {
                Direction::Worse => Decision::of(worse, guard_band, tolerance),
                Direction::Both => Decision::of(worse.abs(), guard_band, tolerance),
                Direction::None => Decision::Accept,
            }
        }
        // A number on one side only cannot be measured.
        (None, Some(_)) | (Some(_), None) if allowed.direction != Direction::None => {
            Decision::Reject
        }
        _ => Decision::Accept,
    };
    let change = new.zip(base).map(|(new, base)| new - base);
    let change = change.filter(|change| change.is_finite());
    Change {
        key: before.key.clone(),
        unit: before.key.quantity.unit(),
        base,
        new,
        change,
        relative_change: change.and_then(|change| part_of(base?, change)),
        tolerance,
        direction: allowed.direction,
        guard_band,
        decision,
        ok: decision == Decision::Accept,
    }
}

/// An amount as a part of the value before; none of zero, or of what is next to nothing.
pub(crate) fn part_of(base: f64, amount: f64) -> Option<f64> {
    let part = amount / base.abs();
    (part.abs() < MOST_TIMES).then_some(part)
}

impl Key {
    /// The name for a person, such as "`standard_error` of `joint_2`, plan optimal".
    pub fn text(&self) -> String {
        let of = (self.of.as_ref()).map_or_else(String::new, |of| format!(" of {of}"));
        let plan = match &*self.plan {
            results::ONLY_PLAN => String::new(),
            name => format!(", plan {name}"),
        };
        format!("{}{of}{plan}", self.quantity.name())
    }
}

impl Comparison {
    /// The changes that are not within their tolerances: the inconclusive ones among them.
    pub fn broken(&self) -> impl Iterator<Item = &Change> {
        self.changes.iter().filter(|change| !change.ok)
    }
}
