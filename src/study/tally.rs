//! What is kept of many runs: sums, a histogram, and why runs failed.
//!
//! Distances are in units of the instrument's sigma. The sums of a block of runs are made in a fixed
//! order in floating point and then turned into integers (fixed point), so that adding tallies is
//! exact, commutative and associative: the number of threads, the order of blocks, sharding and
//! interruption change no bit. A tally's size does not depend on the number of runs.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use strum::VariantArray;
use thiserror::Error;

use crate::numeric::random::normal::LANES;

/// Why a run failed, and that in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr, strum::VariantArray)]
pub enum Failure {
    /// No random feasible plan was found.
    #[strum(serialize = "no random feasible plan was found")]
    NoPlan,
    /// The measurements do not determine what the test poses need.
    #[strum(
        serialize = "the measurements do not determine the compliances that the test poses need"
    )]
    Undetermined,
    /// An experiment has no stable equilibrium on the virtual robot.
    #[strum(serialize = "an experiment has no stable equilibrium")]
    Measurement,
    /// The identification gives nothing.
    #[strum(serialize = "the identification failed")]
    Identification,
    /// A test pose has no stable equilibrium.
    #[strum(serialize = "a test pose has no stable equilibrium")]
    TestPose,
    /// The distance is beyond [`LARGEST`] sigma: no calibration at all.
    #[strum(serialize = "the distance is beyond 16384 sigma")]
    TooFar,
}

impl Failure {
    /// What happened, in words.
    pub fn text(self) -> &'static str {
        self.into()
    }

    /// The same of a run, with what happened.
    pub fn because(self, reason: &(impl ToString + ?Sized)) -> FailedRun {
        FailedRun {
            failure: self,
            reason: reason.to_string(),
        }
    }
}

/// A run that failed, with what happened in words.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{reason}")]
pub struct FailedRun {
    /// Why.
    pub failure: Failure,
    /// What happened.
    pub reason: String,
}

impl From<Failure> for FailedRun {
    fn from(failure: Failure) -> Self {
        failure.because(failure.text())
    }
}

/// Distances beyond this (in sigma) are failures.
pub const LARGEST: f64 = 16384.0;
/// Normalised estimation errors squared beyond this count as this.
const LARGEST_NEES: f64 = 1_048_576.0;

/// What is summed over runs, with u the distance in sigma.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sum {
    /// u.
    Distance,
    /// u^2.
    Square,
    /// u^4.
    Fourth,
    /// u times the reference plan's u in the same run.
    Cross,
    /// What the model predicts for u^2.
    Expected,
    /// The variance that the model predicts for u^2.
    Variance,
    /// The normalised estimation error squared.
    Nees,
    /// Its square.
    NeesSquare,
}

/// The number of sums.
pub const SUMS: usize = 8;

/// Binary places of each sum's integer. With u < 2^14 and 2^40 runs, none exceeds 2^127; the
/// rounding of u and u^2, once a block, is below that of the block's sum in floating point.
const PLACES: [i32; SUMS] = [70, 56, 28, 56, 56, 28, 62, 44];

/// Bins of the histogram in each octave of the distance.
const BINS_PER_OCTAVE: usize = 64;
/// So many bins make one of the histogram that is shown.
const COARSE: usize = BINS_PER_OCTAVE / 8;
/// The exponent of the histogram's lower end; the upper end is [`LARGEST`] = 2^14.
const LOWEST_EXPONENT: i32 = -34;
/// The number of bins of the histogram.
pub const BINS: usize = 48 * BINS_PER_OCTAVE;

/// What a run on the virtual robot came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The squared distance in sigma^2, weighted over the test poses.
    pub square: f64,
    /// The normalised estimation error squared,
    pub nees: f64,
    /// and its degrees of freedom.
    pub freedom: usize,
    /// The 95 % intervals, and how many of them hold the truth.
    pub intervals: [u32; 2],
}

/// The outcome of [`LANES`] consecutive runs of one plan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Batch {
    /// The squared distance in sigma^2, weighted over the test poses.
    pub square: [f64; LANES],
    /// The normalised estimation error squared.
    pub nees: [f64; LANES],
    /// What the model predicts for the squared distance.
    pub expected: [f64; LANES],
    /// The variance that it predicts for that.
    pub variance: [f64; LANES],
    /// What is expected for `nees`: the number of combinations of compliances that are determined, or of numbers that are looked at.
    pub freedom: [usize; LANES],
    /// 95 % intervals of compliances, or regions of places, and how many of them hold the true one; none by the linear model.
    pub intervals: [[u32; 2]; LANES],
    /// Which runs failed.
    pub failed: [Option<Failure>; LANES],
}

