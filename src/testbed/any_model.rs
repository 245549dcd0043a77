//! Any model of a robot, with a tool: where MuJoCo's acceleration vanishes at the commanded angles.

use nalgebra::{Matrix3, Vector3};

use super::rest::{RestSolver, RestingBody};
use crate::files::FileError;
use crate::mujoco::{GivingWay, Model, ModelChange, State, TorqueLaw};
use crate::robot::{Equilibrium, EquilibriumError, Load, TrueRobot};

/// A robot with closed loops is driven to its commands in steps no longer than this (rad, m), so that
/// it stays on the branch on which the file draws it.
const DRIVEN_STEP: f64 = 0.1;

/// A robot of any structure and the last of its equilibria.
#[derive(Debug)]
pub(super) struct MujocoRest {
    /// The model without contacts and limits, with its own compliances.
    model: Model,
    /// Which of the belief's joints it has, and MuJoCo's identifiers of these.
    present: Vec<usize>,
    joints: Vec<usize>,
    /// Where each of the joints has its coordinate.
    coordinates: Vec<usize>,
    site: usize,
    /// The compliances of the belief's joints (rad/(N m)).
    compliance: Vec<f64>,
    state: State,
    solver: RestSolver,
    /// Which joints are rigid: they stand where they are commanded.
    rigid: Vec<bool>,
    /// A robot with closed loops, unloaded at the commands that it was last driven to.
    driven: Option<(Vec<f64>, Vec<f64>)>,
}

impl MujocoRest {
    pub fn new(robot: &TrueRobot, site: &str) -> Result<Self, FileError> {
        let model = robot.model.without_contacts_and_limits();
        let known = robot.joints.iter().enumerate();
        let (present, joints): (Vec<usize>, Vec<usize>) = known
            .filter_map(|(index, joint)| joint.map(|joint| (index, joint)))
            .unzip();
        let coordinates = joints.iter();
        let coordinates = coordinates
            .map(|&joint| model.coordinate_of_joint(joint))
            .collect();
        let state = State::new(&model);
        let mut rest = Self {
            site: model.site(site)?,
            present,
            joints,
            compliance: Vec::new(),
            solver: RestSolver::new(&state, &[]),
            rigid: Vec::new(),
            driven: None,
            coordinates,
            state,
            model,
        };
        rest.become_compliant(&robot.compliance_rad_per_nm)?;
        rest.set_torque_laws(&robot.torque_laws);
        Ok(rest)
    }

    /// What belongs to the joints that it has, of something that belongs to the belief's.
    fn of_present(&self, values: &[f64]) -> Vec<f64> {
        self.present.iter().map(|&index| values[index]).collect()
    }

    fn become_compliant(&mut self, compliance_rad_per_nm: &[f64]) -> Result<(), FileError> {
        self.compliance = compliance_rad_per_nm.to_vec();
        let compliance_rad_per_nm = self.of_present(compliance_rad_per_nm);
        let is_own = |(&joint, value): (&usize, &f64)| {
            (self.model.joint_compliance(joint)).map(f64::to_bits) == Some(value.to_bits())
        };
        let mut values = self.joints.iter().zip(&compliance_rad_per_nm);
        let model = if values.all(is_own) {
            self.model.clone()
        } else {
            (self.model).with_joint_compliance(&self.joints, &compliance_rad_per_nm)?
        };
        self.state.replace_model(&model);
        self.driven = None;
        let rigid: Vec<bool> = compliance_rad_per_nm.iter().map(|&k| k == 0.0).collect();
        if rigid != self.rigid {
            let held: Vec<usize> = (self.joints.iter().zip(&rigid))
                .filter(|(_, rigid)| **rigid)
                .map(|(&joint, _)| model.degree_of_joint(joint))
                .chain((model.locked().iter()).map(|&(joint, _)| model.degree_of_joint(joint)))
                .collect();
            self.solver = RestSolver::new(&self.state, &held);
            self.rigid = rigid;
        }
        Ok(())
    }

