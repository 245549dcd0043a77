//! The rest of a chain, by the elastic law of its joints; it may have passive joints that the belief does
//! not know.

use super::arm::MujocoArm;
use crate::mujoco::{ModelChange, ModelError, State};
use crate::robot::{
    Equilibrium, EquilibriumError, EquilibriumSolver, KinematicState, Load, SerialChain, TrueRobot,
};

/// A chain and the last of its equilibria.
#[derive(Debug)]
pub(super) struct ChainRest {
    arm: MujocoArm,
    solver: EquilibriumSolver,
    /// For each of the belief's joints its place in the chain, and whether it is commanded.
    known: Vec<Option<(usize, bool)>>,
    /// What the joints are commanded; where passive ones are relaxed.
    commanded: Vec<f64>,
    compliance: Vec<f64>,
}

impl ChainRest {
    pub fn new(robot: &TrueRobot, chain: &SerialChain, site: usize) -> Self {
        let own = robot.chain_joints();
        let place = |joint: usize| {
            let index = own.iter().position(|&each| each == joint)?;
            Some((index, chain.joints[index].drive.passive_at.is_none()))
        };
        let joints = chain.joints.iter();
        let mut rest = Self {
            arm: MujocoArm::new(robot, chain, site),
            solver: EquilibriumSolver::new(chain.len()),
            known: (robot.joints.iter())
                .map(|joint| joint.and_then(place))
                .collect(),
            commanded: (joints.clone())
                .map(|joint| joint.drive.passive_at.unwrap_or(0.0))
                .collect(),
            compliance: joints
                .map(|joint| joint.model_compliance_rad_per_nm.unwrap_or(0.0))
                .collect(),
        };
        rest.set_compliance(&robot.compliance_rad_per_nm);
        rest
    }

    pub fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]) {
        for (known, &value) in self.known.iter().zip(compliance_rad_per_nm) {
            if let Some((index, _)) = *known {
                self.compliance[index] = value;
            }
        }
    }

    /// Makes the robot another than the model says.
    pub fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), ModelError> {
        self.arm.change(robot, changes)
    }

    /// Lets the robot come to rest.
    pub fn rest(
        &mut self,
        commanded: &[f64],
        load: &Load,
    ) -> Result<Equilibrium, EquilibriumError> {
        for (known, &value) in self.known.iter().zip(commanded) {
            // Where a passive joint is relaxed, the truth knows better.
            if let Some((index, true)) = *known {
                self.commanded[index] = value;
            }
        }
        (self.solver).solve(&mut self.arm, &self.compliance, &self.commanded, load)
    }

    /// The geometry at rest.
    pub const fn geometry(&self) -> &KinematicState {
        self.solver.state()
    }

    /// The coordinates of the belief's joints that it has.
    pub fn joint_angles(&self) -> Vec<f64> {
        let known = self.known.iter().flatten();
        known.map(|&(index, _)| self.solver.q()[index]).collect()
    }

    pub const fn state(&self) -> &State {
        self.arm.state()
    }
}
