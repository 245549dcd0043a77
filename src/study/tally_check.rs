//! Whether a tally that was read can be one: its counts agree with each other and with the blocks that
//! are done, and its sums with its histogram and with the inequalities that hold for any runs.

use super::runner::block_runs;
use super::tally::{
    BINS, LARGEST, LARGEST_NEES, PLACES, SUMS, Sum, Tally, count_to_f64, integer_to_f64, lower_edge,
};
use super::tally_file::{Header, PlanHeader};
use crate::limits::{MOST_EXPERIMENTS, MOST_JOINTS, MOST_SHARDS, MOST_STUDIED, MOST_TRIALS};
use crate::plausible::{DEVIATION, FACTOR, shown};
use crate::text::{is_unseen, wrong_name};

/// Sums that are rounded may miss an inequality by this share.
const ROUNDING: f64 = 1e-9;

/// A key of the file and what is wrong there.
type Problem = (String, String);

fn wrong<T>(key: impl Into<String>, problem: impl Into<String>) -> Result<T, Problem> {
    Err((key.into(), problem.into()))
}

/// The number must lie in the range.
fn within<T: PartialOrd + std::fmt::Display + Copy>(
    key: &str,
    found: T,
    [low, high]: [T; 2],
) -> Result<(), Problem> {
    if found < low || found > high {
        return wrong(key, format!("found {found}; {low} to {high} are allowed"));
    }
    Ok(())
}

impl Header {
    /// Whether there can be such a study.
    ///
    /// # Errors
    /// The key, and what is wrong there.
    pub fn check(&self) -> Result<(), Problem> {
        within("study.trials", self.trials, [1, MOST_TRIALS])?;
        within("study.shards", self.shards, [1, MOST_SHARDS])?;
        within("study.plans", self.plans.len(), [1, MOST_STUDIED])?;
        within("study.parameters", self.parameters.len(), [1, MOST_JOINTS])?;
        let provenance = &self.provenance;
        for (key, text) in [
            ("version", &provenance.version),
            ("commit", &provenance.commit),
            ("scenario_sha256", &provenance.scenario_sha256),
            ("platform", &provenance.platform),
        ] {
            if text.contains(is_unseen) {
                return wrong(format!("study.{key}"), format!("found {text:?}"));
            }
        }
        let names = [("study.scenario".to_owned(), &provenance.scenario)];
        let joints = self.parameters.iter().enumerate();
        let joints = joints.map(|(index, name)| (format!("study.parameters[{index}]"), name));
        let plans = self.plans.iter().enumerate();
        let plans = plans.map(|(index, plan)| (format!("study.plans[{index}].name"), &plan.name));
        for (key, name) in names.into_iter().chain(joints).chain(plans) {
            if let Some(problem) = wrong_name(name) {
                return wrong(key, problem);
            }
        }
        for (index, plan) in self.plans.iter().enumerate() {
            self.check_plan(plan)
                .map_err(|(key, problem)| (format!("study.plans[{index}].{key}"), problem))?;
        }
        self.gate
            .check()
            .map_err(|(key, problem)| (format!("study.gate.{key}"), problem))
    }

    fn check_plan(&self, plan: &PlanHeader) -> Result<(), Problem> {
        within("experiments", plan.experiments, [1, MOST_EXPERIMENTS])?;
        for (key, text, kind, unit) in [
            ("sigma_m", &plan.sigma_m, &DEVIATION, 1e3),
            ("load_scale", &plan.load_scale, &FACTOR, 1.0),
        ] {
            let number: Option<f64> = text.parse().ok();
            // A deflection's deviation is up to 1.5 times a position's.
            let is_plausible =
                |value: f64| kind.allows(value * unit) || kind.allows(value * unit / 1.5);
            if !number.is_some_and(is_plausible) {
                let allowed = kind.allowed();
                return wrong(
                    key,
                    format!("found {text:?}; {allowed} as text, in SI units"),
                );
            }
        }
        if plan
            .sha256
            .as_ref()
            .is_some_and(|hash| hash.contains(is_unseen))
        {
            return wrong("sha256", "is none");
        }
        let Some(reference) = plan.reference else {
            return Ok(());
        };
        match self.plans.get(reference) {
            None => {
                let last = self.plans.len() - 1;
                wrong(
                    "reference",
                    format!("found {reference}; 0 to {last} are allowed"),
                )
            }
            Some(other) if other.conditions() != plan.conditions() => wrong(
                "reference",
                format!("found {reference}, a plan under other conditions"),
            ),
            Some(_) => Ok(()),
        }
    }

