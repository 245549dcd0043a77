//! Where experiments are possible.

use nalgebra::DVector;

use crate::robot::SerialChain;

/// Where experiments are possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The commanded angle of each joint lies in this range (rad).
    pub joint_range_rad: Vec<[f64; 2]>,
    /// Lower and upper bound of the calibration tool's height above the floor, `p_z` of Table 3 (m).
    pub tool_height_m: [Option<f64>; 2],
    /// Lower and upper bound of the calibration tool's distance from axis 1, r of Table 3 (m).
    pub tool_radius_m: [Option<f64>; 2],
    /// Upper bound of the elevation of the tool's z axis over the horizontal, phi of Table 3 (rad).
    pub tool_elevation_max_rad: Option<f64>,
    /// Upper bounds of the joint torques under load and gravity (N m); infinite where a joint is passive.
    pub joint_torque_max_nm: Option<Vec<f64>>,
    /// Robot, tool and surroundings stay this far apart (m), unloaded and loaded.
    pub collision_clearance_m: Option<f64>,
    /// Whether the tracker must see the reflector at the calibration tool.
    pub line_of_sight: bool,
    /// Configurations to keep away from.
    pub forbidden: Vec<Forbidden>,
}

/// A configuration to keep away from.
#[derive(Debug, Clone, PartialEq)]
pub struct Forbidden {
    /// The configuration (rad).
    pub configuration_rad: DVector<f64>,
    /// Some joint must differ by more than this (rad), whole turns apart.
    pub within_rad: f64,
}

impl Forbidden {
    /// The joint with the largest difference, and that (rad; m where it slides), where no joint of an arm differs by more than is asked for.
    pub fn too_near(&self, chain: &SerialChain, q: &[f64]) -> Option<(usize, f64)> {
        let apart = chain.largest_difference(self.configuration_rad.as_slice(), q);
        (apart.1 <= self.within_rad).then_some(apart)
    }
}
