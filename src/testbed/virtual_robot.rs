//! The robot in MuJoCo: static equilibria without linearisation. A plain chain's follow from MuJoCo's
//! position stage and the joints' elastic law, any other model's from MuJoCo's forward dynamics.

use nalgebra::{DVector, Matrix3, Vector3};
use thiserror::Error;

use super::any_model::MujocoRest;
use super::chain::ChainRest;
use crate::experiment::Experiment;
use crate::mujoco::{GivingWay, ModelChange, ModelError, State, TorqueLaw};
use crate::robot::{Equilibrium, EquilibriumError, Load, TrueRobot, rotation_vector};

/// The tool's motion from the unloaded to the loaded equilibrium, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Displacement {
    /// Loaded minus unloaded position (m).
    pub position_m: Vector3<f64>,
    /// The rotation from unloaded to loaded as a rotation vector (rad).
    pub rotation_rad: Vector3<f64>,
    /// Where the loaded tool rests (m).
    pub at_m: Vector3<f64>,
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
    body: RestMethod,
    compliance_rad_per_nm: Vec<f64>,
}

/// How its equilibria are found.
#[derive(Debug)]
enum RestMethod {
    /// A chain: by the elastic law of its joints.
    Chain(Box<ChainRest>),
    /// Any model: where MuJoCo's acceleration vanishes.
    Any(Box<MujocoRest>),
}

impl VirtualRobot {
    /// The robot with the tool whose origin and axes are the named site's.
    ///
    /// # Errors
    /// The model has no such site.
    pub fn new(robot: &TrueRobot, site: &str) -> Result<Self, ModelError> {
        let site_id = robot.model.site(site)?;
        let body = match &robot.chain {
            // Within a dead band nothing but the balance of all forces says where a joint stands.
            Ok(chain)
                if robot
                    .torque_laws
                    .iter()
                    .all(|(_, law)| law.dead_band == 0.0) =>
            {
                RestMethod::Chain(Box::new(ChainRest::new(robot, chain, site_id)))
            }
            _ => return Self::of_any_model(robot, site),
        };
        Ok(Self {
            body,
            compliance_rad_per_nm: robot.compliance_rad_per_nm.clone(),
        })
    }

    /// The same robot, whose rest is sought where MuJoCo's acceleration vanishes even where the elastic law
    /// of a plain chain would do.
    ///
    /// # Errors
    /// The model has no such site.
    pub fn of_any_model(robot: &TrueRobot, site: &str) -> Result<Self, ModelError> {
        Ok(Self {
            body: RestMethod::Any(Box::new(MujocoRest::new(robot, site)?)),
            compliance_rad_per_nm: robot.compliance_rad_per_nm.clone(),
        })
    }

    /// Replaces the joints' compliances (rad/(N m)).
    pub fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]) {
        if self.compliance_rad_per_nm == compliance_rad_per_nm {
            return;
        }
        self.compliance_rad_per_nm
            .copy_from_slice(compliance_rad_per_nm);
        match &mut self.body {
            RestMethod::Chain(rest) => rest.set_compliance(compliance_rad_per_nm),
            RestMethod::Any(rest) => rest.set_compliance(compliance_rad_per_nm),
        }
    }

    /// Lets joints hold by laws of their own, by the belief's numbers of them.
    pub fn set_torque_laws(&mut self, laws: &[(usize, TorqueLaw)]) {
        match &mut self.body {
            RestMethod::Chain(rest) => rest.set_torque_laws(laws),
            RestMethod::Any(rest) => rest.set_torque_laws(laws),
        }
    }

    /// Makes the robot a run's, which differs from the model in this alone.
    ///
    /// # Errors
    /// A site is missing.
    pub fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), ModelError> {
        match &mut self.body {
            RestMethod::Chain(rest) => rest.change(robot, changes),
            RestMethod::Any(rest) => rest.change(robot, changes),
        }
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
        match &mut self.body {
            RestMethod::Chain(rest) => {
                let equilibrium = rest.rest(commanded_rad.as_slice(), load)?;
                let state = rest.geometry();
                Ok((state.tool_position, state.tool_rotation, equilibrium))
            }
            RestMethod::Any(rest) => {
                let equilibrium = rest.rest(commanded_rad.as_slice(), load)?;
                let (position, rotation) = rest.tool();
                Ok((position, rotation, equilibrium))
            }
        }
    }

    /// The angles of the belief's joints at the last equilibrium (rad).
    pub fn joint_angles(&self) -> Vec<f64> {
        match &self.body {
            RestMethod::Chain(rest) => rest.joint_angles(),
            RestMethod::Any(rest) => rest.joint_angles(),
        }
    }

    /// MuJoCo's coordinates of all joints at the last equilibrium (rad, m).
    pub fn coordinates(&self) -> &[f64] {
        match &self.body {
            RestMethod::Chain(rest) => rest.state().coordinates().0,
            RestMethod::Any(_) => self.simulation().coordinates().0,
        }
    }

    /// MuJoCo's simulation as it stands at the last equilibrium.
    pub fn simulation(&self) -> &State {
        match &self.body {
            RestMethod::Chain(rest) => rest.state(),
            RestMethod::Any(rest) => rest.state(),
        }
    }

    /// How far the model's equality constraints give way at the last equilibrium, found under this load.
    pub fn giving_way(&mut self, load: &Load) -> Vec<GivingWay> {
        match &mut self.body {
            RestMethod::Chain(_) => Vec::new(),
            RestMethod::Any(rest) => rest.giving_way(load),
        }
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
        let commanded = &experiment.configuration_rad;
        self.displacement_between(number, (commanded, commanded), &experiment.load)
    }

    /// The same where the unloaded and the loaded robot are commanded different angles (rad).
    ///
    /// # Errors
    /// One of the two states has no stable equilibrium.
    pub fn displacement_between(
        &mut self,
        number: usize,
        (before, after): (&DVector<f64>, &DVector<f64>),
        load: &Load,
    ) -> Result<Displacement, MeasurementError> {
        let mut rest = |commanded: &DVector<f64>, load: &Load| {
            self.rest(commanded, load)
                .map_err(|source| MeasurementError {
                    experiment: number,
                    loaded: load != &Load::NONE,
                    source,
                })
        };
        let (unloaded, unloaded_axes, first) = rest(before, &Load::NONE)?;
        let (loaded, loaded_axes, second) = rest(after, load)?;
        Ok(Displacement {
            at_m: loaded,
            position_m: loaded - unloaded,
            rotation_rad: rotation_vector(&(loaded_axes * unloaded_axes.transpose())),
            iterations: [first.iterations, second.iterations],
        })
    }
}
