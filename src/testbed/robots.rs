//! The virtual robot of one run after another, in the run's laboratory, with all targets that are read.

use nalgebra::{DVector, Matrix3, Vector3};

use super::circumstances::{Circumstances, ReadingNumbers, Visit};
use super::truth::{RunTruth, Truth, values_of_run};
use super::virtual_robot::{MeasurementError, VirtualRobot};
use crate::experiment::{Experiment, Plan};
use crate::files::FileError;
use crate::measurement::Measurement;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::parameter::{Parameter, ParameterKind, Unloaded, log_ratio};
use crate::robot::{EquilibriumError, Load, TrueRobot};
use crate::task::{Belief, Instrument, TestPose};

/// No study has more than two to the power of so many runs,
const RUNS_BITS: u32 = 40;
/// and no run more than two to the power of so many campaigns.
const CAMPAIGNS_BITS: u32 = 20;
/// The place of the body with the calibration tool, at which loads act,
const MEASURING: usize = 0;
/// and of that with the machining tool.
const MACHINING: usize = 1;

/// A target, and from where it is read.
#[derive(Debug, Clone, Copy)]
pub struct SeenFrom<'a> {
    /// The site of the model that is read.
    pub target: &'a str,
    /// Where the instrument stands (m, world frame), where somebody says.
    pub station_m: Option<Vector3<f64>>,
    /// Whether it errs as a tracker does.
    pub by_tracker: bool,
}

/// The virtual robot of one run after another.
#[derive(Debug)]
pub struct TrueRobots {
    robot: TrueRobot,
    /// With the calibration tool, and with the machining tool, also where they are one.
    bodies: [VirtualRobot; 2],
    /// What else is read: the sites by their names.
    targets: Vec<(String, usize)>,
    laboratory: Circumstances,
    compliance_rad_per_nm: Vec<f64>,
    /// The joints that are identified.
    identified: Vec<usize>,
    /// The normal numbers of the run that it was made last.
    normals: Vec<[f64; LANES]>,
    /// Whether the last run's differed from the model.
    is_changed: bool,
    /// Which campaign's readings are sampled, and which series of them.
    series: [u64; 2],
}

impl TrueRobots {
    /// The robot that is true, with a belief's tools; before anything is drawn nothing else is different.
    ///
    /// # Errors
    /// Its model lacks a tool, or something of which the scenario says that it is uncertain.
    pub fn new(belief: &Belief, truth: &Truth) -> Result<Self, FileError> {
        Self::with_targets(belief, truth, belief.instrument.unloaded, [])
    }

    /// The same for readings of targets by themselves.
    ///
    /// # Errors
    /// Its model lacks a target, or something of which the scenario says that it is uncertain.
    pub fn of_readings<'a>(
        belief: &'a Belief,
        truth: &Truth,
        targets: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, FileError> {
        let mut robots = Self::with_targets(belief, truth, Unloaded::Own, targets)?;
        robots.laboratory = robots.laboratory.of_single_readings();
        Ok(robots)
    }

    fn with_targets<'a>(
        belief: &'a Belief,
        truth: &Truth,
        unloaded: Unloaded,
        targets: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, FileError> {
        let robot = &truth.robot;
        let laboratory = Circumstances::new(belief.arm(), &truth.uncertainties, truth.kept());
        let laboratory = laboratory.map_err(|error| robot.model.not_serial(error))?;
        let with = |name: &str| VirtualRobot::new(robot, name);
        let calibration = &belief.calibration_tool.name;
        let others = targets
            .into_iter()
            .filter(|name| *name != calibration.as_str());
        let site = |name: &str| Ok((name.to_owned(), robot.model.site(name)?));
        Ok(Self {
            bodies: [with(calibration)?, with(&belief.machining_tool.name)?],
            targets: others.map(site).collect::<Result<_, FileError>>()?,
            compliance_rad_per_nm: robot.compliance_rad_per_nm.clone(),
            identified: belief.parameters.clone(),
            robot: robot.clone(),
            laboratory: laboratory.resting_on(unloaded),
            normals: Vec::new(),
            is_changed: false,
            series: [0; 2],
        })
    }

    /// The same robots in another campaign, or in another series of readings of one, each numbered from 0: what is new in readings, visits
    /// and configurations is sampled anew in each, what is new in campaigns in each campaign.
    #[must_use]
    pub fn in_series(mut self, campaign: u64, series: u64) -> Self {
        self.series = [campaign, series];
        self
    }

    /// The number by which what a run's campaign keeps is sampled: beyond all runs in later campaigns.
    pub const fn campaign_of(&self, run: u64) -> u64 {
        run.wrapping_add(self.series[0] << RUNS_BITS)
    }

