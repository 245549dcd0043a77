//! Does optimal design help? Of readings that there are, a few are chosen in several ways, those of one visit together; the robot is
//! calibrated with each choice and judged on all other readings, of positions and distances on the positions.
//!
//! All choices have the same unknowns, the same knowledge before and the same weights. The same is done with a robot that is
//! exactly as the model says, read with independent errors of the same size: what differs is what discrepancy does. Where the planner's
//! model has joint error functions, every fit has them, one choice is planned with them, and that robot's are sampled.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::DMatrix;
use rand::seq::index;
use rayon::prelude::*;

use crate::identification::{
    AbsoluteCase, DistanceStatistics, IdentificationError, ParameterGroup, PartsOfReadings,
    SimulatedReadings,
};
use crate::measurement::AbsoluteReading;
use crate::numeric::correlated::CorrelatedList;
use crate::numeric::random::{generator, streams};
use crate::numeric::tolerance::ends;
use crate::parameter::relative_precision;
use crate::plan::search::{CandidateInformation, FiniteEffort, FiniteProblem, Watch, best_choice};
use crate::plan::{Criterion, CriterionFunction, no_wider_than_high};
use crate::task::Belief;
use crate::text::wording::counted;

/// Searches for one choice, before it is searched for from the others, too.
const SEARCHES: usize = 4;
/// Searches for the choice with joint error functions, by greed and from random ones: so many readings are placed in all of them, in at
/// least two. Few readings are placed in more searches, whose ends differ more.
const PLACED_WITH_FUNCTIONS: usize = 160;

/// What stands for nothing known, as a share of what a reading tells on average of what it tells most of.
const FAINT: f64 = 1e-8;

/// The ways to choose, each with the criterion that it is best by. O1 chooses as D does, and O3 as E.
pub const CHOICES: [Criterion; 6] = [
    Criterion::TestPose,
    Criterion::D,
    Criterion::O2,
    Criterion::O3,
    Criterion::O4,
    Criterion::O5,
];

/// The name of the choice for absolute accuracy that is planned with joint error functions.
pub const WITH_FUNCTIONS: &str = "test_pose_with_joint_errors";

/// What a way to choose is called, by its criterion.
pub fn choice_name(criterion: &str) -> &str {
    match criterion {
        "test_pose" => "absolute accuracy",
        "d" => "D, O1",
        "o2" => "O2",
        "o3" => "O3, E",
        "o4" => "O4",
        "o5" => "O5",
        WITH_FUNCTIONS => "absolute accuracy, joint errors",
        other => other,
    }
}

/// What is compared.
#[derive(Debug, Clone)]
pub struct SelectionWanted {
    /// How many readings are chosen; visits where several readings are of one.
    pub sizes: Vec<u32>,
    /// How many random choices there are of each size.
    pub draws: u32,
    /// How often the robot without discrepancy is read anew.
    pub campaigns: u32,
    /// Of all random numbers.
    pub seed: u64,
}

/// How good a robot is that was calibrated with some readings, on all others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Judged {
    /// Distances from the positions that were read (m).
    pub distance: DistanceStatistics,
    /// The rms distance (m) from where a robot that all readings are fitted to would be; of the robot without discrepancy, from
    /// where it is.
    pub from_all_m: f64,
}

/// Readings that were chosen, and what came of them.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// The readings by their places, in rising order.
    pub readings: Vec<usize>,
    /// `rho_0` (m): what errors that are independent from reading to reading leave, rms over all readings; with joint error functions, over
    /// those that were not chosen.
    pub predicted_m: Option<f64>,
    /// The predicted rms distance (m) at the readings that were not chosen, with what is new at each.
    pub predicted_distance_m: Option<f64>,
    /// The same over what no choice of as many readings is below.
    pub bound_m: Option<f64>,
    /// On the readings that there are; none where there is no fit.
    pub judged: Option<Judged>,
    /// On those of the robot without discrepancy, one for each time that it was read.
    pub without_discrepancy: Vec<Judged>,
}

