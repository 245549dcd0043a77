//! From which side a configuration is approached.

use std::fmt::{Display, Formatter};

use nalgebra::DVector;

use super::PathJudge;
use crate::robot::{Approach, Load};
use crate::task::Task;

/// Of the ways to approach a configuration so many are tried.
const SIDES: usize = 64;

/// The side from which a configuration is approached: for each joint whether it turns positively (1),
/// negatively (-1), or not at all (0) in the end, as passive ones do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Side(pub Vec<i8>);

impl Display for Side {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        let moving = || self.0.iter().filter(|sign| **sign != 0);
        if moving().next().is_none() {
            formatter.write_str("as it comes")
        } else if moving().all(|sign| *sign > 0) {
            formatter.write_str("all joints +")
        } else if moving().all(|sign| *sign < 0) {
            formatter.write_str("all joints -")
        } else {
            let sign = |sign: &i8| if *sign > 0 { "+" } else { "-" };
            let signs: Vec<&str> = moving().map(sign).collect();
            formatter.write_str(&signs.join(" "))
        }
    }
}

/// Which joints must turn positively in the end as a configuration is approached: what is said, or all where gaps make the side
/// count; `None` where any side is as good.
pub(super) fn wanted_side(task: &Task, approach: Option<&Approach>) -> Option<Vec<bool>> {
    let belief = &task.belief;
    let has_backlash = belief.uncertain.has_backlash();
    (has_backlash || approach.is_some()).then(|| Approach::of_all(approach, &belief.nominal.chain))
}

impl Side {
    /// How a configuration is approached, in words: "with all joints +", or "as it comes".
    pub fn words(&self) -> String {
        match self.as_approach() {
            Some(_) => format!("with {self}"),
            None => self.to_string(),
        }
    }

    /// As a file has it; `None` where the configuration is reached as it comes. For joints that are commanded.
    pub fn as_approach(&self) -> Option<Approach> {
        let signs: Vec<bool> = (self.0.iter())
            .filter(|sign| **sign != 0)
            .map(|sign| *sign > 0)
            .collect();
        (!signs.is_empty()).then_some(Approach(signs))
    }

    /// A side from which a configuration can be approached by so much (rad, m) under each of the loads, and where
    /// the approach begins; none where there is no room, or for no approach at all. Where it is said which joints turn
    /// positively in the end (`wanted`), no other side is tried.
    pub(super) fn free(
        task: &Task,
        approach: f64,
        judge: &mut PathJudge<'_>,
        q: &DVector<f64>,
        loads: &[Load],
        wanted: Option<&[bool]>,
    ) -> (Self, Option<DVector<f64>>) {
        let joints = &task.belief.nominal.chain.joints;
        let moves: Vec<usize> = (0..joints.len())
            .filter(|&joint| joints[joint].drive.passive_at.is_none())
            .collect();
        let none = Self(vec![0; joints.len()]);
        if approach == 0.0 {
            return (none, None);
        }
        // All positive, all negative, then all others: bit k of the pattern turns joint k round.
        let patterns = 1_usize << moves.len().min(usize::BITS as usize - 2);
        let mixed = 1..patterns.saturating_sub(1);
        let all: Vec<usize> = [0, patterns - 1]
            .into_iter()
            .chain(mixed)
            .take(SIDES)
            .collect();
        let of_wanted = |wanted: &[bool]| {
            let negative = (moves.iter().enumerate()).filter(|(_, joint)| !wanted[**joint]);
            vec![negative.map(|(bit, _)| 1_usize << bit).sum()]
        };
        for pattern in wanted.map_or(all, of_wanted) {
            let mut side = none.clone();
            let mut start = q.clone();
            for (bit, &joint) in moves.iter().enumerate() {
                side.0[joint] = if pattern >> bit & 1 == 0 { 1 } else { -1 };
                start[joint] -= f64::from(side.0[joint]) * approach;
            }
            // The region is about experiments, not about the way there.
            let is_within = (start.iter().zip(joints)).all(|(angle, joint)| {
                let [low, high] = joint.range_rad;
                (low..=high).contains(angle)
            });
            if is_within && judge.is_straight_clear(start.as_slice(), q.as_slice(), loads) {
                return (side, Some(start));
            }
        }
        (none, None)
    }
}
