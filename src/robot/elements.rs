//! Elastic elements beside the joints' own: springs in joints, springs between places of the arm, and
//! constant forces of actuators.

use std::ops::Range;

use nalgebra::Vector3;

/// A spring in a joint beside what holds it, to which its compliance belongs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointSpring {
    /// The joint.
    pub joint: usize,
    /// Its stiffness (N m/rad or N/m).
    pub stiffness: f64,
    /// Where it is relaxed (rad or m).
    pub rest: f64,
}

/// A constant force that an actuator exerts beside its spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// The joint.
    pub joint: usize,
    /// The torque (N m) or force (N).
    pub force: f64,
}

/// A place on the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// How many joints move it; none for a place in the world.
    pub joints: usize,
    /// Its position in the frame of the link that carries it, or in the world (m).
    pub position_m: Vector3<f64>,
}

/// A spring along a path through places of the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Spring {
    /// Its name.
    pub name: String,
    /// Its stiffness (N/m).
    pub stiffness_n_per_m: f64,
    /// The shortest and the longest length at which it is relaxed (m): the same without a dead band.
    pub rest_m: [f64; 2],
    /// Where it goes through, two places at least.
    pub path: Vec<Place>,
}

impl Spring {
    /// The joints that change its length: not those that move none of its places, or all of them.
    pub(crate) fn joints(&self) -> Range<usize> {
        let places = || self.path.iter().map(|place| place.joints);
        places().min().unwrap_or(0)..places().max().unwrap_or(0)
    }

    /// Its tension (N, negative where it pushes) and its stiffness at a length.
    pub fn tension(&self, length_m: f64) -> (f64, f64) {
        let [low, high] = self.rest_m;
        let stretched = if length_m < low {
            length_m - low
        } else if length_m > high {
            length_m - high
        } else if low < high {
            return (0.0, 0.0);
        } else {
            0.0
        };
        (self.stiffness_n_per_m * stretched, self.stiffness_n_per_m)
    }
}

/// All of them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Elements {
    /// Springs in joints.
    pub joint_springs: Vec<JointSpring>,
    /// Constant forces.
    pub offsets: Vec<Offset>,
    /// Springs between places.
    pub springs: Vec<Spring>,
}

impl Elements {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.joint_springs.is_empty() && self.offsets.is_empty() && self.springs.is_empty()
    }

    /// The places of all springs, in order.
    pub fn places(&self) -> impl Iterator<Item = &Place> {
        self.springs.iter().flat_map(|spring| &spring.path)
    }

    /// Whether there are springs beside the joints' own.
    pub fn has_springs(&self) -> bool {
        !self.joint_springs.is_empty() || !self.springs.is_empty()
    }
}
