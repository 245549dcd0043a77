//! Which absolute readings are of one visit of the robot.

use std::collections::BTreeMap;

use crate::experiment::numbered;
use crate::measurement::AbsoluteReading;
use crate::task::Belief;

/// Fewer visits tell nothing of what the parameters leave but its size.
pub(super) const LEAST_VISITS: usize = 20;

/// Readings by their places: those of one visit together, in the order of the first. Where no column says it, the k-th reading of each
/// target in one configuration, under one load and from one station, is of visit k. Lengths are read in the visits of an only tracker.
pub(super) fn visits(readings: &[AbsoluteReading], belief: &Belief) -> Vec<Vec<usize>> {
    let stations: Vec<Option<&str>> = (readings.iter())
        .map(|each| belief.station_of_visit(each.station.as_deref()))
        .collect();
    let is_alike = |one: usize, other: usize| {
        readings[one].load == readings[other].load && stations[one] == stations[other]
    };
    let alike = numbered(readings.len(), |place| readings[place].pose(), is_alike);
    let mut taken: BTreeMap<(usize, [Option<&str>; 2]), usize> = BTreeMap::new();
    // By a word of a file and the station, or by the number of a configuration and which visit of it.
    let mut known = BTreeMap::new();
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (place, reading) in readings.iter().enumerate() {
        let visit = if let Some(name) = reading.visit.as_deref() {
            (Some((name, stations[place])), [0; 2])
        } else {
            let read = [reading.target.as_deref(), reading.station.as_deref()];
            let count = taken.entry((alike[place], read)).or_default();
            *count += 1;
            (None, [alike[place], *count])
        };
        let number = *known.entry(visit).or_insert(visits.len());
        if number == visits.len() {
            visits.push(Vec::new());
        }
        visits[number].push(place);
    }
    visits
}
