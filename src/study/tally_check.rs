//! Whether a tally that was read can be one: its counts agree with each other and with the blocks that
//! are done, and its sums with its histogram and with the inequalities that hold for any runs.

use super::counts::{count_to_f64, integer_to_f64};
use super::tally::{BINS, LARGEST, LARGEST_NEES, PLACES, SUMS, Sum, Tally, lower_edge};
use crate::quantities::plausible::shown;

/// Sums that are rounded may miss an inequality by this share.
const ROUNDING: f64 = 1e-9;

/// A key of the file and what is wrong there.
pub(crate) type Wrong = (String, String);

pub(crate) fn wrong<T>(key: impl Into<String>, problem: impl Into<String>) -> Result<T, Wrong> {
    Err((key.into(), problem.into()))
}

/// The number must lie in the range.
pub(crate) fn within<T: PartialOrd + std::fmt::Display + Copy>(
    key: &str,
    found: T,
    [low, high]: [T; 2],
) -> Result<(), Wrong> {
    if found < low || found > high {
        return wrong(key, format!("found {found}; {low} to {high} are allowed"));
    }
    Ok(())
}

impl Tally {
    /// Whether it can be the tally of so many runs, with the one that it is compared with.
    ///
    /// # Errors
    /// The key, and what is wrong there.
    pub fn check(&self, runs: u64, reference: Option<&Self>) -> Result<(), Wrong> {
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

    fn check_sums(&self, reference: Option<&Self>) -> Result<(), Wrong> {
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
