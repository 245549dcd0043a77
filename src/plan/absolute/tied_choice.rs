//! Plans whose readings the joints' error functions tie: chosen by exchanges that count what each reading tells of the functions.
//!
//! The search alone is simpler than predictions are: it takes errors of visits as new in each reading.

use std::collections::BTreeSet;
use std::iter::repeat_n;
use std::sync::atomic::AtomicBool;

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::RngExt;

use super::{AbsolutePlan, AbsolutePlanning, setup_of};
use crate::numeric::correlated::{CorrelatedList, CorrelatedReading};
use crate::numeric::markov::ProcessPoint;
use crate::numeric::random::generator;
use crate::numeric::random::streams::drawn_candidates;
use crate::observation::{ReadingKind, planned_rows};
use crate::plan::search::{CandidatePlan, FiniteEffort, best_choice};
use crate::robot::Load;

/// What stands for nothing known: this share of what a reading tells in the mean, and of typical sizes where none tells anything.
const FAINT: f64 = 1e-4;
/// The tool's place anywhere counts by this share of a variance beside the test poses: readings near these alone would leave frames, and
/// what else is unknown, so far open that nobody identifies them. Predictions are to first order.
const ANYWHERE: f64 = 1e-4;
/// Anywhere is at so many sampled configurations.
const SAMPLED: usize = 12;