    /// The runs in the first blocks of a shard.
    #[must_use]
    pub fn runs_of(&self, shard: u64, blocks_done: u64) -> u64 {
        let size = block_runs(self.level);
        let last = shard - 1 + blocks_done.saturating_sub(1) * self.shards;
        // The study's last block may be smaller.
        let beyond = ((last + 1) * size).saturating_sub(self.trials);
        match blocks_done {
            0 => 0,
            _ => blocks_done * size - beyond,
        }
    }
}

impl Tally {
    /// Whether it can be the tally of so many runs, with the one that it is compared with.
    ///
    /// # Errors
    /// The key, and what is wrong there.
    pub fn check(&self, runs: u64, reference: Option<&Self>) -> Result<(), Problem> {
        let failures = self
            .failed
            .iter()
            .try_fold(0_u64, |sum, &count| sum.checked_add(count));
        if failures.and_then(|failures| failures.checked_add(self.runs)) != Some(runs) {
            let problem = format!(
                "found {}, and {:?} that failed; the blocks that are done have {runs}",
                self.runs, self.failed
            );
            return wrong("runs", problem);
        }
        let most_pairs = reference.map_or(0, |other| other.runs.min(self.runs));
        within("pairs", self.pairs, [0, most_pairs])?;
        let counted = self
            .bins
            .iter()
            .try_fold(0_u64, |sum, &count| sum.checked_add(count));
        if counted != Some(self.runs) {
            return wrong("histogram", format!("does not count {} runs", self.runs));
        }
        self.check_sums(reference)
    }

    fn check_sums(&self, reference: Option<&Self>) -> Result<(), Problem> {
        let runs = count_to_f64(self.runs);
        let key = |sum: Sum| format!("sums[{}]", sum as usize);
        for (index, &sum) in self.sums.iter().enumerate() {
            let value = integer_to_f64(sum) * 2.0_f64.powi(-PLACES[index]);
            let most = runs * MOST[index] * (1.0 + ROUNDING);
            if sum < 0 || value > most {
                let problem = format!(
                    "found {sum}; 0 to {most:e} times 2^{} is possible in {} runs",
                    PLACES[index], self.runs
                );
                return wrong(format!("sums[{index}]"), problem);
            }
        }
        // For any numbers, sum x^2 >= (sum x)^2 / n and (sum x y)^2 <= sum x^2 sum y^2.
        for (square, sum) in [
            (Sum::Square, Sum::Distance),
            (Sum::Fourth, Sum::Square),
            (Sum::NeesSquare, Sum::Nees),
        ] {
            let least = self.sum(sum).powi(2) / runs.max(1.0);
            if self.sum(square) < least * (1.0 - ROUNDING) - rounding(square, runs) {
                return wrong(key(square), "is less than the other sums leave possible");
            }
        }
        let other = reference.map_or(0.0, |other| other.sum(Sum::Square));
        let most = (self.sum(Sum::Square) * other).sqrt();
        if self.sum(Sum::Cross) > most * (1.0 + ROUNDING) + rounding(Sum::Cross, runs) {
            return wrong(
                key(Sum::Cross),
                "is more than the other sums leave possible",
            );
        }
        for (sum, power) in [(Sum::Distance, 1), (Sum::Square, 2), (Sum::Fourth, 4)] {
            let [least, most] = self.counted(power);
            let value = self.sum(sum);
            let [least, most] = [
                least * (1.0 - ROUNDING) - rounding(sum, runs),
                most * (1.0 + ROUNDING) + rounding(sum, runs),
            ];
            if value < least || value > most {
                let problem = format!(
                    "found {}; the histogram leaves {} to {} possible",
                    shown(value),
                    shown(least),
                    shown(most)
                );
                return wrong(key(sum), problem);
            }
        }
        Ok(())
    }

    /// The least and the largest sum of the distance's power with this histogram.
    fn counted(&self, power: i32) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (bin, &count) in self
            .bins
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
        {
            let count = count_to_f64(count);
            // The first and the last bin take what is beyond, too.
            let low = if bin == 0 { 0.0 } else { lower_edge(bin) };
            let high = if bin + 1 == BINS {
                LARGEST
            } else {
                lower_edge(bin + 1)
            };
            sums[0] += count * low.powi(power);
            sums[1] += count * high.powi(power);
        }
        sums
    }
}

/// The largest value of each [`Sum`] in a run.
const MOST: [f64; SUMS] = {
    let square = LARGEST * LARGEST;
    let fourth = square * square;
    let nees = LARGEST_NEES;
    [
        LARGEST,
        square,
        fourth,
        square,
        square,
        fourth,
        nees,
        nees * nees,
    ]
};

/// What turning sums into integers, once a block, can make up.
fn rounding(sum: Sum, runs: f64) -> f64 {
    runs * 2.0_f64.powi(-PLACES[sum as usize])
}
