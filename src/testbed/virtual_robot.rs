//! The robot in MuJoCo: static equilibria without linearisation. A plain chain's follow from MuJoCo's
//! position stage and the joints' elastic law, any other model's from MuJoCo's forward dynamics.

use std::ops::{Deref, DerefMut};

use nalgebra::{DVector, Matrix3, Vector3};
use thiserror::Error;

use super::any_model::MujocoRest;
use super::chain::ChainRest;
use super::rest::RestingBody;
use crate::experiment::Experiment;
use crate::files::FileError;
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
pub struct VirtualRobot(Box<dyn RestingBody>);

impl Deref for VirtualRobot {
    type Target = dyn RestingBody;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl DerefMut for VirtualRobot {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.0
    }
}

impl VirtualRobot {
    /// The robot with the tool whose origin and axes are the named site's.
    ///
    /// # Errors
    /// The model has no such site.
    pub fn new(robot: &TrueRobot, site: &str) -> Result<Self, FileError> {
        let site_id = robot.model.site(site)?;
        match &robot.chain {
            Ok(chain) => Ok(Self(Box::new(ChainRest::new(robot, chain, site_id)))),
            Err(_) => Self::of_any_model(robot, site),
        }
    }

    /// The same robot, whose rest is sought where MuJoCo's acceleration vanishes even where the elastic law
    /// of a plain chain would do.
    ///
    /// # Errors
    /// The model has no such site.
    pub fn of_any_model(robot: &TrueRobot, site: &str) -> Result<Self, FileError> {
        Ok(Self(Box::new(MujocoRest::new(robot, site)?)))
    }

    /// The static equilibrium at the commanded angles (rad) under a load: position (m) and axes of
    /// the tool in the world frame, and how it was found.
    pub fn rest(
        &mut self,
        commanded_rad: &DVector<f64>,
        load: &Load,
    ) -> Result<(Vector3<f64>, Matrix3<f64>, Equilibrium), EquilibriumError> {
        let equilibrium = self.0.rest(commanded_rad.as_slice(), load)?;
        let (position, rotation) = self.tool();
        Ok((position, rotation, equilibrium))
    }

    /// The tool's displacement from the unloaded to the loaded equilibrium: the virtual measurement
    /// before noise. `number` is the experiment's place in its plan, for the error.
    pub fn displacement(
        &mut self,
        number: usize,
        experiment: &Experiment,
    ) -> Result<Displacement, MeasurementError> {
        let commanded = &experiment.configuration_rad;
        self.displacement_between(number, (commanded, commanded), &experiment.load)
    }

    /// The same where the unloaded and the loaded robot are commanded different angles (rad).
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