/// The numbers of a choice: of the distances at all other readings the mean, the rms, what 95 % stay below, and the largest; what
/// independent errors leave; the predicted rms distance at all other readings; the rms distance from the robot that all readings are
/// fitted to; and the same from the true robot without discrepancy, over all times that it was read.
pub const NUMBERS: [&str; 8] = [
    "mean_mm",
    "rms_mm",
    "quantile95_mm",
    "largest_mm",
    "rho0_mm",
    "predicted_rms_mm",
    "from_all_mm",
    "without_discrepancy_from_true_mm",
];

impl Chosen {
    /// The [`NUMBERS`].
    pub fn numbers_mm(&self) -> [Option<f64>; 8] {
        let distance = |of: fn(&DistanceStatistics) -> f64| Some(of(&self.judged?.distance));
        let squares = (self.without_discrepancy.iter()).map(|judged| judged.from_all_m.powi(2));
        let count = self.without_discrepancy.len();
        let without_m = || (squares.sum::<f64>() / count as f64).sqrt();
        let numbers_m = [
            distance(|lengths| lengths.mean),
            distance(|lengths| lengths.rms),
            distance(|lengths| lengths.quantile95),
            distance(|lengths| lengths.largest),
            self.predicted_m,
            self.predicted_distance_m,
            self.judged.map(|judged| judged.from_all_m),
            (count > 0).then(without_m),
        ];
        numbers_m.map(|number| number.map(|metres| metres * 1e3))
    }

    /// Why there is no such choice.
    pub fn problem(chosen: &Result<Self, String>) -> Option<&str> {
        match chosen {
            Ok(chosen) if chosen.judged.is_some() => None,
            Ok(_) => Some("there is no fit"),
            Err(problem) => Some(problem),
        }
    }
}

/// All choices of one size.
#[derive(Debug, Clone)]
pub struct SelectionOfSize {
    /// How many were chosen.
    pub size: u32,
    /// With joint error functions, where there are any, and by each of [`CHOICES`], by name; or why there is none.
    pub planned: Vec<(&'static str, Result<Chosen, String>)>,
    /// At random.
    pub random: Vec<Chosen>,
}

impl SelectionOfSize {
    /// The mean distances of the planned choices that have a fit (mm).
    fn planned_means_mm(&self) -> Vec<f64> {
        let chosen = self
            .planned
            .iter()
            .filter_map(|(_, each)| each.as_ref().ok());
        chosen.filter_map(|each| each.numbers_mm()[0]).collect()
    }

    /// The mean distances of the random choices that have a fit (mm).
    pub fn random_means_mm(&self) -> Vec<f64> {
        let means = |chosen: &Chosen| chosen.numbers_mm()[0];
        self.random.iter().filter_map(means).collect()
    }

    /// Of each of the [`NUMBERS`] over the random choices what a twentieth stay below, the median, and what a twentieth are above.
    pub fn spreads_mm(&self) -> [Option<[f64; 3]>; 8] {
        let all: Vec<_> = self.random.iter().map(Chosen::numbers_mm).collect();
        std::array::from_fn(|place| spread_of(all.iter().filter_map(|each| each[place]).collect()))
    }

    /// The share of random choices whose mean distance is larger.
    pub fn better_than_random(&self, chosen: &Chosen) -> Option<f64> {
        let mean_mm = chosen.numbers_mm()[0]?;
        let means_mm = self.random_means_mm();
        let worse = means_mm.iter().filter(|other| **other > mean_mm).count();
        (!means_mm.is_empty()).then(|| worse as f64 / means_mm.len() as f64)
    }
}

/// What came of all choices.
#[derive(Debug, Clone)]
pub struct Selection<'a> {
    /// The readings, and what all together say.
    pub parts: PartsOfReadings<'a>,
    /// By size.
    pub sizes: Vec<SelectionOfSize>,
    /// Whether it was cut short.
    pub is_cut_short: bool,
}

