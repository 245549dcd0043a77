//! A run of a plan of absolute readings: a robot is sampled, read in MuJoCo as the plan says, identified, and looked at where it must be
//! accurate.
//!
//! In run r, everything that the scenario lists as uncertain is sampled as in any study, each at its level: the targets that one visit
//! reads share its errors. What is unknown and of which nothing is known before is sampled by shares of its typical size, and the
//! instrument's frames are anywhere. The one fit sees readings with the covariance that they were planned with, and what it then says of
//! the loaded tool's place is compared with where the virtual robot has it.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix6xX, Point3, Rotation3, SymmetricEigen, Vector3,
};

use super::tally::{FailedRun, Failure, Outcome};
use super::virtual_readings::{ReadPlan, TargetReading, VirtualReadingError};
use super::{Setting, StudyError, TakenReadings};
use crate::files::FileError;
use crate::identification::{AbsoluteCase, AbsoluteFit, JointError, ReadingWeights};
use crate::measurement::AbsoluteReading;
use crate::numeric::tolerance::CHI_SQUARE_95;
use crate::observation::{ObservationModel, ReadingKind, Setup, turned_covariance};
use crate::parameter::{
    ElasticArm, ErrorDistribution, ParameterKind, ParameterSet, Source, Uncertainty,
};
use crate::plan::absolute::{AbsolutePlanning, PredictedAccuracy, RepeatedReading};
use crate::robot::{Load, SerialChain};
use crate::task::Task;
use crate::testbed::{TrueRobots, Truth};

/// What nothing is known of is drawn with this share of its typical size ...
const SHARE_OF_SIZE: f64 = 0.3;
/// ... and compliances with this standard deviation of their logarithm.
const COMPLIANCE_SPREAD: f64 = 0.1;

/// A plan made ready: what is drawn, read and held against what.
#[derive(Debug)]
pub struct ReadingRuns<'a> {
    pub(super) task: &'a Task,
    studied: &'a TakenReadings<'a>,
    /// What is predicted.
    pub prediction: PredictedAccuracy,
    predicted_m: f64,
    /// How it is carried out.
    pub read: ReadPlan<'a>,
    truth: Truth,
    /// Where the tool is predicted to be at each test pose.
    regions: Vec<PlaceRegion>,
    /// How joint error functions move it there by residuals, where the planner's model has any.
    function_gains: Vec<DMatrix<f64>>,
}

/// What one run gave.
#[derive(Debug)]
pub struct ReadingsRun {
    /// What the instrument said.
    pub readings: Vec<AbsoluteReading>,
    /// What was identified from it.
    pub fit: AbsoluteFit,
    /// By how much the tool is elsewhere than predicted at each test pose (m, world frame), of it what counts.
    pub residuals_m: Vec<Vector3<f64>>,
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

impl<'a> ReadingRuns<'a> {
    /// Prepares a plan under a study's conditions.
    ///
    /// # Errors
    /// It predicts nothing, or not what it reads.
    pub fn new(
        setting: &'a Setting<'_>,
        studied: &'a TakenReadings<'a>,
    ) -> Result<Self, StudyError> {
        let (task, planning) = (&setting.task, &studied.planning);
        let read = ReadPlan::new(planning, &studied.plan);
        let machining = &task.belief.machining_tool.name;
        if !read.targets().any(|target| target == machining) {
            return Err(StudyError::Unread(machining.clone()));
        }
        let prediction = planning.prediction(&studied.plan);
        let predicted_m = prediction.rho0_m().ok_or(StudyError::NoPrediction)?;
        let no_place = Matrix3::zeros();
        Ok(Self {
            regions: (prediction.places_m2.iter())
                .map(|place| PlaceRegion::new(place.as_ref().unwrap_or(&no_place)))
                .collect(),
            truth: Truth {
                uncertainties: uncertainties(setting.truth, &task.belief.nominal.chain, planning),
                ..setting.truth.clone()
            },
            function_gains: planning.function_gains(&studied.plan),
            read,
            task,
            studied,
            prediction,
            predicted_m,
        })
    }

    /// The virtual robot of one run after another.
    ///
    /// # Errors
    /// Its model lacks what is read.
    pub fn robots(&self) -> Result<TrueRobots, FileError> {
        TrueRobots::of_readings(&self.task.belief, &self.truth, self.read.targets())
    }

