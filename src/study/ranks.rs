//! Simulation-based calibration: where the true value lies in what is known of it.
//!
//! With truths drawn from the priors, the posterior's distribution function at the true value is uniform from 0 to 1, for
//! each unknown and whatever is measured (Talts et al., 2018, arXiv 1804.06788, whose ranks among draws of the posterior are
//! its steps). What is counted is how often it falls into each of [`RANKS`] even bins.

use statrs::distribution::{ContinuousCDF, Normal};

use super::counts::count_to_f64;
use crate::identification::{Estimate, Identification};

/// The largest rank.
const LAST: u8 = 19;
/// The number of even bins.
pub const RANKS: usize = LAST as usize + 1;
/// The rank of what is not determined.
const NONE: u8 = u8::MAX;

/// How often the true value of each unknown had each rank.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Ranks(Vec<[u64; RANKS]>);

impl Ranks {
    /// Ranks that were counted, by unknown.
    #[must_use]
    pub const fn new(counts: Vec<[u64; RANKS]>) -> Self {
        Self(counts)
    }

    /// The counts, by unknown; none where none were counted.
    #[must_use]
    pub fn counts(&self) -> &[[u64; RANKS]] {
        &self.0
    }

    /// Counts the ranks of a run, see [`ranks`].
    pub fn count(&mut self, ranks: impl ExactSizeIterator<Item = u8>) {
        self.make_room(ranks.len());
        for (counts, rank) in self.0.iter_mut().zip(ranks) {
            if let Some(count) = counts.get_mut(usize::from(rank)) {
                *count += 1;
            }
        }
    }

    /// Adds others.
    pub fn merge(&mut self, other: &Self) {
        self.make_room(other.0.len());
        for (mine, theirs) in self.0.iter_mut().zip(&other.0) {
            for (mine, theirs) in mine.iter_mut().zip(theirs) {
                *mine += theirs;
            }
        }
    }

    fn make_room(&mut self, unknowns: usize) {
        if self.0.len() < unknowns {
            self.0.resize(unknowns, [0; RANKS]);
        }
    }
}

/// The ranks of the true values of all unknowns in what an identification says of them.
#[must_use]
pub fn ranks(identification: &Identification, truth: &[f64]) -> Vec<u8> {
    let compliances = identification.parameters.iter().map(|each| each.estimate);
    let others = identification.uncertain.iter().map(|each| each.estimate);
    let all = compliances.chain(others).zip(truth);
    all.map(|(estimate, truth)| estimate.map_or(NONE, |estimate| rank(&estimate, *truth)))
        .collect()
}

fn rank(estimate: &Estimate, truth: f64) -> u8 {
    let standardised = (truth - estimate.value) / estimate.standard_error;
    let below = Normal::standard().cdf(standardised) * RANKS as f64;
    // The largest rank is that of certainty, too.
    (0..LAST)
        .find(|&rank| below < f64::from(rank) + 1.0)
        .unwrap_or(LAST)
}

/// By how much the counted distribution is off at most from the even one, at the bins' edges.
#[must_use]
pub fn deviation(counts: &[u64; RANKS]) -> f64 {
    let all = count_to_f64(counts.iter().sum::<u64>().max(1));
    let mut below = 0;
    let mut largest: f64 = 0.0;
    for (bin, count) in counts.iter().enumerate() {
        below += count;
        let even = (bin + 1) as f64 / RANKS as f64;
        largest = largest.max((count_to_f64(below) / all - even).abs());
    }
    largest
}

/// What chance leaves of [`deviation`] in at least 95 % of studies with so many runs for the worst of so many unknowns, whose
/// posteriors are right: by the inequality of Dvoretzky, Kiefer and Wolfowitz with Massart's constant,
/// P(deviation > e) <= 2 exp(-2 N e^2) for one of them.
#[must_use]
pub fn left_by_chance(runs: u64, unknowns: usize) -> f64 {
    let each = 0.05 / (2.0 * unknowns.max(1) as f64);
    (-each.ln() / (2.0 * count_to_f64(runs.max(1)))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_the_distribution_functions_steps() {
        let estimate = Estimate {
            value: 2.0,
            standard_error: 0.5,
            interval95: [1.0, 3.0],
        };
        let of = |sigmas: f64| rank(&estimate, 2.0 + 0.5 * sigmas);
        assert_eq!([of(-9.0), of(-1.6449), of(-1.6448)], [0, 0, 1]);
        assert_eq!([of(-1e-9), of(1e-9), of(9.0)], [9, 10, 19]);
    }

    #[test]
    fn even_counts_deviate_by_nothing() {
        assert!(deviation(&[7; RANKS]) < 1e-15);
        let mut counts = [0; RANKS];
        counts[0] = 5;
        assert!((deviation(&counts) - 0.95).abs() < 1e-15);
        // 2 exp(-2 N e^2) = 5 %: the known 1.358 / sqrt(N).
        assert!((left_by_chance(10_000, 1) - 0.013_58).abs() < 1e-5);
    }

    #[test]
    fn what_is_not_determined_is_not_counted() {
        let mut ranks = Ranks::default();
        ranks.count([3, NONE].into_iter());
        let mut other = Ranks::default();
        other.merge(&ranks);
        other.merge(&ranks);
        assert_eq!(other.counts()[0][3], 2);
        assert_eq!(other.counts()[1], [0; RANKS]);
    }
}
