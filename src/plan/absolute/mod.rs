//! Plans of absolute readings: the predicted accuracy of the loaded tool's place in the instrument's frame.
//!
//! Frames of stations and targets are always unknown, with what else is asked for: geometry, compliances. With the rows C of the
//! loaded machining tool's place at the test poses by all of these, and what is known before, rho0^2 = trace(C cov C^T) is eq. 20
//! with the whole vector: compensation takes away what is predicted, so that the residual error is what the parameters' errors make.
//!
//! The place counts in the frame of a station. Of several, it is that where least is left: each station has a frame of its own,
//! which only readings from there tell, so that where the instrument stands is chosen with the readings. Lengths do not show all of
//! such a frame: the place counts in one of theirs, which is otherwise as the planner's model has it, where nothing else is read.

mod assumed;
mod budget;
mod contributions;
mod drawn;
mod from_rows;
mod joint_functions;
mod lengths;
mod offers;
mod predicted_accuracy;
mod readable;
mod stations;
mod tied_choice;
mod together;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeSet;

use super::Criterion;
use super::search::{
    CandidateError, CandidateInformation, CandidatePlan, FiniteBound, FiniteDesign, FiniteEffort,
    FiniteProblem, OfferedCandidates, PlanBound, PlanSize, TogetherBounds, ToldTogether, Watch,
    measurements_in,
};
use crate::compensation::{KnownArm, uncompensated_rows};
use crate::experiment::Candidate;
use crate::identification::AbsoluteCase;
use crate::measurement::AbsoluteReading;
use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::observation::{
    PlannedReadings, ReadingErrors, ReadingKind, Setup, SharedRounding, planned_positions,
    turning_load_rows,
};
use crate::parameter::{ParameterKind, ParameterSet, SourceLevel};
use crate::quantities::limits::MOST_EXPERIMENTS;
use crate::robot::Load;
use crate::task::{Task, TestPose};

pub use drawn::{DrawnWanted, ReadingsWanted};
pub use predicted_accuracy::PredictedAccuracy;

use joint_functions::RobotFunctions;
use predicted_accuracy::{PlaceRows, in_units, known_after, stacked, stacked_task};

use readable::reading_of;
pub use together::RepeatedReading;

/// Searches for one plan.
const SEARCHES: usize = 12;
/// So many names are told one by one.
const NAMED: usize = 6;
/// Candidates that are looked at together.
const TOGETHER: usize = 512;
/// What stands for nothing known, as a share of what a plan tells on average of what it tells most of: more than costs take for
/// singular.
const FAINT: f64 = 1e-8;

/// The readings that may be planned, by what they tell.
#[derive(Debug)]
pub struct AbsolutePlanning<'a> {
    /// How many candidates there were, and why others are not possible.
    pub offer: OfferedCandidates,
    /// Those that are possible.
    pub candidates: Vec<Candidate>,
    task: &'a Task,
    case: AbsoluteCase<'a>,
    set: ParameterSet,
    /// What the scenario names as unknown and nobody asked for.
    unasked: Vec<String>,
    /// The joints' errors that the robot keeps, which tie all readings;
    functions: RobotFunctions,
    /// all other errors of a reading of each candidate besides the instrument's noise,
    errors: Vec<ReadingErrors>,
    /// of which so much is the instrument's,
    rounding: Vec<SharedRounding>,
    /// and which are shared in a configuration, by the number of each candidate's,
    configurations: Vec<usize>,
    /// or in a visit, by the number of what it may share one with.
    visits: Vec<usize>,
    /// The machining tool, by its place among the arm's.
    target: usize,
    poses: Vec<PlaceRows>,
    before: DMatrix<f64>,
    /// What is measured already: the last candidates, which are in `before` and not to be chosen.
    measured: CandidatePlan,
}

/// A plan of absolute readings.
#[derive(Debug, Clone)]
pub struct AbsolutePlan {
    /// The candidates by their places, and how often each is read.
    pub plan: CandidatePlan,
    /// What no plan of as many readings is below.
    pub bound: Option<PlanBound>,
    /// How many searches there were, and how many ended within 0.1 %.
    pub searches: [usize; 2],
}

/// What the candidates can tell at all, and what each tells of that.
struct Shown {
    /// Which candidates these are, by their places.
    places: Vec<usize>,
    /// Directions of the unknowns (p x d).
    basis: DMatrix<f64>,
    told: CandidateInformation,
    /// What several of one configuration tell at most.
    together: Option<TogetherBounds>,
    beside: DMatrix<f64>,
    /// C^T within these directions (d x 3 poses), in the frame of each station that determines the tool's place, by its number.
    test_poses: Vec<(usize, DMatrix<f64>)>,
}

