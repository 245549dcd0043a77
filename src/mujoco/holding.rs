//! Joints that their actuators hold by a law of their own.

use super::State;
use super::torque_law::{LawAtWork, TorqueLaw};

impl State {
    /// Lets position actuators hold some joints, by MuJoCo's identifiers, by a law of their own. Joints that none holds are
    /// left out.
    pub fn set_torque_laws(&mut self, laws: &[(usize, TorqueLaw)]) {
        let at_work = |&(joint, law): &(usize, TorqueLaw)| {
            Some(LawAtWork {
                law,
                servo: self.model.position(joint)?,
                coordinate: self.model.coordinate_of_joint(joint),
                degree: self.model.degree_of_joint(joint),
            })
        };
        let laws = laws.iter().filter_map(at_work).collect();
        self.laws = laws;
    }

    /// Adds what the joints' laws hold beyond their actuators (N m, N) at the present coordinates and commands.
    pub(super) fn add_torque_laws(&self, forces: &mut [f64]) {
        for each in &self.laws {
            let command = self.data.ctrl()[each.servo.control] / each.servo.gear;
            let deflection = command - self.data.qpos()[each.coordinate];
            let beyond = each.law.held(deflection) - deflection;
            forces[each.degree] += each.servo.stiffness(&self.model.inner) * beyond;
        }
    }
}
