//! The virtual robot as an instrument sees it: readings of its targets by themselves, in a run's laboratory.

use nalgebra::{DVector, Matrix3, Rotation3, Vector3};

use super::circumstances::{Circumstances, Disturbed, ReadingNumbers};
use super::truth::Truth;
use super::virtual_robot::VirtualRobot;
use crate::experiment::Experiment;
use crate::mujoco::ModelError;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::robot::{EquilibriumError, Load, TrueRobot};
use crate::task::{Belief, TestPose};

/// How often what depends on where the loaded tool rests is found anew: it moves by millimetres, and each time leaves a thousandth of
/// what is left.
const TURNS: usize = 3;

/// A target, and from where it is read.
#[derive(Debug, Clone, Copy)]
pub struct SeenFrom<'a> {
    /// The site of the model that is read.
    pub target: &'a str,
    /// Where the instrument stands (m, world frame), where somebody says.
    pub station_m: Option<Vector3<f64>>,
}

/// The virtual robot of one run after another, with all targets that are read.
#[derive(Debug)]
pub struct ReadRobots {
    robot: TrueRobot,
    laboratory: Circumstances,
    /// The calibration tool, the machining tool, and what else is read.
    bodies: Vec<(String, VirtualRobot)>,
    normals: Vec<[f64; LANES]>,
    is_changed: bool,
}

impl ReadRobots {
    /// The robot that is true, with a belief's tools and these targets; before anything is drawn nothing else is different.
    ///
    /// # Errors
    /// Its model lacks a target, or something of which the scenario says that it is uncertain.
    pub fn new<'a>(
        belief: &'a Belief,
        truth: &Truth,
        targets: impl IntoIterator<Item = &'a str>,
    ) -> Result<Self, ModelError> {
        let robot = &truth.robot;
        let laboratory = Circumstances::new(belief.arm(), &truth.uncertainties);
        let laboratory = laboratory.map_err(|error| ModelError::NotSerial {
            path: robot.model.path().to_owned(),
            reason: error.to_string(),
        })?;
        let own = [&belief.calibration_tool, &belief.machining_tool];
        let mut bodies: Vec<(String, VirtualRobot)> = Vec::new();
        for name in own
            .into_iter()
            .map(|tool| tool.name.as_str())
            .chain(targets)
        {
            // The first two have their places, also where they are one.
            if bodies.len() < own.len() || !bodies.iter().any(|(known, _)| known == name) {
                bodies.push((name.to_owned(), VirtualRobot::new(robot, name)?));
            }
        }
        Ok(Self {
            robot: robot.clone(),
            laboratory,
            bodies,
            normals: Vec::new(),
            is_changed: false,
        })
    }

    /// Makes the robot that of a run under a seed, with these compliances (rad/(N m)) before what else the laboratory differs in, for
    /// so many readings.
    ///
    /// # Errors
    /// A link has no frame of its own.
    pub fn become_run_of(
        &mut self,
        compliance_rad_per_nm: &[f64],
        readings: usize,
        [seed, run]: [u64; 2],
    ) -> Result<(), ModelError> {
        self.normals = vec![[0.0; LANES]; self.laboratory.numbers(readings)];
        fill_normals(Stream::Circumstances, seed, run, &mut self.normals);
        let mut compliance = compliance_rad_per_nm.to_vec();
        if !self.laboratory.is_certain() {
            self.laboratory.draw(&self.normals, 0);
            for (joint, compliance) in compliance.iter_mut().enumerate() {
                *compliance *= self.laboratory.compliance_factor(joint);
            }
            let changes = self.laboratory.model_changes();
            if self.is_changed || !changes.is_empty() {
                for (_, body) in &mut self.bodies {
                    body.change(&self.robot, &changes)?;
                }
                self.is_changed = !changes.is_empty();
            }
        }
        for (_, body) in &mut self.bodies {
            body.set_compliance(&compliance);
        }
        Ok(())
    }

    /// Where a target is (m, world frame) and its axes, as they are read without the instrument's own noise. The experiment's load
    /// hangs on the calibration tool.
    ///
    /// # Errors
    /// There is no stable equilibrium.
    pub fn read(
        &mut self,
        experiment: &Experiment,
        seen: SeenFrom<'_>,
        numbers: ReadingNumbers,
    ) -> Result<(Vector3<f64>, Matrix3<f64>), EquilibriumError> {
        let Disturbed {
            commanded_rad,
            load,
            noise,
        } = (self.laboratory).disturbed(experiment, &self.normals, 0, numbers);
        let place = self.bodies.iter().position(|(name, _)| name == seen.target);
        let place = place.unwrap_or(0);
        let (carried_m, ..) = self.bodies[0].1.rest(&commanded_rad, &load)?;
        // The load at the target that does what the load at the calibration tool does.
        let mut transferred = load;
        let mut rest = self.bodies[place].1.rest(&commanded_rad, &transferred)?;
        if place > 0 && load != Load::NONE {
            for _ in 0..TURNS {
                let lever = carried_m - rest.0;
                transferred.torque_nm = load.torque_nm + lever.cross(&load.force_n);
                rest = self.bodies[place].1.rest(&commanded_rad, &transferred)?;
            }
        }
        let (at_m, axes, _) = rest;
        let off_by_distance: Vector3<f64> = (noise.by_distance.into_iter())
            .map(|(range, normals)| {
                let apart_m = at_m - seen.station_m.unwrap_or(range.from_m);
                range.drawn(&normals, &apart_m)
            })
            .sum();
        Ok((at_m + noise.discrepancy_m + off_by_distance, axes))
    }

    /// Where the machining tool rests (m, world frame) where a test pose is commanded, under what acts there in this run. A load that
    /// is given in the tool's frame turns with this robot's tool.
    ///
    /// # Errors
    /// There is no stable equilibrium.
    pub fn at_test_pose(&mut self, pose: &TestPose) -> Result<Vector3<f64>, EquilibriumError> {
        let said = self.laboratory.acting_at_test_pose(&pose.load);
        let q: &DVector<f64> = &pose.configuration_rad;
        let mut load = said;
        let mut rest = |load: &Load| {
            let commanded = self.laboratory.commanded(q, load, true, None);
            self.bodies[1].1.rest(&commanded, load)
        };
        for nominal in pose.load_axes.iter().cycle().take(TURNS) {
            let (_, axes, _) = rest(&load)?;
            let turned = Rotation3::from_matrix_unchecked(axes * nominal.transpose());
            load = Load {
                force_n: turned * said.force_n,
                torque_nm: turned * said.torque_nm,
            };
        }
        Ok(rest(&load)?.0)
    }
}
