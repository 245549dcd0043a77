//! Plans whose readings the joints' error functions tie: chosen by exchanges that count what each reading tells of the functions.
//!
//! The search alone is simpler than predictions are: it takes errors of visits and configurations as new in each reading.

use std::sync::atomic::AtomicBool;

use nalgebra::{Cholesky, DMatrix};

use super::AbsolutePlanning;
use crate::numeric::correlated::{CorrelatedList, CorrelatedReading};
use crate::numeric::ornstein_uhlenbeck::ProcessPoint;
use crate::observation::planned_rows;
use crate::plan::search::{CandidatePlan, best_choice};
use crate::quantities::limits::MOST_EXPERIMENTS;

/// Searches: by greed, and from a random choice.
const SEARCHES: usize = 2;
/// What stands for nothing known: this share of what a reading tells in the mean, and of typical sizes where none tells anything.
const FAINT: f64 = 1e-4;

impl AbsolutePlanning<'_> {
    /// The best plan that is found of so many readings, of so many different candidates, for the tool's place in the frame of a station;
    /// none without functions, and where candidates may not be read so often.
    pub(super) fn tied_choice(
        &self,
        station: usize,
        [measurements, configurations]: [u32; 2],
        seed: u64,
        stop: &AtomicBool,
    ) -> Option<CandidatePlan> {
        if !self.ties_all() {
            return None;
        }
        let repeats = measurements.div_ceil(configurations);
        let most = |place: usize| self.candidates[place].most.unwrap_or(MOST_EXPERIMENTS);
        let mut places = self.places();
        places.retain(|&place| most(place) >= repeats);
        let share = f64::from(configurations) / f64::from(measurements);
        let list = self.tied_list(station, &places, share)?;
        let chosen = best_choice(&list, configurations as usize, SEARCHES, seed, stop)?;
        let more = (measurements % configurations) as usize;
        let times = |number: usize| measurements / configurations + u32::from(number < more);
        let chosen = chosen.into_iter().enumerate();
        let plan = chosen.map(|(number, index)| (places[index], times(number)));
        Some(plan.collect())
    }

    /// Candidates of which each has so large a share of its own errors; behind them the tool at the test poses, and what is measured.
    fn tied_list(&self, station: usize, places: &[usize], share: f64) -> Option<CorrelatedList> {
        let mean = &self.set.prior().mean;
        let mut told = DMatrix::zeros(self.set.len(), self.set.len());
        let mut reading = |place: usize, share: f64| {
            let setup = self.setup(place);
            let rows = planned_rows(&self.set, &self.case.arm, mean, &[setup]).remove(0);
            let count = setup.1.rows();
            let rows = rows.rows(0, count).into_owned();
            let own = self.own_covariance(place, 1) + self.errors[place].effects_covariance();
            let new: DMatrix<f64> = own.view((0, 0), (count, count)).into_owned();
            told += rows.tr_mul(&Cholesky::new(new.clone())?.solve(&rows));
            let by_functions = &self.functions.candidates[place];
            Some(CorrelatedReading {
                by_unknowns: rows.transpose(),
                by_processes: ProcessPoint {
                    columns: by_functions.columns.rows(0, count).into_owned(),
                    places: by_functions.places.clone(),
                },
                new: new * share,
            })
        };
        let chosen = places.iter().map(|&place| reading(place, share));
        let mut readings = chosen.collect::<Option<Vec<CorrelatedReading>>>()?;
        let measured = self.measured.iter();
        let measured = measured.map(|&(place, times)| reading(place, f64::from(times).recip()));
        let measured = measured.collect::<Option<Vec<CorrelatedReading>>>()?;
        readings.extend(
            (self.poses.iter().zip(&self.functions.poses)).map(|(pose, point)| {
                let root = pose.weight.sqrt();
                CorrelatedReading {
                    by_unknowns: pose.by_station[station].transpose() * root,
                    by_processes: ProcessPoint {
                        columns: &point.columns * root,
                        places: point.places.clone(),
                    },
                    new: DMatrix::zeros(3, 3),
                }
            }),
        );
        let known = measured.len();
        readings.extend(measured);
        let size = self.set.len();
        let mean = told / places.len().max(1) as f64;
        let faint = (mean + DMatrix::identity(size, size)) * FAINT;
        let factor = Cholesky::new(self.known_before() + faint)?;
        for reading in &mut readings {
            (factor.l_dirty()).solve_lower_triangular_mut(&mut reading.by_unknowns);
        }
        Some(CorrelatedList {
            lengths: self.functions.lengths.clone(),
            choosable: places.len(),
            known,
            readings,
        })
    }
}
