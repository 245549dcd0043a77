//! The virtual robot with each of its tools, in a run's laboratory.

use nalgebra::DVector;

use super::circumstances::{Circumstances, Visit};
use super::true_compliances::compliances_of_run;
use super::truth::{RunTruth, Truth};
use super::virtual_robot::{MeasurementError, VirtualRobot};
use crate::experiment::Plan;
use crate::measurement::Measurement;
use crate::mujoco::ModelError;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::parameter::ParameterKind;
use crate::robot::{EquilibriumError, Load, Tool, TrueRobot};
use crate::task::{Belief, Instrument, TestPose};

/// How often a load is turned with the tool: it turns by milliradians as it bends the arm, and each time leaves a thousandth of what
/// is left.
const TURNS: usize = 3;

/// The virtual robot of one run after another.
#[derive(Debug)]
pub struct TrueRobots {
    robot: TrueRobot,
    measuring: VirtualRobot,
    machining: VirtualRobot,
    laboratory: Circumstances,
    compliance_rad_per_nm: Vec<f64>,
    /// Whether the last run's differed from the model.
    is_changed: bool,
}

impl TrueRobots {
    /// The robot that is true, with a belief's tools; before anything is drawn nothing else is different.
    ///
    /// # Errors
    /// Its model lacks a tool, or something of which the scenario says that it is uncertain.
    pub fn new(belief: &Belief, truth: &Truth) -> Result<Self, ModelError> {
        let robot = &truth.robot;
        let laboratory = Circumstances::new(belief.arm(), &truth.uncertainties);
        let laboratory = laboratory.map_err(|error| ModelError::NotSerial {
            path: robot.model.path().to_owned(),
            reason: error.to_string(),
        })?;
        let laboratory = laboratory.resting_on(belief.instrument.unloaded);
        let of_tool = |tool: &Tool| VirtualRobot::new(robot, &tool.name);
        Ok(Self {
            measuring: of_tool(&belief.calibration_tool)?,
            machining: of_tool(&belief.machining_tool)?,
            compliance_rad_per_nm: robot.compliance_rad_per_nm.clone(),
            robot: robot.clone(),
            laboratory,
            is_changed: false,
        })
    }

    /// How many normal numbers a run takes besides the instrument's noise.
    pub fn numbers(&self, measurements: usize) -> usize {
        self.laboratory.numbers(measurements)
    }

    /// Makes a run's robot: with these compliances (rad/(N m)), and what else its laboratory differs in.
    ///
    /// # Errors
    /// A link has no frame of its own.
    pub fn become_run(
        &mut self,
        compliance_rad_per_nm: &[f64],
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<(), ModelError> {
        self.compliance_rad_per_nm
            .copy_from_slice(compliance_rad_per_nm);
        if !self.laboratory.is_certain() {
            self.laboratory.draw(normals, lane);
            for (joint, compliance) in self.compliance_rad_per_nm.iter_mut().enumerate() {
                *compliance *= self.laboratory.compliance_factor(joint);
            }
            let changes = self.laboratory.model_changes();
            if self.is_changed || !changes.is_empty() {
                self.measuring.change(&self.robot, &changes)?;
                self.machining.change(&self.robot, &changes)?;
                self.is_changed = !changes.is_empty();
            }
        }
        self.measuring.set_compliance(&self.compliance_rad_per_nm);
        self.machining.set_compliance(&self.compliance_rad_per_nm);
        if self.laboratory.draws_laws() {
            let mut laws = self.laboratory.torque_laws(&self.compliance_rad_per_nm);
            laws.extend(&self.robot.torque_laws);
            self.measuring.set_torque_laws(&laws);
            self.machining.set_torque_laws(&laws);
        }
        Ok(())
    }

    /// Makes the robot that of run `run` under a seed, and returns the normal numbers for so many measurements in its
    /// laboratory.
    ///
    /// # Errors
    /// A link has no frame of its own.
    pub fn become_run_of(
        &mut self,
        truth: &Truth,
        measurements: usize,
        seed: u64,
        run: u64,
    ) -> Result<Vec<[f64; LANES]>, ModelError> {
        let mut normals = vec![[0.0; LANES]; self.numbers(measurements)];
        fill_normals(Stream::Circumstances, seed, run, &mut normals);
        self.become_run(&compliances_of_run(truth, seed, run), &normals, 0)?;
        Ok(normals)
    }

    /// The truth of the run that the robot was made that of, for a plan that is measured in it.
    ///
    /// # Errors
    /// The first experiment that has no stable equilibrium.
    pub fn truth(
        &mut self,
        plan: &Plan,
        normals: &[[f64; LANES]],
        run: u64,
    ) -> Result<RunTruth, MeasurementError> {
        let visits = self.laboratory.visits(plan, normals, 0);
        let deflection = |visit: Visit<'_>| {
            let moved = visit.displacement(&mut self.measuring)?;
            Ok(moved.position_m + visit.discrepancy_m())
        };
        let deflections_m = visits.map(deflection).collect::<Result<_, _>>()?;
        Ok(RunTruth {
            run,
            compliance_rad_per_nm: self.compliance_rad_per_nm.clone(),
            sampled: self.laboratory.sampled(),
            deflections_m,
        })
    }

