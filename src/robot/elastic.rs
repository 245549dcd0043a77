//! A robot: what planner and testbed each have one of.

use super::{SerialChain, TrueRobot};
use crate::mujoco::Model;

/// A robot: its model, and its joints' compliances.
#[derive(Debug, Clone)]
pub struct Robot {
    /// The MJCF model.
    pub model: Model,
    /// The serial chain read from it.
    pub chain: SerialChain,
    /// The compliance of every joint (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
}

/// A compliance below this share of the largest says "as good as rigid", and is no measure of what the
/// joint's could be.
const RIGID: f64 = 1e-3;
/// A compliance (rad/(N m)) that stands in where all are zero: that of a small servo, since too large a
/// size only makes the decision on what is determined more generous.
const COMPLIANT: f64 = 1e-2;

impl Robot {
    /// The virtual robot that is just what is believed.
    pub fn as_believed(&self) -> TrueRobot {
        let compliance = self.compliance_rad_per_nm.clone();
        TrueRobot::of_chain(self.model.clone(), self.chain.clone(), compliance)
    }

    /// The typical sizes of the compliances of some joints (rad/(N m)), which make them comparable: their
    /// values; for a joint that is held to be rigid, or nearly so, the largest of all.
    pub fn typical_rad_per_nm(&self, joints: &[usize]) -> Vec<f64> {
        let all = &self.compliance_rad_per_nm;
        let largest = all.iter().copied().fold(0.0, f64::max);
        let instead = if largest > 0.0 { largest } else { COMPLIANT };
        let typical = |&joint: &usize| match all[joint] {
            value if value > RIGID * largest => value,
            _ => instead,
        };
        joints.iter().map(typical).collect()
    }
}