    /// The number by which a run's readings are sampled: beyond all campaigns in later series.
    pub const fn readings_of(&self, run: u64) -> u64 {
        let later = self.series[1] << (RUNS_BITS + CAMPAIGNS_BITS);
        self.campaign_of(run).wrapping_add(later)
    }

    /// How many normal numbers a run takes besides the instrument's noise.
    pub fn numbers(&self, readings: usize) -> usize {
        self.laboratory.numbers(readings)
    }

    /// Makes a run's robot: with these compliances (rad/(N m)) and what sources have in common with an earlier campaign, as
    /// [`TrueCompliances`](super::TrueCompliances) samples them, and what else its laboratory differs in.
    ///
    /// # Errors
    /// A link has no frame of its own.
    pub fn become_run(
        &mut self,
        values: &[f64],
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<(), FileError> {
        let (compliances, kept) = values.split_at(self.compliance_rad_per_nm.len());
        self.compliance_rad_per_nm.copy_from_slice(compliances);
        if !self.laboratory.is_certain() {
            self.laboratory.draw(kept, normals, lane);
            for (joint, compliance) in self.compliance_rad_per_nm.iter_mut().enumerate() {
                let kind = ParameterKind::JointCompliance { joint };
                *compliance *= self.laboratory.difference(kind).exp();
            }
            let changes = self.laboratory.model_changes();
            if self.is_changed || !changes.is_empty() {
                for body in &mut self.bodies {
                    body.change(&self.robot, &changes)?;
                }
                self.is_changed = !changes.is_empty();
            }
        }
        let mut laws = self.laboratory.torque_laws(&self.compliance_rad_per_nm);
        let draws_laws = !laws.is_empty();
        laws.extend(&self.robot.torque_laws);
        for body in &mut self.bodies {
            body.set_compliance(&self.compliance_rad_per_nm);
            if draws_laws {
                body.set_torque_laws(&laws);
            }
        }
        Ok(())
    }

    /// Makes the robot that of run `run` under a seed, and returns the normal numbers for so many readings in its
    /// laboratory.
    ///
    /// # Errors
    /// A link has no frame of its own.
    pub fn become_run_of(
        &mut self,
        truth: &Truth,
        readings: usize,
        seed: u64,
        run: u64,
    ) -> Result<Vec<[f64; LANES]>, FileError> {
        let mut normals = vec![[0.0; LANES]; self.numbers(readings)];
        let numbers = [self.readings_of(run), self.campaign_of(run)];
        fill_normals(Stream::Circumstances, seed, numbers[0], &mut normals);
        if numbers != [run; 2] {
            // What the robot and the load cell keep is the run's, all else that is shared the campaign's.
            let [own, campaign] = [run, numbers[1]].map(|number| {
                let mut shared = vec![[0.0; LANES]; self.numbers(0)];
                fill_normals(Stream::Circumstances, seed, number, &mut shared);
                shared
            });
            let is_kept = self.laboratory.is_kept();
            for (place, is_kept) in is_kept.enumerate() {
                let shared = if is_kept { &own } else { &campaign };
                normals[place] = shared[place];
            }
        }
        self.laboratory.sample_functions(seed, run);
        self.become_run(&values_of_run(truth, seed, run), &normals, 0)?;
        self.normals.clone_from(&normals);
        Ok(normals)
    }

    /// The truth of the run that the robot was made that of, for a plan that is measured in it.
    pub fn truth(
        &mut self,
        plan: &Plan,
        normals: &[[f64; LANES]],
        run: u64,
    ) -> Result<RunTruth, MeasurementError> {
        let (visits, measuring) = self.visits(plan, normals);
        let deflection = |visit: Visit<'_>| {
            let moved = visit.displacement(measuring)?;
            Ok(moved.position_m + visit.discrepancy_m())
        };
        let deflections_m = visits
            .into_iter()
            .map(deflection)
            .collect::<Result<_, _>>()?;
        Ok(RunTruth {
            deflections_m,
            ..self.sampled(run)
        })
    }

    /// The same of a run in which nothing is loaded and read again.
    pub fn sampled(&self, run: u64) -> RunTruth {
        let identified = self.identified.iter();
        RunTruth {
            run,
            compliance_rad_per_nm: identified
                .map(|&joint| self.compliance_rad_per_nm[joint])
                .collect(),
            sampled: self.laboratory.sampled(),
            ..RunTruth::default()
        }
    }