impl Batch {
    /// Puts what a run on the virtual robot came to in a lane.
    pub fn put(&mut self, lane: usize, outcome: &Outcome) {
        self.square[lane] = outcome.square;
        self.nees[lane] = outcome.nees;
        self.freedom[lane] = outcome.freedom;
        self.intervals[lane] = outcome.intervals;
    }

    /// Turns absurd distances into failures, and makes failed runs and those from `runs` on zero, so
    /// that they add nothing to any sum.
    pub fn clean(&mut self, runs: usize) {
        for lane in 0..LANES {
            let is_near = self.square[lane] < LARGEST * LARGEST;
            if !is_near && self.failed[lane].is_none() {
                self.failed[lane] = Some(Failure::TooFar);
            }
            if lane >= runs || self.failed[lane].is_some() {
                self.square[lane] = 0.0;
                self.nees[lane] = 0.0;
                self.expected[lane] = 0.0;
                self.variance[lane] = 0.0;
            }
        }
    }
}

/// The sums of a block of runs, lane by lane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BlockSums([[f64; LANES]; SUMS]);

/// All that is kept of one plan's runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tally {
    /// Runs that did not fail.
    pub runs: u64,
    /// The number of combinations of compliances that were determined, summed over these runs.
    pub freedom: u64,
    /// 95 % intervals of compliances, and how many of them hold the true one; none by the linear model.
    pub intervals: [u64; 2],
    /// Runs in which neither this plan nor the reference plan failed.
    pub pairs: u64,
    /// Failed runs by reason, see [`Failure::VARIANTS`].
    pub failed: [u64; Failure::VARIANTS.len()],
    /// The sums as integers, by [`Sum`]; decimal strings in files, since JSON's numbers are floats to many readers.
    #[serde(serialize_with = "as_texts", deserialize_with = "from_texts")]
    pub sums: [i128; SUMS],
    /// The histogram of the distance; in files the bins that are not empty, index and count.
    #[serde(
        rename = "histogram",
        serialize_with = "as_filled",
        deserialize_with = "from_filled"
    )]
    pub bins: Vec<u64>,
}

fn as_texts<S: Serializer>(sums: &[i128; SUMS], serializer: S) -> Result<S::Ok, S::Error> {
    sums.map(|sum| sum.to_string()).serialize(serializer)
}

fn from_texts<'de, D: Deserializer<'de>>(from: D) -> Result<[i128; SUMS], D::Error> {
    let mut sums = [0; SUMS];
    for (sum, text) in sums.iter_mut().zip(<[String; SUMS]>::deserialize(from)?) {
        *sum = text.parse().map_err(D::Error::custom)?;
    }
    Ok(sums)
}

fn as_filled<S: Serializer>(bins: &[u64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(bins.iter().enumerate().filter(|(_, count)| **count > 0))
}

fn from_filled<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u64>, D::Error> {
    let mut bins = vec![0; BINS];
    for (index, count) in Vec::<(usize, u64)>::deserialize(from)? {
        let bin = bins.get_mut(index);
        *bin.ok_or_else(|| D::Error::custom(format!("there is no bin {index}")))? = count;
    }
    Ok(bins)
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            runs: 0,
            freedom: 0,
            intervals: [0; 2],
            pairs: 0,
            failed: [0; Failure::VARIANTS.len()],
            sums: [0; SUMS],
            bins: vec![0; BINS],
        }
    }
}

