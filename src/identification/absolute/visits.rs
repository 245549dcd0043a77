//! Which absolute readings are of one visit of the robot.

use std::collections::BTreeMap;

use crate::experiment::{is_one_configuration, numbered};
use crate::measurement::AbsoluteReading;

/// What tells a visit from others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum VisitName<'a> {
    /// A word of a file, and the station.
    Given(&'a str, Option<&'a str>),
    /// The number of a configuration under a load from a station, and which visit of it.
    Counted(usize, usize),
}

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
    let q = |place: usize| &readings[place].configuration_rad;
    let alike = numbered(readings.len(), q, is_same);
    let mut taken: BTreeMap<(usize, Option<&str>), usize> = BTreeMap::new();
    let mut known: BTreeMap<VisitName<'_>, usize> = BTreeMap::new();
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (place, reading) in readings.iter().enumerate() {
        let visit = if let Some(name) = reading.visit.as_deref() {
            VisitName::Given(name, reading.station.as_deref())
        } else {
            let target = reading.target.as_deref();
            let count = taken.entry((alike[place], target)).or_default();
            *count += 1;
            VisitName::Counted(alike[place], *count)
        };
        let number = *known.entry(visit).or_insert(visits.len());
        if number == visits.len() {
            visits.push(Vec::new());
        }
        visits[number].push(place);
    }
    visits
}
