//! The rest of a chain, by the elastic law of its joints in the kinematics that MuJoCo computes; it may have passive joints that the
//! belief does not know.

use nalgebra::{Matrix3, Vector3};

use super::rest::RestingBody;
use crate::files::FileError;
use crate::mujoco::{GivingWay, Model, ModelChange, State, TorqueLaw};
use crate::robot::{
    Elements, Equilibrium, EquilibriumError, EquilibriumSolver, KinematicState, Kinematics, Load,
    SerialChain, TrueRobot,
};

/// Joints that are no springs are where their law has them if that no longer changes by more (rad, m).
const LAW_CONVERGED: f64 = 1e-12;
/// Torques hardly follow what a law adds to a spring's deflection: a few rounds do.
const LAW_ROUNDS: usize = 40;

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
    /// Its joints that hold by laws of their own.
    laws: Vec<(usize, TorqueLaw)>,
}

impl ChainRest {
    pub fn new(robot: &TrueRobot, chain: &SerialChain, site: usize) -> Self {
        let own = robot.model.chain_joints();
        let place = |joint: usize| {
            let index = own.iter().position(|&each| each == joint)?;
            Some((index, chain.joints[index].drive.passive_at.is_none()))
        };
        let joints = chain.joints.iter();
        let mut rest = Self {
            arm: MujocoArm::new(robot, chain, site),
            solver: EquilibriumSolver::of_places(chain.len()),
            known: (robot.joints.iter())
                .map(|joint| joint.and_then(place))
                .collect(),
            commanded: (joints.clone())
                .map(|joint| joint.drive.passive_at.unwrap_or(0.0))
                .collect(),
            compliance: joints
                .map(|joint| joint.model_compliance_rad_per_nm.unwrap_or(0.0))
                .collect(),
            laws: Vec::new(),
        };
        rest.set_compliance(&robot.compliance_rad_per_nm);
        rest.set_torque_laws(&robot.torque_laws);
        rest
    }
}

impl RestingBody for ChainRest {
    fn set_compliance(&mut self, compliance_rad_per_nm: &[f64]) {
        for (known, &value) in self.known.iter().zip(compliance_rad_per_nm) {
            if let Some((index, _)) = *known {
                self.compliance[index] = value;
            }
        }
    }

    fn set_torque_laws(&mut self, laws: &[(usize, TorqueLaw)]) {
        let known = |&(joint, law): &(usize, TorqueLaw)| Some((self.known[joint]?.0, law));
        self.laws = laws.iter().filter_map(known).collect();
    }

    fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), FileError> {
        self.arm.change(robot, changes)
    }

    fn rest(&mut self, commanded: &[f64], load: &Load) -> Result<Equilibrium, EquilibriumError> {
        for (known, &value) in self.known.iter().zip(commanded) {
            // Where a passive joint is relaxed, the truth knows better.
            if let Some((index, true)) = *known {
                self.commanded[index] = value;
            }
        }
        let found = if self.laws.is_empty() {
            (self.solver).solve(&mut self.arm, &self.compliance, &self.commanded, load)
        } else {
            self.rest_by_laws(load)
        };
        // The last step is followed without a new geometry.
        self.arm.state.stand_at(self.solver.q());
        found
    }

    fn tool(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let state = self.solver.state();
        (state.tool_position, state.tool_rotation)
    }

    fn site(&mut self, site: usize) -> (Vector3<f64>, Matrix3<f64>) {
        self.arm.state.move_to(self.solver.q());
        self.arm.state.site(site)
    }

    fn joint_angles(&self) -> Vec<f64> {
        let known = self.known.iter().flatten();
        known.map(|&(index, _)| self.solver.q()[index]).collect()
    }

    fn simulation(&self) -> &State {
        &self.arm.state
    }

    fn giving_way(&mut self, _: &Load) -> Vec<GivingWay> {
        Vec::new()
    }
}

