//! The smooth bounds of the feasible region: height, radius and inclination of the tool (Table 3)
//! and joint torques, with their derivatives.

use nalgebra::Vector3;

use crate::experiment::PRINTED_RAD;
use crate::robot::{KinematicState, Load};
use crate::task::Region;

/// One bound of the feasible region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SmoothBound {
    /// The tool is at least this high (m).
    HeightMin(f64),
    /// The tool is at most this high (m).
    HeightMax(f64),
    /// The tool is at least this far from axis 1 (m).
    RadiusMin(f64),
    /// The tool is at most this far from axis 1 (m).
    RadiusMax(f64),
    /// The tool's z axis rises at most this much over the horizontal (sine of the angle).
    ElevationMax(f64),
    /// The tool's z axis falls at most this much below the horizontal (sine of the angle).
    ElevationMin(f64),
    /// The torque of load, gravity and springs about a joint is at most this (N m).
    TorqueMax(usize, f64),
    /// The torque about a joint is at least minus this (N m).
    TorqueMin(usize, f64),
}

/// Plans are printed with one decimal, so that an experiment on a bound may be a little outside. The
/// class of plans that a lower bound speaks about reaches this far beyond the region: in joint ranges
/// and in the tool's elevation (rad) ...
pub const WIDENED_RAD: f64 = PRINTED_RAD;
/// ... in the tool's height and distance from axis 1 (m) ...
pub const WIDENED_M: f64 = 1e-3;
/// ... and in torques, as a share: a load that leans by 0.1 deg has so much of itself to one side.
pub const WIDENED_SHARE: f64 = WIDENED_RAD;

/// The smooth bounds of a region, widened by as much as printing may move an experiment, and no others:
/// neither collisions nor sight nor forbidden configurations.
pub fn widened(region: &Region) -> Region {
    let outward = |[low, high]: [Option<f64>; 2]| {
        [
            low.map(|low| low - WIDENED_M),
            high.map(|high| high + WIDENED_M),
        ]
    };
    let torques = region.joint_torque_max_nm.as_ref();
    Region {
        joint_range_rad: (region.joint_range_rad.iter())
            .map(|[low, high]| [low - WIDENED_RAD, high + WIDENED_RAD])
            .collect(),
        tool_height_m: outward(region.tool_height_m),
        tool_radius_m: outward(region.tool_radius_m),
        tool_elevation_max_rad: (region.tool_elevation_max_rad).map(|angle| angle + WIDENED_RAD),
        joint_torque_max_nm: torques.map(|torques| {
            let widen = |torque: &f64| torque * (1.0 + WIDENED_SHARE);
            torques.iter().map(widen).collect()
        }),
        collision_clearance_m: None,
        line_of_sight: false,
        forbidden: Vec::new(),
    }
}

/// The bounds that a region sets, the joint ranges apart.
pub fn bounds_of(region: &Region) -> Vec<SmoothBound> {
    let mut bounds = Vec::new();
    let [height_min, height_max] = region.tool_height_m;
    let [radius_min, radius_max] = region.tool_radius_m;
    bounds.extend(height_min.map(SmoothBound::HeightMin));
    bounds.extend(height_max.map(SmoothBound::HeightMax));
    bounds.extend(radius_min.map(SmoothBound::RadiusMin));
    bounds.extend(radius_max.map(SmoothBound::RadiusMax));
    // Nothing rises more than upright.
    let upright = std::f64::consts::FRAC_PI_2;
    if let Some(angle) = region
        .tool_elevation_max_rad
        .filter(|angle| *angle < upright)
    {
        bounds.push(SmoothBound::ElevationMax(angle.sin()));
        bounds.push(SmoothBound::ElevationMin(angle.sin()));
    }
    for (joint, &torque) in region.joint_torque_max_nm.iter().flatten().enumerate() {
        bounds.push(SmoothBound::TorqueMax(joint, torque));
        bounds.push(SmoothBound::TorqueMin(joint, torque));
    }
    bounds
}

impl SmoothBound {
    /// How far inside the bound a state is: negative is a violation. In m, as a sine, or as a share
    /// of the largest torque.
    pub fn margin(&self, state: &KinematicState, load: &Load, gravity: &Vector3<f64>) -> f64 {
        match *self {
            Self::HeightMin(bound) => state.tool_position.z - bound,
            Self::HeightMax(bound) => bound - state.tool_position.z,
            Self::RadiusMin(bound) => radius(state).norm() - bound,
            Self::RadiusMax(bound) => bound - radius(state).norm(),
            Self::ElevationMax(sine) => sine - state.tool_rotation[(2, 2)],
            Self::ElevationMin(sine) => sine + state.tool_rotation[(2, 2)],
            Self::TorqueMax(joint, bound) => 1.0 - torque(state, joint, load, gravity) / bound,
            Self::TorqueMin(joint, bound) => 1.0 + torque(state, joint, load, gravity) / bound,
        }
    }

