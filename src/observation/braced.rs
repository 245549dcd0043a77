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

/// A change of a joint's column of a Jacobian, position and rotation rows, is worth so much.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ColumnWorth {
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

    /// Makes what changes of J~ are worth that of changes of J, and adds what those of the springs are worth to `gradient`. From
    ///
    /// ```text
    /// dJ~ = dJ M - J~ k dS M
    /// ```
    ///
    /// a change of J is worth H = G M^T where one of J~ is worth G, and one of the springs' stiffness S costs
    /// `k_a` (`H_b` . `J~_a`) in row a and column b. J's change is known (see
    /// [`ComplianceRows::pull_back`](super::compliances::ComplianceRows::pull_back)); that of S, which few joints have a
    /// part in, comes from differences.
    pub fn pull_back(
        &self,
        arm: BareArm<'_>,
        plain: &KinematicState,
        worth: &mut [ColumnWorth],
        gradient: &mut [f64],
    ) {
        let joints = plain.joints();
        let of_joint = |joint: usize| {
            let mut sum = ColumnWorth::default();
            for (other, each) in worth.iter().enumerate() {
                let share = self.mobility[(joint, other)];
                sum.position += each.position * share;
                sum.rotation += each.rotation * share;
            }
            sum
        };
        let of_columns: Vec<ColumnWorth> = (0..joints).map(of_joint).collect();
        worth.copy_from_slice(&of_columns);
        let cost = DMatrix::from_fn(joints, joints, |row, column| {
            arm.compliance_rad_per_nm[row]
                * (worth[column].position.dot(&self.state.position_column(row))
                    + worth[column].rotation.dot(&self.state.rotation_column(row)))
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
