//! Whether a plan of absolute readings keeps its promise: robots are drawn, read in MuJoCo as the plan says, identified, and looked at
//! where they must be accurate.
//!
//! In run r, everything that the scenario lists as uncertain is drawn as in any study; what is unknown and of which nothing is known
//! before is drawn by shares of its typical size, and the instrument's frames are anywhere. The one fit sees readings with the covariance
//! that they were planned with, and what it then says of the loaded tool's place is compared with where the virtual robot has it.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Matrix6xX, Quaternion, Rotation3, Translation3, UnitQuaternion,
    Vector3,
};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use thiserror::Error;

use super::true_compliances::truth_of_run;
use crate::experiment::{Candidate, Experiment};
use crate::identification::{AbsoluteCase, ParameterGroup, ReadingWeights};
use crate::measurement::AbsoluteReading;
use crate::mujoco::ModelError;
use crate::numeric::random::generator;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::{Stream, frames_of_trial};
use crate::observation::{Form, ObservationModel, ReadingKind, Setup};
use crate::parameter::{ParameterKind, ParameterSet, Source, Uncertainty};
use crate::plan::absolute::{AbsolutePlanning, AbsolutePromise};
use crate::robot::Load;
use crate::task::{Task, station_named};
use crate::testbed::{ReadRobots, SeenFrom, Truth};

/// What nothing is known of is drawn with this share of its typical size ...
const SHARE_OF_SIZE: f64 = 0.3;
/// ... and compliances with this standard deviation of their logarithm.
const COMPLIANCE_SPREAD: f64 = 0.1;
/// The instrument is within such a cube about the robot (m).
const AWAY_M: f64 = 3.0;
/// More standard errors than this are not chance ...
const STANDARD_ERRORS: f64 = 3.0;
/// ... nor are they what linear propagation leaves out, beyond this share.
const LINEAR: f64 = 0.02;

/// A plan of absolute readings that is tried.
#[derive(Debug, Clone, Copy)]
pub struct PlanOnTrial<'a> {
    /// The task.
    pub task: &'a Task,
    /// The virtual robot.
    pub truth: &'a Truth,
    /// What is unknown besides what the belief says.
    pub groups: &'a [ParameterGroup],
    /// The readings that there may be.
    pub planning: &'a AbsolutePlanning<'a>,
    /// The plan: candidates by their places, and how often each is read.
    pub plan: &'a [(usize, u32)],
    /// What it promises.
    pub promise: &'a AbsolutePromise,
    /// Of all random numbers.
    pub seed: u64,
}

/// Why no robots can be drawn.
#[derive(Debug, Error)]
pub enum TrialError {
    /// The virtual robot lacks something.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Nothing tells where the machining tool is.
    #[error("no reading of the plan is of {0}, whose place is promised: it is taken for certain")]
    Unread(String),
    /// Nothing is promised.
    #[error("the plan promises nothing that could be kept: it does not determine the tool's place")]
    NoPromise,
    /// None could be judged.
    #[error("no robot of {robots} could be identified and looked at: {first}")]
    AllFailed {
        /// How many there were.
        robots: u64,
        /// What the first failed by.
        first: String,
    },
    /// It was asked to stop.
    #[error("interrupted")]
    Stopped,
}

/// What was seen of a plan's promise.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteTrials {
    /// How many robots were drawn.
    pub robots: u64,
    /// How many of them could not be identified, or not looked at.
    pub failed: u64,
    /// What the first of these failed by.
    pub first_failure: Option<String>,
    /// The promised rms distance (m).
    pub promised_m: f64,
    /// The rms distance that was left (m), over robots and test poses.
    pub seen_m: f64,
    /// Its standard error (m).
    pub seen_std_m: f64,
    /// The share of robots that stayed below what 95 % were promised to.
    pub below_quantile95: Option<f64>,
}

/// How a promise came off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// Within three standard errors and 2 %.
    Holds,
    /// More is left.
    Broken,
    /// Less is left.
    TooCareful,
}

impl Kept {
    /// Its name in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Broken => "broken",
            Self::TooCareful => "too careful",
        }
    }
}

impl AbsoluteTrials {
    /// Whether the promise was kept.
    #[must_use]
    pub fn kept(&self) -> Kept {
        let room = STANDARD_ERRORS * self.seen_std_m + LINEAR * self.promised_m;
        if self.seen_m > self.promised_m + room {
            Kept::Broken
        } else if self.seen_m < self.promised_m - room {
            Kept::TooCareful
        } else {
            Kept::Holds
        }
    }
}