    /// Drives the unloaded robot from where the file draws it to its commands.
    fn drive(&mut self, commanded: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        self.state.command_joints(&self.joints, commanded);
        if let Some((known, coordinates)) = &self.driven
            && known == commanded
        {
            self.state.set_coordinates(coordinates);
            return self.solver.rest(&mut self.state, self.site, &Load::NONE);
        }
        let reference = self.model.start_coordinates();
        let from: Vec<f64> = (self.coordinates.iter())
            .map(|&coordinate| reference[coordinate])
            .collect();
        let way = from
            .iter()
            .zip(commanded)
            .map(|(from, to)| (to - from).abs());
        let steps = (way.fold(0.0, f64::max) / DRIVEN_STEP).ceil().max(1.0);
        self.state.set_coordinates(&reference);
        let mut found = None;
        let mut step = 0.0;
        while step < steps {
            step += 1.0;
            let share = step / steps;
            let between: Vec<f64> = (from.iter().zip(commanded))
                .map(|(from, to)| from + share * (to - from))
                .collect();
            self.state.command_joints(&self.joints, &between);
            self.hold_rigid(&between);
            found = Some(self.solver.rest(&mut self.state, self.site, &Load::NONE)?);
        }
        self.driven = Some((commanded.to_vec(), self.state.coordinates().0.to_vec()));
        found.ok_or(EquilibriumError::Unstable)
    }

    /// Puts the rigid joints where they are commanded.
    fn hold_rigid(&mut self, commanded: &[f64]) {
        if !self.rigid.contains(&true) {
            return;
        }
        let mut coordinates = self.state.coordinates().0.to_vec();
        for (joint, &coordinate) in self.coordinates.iter().enumerate() {
            if self.rigid[joint] {
                coordinates[coordinate] = commanded[joint];
            }
        }
        self.state.set_coordinates(&coordinates);
    }
}

impl RestingBody for MujocoRest {
    fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]) {
        if self.compliance != compliance_rad_per_nm {
            // The joints are held: `new` has seen that.
            let _ = self.become_compliant(compliance_rad_per_nm);
        }
    }

    fn set_torque_laws(&mut self, laws: &[(usize, TorqueLaw)]) {
        let own = |&(index, law): &(usize, TorqueLaw)| {
            let place = self.present.iter().position(|&each| each == index)?;
            Some((self.joints[place], law))
        };
        let own: Vec<(usize, TorqueLaw)> = laws.iter().filter_map(own).collect();
        self.state.set_torque_laws(&own);
        self.driven = None;
    }

    fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), FileError> {
        let model = robot.model.without_contacts_and_limits();
        self.model = model.with_changes(&robot.joints, changes)?;
        let compliance = std::mem::take(&mut self.compliance);
        self.become_compliant(&compliance)
    }

    fn rest(&mut self, commanded: &[f64], load: &Load) -> Result<Equilibrium, EquilibriumError> {
        let commanded = &self.of_present(commanded);
        let found = if self.model.has_equalities() {
            self.drive(commanded).and_then(|unloaded| {
                if *load == Load::NONE {
                    return Ok(unloaded);
                }
                self.solver.rest(&mut self.state, self.site, load)
            })
        } else {
            let mut coordinates = self.model.start_coordinates();
            for (&coordinate, &value) in self.coordinates.iter().zip(commanded) {
                coordinates[coordinate] = value;
            }
            self.state.set_coordinates(&coordinates);
            self.state.command_joints(&self.joints, commanded);
            self.solver.rest(&mut self.state, self.site, load)
        };
        // The last thing that was evaluated may be a shifted robot.
        self.state.update_kinematics();
        found
    }

    fn giving_way(&mut self, load: &Load) -> Vec<GivingWay> {
        let mut ignored = vec![0.0; self.model.degrees_of_freedom()];
        let (force, torque) = (&load.force_n, &load.torque_nm);
        let applied = (self.state).imbalance(self.site, force, torque, &mut ignored);
        applied.map_or_else(|_| Vec::new(), |()| self.state.giving_way())
    }

    fn joint_angles(&self) -> Vec<f64> {
        let all = self.state.coordinates().0;
        self.coordinates.iter().map(|&at| all[at]).collect()
    }

    fn tool(&self) -> (Vector3<f64>, Matrix3<f64>) {
        self.state.site(self.site)
    }

    fn site(&mut self, site: usize) -> (Vector3<f64>, Matrix3<f64>) {
        self.state.site(site)
    }

    fn simulation(&self) -> &State {
        &self.state
    }
}
