//! Which absolute readings are of one visit of the robot: the one decision that plans, virtual robots, laboratories and fits ask.

use std::collections::BTreeMap;

use crate::experiment::numbered;
use crate::measurement::AbsoluteReading;
use crate::robot::Load;
use crate::task::{Belief, Loading};

/// Fewer visits tell nothing of what the parameters leave but its size.
pub(super) const LEAST_VISITS: usize = 20;

/// The number of what each reading may share a visit with: readings of one command pose from one station, under one load unless loads are
/// hung in place; or those that a column says are of one visit. Lengths are read in the visits of an only tracker.
pub fn visit_classes(readings: &[AbsoluteReading], belief: &Belief) -> Vec<usize> {
    let stations: Vec<Option<&str>> = (readings.iter())
        .map(|each| belief.station_of_visit(each.station.as_deref()))
        .collect();
    let is_alike = |one: usize, other: usize| {
        let (own, others) = (&readings[one], &readings[other]);
        let stays = own.visit.is_some() || belief.loading == Loading::InPlace;
        let is_one_load = stays || own.load == others.load;
        is_one_load && own.visit == others.visit && stations[one] == stations[other]
    };
    numbered(readings.len(), |place| readings[place].pose(), is_alike)
}

/// Readings by their places: those of one visit together, in the order of the first. Where no column says it, the k-th reading of each
/// target from each station under each load is of visit k of its class.
pub(super) fn visits(readings: &[AbsoluteReading], classes: &[usize]) -> Vec<Vec<usize>> {
    let mut taken = BTreeMap::new();
    let mut known = BTreeMap::new();
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (place, (reading, &class)) in readings.iter().zip(classes).enumerate() {
        let mut count = 0;
        if reading.visit.is_none() {
            let read = [reading.target.as_deref(), reading.station.as_deref()];
            let times = taken.entry((class, read, reading.load.bits()));
            let times = times.or_insert(0);
            *times += 1;
            count = *times;
        }
        let number = *known.entry((class, count)).or_insert(visits.len());
        if number == visits.len() {
            visits.push(Vec::new());
        }
        visits[number].push(place);
    }
    visits
}

/// Which of the loads that one visit may hang each reading is under, from 1, or none (0); and how many these are at most.
pub(super) fn loads_of_visits(readings: &[AbsoluteReading], classes: &[usize]) -> Vec<[usize; 2]> {
    let mut hung: BTreeMap<usize, Vec<Load>> = BTreeMap::new();
    let mut numbers = Vec::new();
    for (reading, class) in readings.iter().zip(classes) {
        let loads = hung.entry(*class).or_default();
        if reading.load != Load::NONE && !loads.contains(&reading.load) {
            loads.push(reading.load);
        }
        let own = loads.iter().position(|load| *load == reading.load);
        numbers.push(own.map_or(0, |own| own + 1));
    }
    let most = hung.values().map(Vec::len).max().unwrap_or(0);
    numbers.into_iter().map(|own| [own, most]).collect()
}