/// Draws so many robots, and looks at each.
///
/// # Errors
/// See [`TrialError`].
pub fn try_plan(
    tried: &PlanOnTrial<'_>,
    robots: u64,
    (stop, progress): (&AtomicBool, &(dyn Fn() + Sync)),
) -> Result<AbsoluteTrials, TrialError> {
    let belief = &tried.task.belief;
    let machining = &belief.machining_tool.name;
    let rows: Vec<&Candidate> = (tried.plan.iter())
        .map(|&(place, _)| &tried.planning.candidates[place])
        .collect();
    let target_of = |row: &Candidate| match &row.target {
        Some(target) => target.clone(),
        None => belief.calibration_tool.name.clone(),
    };
    if !rows.iter().any(|row| target_of(row) == *machining) {
        return Err(TrialError::Unread(machining.clone()));
    }
    let promised_m = tried.promise.rho0_m().ok_or(TrialError::NoPromise)?;
    let truth = Truth {
        uncertainties: uncertainties(tried),
        ..tried.truth.clone()
    };
    let targets: Vec<String> = rows.iter().map(|row| target_of(row)).collect();
    let new_robots = || ReadRobots::new(belief, &truth, targets.iter().map(String::as_str));
    // What the model lacks is told once.
    new_robots()?;
    let squares: Vec<Result<f64, String>> = (0..robots)
        .into_par_iter()
        .map_init(new_robots, |drawn, run| {
            if stop.load(Ordering::Relaxed) {
                return Err(String::new());
            }
            let seen = match drawn {
                Ok(drawn) => Trial {
                    tried,
                    truth: &truth,
                    targets: &targets,
                    run,
                }
                .square(drawn),
                Err(error) => Err(error.to_string()),
            };
            progress();
            seen
        })
        .collect();
    if stop.load(Ordering::Relaxed) {
        return Err(TrialError::Stopped);
    }
    let first_failure = squares.iter().find_map(|each| each.as_ref().err().cloned());
    let seen: Vec<f64> = squares.into_iter().flatten().collect();
    let count = seen.len() as f64;
    if seen.is_empty() {
        return Err(TrialError::AllFailed {
            robots,
            first: first_failure.unwrap_or_default(),
        });
    }
    let mean = seen.iter().sum::<f64>() / count;
    let variance =
        seen.iter().map(|each| (each - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let seen_m = mean.sqrt();
    let below = |quantile_m: f64| {
        let is_below = |each: &&f64| each.sqrt() <= quantile_m;
        seen.iter().filter(is_below).count() as f64 / count
    };
    Ok(AbsoluteTrials {
        robots,
        failed: robots - seen.len() as u64,
        first_failure,
        promised_m,
        seen_m,
        seen_std_m: (variance / count).sqrt() / (2.0 * seen_m),
        below_quantile95: tried.promise.quantile95_m.map(below),
    })
}

/// What the virtual robots differ in: what the scenario lists, and what is unknown and of which nothing is known.
fn uncertainties(tried: &PlanOnTrial<'_>) -> Vec<Uncertainty> {
    let unknown = tried.planning.set().parameters().iter();
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
    let mut all = tried.truth.uncertainties.clone();
    if !drawn.is_empty() {
        all.push(Uncertainty {
            name: "unknown".to_owned(),
            is_hidden: false,
            source: Source::Plan(drawn),
        });
    }
    all
}

/// One robot.
struct Trial<'a> {
    tried: &'a PlanOnTrial<'a>,
    truth: &'a Truth,
    /// What each row of the plan reads.
    targets: &'a [String],
    run: u64,
}

impl Trial<'_> {
    /// The weighted mean square (m^2) of what is left at the test poses.
    fn square(&self, robots: &mut ReadRobots) -> Result<f64, String> {
        let PlanOnTrial {
            task, groups, seed, ..
        } = *self.tried;
        let times = self.tried.plan.iter().map(|(_, times)| *times as usize);
        let readings: usize = times.sum();
        let compliance = truth_of_run(self.truth, seed, self.run)
            .robot
            .compliance_rad_per_nm;
        (robots.become_run_of(&compliance, readings, [seed, self.run]))
            .map_err(|error| error.to_string())?;
        let stations = self.tried.planning.stations();
        let mut random = generator(seed, frames_of_trial(self.run));
        let frames: Vec<Isometry3<f64>> = stations.iter().map(|_| anywhere(&mut random)).collect();
        let read = self.read(robots, &frames, readings)?;
        let belief = &task.belief;
        let mut case = AbsoluteCase::new(belief, &read).map_err(|error| error.to_string())?;
        let fit = case
            .fit(groups, ReadingWeights::AsNeeded)
            .map_err(|error| error.to_string())?;
        let frame = self.tried.promise.station;
        let lost = || "no reading that counts is there".to_owned();
        let station = case
            .stations
            .iter()
            .position(|name| *name == stations[frame]);
        let machining = &belief.machining_tool.name;
        let target = case.targets.iter().position(|target| target == machining);
        let (station, target) = (station.ok_or_else(lost)?, target.ok_or_else(lost)?);
        let mut arm = fit.arm;
        // What scales the loads of the readings is not the task's.
        (arm.load_scale, arm.load_offset_n) = (1.0, 0.0);
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        let mut square = 0.0;
        for pose in &task.test_poses {
            let setup = Setup {
                commanded_rad: pose.configuration_rad.clone(),
                load: pose.load,
                target,
                station,
                approach: None,
            };
            let said = model
                .predict(Form::AtRest, &setup, ReadingKind::Position, &mut ignored)
                .map_err(|error| error.to_string())?;
            let is_at = robots
                .at_test_pose(pose)
                .map_err(|error| error.to_string())?;
            let frame = &frames[frame];
            let off = (frame * nalgebra::Point3::from(is_at)).coords - said.position_m;
            let counted = pose.counted(&(frame.rotation.inverse() * off));
            square += pose.weight * counted.norm_squared();
        }
        Ok(square)
    }

    /// What the instrument says: of each row, the mean of all its readings that are there.
    fn read(
        &self,
        robots: &mut ReadRobots,
        frames: &[Isometry3<f64>],
        readings: usize,
    ) -> Result<Vec<AbsoluteReading>, String> {
        let PlanOnTrial {
            task,
            planning,
            plan,
            seed,
            ..
        } = *self.tried;
        let sigma = &task.belief.instrument;
        // One of the two readings that make a deflection.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let is_pose = sigma.rotation_sigma_rad.is_some();
        let mut noise = vec![[0.0; LANES]; 6 * readings];
        fill_normals(Stream::Noise, seed, self.run, &mut noise);
        let kept = robots.kept(readings);
        let mut next = 0;
        let mut read = Vec::new();
        for (&(place, times), target) in plan.iter().zip(self.targets) {
            let row = &planning.candidates[place];
            let experiment = Experiment {
                configuration_rad: row.configuration_rad.clone(),
                load: row.load.unwrap_or(Load::NONE),
                repeats: 1,
                approach: row.approach.clone(),
            };
            let station = station_named(&task.stations, row.station.as_deref());
            let seen = SeenFrom {
                target,
                station_m: station.map(|station| station.position_m),
            };
            let named = |name: &&Option<String>| **name == row.station;
            let frame = planning
                .stations()
                .iter()
                .position(|name| named(&name))
                .unwrap_or(0);
            let frame = &frames[frame];
            let first = next;
            let (mut sum_m, mut turns, mut count) = (Vector3::zeros(), Vec::new(), 0_u32);
            for _ in 0..times {
                let own = next;
                next += 1;
                if !kept[own] {
                    continue;
                }
                let (at_m, axes) = robots
                    .read(&experiment, seen, [own, first])
                    .map_err(|error| error.to_string())?;
                let three =
                    |from: usize| Vector3::from_fn(|axis, _| noise[6 * own + from + axis][0]);
                sum_m += (frame * nalgebra::Point3::from(at_m)).coords
                    + three(0) * (half * sigma.sigma_m);
                let turn = three(3) * (half * sigma.rotation_sigma_rad.unwrap_or(0.0));
                turns.push(
                    Rotation3::new(turn)
                        * frame.rotation.to_rotation_matrix()
                        * Rotation3::from_matrix_unchecked(axes),
                );
                count += 1;
            }
            if count == 0 {
                continue;
            }
            read.push(AbsoluteReading {
                configuration_rad: row.configuration_rad.clone(),
                load: experiment.load,
                target: Some(target.clone()),
                station: row.station.clone(),
                state: None,
                position_m: sum_m / f64::from(count),
                rotation: is_pose.then(|| mean_turn(&turns)),
                covariance: Some(turned(&planning.covariance(place, count), frame)),
                approach: row.approach.clone(),
                time_s: None,
                temperature_c: None,
            });
        }
        Ok(read)
    }
}

/// The mean of rotations that hardly differ.
fn mean_turn(turns: &[Rotation3<f64>]) -> UnitQuaternion<f64> {
    let first = turns.first().copied().unwrap_or_else(Rotation3::identity);
    let off: Vector3<f64> = turns
        .iter()
        .map(|turn| (turn * first.inverse()).scaled_axis())
        .sum();
    UnitQuaternion::from_rotation_matrix(&(Rotation3::new(off / turns.len().max(1) as f64) * first))
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

fn anywhere(random: &mut impl Rng) -> Isometry3<f64> {
    let [x, y, z] = [(); 3].map(|()| AWAY_M * (2.0 * random.random::<f64>() - 1.0));
    let [w, i, j, k] = [(); 4].map(|()| StandardNormal.sample(random));
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)),
    )
}
