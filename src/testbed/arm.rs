//! The kinematics of a serial chain as MuJoCo computes them.

use nalgebra::{Matrix3, Vector3};

use crate::files::FileError;
use crate::mujoco::{Model, ModelChange, State};
use crate::robot::{Elements, KinematicState, Kinematics, SerialChain, TrueRobot};

/// The kinematics of the robot as MuJoCo computes them.
#[derive(Debug)]
pub(super) struct MujocoArm {
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

    /// Has these coordinates of the joints (rad, m), and no pose by them yet.
    pub fn stand_at(&mut self, q: &[f64]) {
        self.state.stand_at(q);
    }

    /// The position (m) and axes of a site at these coordinates (rad, m).
    pub fn site_at(&mut self, q: &[f64], site: usize) -> (Vector3<f64>, Matrix3<f64>) {
        self.state.move_to(q);
        self.state.site(site)
    }

    pub const fn state(&self) -> &State {
        &self.state
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