    /// How many numbers are looked at.
    pub fn freedom(&self) -> usize {
        self.regions.iter().map(|region| region.freedom).sum()
    }

    /// What is predicted for the squared distance, and its variance from run to run; in sigma.
    pub fn expected(&self) -> [f64; 2] {
        let variance_m2 = self.task.belief.instrument.sigma_m.powi(2);
        let variance_m4 = self.prediction.square_variance_m4.unwrap_or(0.0);
        [
            self.predicted_m.powi(2) / variance_m2,
            variance_m4 / variance_m2.powi(2),
        ]
    }

    /// What a run came to.
    pub fn outcome(&self, run: &ReadingsRun) -> Outcome {
        let (mut square_m2, mut nees, mut inside) = (0.0, 0.0, 0);
        let poses = self.task.test_poses.iter().zip(&self.regions);
        for ((pose, region), residual_m) in poses.zip(&run.residuals_m) {
            let (square, is_inside) = region.look(residual_m);
            square_m2 += pose.weight * residual_m.norm_squared();
            nees += square;
            inside += u32::from(is_inside);
        }
        Outcome {
            square: square_m2 / self.task.belief.instrument.sigma_m.powi(2),
            nees,
            freedom: self.freedom(),
            intervals: [
                u32::try_from(self.regions.len()).unwrap_or(u32::MAX),
                inside,
            ],
        }
    }

    /// One run under a seed: draws, reads, identifies, and looks.
    pub fn run(
        &self,
        robots: &mut TrueRobots,
        seed: u64,
        run: u64,
    ) -> Result<ReadingsRun, FailedRun> {
        let no_reading = |error: &dyn ToString| Failure::Measurement.because(error);
        (robots.become_run_of(&self.truth, self.read.count(), seed, run))
            .map_err(|error| no_reading(&error))?;
        let frames = self.read.frames(robots, seed, run);
        let readings =
            (self.readings(robots, &frames, seed, run)).map_err(|error| no_reading(&error))?;
        let no_fit = |error| Failure::Identification.because(&error);
        let mut case = AbsoluteCase::new(&self.task.belief, &readings)
            .map_err(no_fit)?
            .sharing((self.studied.planning).shared_errors(&self.read.groups, &frames));
        let fit = case
            .fit(self.studied.groups, ReadingWeights::AsNeeded)
            .map_err(no_fit)?;
        let mut residuals_m = self.residuals(robots, &frames, &case, &fit.arm, &[])?;
        for (residual_m, moved_m) in residuals_m.iter_mut().zip(self.moved(&fit, &frames)) {
            *residual_m -= moved_m;
        }
        Ok(ReadingsRun {
            readings,
            fit,
            residuals_m,
        })
    }

    /// By how much the joints' functions move the tool at each test pose (m, what counts, world frame), as a fit's residuals say; nothing
    /// where there are none.
    fn moved(
        &self,
        fit: &AbsoluteFit,
        frames: &[Isometry3<f64>],
    ) -> impl Iterator<Item = Vector3<f64>> {
        let each = self.read.groups.iter().flatten().zip(&fit.left);
        let left = each.flat_map(|(each, own)| {
            let turn = (frames[self.studied.planning.station_of(each.place)].rotation).inverse();
            let parts = [own.position_m, own.rotation_rad.unwrap_or_default()];
            parts.map(|part| <[f64; 3]>::from(turn * part)).concat()
        });
        let left = DVector::from_iterator(6 * fit.left.len(), left);
        let gains = self.function_gains.iter();
        gains.map(move |gain| (gain * &left).fixed_rows::<3>(0).into_owned())
    }

    /// What the instrument says of the robot of a run, each reading by itself: as a file of measurements has them.
    pub fn measure(
        &self,
        robots: &mut TrueRobots,
        seed: u64,
        run: u64,
    ) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
        robots.become_run_of(&self.truth, self.read.count(), seed, run)?;
        self.read.readings(self.task, robots, seed, run)
    }

