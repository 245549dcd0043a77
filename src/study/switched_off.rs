//! What each uncertainty leaves, seen and not computed: all runs once more without it, by the same gain and with the
//! same random numbers. What the mean square is smaller by is its share.

use std::sync::atomic::AtomicBool;

use super::counts::count_to_f64;
use super::runner::{Runner, RunsInBlocks};
use super::tally::{Sum, Tally};
use super::{Entry, Level, Setting, StudyError};
use crate::plan::NOISE;
use crate::testbed::Truth;

/// A share that was seen.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenShare {
    /// The uncertainty, or the instrument's noise.
    pub name: String,
    /// The root of the share of the mean square (m); zero where it is not seen among the others.
    pub rms_m: f64,
}

/// The runs of a study, to make again.
#[derive(Debug, Clone, Copy)]
pub struct Runs<'a> {
    /// The conditions, all on the same virtual robot.
    pub settings: &'a [Setting<'a>],
    /// The seed.
    pub seed: u64,
    /// What a run is made of.
    pub level: Level,
    /// The plans, none of which is another one in every run.
    pub entries: &'a [Entry],
    /// The number of runs.
    pub trials: u64,
}

impl Runs<'_> {
    /// The shares of each plan in what its runs came to: the noise, which is what is left with all uncertainties off, then
    /// each of the truth's uncertainties. After every block of runs `progress` is told how many it had.
    ///
    /// # Errors
    /// See [`RunsInBlocks::run`].
    pub fn shares(
        &self,
        tallies: &[Tally],
        stop: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Vec<SeenShare>>, StudyError> {
        let Some(truth) = self.settings.first().map(|setting| setting.truth) else {
            return Ok(Vec::new());
        };
        let count = truth.uncertainties.len();
        let mut shares = vec![Vec::new(); self.entries.len()];
        let alone = self.without(&|_| true, truth, stop, progress)?;
        for (index, tally) in alone.iter().enumerate() {
            shares[index].push(self.share(index, NOISE, mean_square(tally)));
        }
        for source in 0..count {
            let name = &truth.uncertainties[source].name;
            let others = self.without(&|each| each == source, truth, stop, progress)?;
            for (index, (tally, other)) in tallies.iter().zip(&others).enumerate() {
                let square = mean_square(tally) - mean_square(other);
                shares[index].push(self.share(index, name, square));
            }
        }
        Ok(shares)
    }

    /// How many runs that takes.
    #[must_use]
    pub fn count(&self) -> u64 {
        let truth = self.settings.first().map(|setting| setting.truth);
        let sources = truth.map_or(0, |truth| truth.uncertainties.len());
        (sources as u64 + 1) * self.trials
    }

    fn share(&self, entry: usize, name: &str, square: f64) -> SeenShare {
        let conditions = &self.settings[self.entries[entry].setting].conditions;
        SeenShare {
            name: name.to_owned(),
            rms_m: square.max(0.0).sqrt() * conditions.sigma_m,
        }
    }

    /// The runs without some uncertainties.
    fn without(
        &self,
        is_off: &dyn Fn(usize) -> bool,
        truth: &Truth,
        stop: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<Tally>, StudyError> {
        let mut other = truth.clone();
        for (index, uncertainty) in other.uncertainties.iter_mut().enumerate() {
            if is_off(index) {
                uncertainty.switch_off();
            }
        }
        let settings: Vec<Setting<'_>> = (self.settings.iter())
            .map(|setting| Setting {
                conditions: setting.conditions,
                task: setting.task.clone(),
                truth: &other,
            })
            .collect();
        let runner = Runner::new(&settings, self.seed, self.level, self.entries)?.stopped_by(stop);
        runner.run(self.trials, 0..runner.blocks(self.trials), 1, progress)
    }
}

/// The mean of u^2, with u in sigma.
fn mean_square(tally: &Tally) -> f64 {
    tally.sum(Sum::Square) / count_to_f64(tally.runs.max(1))
}
