//! The kinematics of a serial chain as MuJoCo computes them.

use nalgebra::Vector3;

use crate::mujoco::State;
use crate::robot::{KinematicState, Kinematics, TrueRobot};

/// The kinematics of the robot as MuJoCo computes them.
#[derive(Debug)]
pub(super) struct MujocoArm {
    state: State,
    site: usize,
    /// The body that each joint moves.
    bodies: Vec<usize>,
    tool_joints: usize,
    gravity_m_s2: Vector3<f64>,
}

impl MujocoArm {
    /// A chain with a tool at a site.
    pub fn new(robot: &TrueRobot, site: usize) -> Self {
        let (tool_body, _) = robot.model.site_body(site);
        Self {
            bodies: (0..robot.model.bodies())
                .flat_map(|body| robot.model.joints_of(body).map(move |_| body))
                .collect(),
            // Joint j has identifier j: the chain's reader has seen that all joints are in series.
            tool_joints: robot.model.joints_that_move(tool_body),
            gravity_m_s2: robot.model.gravity(),
            state: State::new(&robot.model.with_weighing_masses()),
            site,
        }
    }

    pub const fn state(&self) -> &State {
        &self.state
    }
}

impl Kinematics for MujocoArm {
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
