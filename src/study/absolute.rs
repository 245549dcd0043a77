//! The reference simulation of plans of absolute readings: robots are sampled, read in MuJoCo as the plan says, identified, and looked at
//! where they must be accurate.
//!
//! In run r, everything that the scenario lists as uncertain is sampled as in any study, each at its level: the targets that one visit
//! reads share its errors. What is unknown and of which nothing is known before is sampled by shares of its typical size, and the
//! instrument's frames are anywhere. The one fit sees readings with the covariance that they were planned with, and what it then says of
//! the loaded tool's place is compared with where the virtual robot has it.

use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Matrix6xX, Point3, Rotation3, SymmetricEigen, Vector3,
};
use thiserror::Error;

use super::StudyError;
use super::runner::RunsInBlocks;
use super::summary::Summary;
use super::tally::{Batch, Failure, Tally};
use super::verdict::Kept;
use super::virtual_readings::{ReadPlan, TargetReading, VirtualReadingError};
use crate::files::FileError;
use crate::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use crate::measurement::AbsoluteReading;
use crate::numeric::random::normal::LANES;
use crate::numeric::tolerance::CHI_SQUARE_95;
use crate::observation::{Form, ObservationModel, ReadingKind, Setup, SharedErrors};
use crate::parameter::{ErrorDistribution, ParameterKind, ParameterSet, Source, Uncertainty};
use crate::plan::absolute::{AbsolutePlanning, PredictedAccuracy, RepeatedReading};
use crate::task::Task;
use crate::testbed::{TrueRobots, Truth};

/// What nothing is known of is drawn with this share of its typical size ...
const SHARE_OF_SIZE: f64 = 0.3;
/// ... and compliances with this standard deviation of their logarithm.
const COMPLIANCE_SPREAD: f64 = 0.1;
/// The runs of a block, the unit of work: a run takes longer than one of deflections. Sums depend on it, so it is fixed.
pub const BLOCK_RUNS: u64 = LANES as u64;

/// A plan of absolute readings that takes part in a study.
#[derive(Debug)]
pub struct AbsoluteEntry<'a> {
    /// Its name.
    pub name: String,
    /// The readings that there may be.
    pub planning: AbsolutePlanning<'a>,
    /// The plan: candidates by their places, and how often each is read.
    pub plan: Vec<(usize, u32)>,
    /// Whether it was drawn at random.
    pub is_random: bool,
}

/// Why no robots can be drawn.
#[derive(Debug, Error)]
pub enum TrialError {
    /// The virtual robot lacks something.
    #[error(transparent)]
    Model(#[from] FileError),
    /// Nothing tells where the machining tool is.
    #[error("no reading of the plan is of {0}, whose place is predicted: it is assumed exact")]
    Unread(String),
    /// Nothing is predicted.
    #[error("there is no predicted accuracy: the plan does not determine the tool's place")]
    NoPrediction,
    /// None could be judged.
    #[error("no robot of {robots} could be identified and looked at: {first}")]
    AllFailed {
        /// How many there were.
        robots: u64,
        /// What the first failed by.
        first: String,
    },
    /// The runs could not be made.
    #[error(transparent)]
    Runs(#[from] StudyError),
}

/// A plan made ready: what is drawn, read and held against what.
#[derive(Debug)]
struct JudgedPlan<'a> {
    entry: &'a AbsoluteEntry<'a>,
    prediction: PredictedAccuracy,
    predicted_m: f64,
    /// How it is carried out.
    read: ReadPlan<'a>,
    truth: Truth,
    /// Where the tool is predicted to be at each test pose.
    regions: Vec<PlaceRegion>,
}

/// A region in which the tool is predicted to be.
#[derive(Debug, Clone, Copy)]
struct PlaceRegion {
    /// Turns what is left into numbers of unit variance.
    whitener: Matrix3<f64>,
    /// How many of them there are.
    freedom: usize,
}

/// Directions of a region in which less than this share of the largest variance is left do not count.
const FLAT: f64 = 1e-9;

impl PlaceRegion {
    fn new(covariance: &Matrix3<f64>) -> Self {
        let eigen = SymmetricEigen::new(*covariance);
        let least = FLAT * eigen.eigenvalues.max();
        let mut whitener = Matrix3::zeros();
        let mut freedom = 0;
        for (axis, variance) in eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues) {
            if *variance > least {
                whitener.set_row(freedom, &(axis.transpose() / variance.sqrt()));
                freedom += 1;
            }
        }
        Self { whitener, freedom }
    }

