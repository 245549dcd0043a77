//! The smooth bounds of the feasible region: height, radius and inclination of the tool (Table 3)
//! and joint torques, with their derivatives.

use nalgebra::Vector3;

use crate::experiment::PRINTED_RAD;
use crate::robot::{KinematicState, Load};
use crate::task::Region;

/// What is bounded of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bounded {
    /// The tool's height (m).
    Height,
    /// The tool's distance from axis 1 (m).
    Radius,
    /// How much the tool's z axis rises over the horizontal (sine of the angle).
    Elevation,
    /// The torque of load, gravity and springs about a joint (N m).
    Torque(usize),
}

/// One bound of the feasible region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmoothBound {
    /// What is bounded.
    pub of: Bounded,
    /// Whether it may be at most so much, and not at least.
    pub is_upper: bool,
    /// The bound, in its unit.
    pub bound: f64,
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
    let mut add = |of: Bounded, is_upper: bool, bound: Option<f64>| {
        bounds.extend(bound.map(|bound| SmoothBound {
            of,
            is_upper,
            bound,
        }));
    };
    for (of, [low, high]) in [
        (Bounded::Height, region.tool_height_m),
        (Bounded::Radius, region.tool_radius_m),
    ] {
        add(of, false, low);
        add(of, true, high);
    }
    // Nothing rises more than upright.
    let upright = std::f64::consts::FRAC_PI_2;
    let sine = (region.tool_elevation_max_rad)
        .filter(|angle| *angle < upright)
        .map(f64::sin);
    add(Bounded::Elevation, true, sine);
    add(Bounded::Elevation, false, sine.map(|sine| -sine));
    let torques = region.joint_torque_max_nm.iter().flatten().enumerate();
    // Nothing bounds the torque of a passive joint.
    for (joint, &torque) in torques.filter(|(_, torque)| torque.is_finite()) {
        add(Bounded::Torque(joint), true, Some(torque));
        add(Bounded::Torque(joint), false, Some(-torque));
    }
    bounds
}

impl SmoothBound {
    /// Whether it bounds what a load moves.
    pub const fn is_of_load(&self) -> bool {
        matches!(self.of, Bounded::Torque(_))
    }

    /// What a margin goes down by where what is bounded grows by one.
    fn slope(&self) -> f64 {
        let slope = match self.of {
            Bounded::Torque(_) => self.bound.abs().recip(),
            _ => 1.0,
        };
        if self.is_upper { slope } else { -slope }
    }

    /// How far inside the bound a state is: negative is a violation. In m, as a sine, or as a share
    /// of the largest torque.
    pub fn margin(&self, state: &KinematicState, load: &Load, gravity: &Vector3<f64>) -> f64 {
        self.slope() * (self.bound - self.value(state, load, gravity))
    }

    /// The value of what is bounded.
    fn value(&self, state: &KinematicState, load: &Load, gravity: &Vector3<f64>) -> f64 {
        match self.of {
            Bounded::Height => state.tool_position.z,
            Bounded::Radius => radius(state).norm(),
            Bounded::Elevation => state.tool_rotation[(2, 2)],
            Bounded::Torque(joint) => {
                let (of_springs, _) = state.torque_of_springs(joint, joint);
                state.load_torque(joint, load) + state.gravity_torque(joint, gravity) + of_springs
            }
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
        let grows = match self.of {
            Bounded::Height => state.position_column(by).z,
            Bounded::Radius => radius(state).normalize().dot(&state.position_column(by)),
            Bounded::Elevation => {
                let z_axis = state.tool_rotation.column(2);
                state.rotation_column(by).cross(&z_axis).z
            }
            Bounded::Torque(joint) => {
                let (_, of_springs) = state.torque_of_springs(joint, by);
                state.torque_derivative(joint, by, load, gravity) + of_springs
            }
        };
        -self.slope() * grows
    }

    /// The derivative of the margin with respect to the force (per N); none for bounds that no load
    /// moves. The margin is linear in the force.
    pub fn force_derivative(&self, state: &KinematicState) -> Option<Vector3<f64>> {
        match self.of {
            Bounded::Torque(joint) => Some(state.position_column(joint) * -self.slope()),
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
        let value = self.value(state, load, gravity);
        let both = |shown: &dyn Fn(f64) -> f64| (shown(value), shown(self.bound));
        let (what, (found, bound), unit) = match self.of {
            Bounded::Height => ("tool height".to_owned(), both(&|m| m * 1e3), "mm"),
            Bounded::Radius => {
                let what = "tool distance from axis 1".to_owned();
                (what, both(&|m| m * 1e3), "mm")
            }
            Bounded::Elevation => {
                let degrees = |sine: f64| sine.clamp(-1.0, 1.0).asin().to_degrees();
                ("tool elevation".to_owned(), both(&degrees), "deg")
            }
            Bounded::Torque(joint) => {
                let what = format!("torque about joint {}", joint + 1);
                (what, (value, self.bound.copysign(value)), "N m")
            }
        };
        (what, found, bound, unit)
    }
}

/// From axis 1 to the tool, at right angles to the axis.
fn radius(state: &KinematicState) -> Vector3<f64> {
    let axis = &state.axis[state.first_axis];
    let from_anchor = state.tool_position - state.anchor[state.first_axis];
    from_anchor - axis * axis.dot(&from_anchor)
}