impl AbsolutePlanning<'_> {
    /// The best plan that is found with so much effort and from plans that are known, without a bound; none without functions, where
    /// candidates may not be read so often, and where none determines the tool's place.
    pub(super) fn tied_plan(
        &self,
        known: &[CandidatePlan],
        effort: FiniteEffort,
        stop: &AtomicBool,
    ) -> Option<AbsolutePlan> {
        if !self.ties_all() {
            return None;
        }
        let rho0_m = |found: &AbsolutePlan| self.prediction(&found.plan).rho0_m();
        let of_station = |station: usize| {
            let found = self.tied_choice(station, self.places(), known, effort, stop)?;
            if effort.configurations >= effort.measurements {
                return Some((rho0_m(&found)?, found));
            }
            // All that can be read in the configurations that were found.
            let configurations = &self.configurations;
            let chosen = found.plan.iter().map(|(place, _)| configurations[*place]);
            let chosen: BTreeSet<usize> = chosen.collect();
            let mut places = self.places();
            places.retain(|place| chosen.contains(&configurations[*place]));
            let effort = FiniteEffort {
                configurations: effort.measurements,
                ..effort
            };
            let known = [found.plan.clone()];
            let more = self.tied_choice(station, places, &known, effort, stop);
            let both = [Some(found), more].into_iter().flatten();
            let both = both.filter_map(|found| Some((rho0_m(&found)?, found)));
            both.min_by(|one, other| one.0.total_cmp(&other.0))
        };
        let found = self.frames().into_iter().filter_map(of_station);
        let best = found.min_by(|one, other| one.0.total_cmp(&other.0));
        best.map(|(_, found)| found)
    }

    /// The same of some candidates, for the tool's place in the frame of a station: of so many of them as there may be configurations.
    fn tied_choice(
        &self,
        station: usize,
        mut places: Vec<usize>,
        known: &[CandidatePlan],
        effort: FiniteEffort,
        stop: &AtomicBool,
    ) -> Option<AbsolutePlan> {
        let (measurements, configurations) = (effort.measurements, effort.configurations);
        // Where there are fewer configurations than readings, each that is chosen is read so often.
        let repeats = measurements.div_ceil(configurations);
        let most = |place: usize| self.most(place) / repeats;
        places.retain(|&place| most(place) > 0);
        let share = f64::from(configurations) / f64::from(measurements);
        let mut list = self.tied_list(station, &places, share)?;
        list.most = places.iter().map(|&place| most(place)).collect();
        let count = configurations as usize;
        let indices = |plan: &CandidatePlan| -> Vec<usize> {
            let indices = plan.iter().filter_map(|&(place, times)| {
                let index = places.binary_search(&place).ok()?;
                Some(repeat_n(index, times.div_ceil(repeats) as usize))
            });
            indices.flatten().take(count).collect()
        };
        let known: Vec<Vec<usize>> = known.iter().map(indices).collect();
        let found = best_choice(&list, count, effort.searches, &known, effort.seed, stop)?;
        let more = (measurements % configurations) as usize;
        let mut plan = CandidatePlan::new();
        for (number, index) in found.chosen.into_iter().enumerate() {
            let times = measurements / configurations + u32::from(number < more);
            match plan.last_mut() {
                Some(last) if last.0 == places[index] => last.1 += times,
                _ => plan.push((places[index], times)),
            }
        }
        Some(AbsolutePlan {
            plan,
            bound: None,
            searches: found.searches,
        })
    }

    /// How the tool's place anywhere follows the unknowns (3 x p each), by its weight.
    fn anywhere(&self, station: usize) -> impl Iterator<Item = DMatrix<f64>> {
        let ranges = &self.task.region.joint_range_rad;
        let mut random = generator(0, drawn_candidates(0));
        (0..SAMPLED).map(move |_| {
            let q = ranges
                .iter()
                .map(|[low, high]| low + (high - low) * random.random::<f64>());
            let q = DVector::from_iterator(ranges.len(), q);
            let setup = setup_of(&q, Load::NONE, [self.target, station]);
            let mean = &self.set.prior().mean;
            let wanted = [(&setup, ReadingKind::Position)];
            let rows = planned_rows(&self.set, &self.case.arm, mean, &wanted).remove(0);
            rows.rows(0, 3) * (ANYWHERE / SAMPLED as f64).sqrt()
        })
    }

    /// Candidates of which each has so large a share of its own errors; behind them the tool at the test poses and anywhere, and what is
    /// measured.
    fn tied_list(&self, station: usize, places: &[usize], share: f64) -> Option<CorrelatedList> {
        let mean = &self.set.prior().mean;
        let mut told = DMatrix::zeros(self.set.len(), self.set.len());
        let mut reading = |place: usize, share: f64| {
            let setup = self.setup(place);
            let rows = planned_rows(&self.set, &self.case.arm, mean, &[setup]).remove(0);
            let count = setup.1.rows();
            let rows = rows.rows(0, count).into_owned();
            let errors = &self.errors[place];
            let own = self.own_covariance(place, 1) + &errors.visit * errors.visit.transpose();
            let new: DMatrix<f64> = own.view((0, 0), (count, count)).into_owned();
            told += rows.tr_mul(&Cholesky::new(new.clone())?.solve(&rows));
            let kept = DMatrix::from(errors.configuration.rows(0, count));
            let configuration = self.configurations[place];
            let by_functions = &self.functions.candidates[place];
            Some(CorrelatedReading {
                by_unknowns: rows.transpose(),
                by_processes: ProcessPoint {
                    columns: by_functions.columns.rows(0, count).into_owned(),
                    places: by_functions.places.clone(),
                },
                shared: (configuration, kept),
                new: new * share,
            })
        };
        let chosen = places.iter().map(|&place| reading(place, share));
        let mut readings = chosen.collect::<Option<Vec<CorrelatedReading>>>()?;
        let measured = self.measured.iter();
        let measured = measured.map(|&(place, times)| reading(place, f64::from(times).recip()));
        let measured = measured.collect::<Option<Vec<CorrelatedReading>>>()?;
        let (size, none) = (self.set.len(), self.candidates.len());
        let predicted = |by_unknowns, columns, places| CorrelatedReading {
            by_unknowns,
            by_processes: ProcessPoint { columns, places },
            shared: (none, DMatrix::zeros(3, 0)),
            new: DMatrix::zeros(3, 3),
        };
        let at_poses = self.poses.iter().zip(&self.functions.poses);
        readings.extend(at_poses.map(|(pose, point)| {
            let root = pose.weight.sqrt();
            let by_unknowns = pose.by_station[&station].transpose() * root;
            predicted(by_unknowns, &point.columns * root, point.places.clone())
        }));
        let processes = self.functions.kernels.len();
        readings.extend(self.anywhere(station).map(|rows| {
            let columns = DMatrix::zeros(3, processes);
            predicted(rows.transpose(), columns, vec![0.0; processes])
        }));
        let known = measured.len();
        readings.extend(measured);
        let mean = told / places.len().max(1) as f64;
        let faint = (mean + DMatrix::identity(size, size)) * FAINT;
        let factor = Cholesky::new(self.known_before() + faint)?;
        for reading in &mut readings {
            (factor.l_dirty()).solve_lower_triangular_mut(&mut reading.by_unknowns);
        }
        Some(CorrelatedList {
            kernels: self.functions.kernels.clone(),
            most: vec![1; places.len()],
            known,
            readings,
        })
    }
}
