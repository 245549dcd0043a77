//! A configuration to begin with: free, away from singularities, within reach.

use nalgebra::Vector3;

use super::arm::FoundArm;
use crate::mujoco::State;
use crate::robot::Tool;

/// So many configurations are tried.
const TRIES: u32 = 3000;
/// The distance to keep from collisions (m).
pub(super) const CLEARANCE_M: f64 = 0.01;
/// The share of a joint's range that is left to either end.
const ROOM: f64 = 0.01;
/// Angles beyond this (rad) are another turn.
const HALF_TURN: f64 = std::f64::consts::PI;

/// What was found by trying configurations.
pub(super) struct Tried {
    /// The best configuration (rad, m), in whole degrees and millimetres.
    pub best: Vec<f64>,
    /// The share of configurations without a collision, and the pair that is nearest in most others; none
    /// where nothing collides.
    pub free: Option<(f64, [String; 2])>,
    /// For each joint the largest torque (N m, N) of the own weight, and its largest arm (m, 1) for a force
    /// at the tool.
    pub most: Vec<[f64; 2]>,
}

/// Tries configurations that fill the joints' ranges evenly (Halton's sequence).
pub(super) fn tried(arm: &FoundArm, tool: &Tool) -> Tried {
    let chain = &arm.chain;
    let mut collisions = (arm.model.scenery().iter().any(|each| each.collides))
        .then(|| State::new(&arm.model.with_clearance(CLEARANCE_M)));
    let mut most = vec![[0.0_f64; 2]; chain.len()];
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut hit = std::collections::BTreeMap::<[String; 2], u32>::new();
    let base = chain.joints[0].previous_from_link.translation.vector;
    for index in 1..=TRIES {
        let q: Vec<f64> = (chain.joints.iter().zip(PRIMES.into_iter().cycle()))
            .map(|(joint, prime)| {
                let [low, high] = joint.range_rad;
                let (low, high) = if joint.drive.slides {
                    (low, high)
                } else {
                    (low.max(-HALF_TURN), high.min(HALF_TURN))
                };
                rounded(
                    low + (high - low) * halton(index, prime),
                    [low, high],
                    joint.drive.slides,
                )
            })
            .collect();
        let state = chain.at(tool).state(&q);
        for (joint, most) in most.iter_mut().enumerate() {
            let own = state.gravity_torque(joint, &chain.gravity_m_s2).abs();
            most[0] = most[0].max(own);
            most[1] = most[1].max(state.position_column(joint).norm());
        }
        let contact = collisions.as_mut().and_then(|state| {
            state.move_to(&q);
            state.nearest_contact(CLEARANCE_M)
        });
        let mut score = spread(&state.jacobian().fixed_rows::<3>(0).into_owned())
            - (base.z - state.tool_position.z).max(0.0);
        if let Some(contact) = contact {
            *hit.entry(contact.between).or_default() += 1;
            score -= 1e3;
        }
        if !(chain.joints.iter().zip(&q)).all(|(joint, &q)| has_room(joint.range_rad, q)) {
            score -= 1e2;
        }
        if best.as_ref().is_none_or(|(known, _)| score > *known) {
            best = Some((score, q));
        }
    }
    let hits: u32 = hit.values().sum();
    let nearest = hit.into_iter().max_by_key(|each| each.1);
    Tried {
        best: best.map(|(_, q)| q).unwrap_or_default(),
        free: collisions.map(|_| {
            let share = 1.0 - f64::from(hits) / f64::from(TRIES);
            (share, nearest.map(|each| each.0).unwrap_or_default())
        }),
        most,
    }
}

const PRIMES: [u32; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// The radical inverse of a number.
fn halton(mut index: u32, base: u32) -> f64 {
    let (mut value, mut share) = (0.0, 1.0);
    while index > 0 {
        share /= f64::from(base);
        value += share * f64::from(index % base);
        index /= base;
    }
    value
}

/// A coordinate in whole degrees or millimetres, inside its range.
fn rounded(value: f64, [low, high]: [f64; 2], slides: bool) -> f64 {
    let whole = if slides {
        (value * 1e3).round() * 1e-3
    } else {
        value.to_degrees().round().to_radians()
    };
    if (low..=high).contains(&whole) {
        whole
    } else {
        value
    }
}

/// Whether a coordinate may be commanded some way to both sides, as compensation does.
fn has_room([low, high]: [f64; 2], q: f64) -> bool {
    let least = ROOM * (high - low);
    q - low >= least && high - q >= least
}

/// The smallest singular value that is not zero for want of joints.
fn spread(rows: &nalgebra::Matrix3xX<f64>) -> f64 {
    let values = rows.singular_values();
    values
        .iter()
        .copied()
        .take(rows.ncols())
        .fold(f64::INFINITY, f64::min)
}

/// The axis of the arm's last joint in a frame that all its joints move, and the frame's distance from it (m).
pub(super) fn last_axis(arm: &FoundArm, tool: &Tool) -> (Vector3<f64>, f64) {
    let Some(joint) = arm.chain.joints.last() else {
        return (Vector3::z(), 0.0);
    };
    let origin = tool.link_from_tool.translation.vector;
    let axis = joint.axis.into_inner();
    let away = origin - axis * axis.dot(&origin);
    let distance = if joint.drive.slides {
        f64::INFINITY
    } else {
        away.norm()
    };
    (tool.link_from_tool.rotation.inverse() * axis, distance)
}
