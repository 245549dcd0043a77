//! Which absolute readings are of one visit of the robot.

use std::collections::BTreeMap;

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
