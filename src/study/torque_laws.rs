//! Nonlinear joint stiffness of the virtual robot: its effect on readings and at test poses, to first order.

use nalgebra::Vector6;

use crate::parameter::ElasticArm;
use crate::robot::{Kinematics, Load, TrueRobot};

/// By how much (m, rad) the deflection of an arm at one of its tools differs from that of springs, where some joints of the true
/// robot have a law of their own. In the torques of the weight and of the load, at the commanded angles.
pub(super) fn beyond_springs(
    arm: &ElasticArm,
    robot: &TrueRobot,
    target: usize,
    q: &[f64],
    load: &Load,
) -> Vector6<f64> {
    let chain = arm.loaded_chain();
    let at_tool = chain.at(&arm.tools[target]);
    let state = at_tool.state(q);
    let gravity = at_tool.gravity_m_s2();
    let mut seen = Vector6::zeros();
    for &(joint, law) in &robot.torque_laws {
        let compliance = robot.compliance_rad_per_nm[joint];
        let weight = compliance * state.gravity_torque(joint, &gravity);
        let loaded = compliance * state.load_torque(joint, load);
        let gives = law.deflection(weight + loaded) - law.deflection(weight) - loaded;
        let (moved, turned) = (state.position_column(joint), state.rotation_column(joint));
        seen += Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z) * gives;
    }
    seen
}
