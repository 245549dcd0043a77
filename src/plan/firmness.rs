//! Which loads an arm surely holds, without looking for its equilibrium.

use crate::robot::Load;
use crate::task::Belief;

/// What a plain arm surely holds. No torque about joint j is larger than `T_j` = (F + m g) l + M with the mass and the reach beyond it, nor are
/// its derivatives by this joint's angle and those before. With the sum a of all `k_j` `T_j` at most 1/5, Newton's method converges to a
/// stable equilibrium (Kantorovich: the first step is at most a / (1 - a), the whole way twice that, below half a radian; eigenvalues of
/// I - k dtau/dq are at least 1 - a, as |dtau_i/dq_j|^2 is at most `T_i` `T_j`).
#[derive(Debug)]
pub(super) struct Firmness(Option<Vec<FirmJoint>>);

/// What lies beyond a joint.
#[derive(Debug)]
struct FirmJoint {
    compliance_rad_per_nm: f64,
    reach_m: f64,
    weight_n: f64,
}

impl Firmness {
    /// Of the planner's arm; nothing is said of one where more than the joints of the paper's arm is elastic.
    pub fn new(belief: &Belief) -> Self {
        let (nominal, tool) = (&belief.nominal, &belief.calibration_tool);
        if !nominal.chain.is_plain() {
            return Self(None);
        }
        let gravity_m_s2 = nominal.chain.gravity_m_s2.norm();
        let mut reach_m = tool.link_from_tool.translation.vector.norm();
        let mut weight_n = 0.0;
        let each = nominal
            .chain
            .joints
            .iter()
            .zip(&nominal.compliance_rad_per_nm);
        let beyond = each.rev().map(|(joint, compliance)| {
            weight_n += joint.mass_kg * gravity_m_s2;
            let own_m = reach_m.max(joint.centre_of_mass_m.norm());
            reach_m = own_m + joint.previous_from_link.translation.vector.norm();
            FirmJoint {
                compliance_rad_per_nm: compliance.abs(),
                reach_m: own_m,
                weight_n,
            }
        });
        Self(Some(beyond.collect()))
    }

    /// Whether the arm surely holds a load, and itself.
    pub fn holds(&self, load: &Load) -> bool {
        let (force_n, moment_nm) = (load.force_n.norm(), load.torque_nm.norm());
        let gives = |joint: &FirmJoint| {
            let torque_nm = (force_n + joint.weight_n) * joint.reach_m + moment_nm;
            joint.compliance_rad_per_nm * torque_nm
        };
        (self.0.as_ref()).is_some_and(|joints| joints.iter().map(gives).sum::<f64>() <= 0.2)
    }
}