    /// The normalised square of an error, and whether it is within the region of 95 %.
    fn look(&self, off: &Vector3<f64>) -> (f64, bool) {
        let square = (self.whitener * off).norm_squared();
        let most = self.freedom.checked_sub(1).map(|last| CHI_SQUARE_95[last]);
        (square, most.is_none_or(|most| square <= most))
    }
}

/// Runs of plans of absolute readings on virtual robots, in blocks.
#[derive(Debug)]
pub struct AbsoluteRunner<'a> {
    task: &'a Task,
    groups: &'a [ParameterGroup],
    seed: u64,
    tried: Vec<JudgedPlan<'a>>,
    stop: Option<&'a AtomicBool>,
    /// The first run that failed, and why.
    first_failure: Mutex<Option<(u64, String)>>,
}

impl<'a> AbsoluteRunner<'a> {
    /// Prepares plans for a task, a virtual robot, what is unknown besides what the belief says, and a seed.
    pub fn new(
        (task, truth): (&'a Task, &Truth),
        groups: &'a [ParameterGroup],
        seed: u64,
        entries: &'a [AbsoluteEntry<'a>],
    ) -> Result<Self, TrialError> {
        let tried = (entries.iter())
            .map(|entry| JudgedPlan::new(task, truth, entry))
            .collect::<Result<Vec<_>, _>>()?;
        // What the model lacks is told before the work.
        for each in &tried {
            each.robots(task)?;
        }
        Ok(Self {
            task,
            groups,
            seed,
            tried,
            stop: None,
            first_failure: Mutex::new(None),
        })
    }

    /// The same, which gives up when the flag is set.
    pub fn stopped_by(self, stop: &'a AtomicBool) -> Self {
        Self {
            stop: Some(stop),
            ..self
        }
    }

    /// What each plan predicts.
    pub fn predictions(&self) -> impl Iterator<Item = &PredictedAccuracy> {
        self.tried.iter().map(|each| &each.prediction)
    }

    /// Why the first of the runs that were made and failed did so.
    pub fn first_failure(&self) -> Option<String> {
        let first = self.first_failure.lock().ok()?;
        first.as_ref().map(|(_, reason)| reason.clone())
    }

    fn note(&self, run: u64, reason: String) {
        if let Ok(mut first) = self.first_failure.lock()
            && first.as_ref().is_none_or(|(known, _)| run < *known)
        {
            *first = Some((run, reason));
        }
    }

    /// One run of one plan: draws, reads, identifies, and looks.
    fn see(
        &self,
        tried: &JudgedPlan<'_>,
        robots: &mut TrueRobots,
        run: u64,
        (batch, lane): (&mut Batch, usize),
    ) -> Result<(), Unseen> {
        let task = self.task;
        let belief = &task.belief;
        let no_reading = unseen(Failure::Measurement);
        (robots.become_run_of(&tried.truth, tried.read.len(), self.seed, run))
            .map_err(|error| no_reading(&error))?;
        let frames = tried.read.frames([self.seed, run]);
        let read = self.read(tried, robots, &frames, run);
        let read = read.map_err(|error| no_reading(&error))?;
        let no_fit = unseen(Failure::Identification);
        let case = AbsoluteCase::new(belief, &read).map_err(|error| no_fit(&error))?;
        let mut case = case.sharing(tried.sharing(&frames));
        let fit = case
            .fit(self.groups, ReadingWeights::AsNeeded)
            .map_err(|error| no_fit(&error))?;
        let frame = tried.prediction.station;
        let own = &tried.entry.planning.stations()[frame];
        let station = case.stations.iter().position(|name| name == own);
        let machining = &belief.machining_tool.name;
        let target = case.targets.iter().position(|target| target == machining);
        let (Some(station), Some(target)) = (station, target) else {
            let reason = "no reading that counts is there".to_owned();
            return Err((Failure::Undetermined, reason));
        };
        let mut arm = fit.arm;
        // What scales the loads of the readings is not the task's.
        (arm.load_scale, arm.load_offset_n) = (1.0, 0.0);
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        let variance_m2 = belief.instrument.sigma_m.powi(2);
        let mut square_m2 = 0.0;
        let no_rest = unseen(Failure::TestPose);
        for (pose, region) in task.test_poses.iter().zip(&tried.regions) {
            let setup = Setup {
                commanded_rad: pose.configuration_rad.clone(),
                load: pose.load,
                target,
                station,
                approach: None,
            };
            let said = model
                .predict(Form::AtRest, &setup, ReadingKind::Position, &mut ignored)
                .map_err(|error| no_rest(&error))?;
            let is_at = robots
                .machining_tool_at_work(&pose.configuration_rad, pose)
                .map_err(|error| no_rest(&error))?;
            let frame = &frames[frame];
            let off = (frame * Point3::from(is_at)).coords - said.position_m;
            let counted = pose.counted(&(frame.rotation.inverse() * off));
            square_m2 += pose.weight * counted.norm_squared();
            let (nees, is_inside) = region.look(&counted);
            batch.nees[lane] += nees;
            batch.freedom[lane] += region.freedom;
            batch.intervals[lane][0] += 1;
            batch.intervals[lane][1] += u32::from(is_inside);
        }
        batch.square[lane] = square_m2 / variance_m2;
        batch.expected[lane] = tried.predicted_m.powi(2) / variance_m2;
        let variance_m4 = tried.prediction.square_variance_m4.unwrap_or(0.0);
        batch.variance[lane] = variance_m4 / variance_m2.powi(2);
        Ok(())
    }

