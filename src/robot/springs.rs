//! What springs exert on the joints, and how a motion of the arm changes it.
//!
//! A spring of stiffness c along a path of length L(q) has the energy E(L) and pulls at the joints with
//!
//! ```text
//! tau_j = -E'(L) dL/dq_j
//! dtau_j/dq_i = -E''(L) dL/dq_j dL/dq_i - E'(L) d2L/(dq_j dq_i)
//! ```
//!
//! where E' = c (L - L_0), and zero in a dead band of lengths.

use nalgebra::{DMatrix, Vector3};

use super::KinematicState;
use super::elements::{Elements, Spring};

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
    pub fn pull(&self, spring: usize, state: &KinematicState, joint: usize) -> f64 {
        self.paths(state)
            .nth(spring)
            .map_or(0.0, |(spring, places)| {
                -lengthening(spring, places, |at, p| state.moves(joint, at, p))
            })
    }

    /// The length of a spring's path (m).
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
        .map(|piece| piece.way.dot(&piece.change(&velocity)) / piece.length_m)
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
        .map(|piece| {
            let along = piece.way / piece.length_m;
            let [v, w] = [piece.change(&one), piece.change(&other)];
            let a = piece.change(&both);
            (v.dot(&w) - v.dot(&along) * w.dot(&along)) / piece.length_m + along.dot(&a)
        })
        .sum()
}

/// A straight piece of a path.
struct PathPiece<'a> {
    /// How many joints move its ends, and where these are.
    ends: [(usize, &'a Vector3<f64>); 2],
    /// From the one to the other (m).
    way: Vector3<f64>,
    length_m: f64,
}

impl PathPiece<'_> {
    /// How a motion changes the way.
    fn change(&self, velocity: impl Fn(usize, &Vector3<f64>) -> Vector3<f64>) -> Vector3<f64> {
        let [(from, before), (to, after)] = self.ends;
        velocity(to, after) - velocity(from, before)
    }
}

/// The pieces of a path that have a length: the others have no direction to pull in.
fn pieces<'a>(
    spring: &'a Spring,
    places: &'a [Vector3<f64>],
) -> impl Iterator<Item = PathPiece<'a>> {
    let joints = spring.path.windows(2);
    let pieces = joints.zip(places.windows(2)).map(|(joints, places)| {
        let way = places[1] - places[0];
        PathPiece {
            ends: [
                (joints[0].joints, &places[0]),
                (joints[1].joints, &places[1]),
            ],
            way,
            length_m: way.norm(),
        }
    });
    pieces.filter(|piece| piece.length_m != 0.0)
}