impl Selection<'_> {
    /// Of how many unknowns something is known before.
    pub fn known_before(&self) -> usize {
        let precision = &self.parts.all.set.prior().precision;
        let known = precision.diagonal();
        known.iter().filter(|each| **each > 0.0).count()
    }

    /// What a fit of all readings leaves of them (mm).
    pub fn all_mm(&self) -> DistanceStatistics {
        let left = DistanceStatistics::of(self.parts.distances_m()).unwrap_or_default();
        left.in_thousandths()
    }

    /// The mean distances that matter, from the lowest to the highest (mm): that of all readings, and of each size all up to three times
    /// what three quarters of its random choices stay below.
    pub fn usual_mm(&self) -> [f64; 2] {
        let means =
            |of_size: &SelectionOfSize| [of_size.random_means_mm(), of_size.planned_means_mm()];
        usual(
            self.all_mm().mean,
            &self.sizes.iter().map(means).collect::<Vec<_>>(),
        )
    }
}

/// The ends of those that are not far above the others, of the means of all readings, and of the random and the planned choices of each size.
fn usual(all: f64, sizes: &[[Vec<f64>; 2]]) -> [f64; 2] {
    let mut kept = vec![all];
    for [random, planned] in sizes {
        let mut sorted = if random.is_empty() { planned } else { random }.clone();
        sorted.sort_by(f64::total_cmp);
        let limit = 3.0 * sorted.get(sorted.len() * 3 / 4).copied().unwrap_or(0.0);
        kept.extend((random.iter().chain(planned)).filter(|mean| **mean <= limit));
    }
    ends(kept.into_iter().filter(|mean| *mean > 0.0))
}

/// The readings, ready to be chosen from.
struct Chooser<'a> {
    parts: &'a PartsOfReadings<'a>,
    told: CandidateInformation,
    before: DMatrix<f64>,
    positions: DMatrix<f64>,
    /// The readings as they are, and those of the robot without discrepancy, each time that it was read.
    read: SimulatedReadings,
    campaigns: Vec<SimulatedReadings>,
    /// With joint error functions, where there are any.
    list: Option<CorrelatedList>,
    wanted: &'a SelectionWanted,
}

/// Chooses, calibrates and judges, as long as it is not asked to stop; who watches hears how many choices are done, and of how many.
///
/// # Errors
/// The readings cannot be fitted, or are no more than are chosen.
pub fn select<'a>(
    belief: &'a Belief,
    readings: &[AbsoluteReading],
    groups: &[ParameterGroup],
    wanted: &SelectionWanted,
    watch: Watch<'_>,
) -> Result<Selection<'a>, IdentificationError> {
    let parts =
        (AbsoluteCase::new(belief, readings)?.counting_sources_of_lengths()).in_parts(groups)?;
    let count = parts.together.len();
    if let Some(&size) = wanted.sizes.iter().find(|size| **size as usize >= count) {
        let offered = counted(count as u64, parts.unit());
        return Err(IdentificationError::NothingLeft { offered, size });
    }
    let campaign = |campaign: u64| {
        let stream = streams::campaign_of_choices(campaign);
        parts.simulated(&mut generator(wanted.seed, stream))
    };
    let campaigns: Result<Vec<_>, _> = (0..u64::from(wanted.campaigns)).map(campaign).collect();
    let told = CandidateInformation::of_all(parts.all.set.len(), &parts.told());
    let mut before = relative_precision(&parts.all.set);
    if !parts.are_all_judged() {
        // What only readings show that are not judged on may be left open.
        let faint = FAINT * told.mean().diagonal().amax();
        before += DMatrix::identity(told.size(), told.size()) * faint;
    }
    let chooser = Chooser {
        told,
        before,
        positions: no_wider_than_high(parts.positions()),
        read: SimulatedReadings {
            observations: parts.case.observations.clone(),
            expected_m: parts.expected_m.clone(),
        },
        list: (!parts.known.functions.is_empty())
            .then(|| parts.with_functions())
            .transpose()?,
        campaigns: campaigns.unwrap_or_default(),
        wanted,
        parts: &parts,
    };
    let done = AtomicUsize::new(0);
    let planned = CHOICES.len() + usize::from(chooser.list.is_some());
    let all = wanted.sizes.len() * (planned + wanted.draws as usize);
    let tell = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        (watch.progress)(done, all, f64::INFINITY);
    };
    let of_size = |&size: &u32| {
        let mut planned = Vec::new();
        let by_criterion = chooser.planned(size, watch.stop, &tell);
        if let Some(list) = &chooser.list {
            planned.push((
                WITH_FUNCTIONS,
                chooser.with_functions(list, size, watch.stop),
            ));
            tell();
        }
        planned.extend(by_criterion);
        let random = (0..wanted.draws)
            .into_par_iter()
            .filter(|_| !watch.stop.load(Ordering::Relaxed))
            .map(|draw| {
                let chosen = chooser.random(size, draw);
                tell();
                chosen
            });
        SelectionOfSize {
            size,
            planned,
            random: random.collect(),
        }
    };
    Ok(Selection {
        sizes: wanted.sizes.iter().map(of_size).collect(),
        is_cut_short: watch.stop.load(Ordering::Relaxed),
        parts,
    })
}