    /// What the instrument says: of each reading that visits repeat alike, the mean.
    fn read(
        &self,
        tried: &JudgedPlan<'_>,
        robots: &mut TrueRobots,
        frames: &[Isometry3<f64>],
        run: u64,
    ) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
        let planning = &tried.entry.planning;
        let is_pose = self.task.belief.instrument.rotation_sigma_rad.is_some();
        let of_one = |(each, shown): (RepeatedReading, Vec<TargetReading>)| {
            let sum_m: Vector3<f64> = shown.iter().map(|shown| shown.position_m).sum();
            let turns: Vec<Rotation3<f64>> = shown.iter().map(|shown| shown.rotation).collect();
            let covariance = planning.own_covariance(each.place, each.times);
            let covariance = turned(&covariance, &frames[planning.station_of(each.place)]);
            let mean = (
                sum_m / f64::from(each.times),
                is_pose.then(|| mean_turn(&turns)),
            );
            tried.read.reading(each.place, mean, covariance)
        };
        let read = (tried.read).read(self.task, robots, frames, [self.seed, run])?;
        Ok(read.into_iter().map(of_one).collect())
    }
}

/// Why nothing is seen, in words too.
type Unseen = (Failure, String);

fn unseen(failure: Failure) -> impl Fn(&dyn std::error::Error) -> Unseen {
    move |error| (failure, error.to_string())
}

impl RunsInBlocks for AbsoluteRunner<'_> {
    type Workspace<'a>
        = Vec<TrueRobots>
    where
        Self: 'a;

    fn block_runs(&self) -> u64 {
        BLOCK_RUNS
    }

    /// The first random one.
    fn references(&self) -> Vec<Option<usize>> {
        let random = self.tried.iter().position(|each| each.entry.is_random);
        vec![random; self.tried.len()]
    }

    fn stop(&self) -> Option<&AtomicBool> {
        self.stop
    }

    fn workspace(&self) -> Result<Self::Workspace<'_>, StudyError> {
        let robots = self.tried.iter().map(|each| each.robots(self.task));
        Ok(robots.collect::<Result<_, _>>()?)
    }

    fn draw<'a>(&'a self, _: &mut Self::Workspace<'a>, _: u64) {}

    fn make<'a>(
        &'a self,
        robots: &mut Self::Workspace<'a>,
        plan: usize,
        (first, count): (u64, usize),
        batch: &mut Batch,
    ) -> Result<(), StudyError> {
        *batch = Batch::default();
        for (lane, run) in (first..).take(count).enumerate() {
            self.proceed()?;
            let seen = self.see(&self.tried[plan], &mut robots[plan], run, (batch, lane));
            if let Err((failure, reason)) = seen {
                batch.failed[lane] = Some(failure);
                self.note(run, reason);
            }
        }
        Ok(())
    }
}

impl<'a> JudgedPlan<'a> {
    fn new(
        task: &'a Task,
        truth: &Truth,
        entry: &'a AbsoluteEntry<'a>,
    ) -> Result<Self, TrialError> {
        let belief = &task.belief;
        let read = ReadPlan::new(task, &entry.planning, &entry.plan);
        let machining = &belief.machining_tool.name;
        if !read.targets().any(|target| target == machining) {
            return Err(TrialError::Unread(machining.clone()));
        }
        let prediction = entry.planning.prediction(&entry.plan);
        let predicted_m = prediction.rho0_m().ok_or(TrialError::NoPrediction)?;
        let no_place = Matrix3::zeros();
        Ok(Self {
            regions: (prediction.places_m2.iter())
                .map(|place| PlaceRegion::new(place.as_ref().unwrap_or(&no_place)))
                .collect(),
            truth: Truth {
                uncertainties: uncertainties(truth, &entry.planning),
                ..truth.clone()
            },
            read,
            entry,
            prediction,
            predicted_m,
        })
    }

    fn robots(&self, task: &Task) -> Result<TrueRobots, FileError> {
        TrueRobots::of_readings(&task.belief, &self.truth, self.read.targets())
    }
}

