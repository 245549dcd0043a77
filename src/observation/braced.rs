//! An arm that springs beside the joints' own brace, such as a gravity compensator: what it changes in the
//! observation matrix's derivatives.

use nalgebra::{DMatrix, Vector3};

use crate::robot::{KinematicState, Kinematics, SerialChain, Tool};

/// How far joints are moved to see how the springs' stiffness changes (rad, m).
const SHIFT: f64 = 1e-5;

/// An arm with a tool, of which compliances alone may be unknown.
#[derive(Debug, Clone, Copy)]
pub struct BareArm<'a> {
    /// The chain.
    pub chain: &'a SerialChain,
    /// The nominal compliances of all joints (rad/(N m)).
    pub compliance_rad_per_nm: &'a [f64],
    /// The tool.
    pub tool: &'a Tool,
}

/// The arm at one configuration.
#[derive(Debug, Clone)]
pub(super) struct BracedArm {
    q: Vec<f64>,
    /// M = (I + k S)^-1, see [`KinematicState::mobility`].
    mobility: DMatrix<f64>,
    /// With J~ = J M for the Jacobian J.
    pub state: KinematicState,
}

/// A change of column n of J~, position and rotation rows, is worth so much.
#[derive(Debug, Clone, Copy)]
pub(super) struct ColumnWorth {
    pub joint: usize,
    pub position: Vector3<f64>,
    pub rotation: Vector3<f64>,
}

impl BracedArm {
    /// `None` where no spring braces the arm.
    pub fn new(arm: BareArm<'_>, state: &KinematicState, q: &[f64]) -> Option<Self> {
        let mobility = state.mobility(arm.compliance_rad_per_nm)?;
        let mut state = state.clone();
        state.brace(&mobility);
        Some(Self {
            q: q.to_vec(),
            mobility,
            state,
        })
    }

    /// Adds what changes of J~ with the joints are worth to `gradient`. From
    ///
    /// ```text
    /// dJ~ = dJ M - J~ k dS M
    /// ```
    ///
    /// a change of J is worth H = G M^T where one of J~ is worth G, and one of the springs' stiffness S costs
    /// `k_a` (`H_b` . `J~_a`) in row a and column b. J's change is known (see
    /// [`ComplianceRows::pull_back`](super::compliances::ComplianceRows::pull_back)), that of S, which few joints have a
    /// part in, comes from differences.
    pub fn pull_back(
        &self,
        arm: BareArm<'_>,
        plain: &KinematicState,
        worth: &[ColumnWorth],
        gradient: &mut [f64],
    ) {
        let joints = plain.joints();
        let of_joint = |joint: usize| {
            let mut sums = [Vector3::zeros(); 2];
            for each in worth {
                let share = self.mobility[(joint, each.joint)];
                sums[0] += each.position * share;
                sums[1] += each.rotation * share;
            }
            sums
        };
        let worth: Vec<[Vector3<f64>; 2]> = (0..joints).map(of_joint).collect();
        let adjoint = |joint: usize| {
            let [moved, turned] = &worth[joint];
            plain.position_column(joint).cross(moved) + plain.rotation_column(joint).cross(turned)
        };
        let mut outer: Vector3<f64> = (0..joints).map(adjoint).sum();
        let mut inner = Vector3::zeros();
        for (joint, slope) in gradient.iter_mut().enumerate().take(joints) {
            let (column, axis) = (plain.position_column(joint), plain.rotation_column(joint));
            *slope += axis.dot(&outer) + column.dot(&inner);
            outer -= adjoint(joint);
            inner += worth[joint][0].cross(&axis);
        }
        let cost = DMatrix::from_fn(joints, joints, |row, column| {
            let [moved, turned] = &worth[column];
            arm.compliance_rad_per_nm[row]
                * (moved.dot(&self.state.position_column(row))
                    + turned.dot(&self.state.rotation_column(row)))
        });
        let mut state = plain.clone();
        let mut q = self.q.clone();
        for joint in arm.chain.elements.joints_of_springs() {
            let mut cost_at = |shift: f64| {
                q[joint] = self.q[joint] + shift;
                arm.chain.at(arm.tool).update(&q, &mut state);
                state.spring_stiffness.dot(&cost)
            };
            gradient[joint] -= (cost_at(SHIFT) - cost_at(-SHIFT)) / (2.0 * SHIFT);
            q[joint] = self.q[joint];
        }
    }
}
