//! What only the testbed sees.

use crate::robot::TrueRobot;

/// The virtual robot, and how it varies.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The virtual robot.
    pub robot: TrueRobot,
    /// Its compliances vary from run to run of a study about those of the robot, log-normally: the standard
    /// deviation of each joint's logarithm.
    pub compliance_spread: Vec<f64>,
}