    /// The derivative of the margin with respect to joint `by` (per rad).
    pub fn derivative(
        &self,
        state: &KinematicState,
        load: &Load,
        gravity: &Vector3<f64>,
        by: usize,
    ) -> f64 {
        let moved = || state.position_column(by);
        let outward = || radius(state).normalize().dot(&moved());
        let z_axis_rises = || {
            let z_axis = state.tool_rotation.column(2);
            state.rotation_column(by).cross(&z_axis).z
        };
        match *self {
            Self::HeightMin(_) => moved().z,
            Self::HeightMax(_) => -moved().z,
            Self::RadiusMin(_) => outward(),
            Self::RadiusMax(_) => -outward(),
            Self::ElevationMax(_) => -z_axis_rises(),
            Self::ElevationMin(_) => z_axis_rises(),
            Self::TorqueMax(joint, bound) => {
                -torque_derivative(state, joint, by, load, gravity) / bound
            }
            Self::TorqueMin(joint, bound) => {
                torque_derivative(state, joint, by, load, gravity) / bound
            }
        }
    }

    /// The derivative of the margin with respect to the force (per N); none for bounds that no load
    /// moves. The margin is linear in the force.
    pub fn force_derivative(&self, state: &KinematicState) -> Option<Vector3<f64>> {
        match *self {
            Self::TorqueMax(joint, bound) => Some(-state.position_column(joint) / bound),
            Self::TorqueMin(joint, bound) => Some(state.position_column(joint) / bound),
            _ => None,
        }
    }

    /// What is bounded, with the value that a state has, the bound, and the unit, for a person.
    pub fn describe(
        &self,
        state: &KinematicState,
        load: &Load,
        gravity: &Vector3<f64>,
    ) -> (String, f64, f64, &'static str) {
        let elevation = state.tool_rotation[(2, 2)].clamp(-1.0, 1.0).asin();
        match *self {
            Self::HeightMin(bound) | Self::HeightMax(bound) => {
                let height = state.tool_position.z;
                ("tool height".to_owned(), height * 1e3, bound * 1e3, "mm")
            }
            Self::RadiusMin(bound) | Self::RadiusMax(bound) => {
                let distance = radius(state).norm();
                let what = "tool distance from axis 1".to_owned();
                (what, distance * 1e3, bound * 1e3, "mm")
            }
            Self::ElevationMax(sine) => {
                let bound = sine.asin().to_degrees();
                (
                    "tool elevation".to_owned(),
                    elevation.to_degrees(),
                    bound,
                    "deg",
                )
            }
            Self::ElevationMin(sine) => {
                let bound = -sine.asin().to_degrees();
                (
                    "tool elevation".to_owned(),
                    elevation.to_degrees(),
                    bound,
                    "deg",
                )
            }
            Self::TorqueMax(joint, bound) | Self::TorqueMin(joint, bound) => {
                let torque = torque(state, joint, load, gravity);
                let bound = bound.copysign(torque);
                (
                    format!("torque about joint {}", joint + 1),
                    torque,
                    bound,
                    "N m",
                )
            }
        }
    }
}

/// From axis 1 to the tool, at right angles to the axis.
fn radius(state: &KinematicState) -> Vector3<f64> {
    let axis = &state.axis[state.first_axis];
    let from_anchor = state.tool_position - state.anchor[state.first_axis];
    from_anchor - axis * axis.dot(&from_anchor)
}

fn torque(state: &KinematicState, joint: usize, load: &Load, gravity: &Vector3<f64>) -> f64 {
    let (of_springs, _) = state.torque_of_springs(joint, joint);
    state.load_torque(joint, load) + state.gravity_torque(joint, gravity) + of_springs
}

fn torque_derivative(
    state: &KinematicState,
    joint: usize,
    by: usize,
    load: &Load,
    gravity: &Vector3<f64>,
) -> f64 {
    let (_, of_springs) = state.torque_of_springs(joint, by);
    state.torque_derivative(joint, by, load, gravity) + of_springs
}
