//! What was read beyond what an instrument shows, in sentences.

use crate::measurement::{AbsoluteReading, Measurement};
use crate::quantities::units::thousandths;
use crate::task::{Belief, Gauge, station_named};

/// Rounding of files.
const ROUNDING: f64 = 1e-9;

/// The displacements beyond a gauge's range, by their numbers.
pub fn beyond_gauge(gauge: Option<Gauge>, measurements: &[Measurement]) -> Option<String> {
    let range_m = gauge?.range_m?;
    let is_beyond = |each: &Measurement| {
        each.direction.is_some() && each.deflection_m.norm() > range_m * (1.0 + ROUNDING)
    };
    let beyond = numbers(measurements.iter().map(is_beyond))?;
    let range = thousandths(range_m);
    Some(format!(
        "the gauge shows at most {range} mm to either side, and more in measurement {beyond}"
    ))
}

/// The lengths outside of what their stations read, by their numbers.
pub fn beyond_stations(belief: &Belief, readings: &[AbsoluteReading]) -> Option<String> {
    let is_beyond = |each: &AbsoluteReading| {
        let station = station_named(&belief.stations, each.station.as_deref());
        (each.length.zip(station)).is_some_and(|(read, station)| {
            let room_m = ROUNDING * read.length_m;
            station.missed(read.length_m, room_m).is_some()
        })
    };
    let beyond = numbers(readings.iter().map(is_beyond))?;
    Some(format!(
        "lengths outside of the range of their stations, which no instrument shows there: reading {beyond}"
    ))
}

/// The numbers from 1 of those that hold; none where none does.
fn numbers(all: impl Iterator<Item = bool>) -> Option<String> {
    let beyond = (all.zip(1..)).filter(|(is_beyond, _)| *is_beyond);
    let beyond: Vec<String> = beyond
        .map(|(_, number): (_, usize)| number.to_string())
        .collect();
    (!beyond.is_empty()).then(|| beyond.join(", "))
}