impl Tally {
    /// Adds the first `runs` runs of a clean batch; their sums go to `block`. `reference` is the
    /// clean batch of the plan that others are compared with.
    pub fn add(
        &mut self,
        block: &mut BlockSums,
        batch: &Batch,
        reference: Option<&Batch>,
        runs: usize,
    ) {
        let distance = batch.square.map(f64::sqrt);
        let other = reference.map_or([0.0; LANES], |other| other.square.map(f64::sqrt));
        let sums = &mut block.0;
        for lane in 0..LANES {
            let square = batch.square[lane];
            let nees = batch.nees[lane].min(LARGEST_NEES);
            sums[Sum::Distance as usize][lane] += distance[lane];
            sums[Sum::Square as usize][lane] += square;
            sums[Sum::Fourth as usize][lane] += square * square;
            sums[Sum::Cross as usize][lane] += distance[lane] * other[lane];
            sums[Sum::Expected as usize][lane] += batch.expected[lane].min(LARGEST * LARGEST);
            sums[Sum::Variance as usize][lane] += batch.variance[lane].min(LARGEST.powi(4));
            sums[Sum::Nees as usize][lane] += nees;
            sums[Sum::NeesSquare as usize][lane] += nees * nees;
        }
        for (lane, distance) in distance.into_iter().enumerate().take(runs) {
            if let Some(failure) = batch.failed[lane] {
                self.failed[failure as usize] += 1;
                continue;
            }
            self.runs += 1;
            self.freedom += batch.freedom[lane] as u64;
            self.count_intervals(batch.intervals[lane].map(u64::from));
            self.pairs +=
                u64::from(reference.is_some_and(|reference| reference.failed[lane].is_none()));
            self.bins[bin_of(distance)] += 1;
        }
    }

    /// Adds the sums of a finished block, which starts again from zero.
    pub fn close(&mut self, block: &mut BlockSums) {
        for ((sum, lanes), places) in self.sums.iter_mut().zip(&block.0).zip(PLACES) {
            *sum += to_fixed(lanes.iter().sum(), places);
        }
        *block = BlockSums::default();
    }

    /// Adds another tally: exact, and in any order.
    pub fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        self.freedom += other.freedom;
        self.count_intervals(other.intervals);
        self.pairs += other.pairs;
        for (mine, theirs) in self.failed.iter_mut().zip(&other.failed) {
            *mine += theirs;
        }
        for (mine, theirs) in self.sums.iter_mut().zip(&other.sums) {
            *mine += theirs;
        }
        for (mine, theirs) in self.bins.iter_mut().zip(&other.bins) {
            *mine += theirs;
        }
    }

    fn count_intervals(&mut self, [all, holding]: [u64; 2]) {
        self.intervals[0] += all;
        self.intervals[1] += holding;
    }

    /// The share of 95 % intervals that hold the true compliance.
    pub fn coverage(&self) -> Option<f64> {
        let [all, holding] = self.intervals.map(|count| count as f64);
        (all > 0.0).then(|| holding / all)
    }

    /// The sum over all runs that did not fail.
    pub fn sum(&self, which: Sum) -> f64 {
        let places = PLACES[which as usize];
        self.sums[which as usize] as f64 * 2.0_f64.powi(-places)
    }

    /// The number of failed runs.
    pub fn failures(&self) -> u64 {
        self.failed.iter().sum()
    }

    /// The histogram in 8 even bins an octave, from the first that has runs to the last: their edges (in
    /// sigma, one more than bins) and counts.
    pub fn histogram(&self) -> (Vec<f64>, Vec<u64>) {
        let coarse: Vec<u64> = (self.bins.chunks(COARSE))
            .map(|bins| bins.iter().sum())
            .collect();
        let is_used = |count: &u64| *count > 0;
        let (Some(first), Some(last)) = (
            coarse.iter().position(is_used),
            coarse.iter().rposition(is_used),
        ) else {
            return (Vec::new(), Vec::new());
        };
        let edges = (first..=last + 1)
            .map(|bin| lower_edge(bin * COARSE))
            .collect();
        (edges, coarse[first..=last].to_vec())
    }

    /// The share of the runs whose distance (in sigma) does not exceed this, from the histogram as [`Self::quantile`]; `None`
    /// without runs.
    pub fn share_below(&self, distance: f64) -> Option<f64> {
        let total: u64 = self.bins.iter().sum();
        let own = bin_of(distance);
        let below: u64 = self.bins[..own].iter().sum();
        let (low, high) = (lower_edge(own), lower_edge(own + 1));
        let within = ((distance - low) / (high - low)).clamp(0.0, 1.0);
        let counted = below as f64 + within * self.bins[own] as f64;
        (total > 0).then(|| counted / total as f64)
    }

    /// The distance (in sigma) that a share of the runs does not exceed, from the histogram: within
    /// its bin, 1/64 octave, the runs are taken as spread evenly.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let total: u64 = self.bins.iter().sum();
        let wanted = share * total as f64;
        let mut below = 0.0;
        let filled = self.bins.iter().enumerate();
        for (index, &count) in filled.filter(|(_, count)| **count > 0) {
            let count = count as f64;
            if below + count >= wanted {
                let within = ((wanted - below) / count).clamp(0.0, 1.0);
                let (low, high) = (lower_edge(index), lower_edge(index + 1));
                return Some(low + (high - low) * within);
            }
            below += count;
        }
        None
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "bounded far below 2^127, and whole"
)]
fn to_fixed(value: f64, places: i32) -> i128 {
    (value * 2.0_f64.powi(places)).round() as i128
}