impl Chooser<'_> {
    fn problem(&self, criterion: Criterion) -> FiniteProblem<'_> {
        FiniteProblem {
            criterion,
            test_poses: self.positions.clone(),
            beside: self.before.clone(),
            told: self.told.clone(),
            most: vec![1; self.told.count()],
            configurations: (0..self.told.count()).collect(),
            mandatory: BTreeSet::new(),
            told_together: None,
            bounds: None,
        }
    }

    /// The best choice by each criterion.
    ///
    /// Exchanges end at a choice that no single one betters, of which there are many. What one criterion found is therefore
    /// offered to all others, which go on from there, until none of them gains: no choice is better by another's criterion than
    /// that other's own.
    fn planned(
        &self,
        size: u32,
        stop: &AtomicBool,
        tell: &(dyn Fn() + Sync),
    ) -> Vec<(&'static str, Result<Chosen, String>)> {
        let effort = FiniteEffort {
            measurements: size,
            configurations: size,
            searches: SEARCHES,
            seed: self.wanted.seed,
            is_thorough: false,
        };
        let mut found: Vec<_> = CHOICES
            .into_par_iter()
            .map(|criterion| {
                let problem = self.problem(criterion);
                let found = problem.search(effort, Watch::quiet(stop));
                tell();
                (problem, found)
            })
            .collect();
        let designs = found.iter().filter_map(|(_, found)| found.as_ref().ok());
        let mut offered: Vec<_> = designs.map(|design| design.plan.clone()).collect();
        // All that may help is tried from what was found in the end: that takes longer.
        let mut is_thorough = false;
        while !stop.load(Ordering::Relaxed) {
            let effort = FiniteEffort {
                is_thorough,
                ..effort
            };
            let better: Vec<_> = found
                .par_iter_mut()
                .map(|(problem, found)| {
                    let design = found.as_mut().ok()?;
                    let own = [design.plan.clone()];
                    let from = if is_thorough { &own[..] } else { &offered };
                    let (plan, cost) = problem.bettered(from, effort, design.cost, |_| true)?;
                    design.plan.clone_from(&plan);
                    design.cost = cost;
                    Some(plan)
                })
                .collect();
            offered = better.into_iter().flatten().collect();
            if is_thorough && offered.is_empty() {
                break;
            }
            is_thorough = offered.is_empty();
        }
        let chosen = (found.into_par_iter()).map(|(problem, found)| {
            let chosen = found.map(|design| {
                let chosen: Vec<usize> = design.plan.iter().map(|&(chosen, _)| chosen).collect();
                let is_bounded = problem.criterion == Criterion::TestPose;
                let least = design.bound.least_cost(size).filter(|_| is_bounded);
                Chosen {
                    bound_m: least.map(f64::sqrt),
                    ..self.judged(&chosen)
                }
            });
            let chosen = chosen.map_err(|error| error.to_string());
            (problem.criterion.name(), chosen)
        });
        chosen.collect()
    }

    /// The best choice for absolute accuracy with joint error functions.
    fn with_functions(
        &self,
        list: &CorrelatedList,
        size: u32,
        stop: &AtomicBool,
    ) -> Result<Chosen, String> {
        let size = size as usize;
        let searches = (PLACED_WITH_FUNCTIONS / size.max(1)).max(2);
        let found = best_choice(list, size, searches, &[], self.wanted.seed, stop);
        let found = found.ok_or("the readings determine nothing")?;
        Ok(self.judged(&found.chosen))
    }

    /// A random choice.
    fn random(&self, size: u32, draw: u32) -> Chosen {
        let number = (u64::from(size) << 32) + u64::from(draw);
        let mut random = generator(self.wanted.seed, streams::random_choice(number));
        let mut chosen = index::sample(&mut random, self.told.count(), size as usize).into_vec();
        chosen.sort_unstable();
        self.judged(&chosen)
    }

    /// What comes of a choice of what belongs together.
    fn judged(&self, chosen: &[usize]) -> Chosen {
        let mut information = self.before.clone();
        for &each in chosen {
            self.told.add_to(&mut information, each, 1.0);
        }
        let all = (chosen.iter()).flat_map(|&each| &self.parts.together[each].readings);
        let mut readings: Vec<usize> = all.copied().collect();
        readings.sort_unstable();
        let mut function = CriterionFunction::new(Criterion::TestPose, self.positions.clone());
        let (judged, predicted) = self.judge(&readings, &self.read).unzip();
        let [place, distance] = [0, 1].map(|part| predicted.map(|squares| squares[part].sqrt()));
        let campaigns = self.campaigns.iter();
        Chosen {
            predicted_m: match self.list {
                Some(_) => place,
                None => function.value(&information),
            },
            predicted_distance_m: distance,
            bound_m: None,
            judged,
            without_discrepancy: campaigns
                .filter_map(|readings_of| Some(self.judge(&readings, readings_of)?.0))
                .collect(),
            readings,
        }
    }

    /// Calibrates with chosen readings of some, and judges on the others; with the predicted mean squares, see
    /// [`PredictedPositions`](crate::identification::PredictedPositions).
    fn judge(&self, chosen: &[usize], read: &SimulatedReadings) -> Option<(Judged, [f64; 2])> {
        let predicted = self.parts.predicted_by(&read.observations, chosen)?;
        let positions = predicted.positions_m.iter().enumerate();
        let others = || {
            let positions = positions.clone();
            positions.filter(|(index, _)| {
                chosen.binary_search(index).is_err() && self.parts.is_judged(*index)
            })
        };
        let distances =
            others().map(|(index, at)| (read.observations[index].position_m() - at).norm());
        let squares = others().map(|(index, at)| (read.expected_m[index] - at).norm_squared());
        let count = others().count().max(1) as f64;
        let judged = Judged {
            distance: DistanceStatistics::of(distances.collect())?,
            from_all_m: (squares.sum::<f64>() / count).sqrt(),
        };
        Some((judged, predicted.squares_m2))
    }
}

/// What random choices come to: the median of a quantity, and what a twentieth of them stay below and above.
fn spread_of(mut values: Vec<f64>) -> Option<[f64; 3]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = |share: f64| {
        let place = share * last as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the last place"
        )]
        let low = place.floor() as usize;
        let high = (low + 1).min(last);
        values[low] + (values[high] - values[low]) * place.fract()
    };
    Some([0.05, 0.5, 0.95].map(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size whose choices are all far worse than the best of another, but for one that failed altogether.
    #[test]
    fn what_failed_altogether_is_not_usual() {
        let sizes = [
            [vec![0.7, 40.0, 0.9, 0.8, 0.75], vec![0.2, 1.1]],
            [vec![0.1, 0.11, 0.12, 0.13], vec![]],
        ];
        assert_eq!(
            usual(0.08, &sizes).map(f64::to_bits),
            [0.08, 1.1].map(f64::to_bits)
        );
    }
}
