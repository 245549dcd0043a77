//! Joints that their actuators hold by a law of their own.

use super::servo::Servo;
use super::torque_law::{LawAtWork, TorqueLaw};
use super::{Model, State};

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
            let deflection = self.command(each) - self.data.qpos()[each.coordinate];
            let beyond = each.law.held(deflection) - deflection;
            forces[each.degree] += self.model.stiffness_by(&each.servo) * beyond;
        }
    }

    /// The commanded coordinate.
    fn command(&self, each: &LawAtWork) -> f64 {
        self.data.ctrl()[each.servo.control] / each.servo.gear
    }
}

impl Model {
    /// The stiffness that a position actuator gives its joint (N m/rad, N/m).
    fn stiffness_by(&self, servo: &Servo) -> f64 {
        let spring = -self.inner.actuator_biasprm()[servo.actuator][1];
        spring * servo.gear * servo.gear
    }
}