impl AbsolutePlanning<'_> {
    /// The rows of a file of a plan, each with how often it is read.
    pub fn rows(&self, plan: &[(usize, u32)]) -> Vec<Candidate> {
        let rows = self.readings(plan).into_iter();
        rows.map(|(candidate, times)| Candidate {
            most: Some(times),
            ..candidate.clone()
        })
        .collect()
    }

    /// What a plan reads, and how often.
    pub fn readings(&self, plan: &[(usize, u32)]) -> Vec<(&Candidate, u32)> {
        (plan.iter())
            .map(|&(place, times)| (&self.candidates[place], times))
            .collect()
    }

    /// The site that a candidate reads.
    pub fn target(&self, place: usize) -> &str {
        &self.case.targets[self.case.observations[place].setup.target]
    }

    /// A reading of a candidate in which nothing is filled in.
    pub fn blank_reading(&self, place: usize) -> AbsoluteReading {
        AbsoluteReading {
            target: Some(self.target(place).to_owned()),
            ..reading_of(&self.candidates[place], self.case.belief)
        }
    }

    /// What is unknown.
    pub const fn set(&self) -> &ParameterSet {
        &self.set
    }

    /// The arm with the machining tool and what is known of the unknowns.
    pub const fn known_arm<'b>(&'b self, posterior: &'b Posterior) -> KnownArm<'b> {
        KnownArm {
            arm: &self.case.arm,
            tool: self.target,
            set: &self.set,
            posterior,
        }
    }

    /// What an unknown is, in words.
    pub fn words(&self, unknown: usize) -> String {
        self.set.parameters()[unknown].kind.words(&self.case.arm)
    }

    /// The station or the target by its name that an unknown is of.
    pub fn mounted(&self, unknown: usize) -> Option<String> {
        match self.set.parameters()[unknown].kind {
            ParameterKind::BasePosition { station, .. }
            | ParameterKind::BaseRotation { station, .. } => {
                let name = self.case.stations.get(station)?.as_ref()?;
                Some(format!("station {name}"))
            }
            ParameterKind::ToolPosition { tool, .. } | ParameterKind::ToolRotation { tool, .. } => {
                Some(format!("target {}", self.case.targets.get(tool)?))
            }
            _ => None,
        }
    }

    /// What it is planned for.
    pub const fn task(&self) -> &Task {
        self.task
    }

    /// Some candidates, of which so many are to be measured, by what they tell of what they can tell at all.
    fn shown(&self, places: Vec<usize>, measurements: u32) -> Result<Shown, CandidateError> {
        let told_of = |places: &[usize]| {
            let alone = places.iter().map(|&place| vec![(place, 1)]);
            self.told_of(&alone.collect::<Vec<CandidatePlan>>())
        };
        let mut all = DMatrix::zeros(self.set.len(), self.set.len());
        for some in places.chunks(TOGETHER) {
            for told in told_of(some) {
                all += told;
            }
        }
        let estimable = Estimable::new(&(&self.before + &all), &vec![1.0; self.set.len()]);
        // What is hidden matters beside what a plan leaves, and that is what so many average readings do.
        let share = f64::from(measurements) / places.len().max(1) as f64;
        let average = &self.before + all * share.min(1.0);
        let likely = known_after(&self.set, &average).covariance;
        let scales = self.set.scales();
        let frames = self.frames().into_iter();
        let rows: Vec<(usize, DMatrix<f64>)> = frames
            .map(|station| (station, stacked(&self.poses, station)))
            .collect();
        let missing_of = |(_, rows): &(usize, DMatrix<f64>)| {
            let own = in_units(rows.clone(), &scales);
            let variance = (&own * &likely * own.transpose()).trace();
            estimable.missing(rows, variance.max(0.0).sqrt())
        };
        let missing: Vec<Vec<usize>> = rows.iter().map(missing_of).collect();
        if let Some(fewest) = missing.iter().min_by_key(|missing| missing.len())
            && !fewest.is_empty()
        {
            let name = |&index: &usize| self.set.parameters()[index].name.clone();
            let names = some_of(&fewest.iter().map(name).collect::<Vec<String>>());
            let unread = self
                .unread()
                .map(|target| format!("; none of them reads {target}"));
            let problem = format!(
                "the tool's place at the test poses depends on {names}, which the candidates do not separate{}",
                unread.unwrap_or_default()
            );
            let hint = "give candidates in which all joints differ and whose target is the machining site, or say with [[uncertainty]] \
                        how well joints and links are known";
            return Err(CandidateError::new(problem, Some(hint)).whatever_number());
        }
        let basis = estimable.basis();
        let within = |matrix: &DMatrix<f64>| basis.tr_mul(matrix) * basis;
        let mut told = CandidateInformation::new(basis.ncols());
        for some in places.chunks(TOGETHER) {
            let reduced: Vec<DMatrix<f64>> = told_of(some).par_iter().map(within).collect();
            for information in &reduced {
                told.push(information);
            }
        }
        let determined = (rows.iter().zip(&missing)).filter(|(_, missing)| missing.is_empty());
        Ok(Shown {
            beside: within(&self.before),
            test_poses: determined
                .map(|((station, rows), _)| (*station, basis.tr_mul(&rows.transpose())))
                .collect(),
            together: self.bounds_together(&places, basis),
            basis: basis.clone(),
            told,
            places,
        })
    }

    /// The problem of choosing so many of these candidates where the tool's place counts in one frame.
    ///
    /// The best plans leave undetermined what the tool's place does not need, such as the frames of other stations. A faint
    /// knowledge of everything keeps the costs finite; it can only lower them, so that bounds hold.
    fn problem<'s>(
        &'s self,
        shown: &'s Shown,
        test_poses: &DMatrix<f64>,
        measurements: u32,
    ) -> FiniteProblem<'s> {
        let told = |measured: &[(usize, u32)]| {
            let group = measured.iter();
            let group = group.map(|&(index, times)| (shown.places[index], times));
            let told = self.told_by(&mut self.equations(), &group.collect::<CandidatePlan>());
            shown.basis.tr_mul(&told) * &shown.basis
        };
        let places = || shown.places.iter();
        let faint = FAINT * f64::from(measurements) * shown.told.mean().diagonal().amax();
        let size = shown.told.size();
        FiniteProblem {
            criterion: Criterion::TestPose,
            test_poses: test_poses.clone(),
            beside: &shown.beside + DMatrix::identity(size, size) * faint,
            told: shown.told.clone(),
            most: places().map(|&place| self.most(place)).collect(),
            configurations: places().map(|&place| self.configurations[place]).collect(),
            mandatory: BTreeSet::new(),
            told_together: (self.shares(&shown.places))
                .then(|| -> Box<ToldTogether<'s>> { Box::new(told) }),
            bounds: shown.together.as_ref(),
        }
    }

    /// How often a candidate may be read.
    fn most(&self, place: usize) -> u32 {
        self.candidates[place].most.unwrap_or(MOST_EXPERIMENTS)
    }

    /// All candidates that may be chosen.
    fn places(&self) -> Vec<usize> {
        (0..self.candidates.len() - self.measured.len()).collect()
    }

    /// The best plan of so many readings, of so many different candidates, begun also from plans that are known.
    ///
    /// # Errors
    /// The candidates do not determine the tool's place, or allow fewer readings.
    pub fn design_from(
        &self,
        known: &[CandidatePlan],
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<AbsolutePlan, CandidateError> {
        let found = self.design_by(SEARCHES, known, size, seed, watch)?;
        let bound = match found.bound {
            None if self.ties_all() => self.bound(&found.plan)?,
            bound => bound,
        };
        Ok(AbsolutePlan { bound, ..found })
    }

    /// The best plan that is found by so many searches and from plans that are known; where functions tie readings, without a bound.
    fn design_by(
        &self,
        searches: usize,
        known: &[CandidatePlan],
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<AbsolutePlan, CandidateError> {
        let measurements = size.measurements;
        let effort = FiniteEffort {
            measurements,
            configurations: size.configurations,
            searches,
            seed,
            is_thorough: false,
        };
        if let Some(tied) = self.tied_plan(known, effort, watch.stop) {
            (watch.progress)(1, 1, f64::INFINITY);
            return Ok(tied);
        }
        let shown = self.shown(self.places(), measurements)?;
        let frames = shown.test_poses.len();
        let (mut designs, mut bounds) = (Vec::new(), Vec::new());
        for (frame, (station, test_poses)) in shown.test_poses.iter().enumerate() {
            let problem = &self.problem(&shown, test_poses, measurements);
            let search = |here: Watch<'_>| self.search(problem, *station, known, effort, here);
            let found = watch.part(frame, frames, search);
            // Where no plan was found, others have a bound there none the less.
            bounds.push(match &found {
                Ok(design) => Some(design.bound.clone()),
                Err(_) => problem.weigh(measurements).ok().map(|(_, bound)| bound),
            });
            designs.push(found);
        }
        let cost = |found: &Result<FiniteDesign, CandidateError>| {
            found.as_ref().map_or(f64::INFINITY, |found| found.cost)
        };
        let best = (designs.into_iter()).min_by(|one, other| cost(one).total_cmp(&cost(other)));
        let best = best.unwrap_or_else(|| Err(CandidateError::undetermined()))?;
        if let Err(names) = self.prediction(&best.plan).left {
            let problem = format!(
                "no {measurements} readings of the candidates were found that determine the tool's place at the test poses: it depends on {} besides",
                some_of(&names)
            );
            let hint = "give more --experiments, or more candidates";
            return Err(CandidateError::new(problem, Some(hint)));
        }
        Ok(AbsolutePlan {
            bound: self.bound_of(&bounds, measurements),
            plan: best.plan,
            searches: best.searches,
        })
    }

    /// Searches among all candidates and, where there are several stations, among those of the one in whose frame the place counts:
    /// few readings from elsewhere tell of themselves alone, and exchanges of one at a time hardly leave them. Goes on from plans that
    /// are known, too.
    fn search(
        &self,
        problem: &FiniteProblem<'_>,
        station: usize,
        known: &[CandidatePlan],
        effort: FiniteEffort,
        watch: Watch<'_>,
    ) -> Result<FiniteDesign, CandidateError> {
        let found = problem.search(effort, watch);
        let mut from_there = self.places();
        from_there.retain(|&place| self.station_of(place) == station);
        let is_one = from_there.len() == self.places().len();
        if is_one && known.is_empty() {
            return found;
        }
        let measurements = effort.measurements;
        let search_there = || {
            if is_one {
                return None;
            }
            let shown = self.shown(from_there, measurements).ok()?;
            let mut frames = shown.test_poses.iter();
            let (_, test_poses) = frames.find(|frame| frame.0 == station)?;
            let there = self.problem(&shown, test_poses, measurements);
            let mut found = there.search(effort, Watch::quiet(watch.stop)).ok()?;
            for (place, _) in &mut found.plan {
                *place = shown.places[*place];
            }
            Some(found)
        };
        let from_one = search_there();
        let plans = from_one.iter().map(|design| &design.plan).chain(known);
        let plans: Vec<CandidatePlan> = plans.cloned().collect();
        // An identification refuses readings of other stations that are too few to place these.
        let is_fitted = |plan: &CandidatePlan| self.unplaced_stations(plan).is_empty();
        let fitted = found.as_ref().ok().filter(|found| is_fitted(&found.plan));
        let another = fitted.map_or(f64::INFINITY, |found| found.cost);
        let Some((plan, cost)) = problem.bettered(&plans, effort, another, is_fitted) else {
            return found;
        };
        let searched = from_one.as_ref().or(found.as_ref().ok());
        Ok(FiniteDesign {
            searches: searched.map_or([0; 2], |design| design.searches),
            bound: problem.bound_of(&plan)?,
            plan,
            cost,
        })
    }

    /// What no plan of as many readings of the candidates is below, as a plan of them tells it.
    ///
    /// # Errors
    /// The candidates do not determine the tool's place.
    pub fn bound(&self, plan: &[(usize, u32)]) -> Result<Option<PlanBound>, CandidateError> {
        let measurements = measurements_in(plan);
        let shown = self.shown(self.places(), measurements)?;
        let in_frame = |(_, test_poses): &(usize, DMatrix<f64>)| {
            let problem = self.problem(&shown, test_poses, measurements);
            problem.bound_of(plan).ok()
        };
        let bounds: Vec<Option<FiniteBound>> = shown.test_poses.iter().map(in_frame).collect();
        Ok(self.bound_of(&bounds, measurements))
    }

    /// The lowest of the bounds in all frames; none unless there is one in each.
    fn bound_of(&self, bounds: &[Option<FiniteBound>], measurements: u32) -> Option<PlanBound> {
        if self.shares_with_measured() {
            return None;
        }
        let each = (bounds.iter()).map(|bound| bound.as_ref()?.least_cost(measurements));
        let least = each.reduce(|one, other| Some(one?.min(other?)))??;
        let best = (least + stacked_task(&self.poses).norm_squared()).sqrt();
        let places = self.places().len();
        Some(PlanBound::of_all(best, places, self.kept_errors()))
    }

    /// The predicted accuracy of a plan: candidates by their places, and how often each is read.
    pub fn prediction(&self, plan: &[(usize, u32)]) -> PredictedAccuracy {
        let (information, poses) = if self.ties_all() {
            self.tied_together(plan)
        } else {
            let told = self.told_of(&self.groups(plan)).into_iter();
            (
                told.fold(self.before.clone(), |sum, told| sum + told),
                self.poses.clone(),
            )
        };
        let posterior = known_after(&self.set, &information);
        PredictedAccuracy {
            task_force_m: stacked_task(&self.poses).norm(),
            ..PredictedAccuracy::new(posterior, &poses, &self.set.scales(), measurements_in(plan))
        }
    }
}

/// Some names, and how many more there are.
fn some_of(names: &[String]) -> String {
    let (some, rest) = names.split_at(names.len().min(NAMED));
    let some = some.join(", ");
    if rest.is_empty() {
        some
    } else {
        format!("{some} and {} more unknowns", rest.len())
    }
}

/// The setup in which a target is read from a station, both by their numbers.
fn setup_of(q: &DVector<f64>, load: Load, [target, station]: [usize; 2]) -> Setup {
    Setup {
        commanded_rad: q.clone(),
        load,
        hangs_on: None,
        target,
        station,
        approach: None,
    }
}

/// How the tool's place follows the unknowns at the test poses, in the frame of each station.
fn place_rows(
    task: &Task,
    case: &AbsoluteCase<'_>,
    set: &ParameterSet,
    target: usize,
) -> Vec<PlaceRows> {
    let by_station: Vec<(usize, DMatrix<f64>)> = (case.framing_stations().into_iter())
        .map(|station| {
            let setups = task.test_poses.iter();
            let setups =
                setups.map(|pose| setup_of(&pose.configuration_rad, pose.load, [target, station]));
            let setups: Vec<Setup> = setups.collect();
            let wanted = setups.iter().map(|setup| (setup, ReadingKind::Position));
            let wanted: Vec<_> = wanted.collect();
            let mean = &set.prior().mean;
            let mut rows = planned_positions(set, &case.arm, mean, &wanted);
            let turns = |(index, pose): (usize, &TestPose)| pose.load_axes.map(|_| index);
            for index in task.test_poses.iter().enumerate().filter_map(turns) {
                let mut place = rows.rows_mut(3 * index, 3);
                place += turning_load_rows(set, &case.arm, mean, &setups[index]);
            }
            set.under_loads_of_task(&mut rows);
            (station, rows)
        })
        .collect();
    (task
        .test_poses
        .iter()
        .zip(by_task(task, &of_task(task)))
        .enumerate())
    .map(|(index, (pose, by_task))| PlaceRows {
        weight: pose.weight,
        by_station: (by_station.iter())
            .map(|(station, rows)| {
                let own = rows.rows(3 * index, 3).into_owned();
                (*station, pose.counted_rows(own))
            })
            .collect(),
        by_task,
    })
    .collect()
}

/// The parameters of the task's force that the planner's model has, each with its standard deviation.
fn of_task(task: &Task) -> Vec<(ParameterKind, f64)> {
    let extended = &task.belief.uncertain;
    let parameters = extended.set().parameters().iter().enumerate();
    parameters
        .filter(|(_, each)| each.kind.level() == SourceLevel::Task)
        .map(|(place, each)| (each.kind, extended.prior_deviation(place).unwrap_or(0.0)))
        .collect()
}

/// How the tool's place follows parameters of the task's force at each test pose, what counts of it (3 x t, m in standard deviations).
fn by_task(task: &Task, of_task: &[(ParameterKind, f64)]) -> Vec<DMatrix<f64>> {
    let arm = task.belief.arm();
    let parameters = of_task.iter().map(|&(kind, size)| (kind, Some(size)));
    let Ok(set) = ParameterSet::new(&arm, parameters) else {
        return vec![DMatrix::zeros(3, 0); task.test_poses.len()];
    };
    let sizes: Vec<f64> = of_task.iter().map(|(_, deviation)| *deviation).collect();
    let rows = |pose| {
        let model = PlannedReadings::at_test_pose(&arm, arm.tools.len() - 1, &set, &sizes);
        uncompensated_rows(model, pose)
    };
    task.test_poses.iter().map(rows).collect()
}