/// What was seen of a plan's prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteTrials {
    /// How many robots were drawn.
    pub robots: u64,
    /// Why the first of those that could not be identified, or not looked at, could not be.
    pub first_failure: Option<String>,
    /// The predicted rms distance (m).
    pub predicted_m: f64,
    /// What 95 % were predicted to stay below (m).
    pub quantile95_m: Option<f64>,
    /// What is kept of the runs, whose distances are in units of the instrument's sigma.
    pub tally: Tally,
    /// What it says.
    pub summary: Summary,
    /// The instrument's sigma (m).
    pub sigma_m: f64,
}

impl AbsoluteTrials {
    /// Draws so many robots for the first plan of a runner, and looks at each.
    ///
    /// # Errors
    /// None of them could be looked at, or it was asked to stop.
    pub fn new(
        runner: &AbsoluteRunner<'_>,
        robots: u64,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Self, TrialError> {
        let blocks = 0..runner.blocks(robots);
        let tallies = runner.run(robots, blocks, 1, progress)?;
        let tally = tallies.into_iter().next().ok_or(StudyError::NoPlan)?;
        let tried = runner.tried.first().ok_or(StudyError::NoPlan)?;
        let sigma_m = runner.task.belief.instrument.sigma_m;
        Ok(Self {
            robots,
            first_failure: runner.first_failure(),
            predicted_m: tried.predicted_m,
            quantile95_m: tried.prediction.quantile95_m,
            summary: Summary::new(&tally, sigma_m, None).ok_or_else(|| TrialError::AllFailed {
                robots,
                first: runner.first_failure().unwrap_or_default(),
            })?,
            tally,
            sigma_m,
        })
    }

    /// Whether the prediction was kept.
    pub fn kept(&self) -> Kept {
        Kept::of(self.predicted_m, self.summary.rms_m)
    }

    /// The share of robots that stayed below what 95 % were predicted to.
    pub fn below_quantile95(&self) -> Option<f64> {
        self.tally.share_below(self.quantile95_m? / self.sigma_m)
    }
}

/// What the virtual robots differ in: what the scenario lists, and what is unknown and of which nothing is known.
fn uncertainties(truth: &Truth, planning: &AbsolutePlanning<'_>) -> Vec<Uncertainty> {
    let unknown = planning.set().parameters().iter();
    let drawn: Vec<(ParameterKind, f64)> = unknown
        .filter(|parameter| parameter.prior_deviation.is_none())
        .filter_map(|parameter| match parameter.kind {
            kind @ (ParameterKind::JointZero { .. }
            | ParameterKind::LinkPosition { .. }
            | ParameterKind::LinkRotation { .. }
            | ParameterKind::JointWave { .. }) => Some((kind, SHARE_OF_SIZE * parameter.scale)),
            kind @ ParameterKind::JointCompliance { .. } => Some((kind, COMPLIANCE_SPREAD)),
            _ => None,
        })
        .collect();
    let mut all = truth.uncertainties.clone();
    if !drawn.is_empty() {
        all.push(Uncertainty {
            name: "unknown".to_owned(),
            is_hidden: false,
            distribution: ErrorDistribution::Normal,
            source: Source::Plan(drawn),
        });
    }
    all
}

impl JudgedPlan<'_> {
    /// The errors that readings share, from an instrument with these frames.
    fn sharing(&self, frames: &[Isometry3<f64>]) -> SharedErrors {
        let mut next = 0;
        let of_group = |group: &Vec<RepeatedReading>| {
            let mut sharing = self.entry.planning.sharing(group, frames);
            for reading in &mut sharing.readings {
                *reading += next;
            }
            next += group.len();
            sharing
        };
        SharedErrors {
            groups: self.read.groups.iter().map(of_group).collect(),
        }
    }
}

/// The mean of rotations that hardly differ.
fn mean_turn(turns: &[Rotation3<f64>]) -> Rotation3<f64> {
    let first = turns.first().copied().unwrap_or_else(Rotation3::identity);
    let off: Vector3<f64> = turns
        .iter()
        .map(|turn| (turn * first.inverse()).scaled_axis())
        .sum();
    Rotation3::new(off / turns.len().max(1) as f64) * first
}

/// A covariance in the world frame as one in the instrument's.
fn turned(covariance: &Matrix6<f64>, frame: &Isometry3<f64>) -> Matrix6<f64> {
    let axes: Matrix3<f64> = frame.rotation.to_rotation_matrix().into_inner();
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(&axes);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(&axes);
    let turned = both * covariance * both.transpose();
    // Rounding leaves the halves apart, and a covariance has one value for both.
    (turned + turned.transpose()) / 2.0
}