/// The first bits of a float are its exponent and the first of its binary places.
const SHIFT: u32 = 52 - BINS_PER_OCTAVE.ilog2();

/// The first bits of the histogram's lower end.
fn lowest() -> u64 {
    2.0_f64.powi(LOWEST_EXPONENT).to_bits() >> SHIFT
}

fn bin_of(distance: f64) -> usize {
    let first_bits = distance.to_bits() >> SHIFT;
    usize::try_from(first_bits.saturating_sub(lowest()))
        .unwrap_or(BINS)
        .min(BINS - 1)
}

fn lower_edge(bin: usize) -> f64 {
    f64::from_bits((lowest() + bin as u64) << SHIFT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_lies_in_its_bin() {
        for distance in [1e-9, 0.3, 1.0, 1.999, 2.0, 777.0, 16383.9] {
            let bin = bin_of(distance);
            assert!(lower_edge(bin) <= distance && distance < lower_edge(bin + 1));
            assert!(lower_edge(bin + 1) / lower_edge(bin) <= 1.0 + 1.0 / 64.0);
        }
        assert_eq!(bin_of(0.0), 0);
        assert_eq!(bin_of(LARGEST), BINS - 1);
        assert!((lower_edge(BINS) / LARGEST - 1.0).abs() < 1e-15);
    }

    /// A billion blocks of the largest values fit into the integers.
    #[test]
    fn nothing_overflows() {
        let largest = [
            LARGEST,
            LARGEST.powi(2),
            LARGEST.powi(4),
            LARGEST.powi(2),
            LARGEST.powi(2),
            LARGEST.powi(4),
            LARGEST_NEES,
            LARGEST_NEES.powi(2),
        ];
        for (value, places) in largest.into_iter().zip(PLACES) {
            let bits = (value * 1e12).log2() + f64::from(places);
            assert!(bits < 126.0, "{value}: {bits}");
        }
    }

    #[test]
    fn failed_runs_add_nothing_but_their_reason() {
        let mut tally = Tally::default();
        let mut block = BlockSums::default();
        let mut batch = Batch {
            square: [4.0; LANES],
            nees: [5.0; LANES],
            ..Batch::default()
        };
        batch.square[1] = f64::NAN;
        batch.square[2] = 1e30;
        batch.failed[3] = Some(Failure::Identification);
        batch.clean(6);
        tally.add(&mut block, &batch, Some(&batch), 6);
        tally.close(&mut block);
        assert_eq!((tally.runs, tally.pairs, tally.failures()), (3, 3, 3));
        assert_eq!(tally.failed, [0, 0, 0, 1, 0, 2]);
        let is = |sum, value: f64| (tally.sum(sum) - value).abs() < 1e-9;
        assert!(is(Sum::Distance, 6.0) && is(Sum::Cross, 12.0) && is(Sum::Nees, 15.0));
        assert_eq!(tally.bins.iter().sum::<u64>(), 3);
        let (edges, counts) = tally.histogram();
        assert_eq!((&*counts, edges[0]), (&[3][..], 2.0));
        assert!((edges[1] - 2.0 * (1.0 + 1.0 / 8.0)).abs() < 1e-12);
        // All three are in the bin from 2 to 2 + 1/32.
        let below = |distance| tally.share_below(distance).expect("there are runs");
        assert!(below(1.9) < 1e-12 && below(2.0) < 1e-12 && (below(3.0) - 1.0).abs() < 1e-12);
        assert!((below(2.0 + 1.0 / 64.0) - 0.5).abs() < 1e-12);
        assert_eq!(Tally::default().share_below(1.0), None);
    }
}
