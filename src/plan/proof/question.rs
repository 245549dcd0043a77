//! What is to be proved, in plain numbers, which are taken as the doubles that they are.

use serde::Serialize;

/// A joint and the link that it moves.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProofJoint {
    /// Where the link's frame stands in that of the link before (m).
    pub offset_m: [f64; 3],
    /// How it stands there at zero angle: a quaternion (x, y, z, w) of any length.
    pub rotation: [f64; 4],
    /// The axis through the frame's origin, in the frame; a vector of any length.
    pub axis: [f64; 3],
    /// The joint's range (rad).
    pub range_rad: [f64; 2],
}

/// A serial arm with a tool.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Arm {
    /// The joints from the base to the flange.
    pub joints: Vec<ProofJoint>,
    /// How many joints, from the base, move the tool.
    pub tool_joints: usize,
    /// Where the tool is in the frame of the link that carries it (m).
    pub tool_offset_m: [f64; 3],
    /// How it stands there: a quaternion (x, y, z, w) of any length.
    pub tool_rotation: [f64; 4],
}

/// Where experiments are possible, beside the joint ranges.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SmoothRegion {
    /// Lower and upper bound of the tool's height (m).
    pub height_m: [Option<f64>; 2],
    /// Lower and upper bound of the tool's distance from the first axis (m).
    pub radius_m: [Option<f64>; 2],
    /// The tool's z axis has at most this height, up or down (the sine of its elevation).
    pub elevation_sine: Option<f64>,
}

/// The loads that an experiment may have.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProofLoads {
    /// One of these wrenches, force (N) and torque (N m) in the world frame.
    OneOf(Vec<[f64; 6]>),
    /// A force of any direction of at most this size (N).
    AnyForce(f64),
}

/// What is new in each reading besides the instrument's noise, in units of the latter's standard deviation sigma. With `J_n`, `z_n`
/// the columns of the joints, `k_n` their compliances, F the force and T the torque, the covariance over sigma^2 is
///
/// ```text
/// R = everywhere I + sum_n joint_repeatability_n^2 J_n J_n^T
///   + turned^2 sum_n,m k_n k_m J_n (F x J_n + T x z_n) . (F x J_m + T x z_m) J_m^T
///   + shifted^2 sum_n,m k_n k_m J_n (F x z_n) . (F x z_m) J_m^T
/// ```
///
/// It has the symmetries of the deflections: what leaves all `J_n` and `z_n` as they are, but for a rotation, a mirror and signs,
/// does the same to it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReadingSpread {
    /// What there is in every reading: 1 for the instrument's own noise.
    pub everywhere: f64,
    /// Each joint's standard deviation of its return, over sigma (1/m).
    pub joint_repeatability: Vec<f64>,
    /// The joints' compliances (rad/(N m)).
    pub compliance_rad_per_nm: Vec<f64>,
    /// The standard deviation of the load's direction, over sigma (rad/m).
    pub turned: f64,
    /// The standard deviation of the load's point, over sigma (1).
    pub shifted: f64,
}

/// The largest of d(x) = sum over rows r of |sum over parameters n of `b_rn` `tau_n`(x) `J_n`(x)|^2 over all
/// experiments x is to be bounded. Where more than the instrument's noise is new in each
/// reading, of the sum of `v_r`^T R^-1 `v_r`, `v_r` the sum over n of `b_rn` `tau_n` `J_n`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Question {
    /// The arm.
    pub arm: Arm,
    /// The joints n whose compliances are the parameters.
    pub parameters: Vec<usize>,
    /// The rows of B: one number for each parameter.
    pub rows: Vec<Vec<f64>>,
    /// Where experiments are possible.
    pub region: SmoothRegion,
    /// Their loads.
    pub loads: ProofLoads,
    /// What is new in each reading; under one of several loads alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread: Option<ReadingSpread>,
}

impl Question {
    /// How far from the axis of each joint the tool can be at most, by the lengths of the links (m).
    pub fn reaches_m(&self) -> Vec<f64> {
        let length = |vector: &[f64; 3]| vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        let joints = &self.arm.joints[..self.arm.tool_joints];
        let mut reach = length(&self.arm.tool_offset_m);
        let mut reaches = vec![0.0; self.arm.joints.len()];
        for (joint, place) in joints.iter().zip(&mut reaches).rev() {
            *place = reach;
            reach += length(&joint.offset_m);
        }
        reaches
    }

    /// A bound of the root of d under any load of at most 1 N and 1 N m, by the lengths of the links.
    pub fn root_of_unit_load(&self) -> f64 {
        let reaches = self.reaches_m();
        let everywhere = (self.spread.as_ref()).map_or(1.0, |spread| spread.everywhere);
        let row = |row: &Vec<f64>| {
            let terms = row.iter().zip(&self.parameters);
            let terms = terms
                .map(|(factor, &joint)| factor.abs() * (reaches[joint] + 1.0) * reaches[joint]);
            terms.sum::<f64>().powi(2)
        };
        // Fewer than 1000 roundings of numbers that are not negative.
        (self.rows.iter().map(row).sum::<f64>() / everywhere).sqrt() * (1.0 + 1e-12)
    }
}
