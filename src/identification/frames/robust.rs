//! Frames from readings with gross errors: least absolute deviations, then least squares without outliers.

use std::collections::BTreeMap;

use super::{MountedFrames, Sight};
use crate::numeric::tolerance;

/// Beyond so many times the median of what is left a reading is wrong.
const WRONG: f64 = 10.0;
/// Frames that leave more than this share of how far positions reach are not believed at once.
const BAD: f64 = 2e-3;
/// Steps towards the least absolute deviations.
const STEPS: i32 = 12;
/// Readings that these look at.
const ENOUGH: usize = 240;
/// A larger share of readings is not wrong: the model is.
const MOST: f64 = 0.25;
/// With more than this share of what frames of all leave, the others are no better.
const BETTER: f64 = 0.5;

/// Frames that most readings agree on.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustFrames {
    /// The frames.
    pub frames: MountedFrames,
    /// For each reading how many times the median it is off; one at least.
    pub off: Vec<f64>,
    /// The median of what is left, with a rotation as a length (m).
    pub median_m: f64,
}

impl RobustFrames {
    /// Frames of readings, as [`MountedFrames::guessed`] has them where none is far out.
    pub fn guessed(sights: &[Sight], stations: usize, tools: &[nalgebra::Isometry3<f64>]) -> Self {
        let all = Self::of(MountedFrames::guessed(sights, stations, tools), sights);
        let is_good = all.median_m <= BAD * reach(sights);
        if sights.is_empty() || (is_good && all.wrong().is_empty()) {
            return all;
        }
        let of_each = ENOUGH.div_ceil(groups(sights).len().max(1));
        let mut some: Vec<Sight> = evenly(sights, of_each);
        let mut found = all.frames.clone();
        for step in 0..STEPS {
            let left = found.left(&some);
            // The bend from squares to absolute values comes nearer to the median.
            let bend = median_or_zero(left.clone()).max(f64::MIN_POSITIVE) * 0.7_f64.powi(step);
            for (sight, left) in some.iter_mut().zip(left) {
                sight.weight = bend / left.max(bend);
            }
            found = MountedFrames::guessed(&some, stations, tools);
        }
        let mut best = Self::of(found, sights);
        for _ in 0..2 {
            let near: Vec<Sight> = (sights.iter().zip(&best.off))
                .filter(|(_, off)| **off <= WRONG)
                .map(|(sight, _)| sight.clone())
                .collect();
            let next = Self::of(MountedFrames::guessed(&near, stations, tools), sights);
            if next.median_m > best.median_m {
                break;
            }
            best = next;
        }
        let is_few = best.wrong().len() as f64 <= MOST * sights.len() as f64;
        let is_better = is_good || best.median_m < BETTER * all.median_m;
        if is_few && is_better {
            best
        } else {
            Self {
                off: vec![1.0; sights.len()],
                ..all
            }
        }
    }

    /// The readings that are far out, by their places.
    pub fn wrong(&self) -> Vec<usize> {
        (0..self.off.len())
            .filter(|&place| self.off[place] > WRONG)
            .collect()
    }

    fn of(frames: MountedFrames, sights: &[Sight]) -> Self {
        let left = frames.left(sights);
        let median_m = median_or_zero(left.clone());
        let least = median_m.max(LEAST_M);
        Self {
            off: left.iter().map(|left| (left / least).max(1.0)).collect(),
            frames,
            median_m,
        }
    }
}

/// Frames are not known better than this (m).
const LEAST_M: f64 = 1e-5;

/// How far most positions lie from the middle of their station's and target's (m).
pub(in crate::identification) fn reach(sights: &[Sight]) -> f64 {
    let far = groups(sights).into_values().flat_map(|group| {
        let middle = nalgebra::Vector3::from_fn(|axis, _| {
            median_or_zero(group.iter().map(|each| each.position_m[axis]).collect())
        });
        (group.into_iter()).map(move |each| (each.position_m - middle).norm())
    });
    median_or_zero(far.collect())
}

pub(in crate::identification) fn groups(sights: &[Sight]) -> BTreeMap<(usize, usize), Vec<&Sight>> {
    let mut groups: BTreeMap<_, Vec<&Sight>> = BTreeMap::new();
    for sight in sights {
        let group = groups.entry((sight.station, sight.target));
        group.or_default().push(sight);
    }
    groups
}

/// Some of the readings, up to so many of each station and target.
pub(in crate::identification) fn evenly(sights: &[Sight], of_each: usize) -> Vec<Sight> {
    (groups(sights).values())
        .flat_map(|group| {
            let step = group.len().div_ceil(of_each).max(1);
            group.iter().step_by(step).map(|each| (*each).clone())
        })
        .collect()
}

pub(in crate::identification) fn median_or_zero(values: Vec<f64>) -> f64 {
    tolerance::median(values).unwrap_or(0.0)
}
