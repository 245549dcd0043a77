//! The virtual robot's physics: a model that need not be the belief's.

use super::SerialChain;
use crate::mujoco::{Model, ModelError};

/// A robot as it is: MuJoCo's model, with the joints that the belief commands.
#[derive(Debug, Clone)]
pub struct TrueRobot {
    /// The MJCF model.
    pub model: Model,
    /// MuJoCo's identifiers of the belief's joints, in the belief's order.
    pub joints: Vec<usize>,
    /// The compliance of each of these (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
    /// The model as a serial chain of just these joints, where it is one and nothing else moves its rest;
    /// else the first reason why it is not.
    pub chain: Result<SerialChain, String>,
}

impl TrueRobot {
    /// A virtual robot that is what a belief's chain says.
    #[must_use]
    pub fn of_chain(model: Model, chain: SerialChain, compliance_rad_per_nm: Vec<f64>) -> Self {
        Self {
            joints: (0..chain.len()).collect(),
            chain: Ok(chain),
            compliance_rad_per_nm,
            model,
        }
    }

    /// A virtual robot that may be more than a chain, with the named joints of the belief and the
    /// compliances that its model gives them.
    ///
    /// # Errors
    /// The model has something that no static equilibrium tells, lacks a joint, or does not hold one at
    /// its command by one position actuator.
    pub fn of_model(model: Model, joints: &[String], reason: String) -> Result<Self, ModelError> {
        model.check_rest()?;
        let joints = (joints.iter())
            .map(|name| {
                let joint = model.joint(name)?;
                model.check_commanded(joint)?;
                Ok(joint)
            })
            .collect::<Result<Vec<usize>, ModelError>>()?;
        Ok(Self {
            compliance_rad_per_nm: (joints.iter())
                .filter_map(|&joint| model.joint_compliance(joint))
                .collect(),
            chain: Err(reason),
            joints,
            model,
        })
    }

    /// The names of the belief's joints in this model.
    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        let names = self
            .joints
            .iter()
            .map(|&joint| self.model.joint_name(joint));
        names.collect()
    }
}