impl ChainRest {
    /// Lets the robot come to rest where joints hold by laws: as one of springs whose commands are moved by what the laws add
    /// to the springs' deflections.
    fn rest_by_laws(&mut self, load: &Load) -> Result<Equilibrium, EquilibriumError> {
        let mut moved = self.commanded.clone();
        let mut iterations = 0;
        for _ in 0..LAW_ROUNDS {
            let found = (self.solver).solve(&mut self.arm, &self.compliance, &moved, load)?;
            iterations += found.iterations;
            let mut change: f64 = 0.0;
            for &(joint, law) in &self.laws {
                let spring = self.compliance[joint] * self.solver.torque()[joint];
                if !law.can_hold(spring) {
                    return Err(EquilibriumError::Unstable);
                }
                let at = self.commanded[joint] + law.deflection(spring) - spring;
                change = change.max((at - moved[joint]).abs());
                moved[joint] = at;
            }
            if change <= LAW_CONVERGED {
                return Ok(Equilibrium {
                    iterations,
                    last_step_rad: found.last_step_rad.max(change),
                });
            }
        }
        Err(EquilibriumError::Unstable)
    }
}

/// The kinematics of the robot as MuJoCo computes them.
#[derive(Debug)]
struct MujocoArm {
    state: State,
    /// The model as its file says, and one to change for the next run.
    nominal: Model,
    spare: Option<Model>,
    site: usize,
    /// MuJoCo's identifiers of the joints.
    joints: Vec<usize>,
    slides: Vec<bool>,
    /// The body that each joint moves.
    bodies: Vec<usize>,
    tool_joints: usize,
    gravity_m_s2: Vector3<f64>,
    is_plain: bool,
    elements: Elements,
    /// The sites that springs go through, in the order of the elements' places.
    places: Vec<usize>,
}

impl MujocoArm {
    /// A chain with a tool at a site.
    pub fn new(robot: &TrueRobot, chain: &SerialChain, site: usize) -> Self {
        let model = &robot.model;
        let (tool_body, _) = model.site_body(site);
        // The chain's reader has seen that all joints are in series.
        let bodies = (0..model.bodies()).flat_map(|body| model.joints_of(body).map(move |_| body));
        let body_of: Vec<usize> = bodies.collect();
        let joints = model.chain_joints();
        let nominal = robot.chain_statics().clone();
        let state = State::new(&nominal);
        Self {
            bodies: joints.iter().map(|&joint| body_of[joint]).collect(),
            tool_joints: model.joints_that_move(tool_body),
            gravity_m_s2: model.gravity(),
            slides: chain
                .joints
                .iter()
                .map(|joint| joint.drive.slides)
                .collect(),
            joints,
            is_plain: chain.is_plain(),
            elements: chain.elements.clone(),
            places: model.spring_sites(),
            state,
            nominal,
            spare: None,
            site,
        }
    }

    /// Makes the robot another than the model says.
    pub fn change(&mut self, robot: &TrueRobot, changes: &[ModelChange]) -> Result<(), FileError> {
        let mut model = self.spare.take().unwrap_or_else(|| self.nominal.clone());
        model.become_changed(&self.nominal, &robot.joints, changes)?;
        if !self.elements.springs.is_empty() {
            let springs = model.tendon_springs();
            for (spring, now) in self.elements.springs.iter_mut().zip(springs) {
                spring.stiffness_n_per_m = now.stiffness_n_per_m;
                spring.rest_m = now.rest_m;
            }
        }
        self.spare = Some(self.state.replace_model(&model));
        Ok(())
    }
}

impl Kinematics for MujocoArm {
    fn gravity_m_s2(&self) -> Vector3<f64> {
        self.gravity_m_s2
    }

    fn is_plain(&self) -> bool {
        self.is_plain
    }

    fn elements(&self) -> &Elements {
        &self.elements
    }

    fn update(&mut self, q: &[f64], state: &mut KinematicState) {
        self.state.move_to(q);
        for (index, (&joint, &body)) in self.joints.iter().zip(&self.bodies).enumerate() {
            let (anchor, axis) = self.state.joint(joint);
            state.place_joint(index, self.slides[index], axis, anchor);
            (state.distal_mass[index], state.distal_centre[index]) = self.state.subtree(body);
        }
        if !self.places.is_empty() {
            state.places.clear();
            let places = self.places.iter().map(|&site| self.state.site(site).0);
            state.places.extend(places);
        }
        let (position, rotation) = self.state.site(self.site);
        state.place_tool(self.tool_joints, position, rotation);
        state.feel(&self.elements, q);
    }
}
