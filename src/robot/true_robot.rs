//! The virtual robot's physics: a model that need not be the belief's.

use std::sync::OnceLock;

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
    /// See [`Self::chain_statics`].
    chain_statics: OnceLock<Model>,
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
            joints: model.chain_joints().into_iter().map(Some).collect(),
            chain: Ok(chain),
            compliance_rad_per_nm,
            torque_laws: Vec::new(),
            chain_statics: OnceLock::new(),
            model,
        }
    }

    /// A virtual robot that may be more than a chain, with a belief's joints by their names and the
    /// compliances that its model gives them. It may lack the belief's passive joints. The chain that was read from its model is used if
    /// all that it commands is known.
    ///
    /// # Errors
    /// The model has something that no static equilibrium tells, lacks a joint that is commanded, or does
    /// not hold one at its command by one position actuator.
    pub fn of_model(
        model: Model,
        known: &[KnownJoint],
        chain: Result<SerialChain, String>,
    ) -> Result<Self, FileError> {
        let is_known = |name: &String| {
            let mut known = known.iter();
            known.any(|each| !each.is_passive && each.name == *name)
        };
        let chain = chain.and_then(|chain| {
            let commanded = chain.commanded().map(|joint| &chain.joints[joint].name);
            let unknown: Vec<&str> = (commanded.filter(|name| !is_known(name)))
                .map(String::as_str)
                .collect();
            if unknown.is_empty() {
                return Ok(chain);
            }
            Err(format!(
                "it commands joints that the planner's model does not have: {}",
                unknown.join(", ")
            ))
        });
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
            chain_statics: OnceLock::new(),
            model,
        })
    }

    /// Its model as [`Model::for_chain_statics`] has it, made once.
    pub fn chain_statics(&self) -> &Model {
        (self.chain_statics).get_or_init(|| self.model.for_chain_statics())
    }

    /// The names of the belief's joints that this robot has.
    pub fn joint_names(&self) -> Vec<String> {
        let names = self.joints.iter().flatten();
        names.map(|&joint| self.model.joint_name(joint)).collect()
    }
}