    /// What each reading of a plan comes about by in this run, in the plan's order, with the robot that carries the
    /// calibration tool.
    pub fn visits<'a>(
        &'a mut self,
        plan: &'a Plan,
        normals: &[[f64; LANES]],
    ) -> (Vec<Visit<'a>>, &'a mut VirtualRobot) {
        let visits = self.laboratory.visits(plan, normals, 0).collect();
        (visits, &mut self.measuring)
    }

    /// The robot that carries the machining tool, as it came to rest last.
    pub const fn machining(&self) -> &VirtualRobot {
        &self.machining
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
        if let Some(extended) = &belief.uncertain {
            let others = &extended.set().parameters()[extended.identified()..];
            values.extend(others.iter().map(|parameter| match parameter.kind {
                ParameterKind::JointCompliance { joint } => {
                    (compliance[joint] / belief.nominal.compliance_rad_per_nm[joint]).ln()
                }
                // In truth it differs by its logarithm.
                kind @ ParameterKind::SpringStiffness { .. } if !parameter.is_logarithmic => {
                    parameter.nominal * self.laboratory.difference(kind).exp()
                }
                kind => parameter.nominal + self.laboratory.difference(kind),
            }));
        }
        values
    }

    /// Measures a plan in this run's laboratory, without the instrument's own noise.
    ///
    /// # Errors
    /// The first experiment that has no stable equilibrium.
    pub fn measure_noise_free(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
        normals: &[[f64; LANES]],
        lane: usize,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        if self.laboratory.is_certain() {
            return self.measuring.measure_noise_free(plan, instrument);
        }
        (self.laboratory).measure(&mut self.measuring, plan, instrument, normals, lane)
    }

    /// Where the machining tool rests (m) if a controller commands these angles (rad), under what acts in this run where
    /// a test pose says what acts there. A load that is given in the tool's frame turns with this robot's tool.
    ///
    /// # Errors
    /// There is no stable equilibrium.
    pub fn machining_tool_at_work(
        &mut self,
        commanded_rad: &DVector<f64>,
        pose: &TestPose,
    ) -> Result<nalgebra::Vector3<f64>, EquilibriumError> {
        let said = self.laboratory.acting_at_test_pose(&pose.load);
        let mut load = said;
        for nominal in pose.load_axes.iter().cycle().take(TURNS) {
            let commanded = (self.laboratory).commanded(commanded_rad, &load, true, None);
            let (_, axes, _) = self.machining.rest(&commanded, &load)?;
            let turned = axes * nominal.transpose();
            load = Load {
                force_n: turned * said.force_n,
                torque_nm: turned * said.torque_nm,
            };
        }
        self.machining_tool(commanded_rad, &load)
    }

    /// Where the machining tool rests (m) if a controller commands these angles (rad).
    ///
    /// # Errors
    /// There is no stable equilibrium.
    pub fn machining_tool(
        &mut self,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<nalgebra::Vector3<f64>, EquilibriumError> {
        let commanded = (self.laboratory).commanded(commanded_rad, load, true, None);
        let (position, _, _) = self.machining.rest(&commanded, load)?;
        Ok(position)
    }
}
