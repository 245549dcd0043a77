//! Which absolute readings are of one visit of the robot, and how far their residuals differ.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{AbsoluteCase, ReadingResidual};
use crate::experiment::{is_one_configuration, together};
use crate::measurement::AbsoluteReading;

/// Readings by their places: those of one visit together, in the order of the first. Where no column says it, the k-th reading of each
/// target in one configuration, under one load and from one station, is of visit k.
pub(super) fn visits(readings: &[AbsoluteReading]) -> Vec<Vec<usize>> {
    let pose = |place: usize| {
        let reading = &readings[place];
        (&reading.configuration_rad, reading.approach.as_ref())
    };
    let is_same = |one: usize, other: usize| {
        let [own, others] = [&readings[one], &readings[other]];
        is_one_configuration(pose(one), pose(other))
            && own.load == others.load
            && own.station == others.station
    };
    let mut alike = vec![0; readings.len()];
    let groups = together(
        readings.len(),
        |place| &readings[place].configuration_rad,
        is_same,
    );
    for (number, group) in groups.iter().enumerate() {
        for &place in group {
            alike[place] = number;
        }
    }
    let mut taken: BTreeMap<(usize, Option<&str>), usize> = BTreeMap::new();
    let mut known: BTreeMap<(Option<&str>, Option<&str>, usize, usize), usize> = BTreeMap::new();
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (place, reading) in readings.iter().enumerate() {
        let station = reading.station.as_deref();
        let visit = match reading.visit.as_deref() {
            Some(visit) => (Some(visit), station, 0, 0),
            None => {
                let before = taken
                    .entry((alike[place], reading.target.as_deref()))
                    .or_default();
                *before += 1;
                (None, station, alike[place], *before)
            }
        };
        let number = *known.entry(visit).or_insert(visits.len());
        if number == visits.len() {
            visits.push(Vec::new());
        }
        visits[number].push(place);
    }
    visits
}

impl AbsoluteCase<'_> {
    /// By how much residuals within visits differ more than the readings' own covariances make them: standard deviations of each
    /// coordinate of the position (m) and of the rotation (rad). `spare` is the share of the numbers that the fit did not use up.
    pub(super) fn within_visits(&self, left: &[ReadingResidual], spare: f64) -> [f64; 2] {
        let mut sums = [[0.0; 3]; 2];
        for visit in self.visits.iter().filter(|visit| visit.len() > 1) {
            let positions = visit.iter().map(|&index| (index, left[index].position_m));
            let turned = |&index: &usize| Some((index, left[index].rotation_rad?));
            let rotations = visit.iter().filter_map(turned);
            let parts: [Vec<(usize, Vector3<f64>)>; 2] = [positions.collect(), rotations.collect()];
            for ((first, part), sum) in [0, 3].into_iter().zip(parts).zip(&mut sums) {
                let count = part.len() as f64;
                if part.len() < 2 {
                    continue;
                }
                let mean = part.iter().map(|(_, each)| each).sum::<Vector3<f64>>() / count;
                for (index, each) in &part {
                    let own = &self.covariances[*index];
                    let own: f64 = (first..first + 3).map(|row| own[(row, row)]).sum();
                    sum[0] += (each - mean).norm_squared();
                    sum[1] += own * (1.0 - 1.0 / count);
                }
                sum[2] += 3.0 * (count - 1.0);
            }
        }
        sums.map(|[square, own, freedom]| {
            ((square / spare - own) / f64::max(freedom, 1.0))
                .max(0.0)
                .sqrt()
        })
    }
}