    /// By how much the tool of the robot of a run is elsewhere than an arm whose joints are off says at each test pose (m, world frame), of
    /// it what counts, with the run's frames; the arm has the targets and stations of a case.
    ///
    /// # Errors
    /// The case has no reading of the tool, or from the station that counts; the robot or the arm does not rest.
    pub fn residuals(
        &self,
        robots: &mut TrueRobots,
        frames: &[Isometry3<f64>],
        case: &AbsoluteCase<'_>,
        arm: &ElasticArm,
        joints: &[JointError],
    ) -> Result<Vec<Vector3<f64>>, FailedRun> {
        let frame = self.prediction.station;
        let own = &self.studied.planning.stations()[frame];
        let station = case.stations.iter().position(|name| name == own);
        let machining = &self.task.belief.machining_tool.name;
        let target = case.targets.iter().position(|target| target == machining);
        let (Some(station), Some(target)) = (station, target) else {
            return Err(Failure::Undetermined.because("no reading that counts is there"));
        };
        let arm = arm.clone().under_loads_of_task();
        let nothing = ParameterSet::empty();
        let mut model = ObservationModel::new(&nothing, &arm, &[]);
        let mut ignored = Matrix6xX::zeros(0);
        let no_rest = |error| Failure::TestPose.because(&error);
        (self.task.test_poses.iter())
            .map(|pose| {
                let mut setup = Setup {
                    commanded_rad: pose.configuration_rad.clone(),
                    load: pose.load,
                    hangs_on: None,
                    target,
                    station,
                    approach: None,
                };
                for each in joints {
                    setup.commanded_rad[each.joint] += each.at(pose.configuration_rad.as_slice());
                }
                let base = arm.instrument_from_base[station].rotation.inverse();
                let rest = |load: &Load| {
                    setup.load = *load;
                    let kind = ReadingKind::Position;
                    let said = model.predict(&setup, kind, &mut ignored)?;
                    let axes = base.to_rotation_matrix() * said.rotation;
                    Ok((said.position_m, axes))
                };
                let said_m = pose.at_rest(&pose.load, rest).map_err(no_rest)?;
                let is_at = robots
                    .machining_tool_at_work(&pose.configuration_rad, pose)
                    .map_err(no_rest)?;
                let frame = &frames[frame];
                let off = (frame * Point3::from(is_at)).coords - said_m;
                Ok(pose.counted(&(frame.rotation.inverse() * off)))
            })
            .collect()
    }

    /// What the instrument says: of each reading that visits repeat alike, the mean.
    fn readings(
        &self,
        robots: &mut TrueRobots,
        frames: &[Isometry3<f64>],
        seed: u64,
        run: u64,
    ) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
        let planning = &self.studied.planning;
        let is_pose = self.task.belief.instrument.rotation_sigma_rad.is_some();
        let of_one = |(each, shown): (RepeatedReading, Vec<TargetReading>)| {
            let sum_m: Vector3<f64> = shown.iter().map(|shown| shown.position_m).sum();
            let turns: Vec<Rotation3<f64>> = shown.iter().map(|shown| shown.rotation).collect();
            let covariance = planning.own_covariance(each.place, each.times);
            let frame = &frames[planning.station_of(each.place)];
            let covariance = turned_covariance(&covariance, &frame.rotation);
            let mean_m = sum_m / f64::from(each.times);
            let rotation = is_pose.then(|| mean_turn(&turns));
            self.read.reading(each.place, mean_m, rotation, covariance)
        };
        let read = self.read.read(self.task, robots, frames, seed, run)?;
        Ok(read.into_iter().map(of_one).collect())
    }
}

/// What the virtual robots differ in: what the scenario lists, and what is unknown and of which nothing is known.
fn uncertainties(
    truth: &Truth,
    chain: &SerialChain,
    planning: &AbsolutePlanning<'_>,
) -> Vec<Uncertainty> {
    let set = planning.set();
    // What the scenario lists of compliances that are identified is a precision without a deviation of its own.
    let is_known = |place: usize| set.prior().precision[(place, place)] > 0.0;
    let is_passive = |joint: usize| chain.joints[joint].drive.passive_at.is_some();
    let drawn: Vec<(ParameterKind, f64)> = (set.parameters().iter().enumerate())
        .filter(|&(place, _)| !is_known(place))
        .filter_map(|(_, parameter)| match parameter.kind {
            // The virtual robot has its passive joints' springs as they are.
            ParameterKind::JointZero { joint } if is_passive(joint) => None,
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
            is_replaced: false,
            distribution: ErrorDistribution::Normal,
            source: Source::Plan(drawn),
        });
    }
    all
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