    /// What each reading of a plan comes about by in this run, in the plan's order, with the robot that carries the
    /// calibration tool.
    pub fn visits<'a>(
        &mut self,
        plan: &'a Plan,
        normals: &[[f64; LANES]],
    ) -> (Vec<Visit<'a>>, &mut VirtualRobot) {
        let visits = self.laboratory.visits(plan, normals, 0);
        (visits, &mut self.bodies[MEASURING])
    }

    /// The robot whose targets are read, as it came to rest last.
    pub fn reading(&self) -> &VirtualRobot {
        &self.bodies[MEASURING]
    }

    /// The robot that carries the machining tool, as it came to rest last.
    pub fn machining(&self) -> &VirtualRobot {
        &self.bodies[MACHINING]
    }

    /// The compliance of every joint in this run (rad/(N m)).
    pub fn compliance_rad_per_nm(&self) -> &[f64] {
        &self.compliance_rad_per_nm
    }

    /// The true values of a belief's unknowns in this run (p).
    pub fn unknowns(&self, belief: &Belief) -> Vec<f64> {
        let compliance = &self.compliance_rad_per_nm;
        let mut values: Vec<f64> = (belief.parameters.iter())
            .map(|&joint| compliance[joint])
            .collect();
        let extended = &belief.uncertain;
        let others = &extended.set().parameters()[extended.identified()..];
        values.extend(others.iter().map(|each| self.value(belief, each)));
        values
    }

    /// The true value of a parameter of a belief's arm in this run, as far as runs sample it.
    pub fn value(&self, belief: &Belief, parameter: &Parameter) -> f64 {
        match parameter.kind {
            ParameterKind::JointCompliance { joint } => {
                let nominal = belief.nominal.compliance_rad_per_nm[joint];
                log_ratio(self.compliance_rad_per_nm[joint], nominal)
            }
            // In truth it differs by its logarithm.
            kind @ ParameterKind::SpringStiffness { .. } if !parameter.is_logarithmic => {
                parameter.nominal * self.laboratory.difference(kind).exp()
            }
            kind => parameter.nominal + self.laboratory.difference(kind),
        }
    }

    /// By how much a parameter differs in this run from what is nominal, in its unit, where that is uncertain.
    pub fn sampled_of(&self, kind: ParameterKind) -> Option<f64> {
        self.laboratory.sampled_difference(kind)
    }

    /// Measures a plan in this run's laboratory, without the instrument's own noise.
    pub fn measure_noise_free(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let measuring = &mut self.bodies[MEASURING];
        if self.laboratory.is_certain() {
            return measuring.measure_noise_free(plan, instrument);
        }
        (self.laboratory).measure(measuring, plan, instrument, normals, lane)
    }

    /// Where a target is (m, world frame) and its axes, as they are read without the instrument's own noise in the run that
    /// [`Self::become_run_of`] named last. The experiment's load hangs on the calibration tool.
    pub fn read(
        &mut self,
        experiment: &Experiment,
        seen: SeenFrom<'_>,
        numbers: ReadingNumbers,
    ) -> Result<(Vector3<f64>, Matrix3<f64>), EquilibriumError> {
        let reading = (self.laboratory).reading(experiment, &self.normals, 0, numbers);
        let body = &mut self.bodies[MEASURING];
        let (tool_m, tool_axes, _) = body.rest(&reading.commanded_rad, &reading.load)?;
        let target = self.targets.iter().find(|(name, _)| name == seen.target);
        let (at_m, axes) = match target {
            Some(&(_, site)) => body.site(site),
            None => (tool_m, tool_axes),
        };
        let ranges = (reading.noise.by_distance.into_iter()).filter(|_| seen.by_tracker);
        let off_by_distance: Vector3<f64> = ranges
            .map(|(range, normals)| {
                let apart_m = at_m - seen.station_m.unwrap_or(range.from_m);
                range.drawn(&normals, &apart_m)
            })
            .sum();
        Ok((at_m + reading.noise.discrepancy_m + off_by_distance, axes))
    }

    /// Where the machining tool rests (m) if a controller commands these angles (rad), under what acts in this run where
    /// a test pose says what acts there. A load that is given in the tool's frame turns with this robot's tool.
    pub fn machining_tool_at_work(
        &mut self,
        commanded_rad: &DVector<f64>,
        pose: &TestPose,
    ) -> Result<Vector3<f64>, EquilibriumError> {
        let load = self.laboratory.acting_at_test_pose(&pose.load);
        pose.at_rest(&load, |load| self.machining_tool(commanded_rad, load))
    }

    /// Where the machining tool rests (m), with its axes, if a controller commands these angles (rad).
    pub fn machining_tool(
        &mut self,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<(Vector3<f64>, Matrix3<f64>), EquilibriumError> {
        let commanded = (self.laboratory).commanded(commanded_rad, load, true, None);
        let (position, axes, _) = self.bodies[MACHINING].rest(&commanded, load)?;
        Ok((position, axes))
    }
}
