//! The virtual robot's physics: a model that need not be the belief's.

use super::SerialChain;
use crate::files::FileError;
use crate::mujoco::{Model, TorqueLaw};

/// A robot as it is: MuJoCo's model, with the joints that the belief knows.
#[derive(Debug, Clone)]
pub struct TrueRobot {
    /// The MJCF model.
    pub model: Model,
    /// MuJoCo's identifiers of the belief's joints, in the belief's order; none for a passive joint that
    /// this robot does not have.
    pub joints: Vec<Option<usize>>,
    /// The compliance of each of these (rad/(N m), m/N); zero for one that it does not have.
    pub compliance_rad_per_nm: Vec<f64>,
    /// The model as a serial chain, where it is one of commanded joints that the belief knows and of passive
    /// ones; else the first reason why it is not.
    pub chain: Result<SerialChain, String>,
    /// The belief's joints that are no springs, each once, and their laws.
    pub torque_laws: Vec<(usize, TorqueLaw)>,
}

/// A joint that the belief knows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnownJoint {
    /// Its name.
    pub name: String,
    /// Whether nothing commands it.
    pub is_passive: bool,
}

impl TrueRobot {
    /// A virtual robot that is what a belief's chain says.
    pub fn of_chain(model: Model, chain: SerialChain, compliance_rad_per_nm: Vec<f64>) -> Self {
        Self {
            joints: (0..model.joints())
                .filter(|&joint| model.locked_at(joint).is_none())
                .map(Some)
                .collect(),
            chain: Ok(chain),
            compliance_rad_per_nm,
            torque_laws: Vec::new(),
            model,
        }
    }

    /// A virtual robot that may be more than a chain, with a belief's joints by their names and the
    /// compliances that its model gives them. It may lack the belief's passive joints.
    ///
    /// # Errors
    /// The model has something that no static equilibrium tells, lacks a joint that is commanded, or does
    /// not hold one at its command by one position actuator.
    pub fn of_model(model: Model, known: &[KnownJoint], reason: String) -> Result<Self, FileError> {
        Self::with_joints(model, known, Err(reason))
    }

    /// The same where a chain was read from the model. It is used if all that it commands is known.
    pub fn of_other_chain(
        model: Model,
        known: &[KnownJoint],
        chain: SerialChain,
    ) -> Result<Self, FileError> {
        let commanded = chain.commanded().map(|joint| &chain.joints[joint].name);
        let is_known = |name: &&String| {
            known
                .iter()
                .any(|each| !each.is_passive && each.name == **name)
        };
        let unknown: Vec<&str> = commanded
            .filter(|name| !is_known(name))
            .map(String::as_str)
            .collect();
        let chain = if unknown.is_empty() {
            Ok(chain)
        } else {
            Err(format!(
                "it commands joints that the planner's model does not have: {}",
                unknown.join(", ")
            ))
        };
        Self::with_joints(model, known, chain)
    }

    fn with_joints(
        model: Model,
        known: &[KnownJoint],
        chain: Result<SerialChain, String>,
    ) -> Result<Self, FileError> {
        model.check_rest()?;
        let joints = (known.iter())
            .map(|joint| {
                if joint.is_passive {
                    return Ok(model.joint(&joint.name).ok());
                }
                let joint = model.joint(&joint.name)?;
                model.check_commanded(joint)?;
                Ok(Some(joint))
            })
            .collect::<Result<Vec<Option<usize>>, FileError>>()?;
        let compliance = |joint: &Option<usize>| {
            joint
                .and_then(|joint| model.joint_compliance(joint))
                .unwrap_or(0.0)
        };
        Ok(Self {
            compliance_rad_per_nm: joints.iter().map(compliance).collect(),
            chain,
            joints,
            torque_laws: Vec::new(),
            model,
        })
    }

    /// MuJoCo's identifiers of the chain's joints.
    pub fn chain_joints(&self) -> Vec<usize> {
        let joints = 0..self.model.joints();
        joints
            .filter(|&joint| self.model.locked_at(joint).is_none())
            .collect()
    }

    /// MuJoCo's identifiers of the joints that are no springs, with their laws.
    pub fn laws_by_joint(&self) -> Vec<(usize, TorqueLaw)> {
        let laws = self.torque_laws.iter();
        laws.filter_map(|&(joint, law)| Some((self.joints[joint]?, law)))
            .collect()
    }

    /// The joints that this robot has, with values that belong to the belief's joints.
    pub fn present(&self, values: &[f64]) -> (Vec<usize>, Vec<f64>) {
        let pairs = self.joints.iter().zip(values);
        pairs
            .filter_map(|(joint, &value)| joint.map(|joint| (joint, value)))
            .unzip()
    }

    /// The names of the belief's joints that this robot has.
    pub fn joint_names(&self) -> Vec<String> {
        let names = self.joints.iter().flatten();
        names.map(|&joint| self.model.joint_name(joint)).collect()
    }
}
