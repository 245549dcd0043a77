//! Elastic elements beside the joints' own: springs in joints, springs between places of the arm, and
//! constant forces of actuators.
//!
//! A spring of stiffness c along a path of length L(q) has the energy E(L) and pulls at the joints with
//!
//! ```text
//! tau_j = -E'(L) dL/dq_j
//! dtau_j/dq_i = -E''(L) dL/dq_j dL/dq_i - E'(L) d2L/(dq_j dq_i)
//! ```
//!
//! where E' = c (L - L_0), and zero in a dead band of lengths.

use std::ops::Range;

use nalgebra::{DMatrix, Vector3};

use super::KinematicState;

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
    #[must_use]
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

/// A motion of all that is beyond some joints: velocity v + omega x p of a point p.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// How many joints are before what moves.
    pub joints: usize,
    /// v (m).
    pub velocity: Vector3<f64>,
    /// omega (rad).
    pub omega: Vector3<f64>,
}

impl Elements {
    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.joint_springs.is_empty() && self.offsets.is_empty() && self.springs.is_empty()
    }

    /// The places of all springs, in order.
    pub fn places(&self) -> impl Iterator<Item = &Place> {
        self.springs.iter().flat_map(|spring| &spring.path)
    }

    /// Each spring with the places that it goes through, in the world frame.
    fn paths<'a>(
        &'a self,
        state: &'a KinematicState,
    ) -> impl Iterator<Item = (&'a Spring, &'a [Vector3<f64>])> {
        let mut first = 0;
        self.springs.iter().map(move |spring| {
            let places = &state.places[first..first + spring.path.len()];
            first += spring.path.len();
            (spring, places)
        })
    }

    /// Whether there are springs beside the joints' own.
    #[must_use]
    pub fn has_springs(&self) -> bool {
        !self.joint_springs.is_empty() || !self.springs.is_empty()
    }

    /// Adds the springs' torques (N m, N) to others, and their stiffness (row: torque, column: joint), the
    /// negative derivative, to another.
    pub fn exert(
        &self,
        q: &[f64],
        state: &KinematicState,
        torque: &mut [f64],
        stiffness: &mut DMatrix<f64>,
    ) {
        for spring in &self.joint_springs {
            torque[spring.joint] -= spring.stiffness * (q[spring.joint] - spring.rest);
            stiffness[(spring.joint, spring.joint)] += spring.stiffness;
        }
        for (spring, places) in self.paths(state) {
            let (tension, along) = spring.tension(length(places));
            if tension == 0.0 && along == 0.0 {
                continue;
            }
            let first = spring.joints().start;
            for joint in spring.joints() {
                let longer = lengthening(spring, places, |at, p| state.moves(joint, at, p));
                torque[joint] -= tension * longer;
                for other in first..=joint {
                    let by = lengthening(spring, places, |at, p| state.moves(other, at, p));
                    let bend = bending(
                        spring,
                        places,
                        |at, p| state.moves(joint, at, p),
                        |at, p| state.moves(other, at, p),
                        |at, p| {
                            if joint < at {
                                state.turning[other].cross(&state.moves(joint, at, p))
                            } else {
                                Vector3::zeros()
                            }
                        },
                    );
                    let change = along * longer * by + tension * bend;
                    stiffness[(joint, other)] += change;
                    if other != joint {
                        stiffness[(other, joint)] += change;
                    }
                }
            }
        }
    }

    /// The joints that change the stiffness of springs.
    pub(crate) fn joints_of_springs(&self) -> Range<usize> {
        let joints = self.springs.iter().map(Spring::joints);
        joints
            .reduce(|one, other| one.start.min(other.start)..one.end.max(other.end))
            .unwrap_or(0..0)
    }

    /// Adds the change of the springs' torques by a motion of all that is beyond some joints.
    pub fn add_change(&self, state: &KinematicState, motion: &Motion, change: &mut [f64]) {
        for (spring, places) in self.paths(state) {
            let (tension, stiffness) = spring.tension(length(places));
            let moved = |at: usize, p: &Vector3<f64>| motion.of(at, p);
            let by = lengthening(spring, places, moved);
            for joint in spring.joints() {
                let longer = lengthening(spring, places, |at, p| state.moves(joint, at, p));
                let bend = bending(
                    spring,
                    places,
                    |at, p| state.moves(joint, at, p),
                    moved,
                    |at, p| {
                        if joint < motion.joints {
                            // The joint turns what the motion displaces.
                            if joint < at {
                                state.turning[joint].cross(&motion.of(at, p))
                            } else {
                                Vector3::zeros()
                            }
                        } else {
                            // The motion turns the joint with what it moves.
                            motion.omega.cross(&state.moves(joint, at, p))
                        }
                    },
                );
                change[joint] -= stiffness * longer * by + tension * bend;
            }
        }
    }

    /// The torques (N m, N) that a spring exerts on the joints for each newton of its tension: -dL/dq.
    #[must_use]
    pub fn pull(&self, spring: usize, state: &KinematicState, joint: usize) -> f64 {
        self.paths(state)
            .nth(spring)
            .map_or(0.0, |(spring, places)| {
                -lengthening(spring, places, |at, p| state.moves(joint, at, p))
            })
    }

    /// The length of a spring's path (m).
    #[must_use]
    pub fn length_m(&self, spring: usize, state: &KinematicState) -> f64 {
        (self.paths(state).nth(spring)).map_or(0.0, |(_, places)| length(places))
    }
}

impl Motion {
    /// The velocity of a point that so many joints move.
    fn of(&self, at: usize, point: &Vector3<f64>) -> Vector3<f64> {
        if at > self.joints {
            self.velocity + self.omega.cross(point)
        } else {
            Vector3::zeros()
        }
    }
}

fn length(places: &[Vector3<f64>]) -> f64 {
    let pieces = places.iter().zip(places.iter().skip(1));
    pieces.map(|(from, to)| (to - from).norm()).sum()
}

/// dL of a motion of the places: sum of u . (v_to - v_from).
fn lengthening(
    spring: &Spring,
    places: &[Vector3<f64>],
    velocity: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
) -> f64 {
    pieces(spring, places)
        .map(|([from, to], [before, after])| {
            let way = after - before;
            let apart = way.norm();
            if apart == 0.0 {
                return 0.0;
            }
            way.dot(&(velocity(to, after) - velocity(from, before))) / apart
        })
        .sum()
}

/// d2L of two motions: sum of v . (I - u u^T) w / l + u . a, where a is how the one changes the other.
fn bending(
    spring: &Spring,
    places: &[Vector3<f64>],
    one: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
    other: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
    both: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>,
) -> f64 {
    pieces(spring, places)
        .map(|([from, to], [before, after])| {
            let way = after - before;
            let apart = way.norm();
            if apart == 0.0 {
                return 0.0;
            }
            let along = way / apart;
            let v = one(to, after) - one(from, before);
            let w = other(to, after) - other(from, before);
            let a = both(to, after) - both(from, before);
            (v.dot(&w) - v.dot(&along) * w.dot(&along)) / apart + along.dot(&a)
        })
        .sum()
}

/// The straight pieces of a path: how many joints move their ends, and where these are.
fn pieces<'a>(
    spring: &'a Spring,
    places: &'a [Vector3<f64>],
) -> impl Iterator<Item = ([usize; 2], [&'a Vector3<f64>; 2])> {
    let joints = spring.path.windows(2);
    let joints = joints.map(|pair| [pair[0].joints, pair[1].joints]);
    joints.zip(places.windows(2).map(|pair| [&pair[0], &pair[1]]))
}
