//! What only the testbed sees.

use nalgebra::DMatrix;

use crate::parameter::Uncertainty;
use crate::robot::TrueRobot;

/// The virtual robot, and how it varies.
#[derive(Debug, Clone)]
pub struct Truth {
    /// The virtual robot.
    pub robot: TrueRobot,
    /// Its compliances vary from run to run of a study about those of the robot, log-normally: the standard
    /// deviation of each joint's logarithm.
    pub compliance_spread: Vec<f64>,
    /// Compliances that every run of a study draws anew from what the belief knows of them, so that this
    /// knowledge is as good as it says.
    pub drawn: Option<DrawnCompliances>,
    /// What every run draws anew besides: all that the scenario lists as uncertain, whether the belief knows of it or
    /// not.
    pub uncertainties: Vec<Uncertainty>,
}

impl Truth {
    /// Whether errors are made of more than the instrument's noise and other compliances.
    #[must_use]
    pub const fn leaves_more_than_noise(&self) -> bool {
        !self.uncertainties.is_empty() || !self.robot.torque_laws.is_empty()
    }
}

/// Compliances with a normal distribution.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnCompliances {
    /// The joints.
    pub joints: Vec<usize>,
    /// Their means (rad/(N m)).
    pub mean_rad_per_nm: Vec<f64>,
    /// L: mean + L z for independent standard normals z.
    pub spread: DMatrix<f64>,
}
