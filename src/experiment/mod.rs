//! Experiments: a configuration and a load, plans of them, and the loads that are allowed.

mod candidates;
mod file;
mod load_set;
mod mandatory;

use std::collections::BTreeMap;

use nalgebra::{DVector, Vector3};

use crate::robot::{Approach, CommandPose, Load};

pub use candidates::{Candidate, read_candidates, read_plan, write_candidates, write_plan};
pub use file::{
    APPROACH, DIRECTION, LOAD, add_approach, approach, configuration, direction,
    experiment_columns, experiment_fields, fields_of, load, reading_columns, reading_fields,
};
pub use load_set::{Loads, in_words, is_printed_as, printed_tolerance};
pub use mandatory::{NotMandatory, PRINTED_RAD};

/// One configuration and load of a plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// The commanded joint angles q (rad).
    pub configuration_rad: DVector<f64>,
    /// The load W, in the world frame at the calibration tool.
    pub load: Load,
    /// How often it is measured.
    pub repeats: u32,
    /// From which side the configuration is approached, unloaded and loaded; with all joints turning positively where nothing
    /// is said.
    pub approach: Option<Approach>,
    /// The direction (unit vector, world frame) that a gauge reads along; none where all three coordinates are read.
    pub direction: Option<Vector3<f64>>,
}

/// A plan of experiments (D1).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// The different configurations and loads.
    pub experiments: Vec<Experiment>,
}

impl Experiment {
    /// Its command pose.
    pub const fn pose(&self) -> CommandPose<'_> {
        (&self.configuration_rad, self.approach.as_ref())
    }

    /// Whether both are made in one [configuration](is_one_configuration), whatever hangs there.
    pub fn stands_as(&self, other: &Self) -> bool {
        is_one_configuration(self.pose(), other.pose())
    }
}

/// Commanded angles (rad) and lengths (m) that differ by no more are the same: controllers and tables round them.
pub const SAME_CONFIGURATION: f64 = 0.01 * std::f64::consts::PI / 180.0;

/// Directions that differ by no more than this are the same: tables round them.
const SAME_DIRECTION: f64 = 1e-3;

/// Whether a gauge reads along the same direction (unit vectors), or both times all three coordinates are read.
pub fn is_one_direction(one: Option<&Vector3<f64>>, other: Option<&Vector3<f64>>) -> bool {
    match (one, other) {
        (Some(one), Some(other)) => (one - other).amax() <= SAME_DIRECTION,
        (one, other) => one == other,
    }
}

/// Whether these are one configuration, of which deflections may share errors: the same commanded angles (rad), within
/// [`SAME_CONFIGURATION`], approached from the same side.
pub fn is_one_configuration(
    (angles, side): CommandPose<'_>,
    (others, other_side): CommandPose<'_>,
) -> bool {
    let is_near = |(one, other): (&f64, &f64)| (one - other).abs() <= SAME_CONFIGURATION;
    angles.len() == others.len()
        && angles.iter().zip(others).all(is_near)
        && Approach::is_same(side, other_side)
}

/// Configurations that are one differ by less than this (rad) in the mean angle that sorts them.
const ALIKE_RAD: f64 = 2.0 * SAME_CONFIGURATION;

/// The number of each of so many things: those that are [together](together()) have the same.
pub fn numbered<'a>(
    count: usize,
    pose: impl Fn(usize) -> CommandPose<'a>,
    is_alike: impl Fn(usize, usize) -> bool,
) -> Vec<usize> {
    let mut numbers = vec![0; count];
    for (number, members) in together(count, pose, is_alike).iter().enumerate() {
        for &member in members {
            numbers[member] = number;
        }
    }
    numbers
}

/// So many things by their places, those of one [configuration](is_one_configuration) that are alike besides together, in the order of the
/// first. Only those whose angles are near are compared.
pub fn together<'a>(
    count: usize,
    pose: impl Fn(usize) -> CommandPose<'a>,
    is_alike: impl Fn(usize, usize) -> bool,
) -> Vec<Vec<usize>> {
    let is_same = |one: usize, other: usize| {
        is_one_configuration(pose(one), pose(other)) && is_alike(one, other)
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut near: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
    for index in 0..count {
        // Two means of different weights, lest a grid of angles, or a line, sums up to the same.
        let place = [0.37, -0.59].map(|slope| {
            let (mut total, mut mean_rad) = (0.0, 0.0);
            for (joint, angle_rad) in pose(index).0.iter().enumerate() {
                let weight: f64 = 1.0 + slope * joint as f64;
                total += weight.abs();
                mean_rad += weight * angle_rad;
            }
            #[expect(
                clippy::cast_possible_truncation,
                reason = "what is beyond is at the end"
            )]
            let place = (mean_rad / f64::max(total, 1.0) / ALIKE_RAD).floor() as i64;
            place
        });
        let beside = |place: i64| place.saturating_sub(1)..=place.saturating_add(1);
        let candidates = beside(place[0]).flat_map(|first| {
            let second = beside(place[1]);
            near.range([first, *second.start()]..=[first, *second.end()])
                .flat_map(|(_, known)| known)
        });
        let found = (candidates.copied())
            .filter(|&group| is_same(groups[group][0], index))
            .min();
        if let Some(group) = found {
            groups[group].push(index);
        } else {
            near.entry(place).or_default().push(groups.len());
            groups.push(vec![index]);
        }
    }
    groups
}

impl Plan {
    /// The places of its experiments, those of one configuration together, in the order of the first.
    pub fn by_configuration(&self) -> Vec<Vec<usize>> {
        let all = &self.experiments;
        together(all.len(), |place| all[place].pose(), |_, _| true)
    }

    /// Gives experiments of one configuration the same commanded angles, and makes those under the same load one with
    /// repeats: the robot goes there once.
    pub fn put_repeats_together(&mut self) {
        let mut kept: Vec<Experiment> = Vec::new();
        for mut each in std::mem::take(&mut self.experiments) {
            if let Some(first) = kept.iter().find(|first| first.stands_as(&each)) {
                each.configuration_rad = first.configuration_rad.clone();
                each.approach.clone_from(&first.approach);
            }
            let same = kept.iter_mut().find(|known| {
                known.configuration_rad == each.configuration_rad
                    && known.approach == each.approach
                    && known.load == each.load
                    && known.direction == each.direction
            });
            match same {
                Some(known) => known.repeats += each.repeats,
                None => kept.push(each),
            }
        }
        self.experiments = kept;
    }

    /// Two experiments (their places) of one configuration under different loads, where there are such.
    pub fn several_loads(&self) -> Option<[usize; 2]> {
        self.by_configuration().into_iter().find_map(|group| {
            let first = &self.experiments[group[0]];
            let other = (group.iter()).find(|&&each| self.experiments[each].load != first.load)?;
            Some([group[0], *other])
        })
    }

    /// The same, measured so many times as a whole.
    pub fn repeated(&self, times: u32) -> Self {
        let mut plan = self.clone();
        for each in &mut plan.experiments {
            each.repeats = each.repeats.saturating_mul(times);
        }
        plan
    }

    /// The number m of measurements, repeats counted.
    pub fn measurements(&self) -> u32 {
        self.experiments.iter().map(|each| each.repeats).sum()
    }
}
