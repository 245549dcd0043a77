//! The serial arm: its kinematic chain, read from an MJCF model, and its elastostatics.
//!
//! [`SerialChain`] is what the planner believes of the robot's geometry and masses. At a
//! configuration it yields a [`KinematicState`], and everything else follows from that: the
//! Jacobian, the observation matrix (eqs. 3, 4, 7, 8), the torques of gravity and of a wrench, and
//! the static equilibrium. The virtual robot yields the same [`KinematicState`] from MuJoCo, so that
//! the two can judge each other.

mod approach;
mod bracing;
mod chain;
mod commands;
mod elastic;
mod elastostatics;
mod elements;
mod equilibrium;
mod kinematic_state;
mod mjcf;
mod passive;
mod springs;
mod true_robot;

pub use approach::{Approach, CommandPose};
pub use chain::{Drive, Joint, SerialChain, Tool, nearest_turn};
pub use commands::{Commands, ReadsAlong};
pub use elastic::Robot;
pub use elastostatics::ObservationMatrix;
pub use elements::{Elements, JointSpring, Offset, Place, Spring};
pub use equilibrium::{
    CONVERGED_RAD, Equilibrium, EquilibriumError, EquilibriumSolver, MAXIMUM_ITERATIONS,
    until_it_stands,
};
pub use kinematic_state::{KinematicState, Kinematics, Load, rotation_vector};
pub use passive::{commands_for, made_up};
pub use springs::Motion;
pub use true_robot::{KnownJoint, TrueRobot};
