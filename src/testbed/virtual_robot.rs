//! The robot in MuJoCo: static equilibria from MuJoCo's position stage, without linearisation.

use nalgebra::{DVector, Matrix3, Vector3};
use thiserror::Error;

use crate::mujoco::{ModelError, State};
use crate::plan::Experiment;
use crate::robot::{
    Equilibrium, EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load,
    rotation_vector,
};
use crate::scenario::Robot;

/// The tool's motion from the unloaded to the loaded equilibrium, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Displacement {
    /// Loaded minus unloaded position (m).
    pub position_m: Vector3<f64>,
    /// The rotation from unloaded to loaded as a rotation vector (rad).
    pub rotation_rad: Vector3<f64>,
    /// Newton steps of the unloaded and of the loaded equilibrium.
    pub iterations: [usize; 2],
}

/// Why an experiment cannot be measured.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("experiment {experiment}, {}: {source}", if *.loaded { "loaded" } else { "unloaded" })]
pub struct MeasurementError {
    /// The experiment's number in the plan, from 1.
    pub experiment: usize,
    /// Whether it was the loaded or the unloaded state.
    pub loaded: bool,
    /// What is wrong.
    pub source: EquilibriumError,
}

/// A compliant robot in MuJoCo with one tool mounted.
#[derive(Debug)]
pub struct VirtualRobot {
    arm: MujocoArm,
    compliance_rad_per_nm: Vec<f64>,
    solver: EquilibriumSolver,
}

impl VirtualRobot {
    /// The robot with the tool whose origin and axes are the named site's.
    ///
    /// # Errors
    /// The model has no such site.
    pub fn new(robot: &Robot, site: &str) -> Result<Self, ModelError> {
        let site = robot.model.site(site)?;
        let joints = robot.chain.len();
        let (tool_body, _) = robot.model.site_body(site);
        Ok(Self {
            arm: MujocoArm {
                bodies: (0..robot.model.bodies())
                    .flat_map(|body| robot.model.joints_of(body).map(move |_| body))
                    .collect(),
                // Joint j has identifier j: the chain's reader has seen that all joints are in series.
                tool_joints: robot.model.joints_that_move(tool_body),
                gravity_m_s2: robot.model.gravity(),
                state: State::new(&robot.model.with_weighing_masses()),
                site,
            },
            compliance_rad_per_nm: robot.compliance_rad_per_nm.clone(),
            solver: EquilibriumSolver::new(joints),
        })
    }

    /// Replaces the joints' compliances (rad/(N m)).
    pub fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]) {
        self.compliance_rad_per_nm
            .copy_from_slice(compliance_rad_per_nm);
    }

    /// The static equilibrium at the commanded angles (rad) under a load: position (m) and axes of
    /// the tool in the world frame, and how it was found.
    ///
    /// # Errors
    /// There is no stable equilibrium.
    pub fn rest(
        &mut self,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<(Vector3<f64>, Matrix3<f64>, Equilibrium), EquilibriumError> {
        let equilibrium = self.solver.solve(
            &mut self.arm,
            &self.compliance_rad_per_nm,
            commanded_rad.as_slice(),
            load,
        )?;
        let state = self.solver.state();
        Ok((state.tool_position, state.tool_rotation, equilibrium))
    }

    /// The joint angles at the last equilibrium (rad).
    #[must_use]
    pub fn joint_angles(&self) -> &[f64] {
        self.solver.q()
    }

    /// MuJoCo's simulation as it stands at the last equilibrium.
    #[must_use]
    pub fn simulation(&self) -> &State {
        &self.arm.state
    }

    /// The tool's displacement from the unloaded to the loaded equilibrium: the virtual measurement
    /// before noise. `number` is the experiment's place in its plan, for the error.
    ///
    /// # Errors
    /// One of the two states has no stable equilibrium.
    pub fn displacement(
        &mut self,
        number: usize,
        experiment: &Experiment,
    ) -> Result<Displacement, MeasurementError> {
        let mut rest = |load: &Load| {
            self.rest(&experiment.configuration_rad, load)
                .map_err(|source| MeasurementError {
                    experiment: number,
                    loaded: load != &Load::NONE,
                    source,
                })
        };
        let (unloaded, unloaded_axes, first) = rest(&Load::NONE)?;
        let (loaded, loaded_axes, second) = rest(&experiment.load)?;
        Ok(Displacement {
            position_m: loaded - unloaded,
            rotation_rad: rotation_vector(&(loaded_axes * unloaded_axes.transpose())),
            iterations: [first.iterations, second.iterations],
        })
    }
}

/// The kinematics of the robot as MuJoCo computes them.
#[derive(Debug)]
struct MujocoArm {
    state: State,
    site: usize,
    /// The body that each joint moves.
    bodies: Vec<usize>,
    tool_joints: usize,
    gravity_m_s2: Vector3<f64>,
}

impl Kinematics for MujocoArm {
    fn joints(&self) -> usize {
        self.bodies.len()
    }

    fn gravity_m_s2(&self) -> Vector3<f64> {
        self.gravity_m_s2
    }

    fn update(&mut self, q: &[f64], state: &mut KinematicState) {
        self.state.move_to(q);
        for (joint, &body) in self.bodies.iter().enumerate() {
            (state.anchor[joint], state.axis[joint]) = self.state.joint(joint);
            (state.distal_mass[joint], state.distal_centre[joint]) = self.state.subtree(body);
        }
        state.tool_joints = self.tool_joints;
        (state.tool_position, state.tool_rotation) = self.state.site(self.site);
    }
}
