//! Distances among absolute readings: from points, which have no axes, and with errors of one coordinate that visits share.

use nalgebra::{Isometry3, Translation3};

use super::super::frames::MountedFrames;
use super::case::whitener;
use super::{AbsoluteCase, AbsoluteError};
use crate::experiment::together;
use crate::measurement::AbsoluteReading;
use crate::observation::{ReadingErrors, ReadingKind, SharedErrors, SharingReadings};
use crate::task::station_named;

impl AbsoluteCase<'_> {
    /// Where a station is begun with: where the robot's own world is; the point of one that distances are read from, where the planner's
    /// model has it, with the axes of the robot's base.
    pub(super) fn placed_frame(&self, station: usize) -> Isometry3<f64> {
        let name = self.stations[station].as_deref();
        match station_named(&self.belief.stations, name).filter(|_| self.is_point(station)) {
            Some(place) => Translation3::from(-place.position_m).into(),
            None => Isometry3::identity(),
        }
    }

    /// Frames with points where they are begun with: closed forms are of positions.
    pub(super) fn beside_points(&self, mut frames: MountedFrames) -> MountedFrames {
        let stations = frames.instrument_from_base.iter_mut().enumerate();
        for (station, frame) in stations.filter(|(station, _)| self.is_point(*station)) {
            *frame = self.arm.instrument_from_base[station];
        }
        frames
    }

    /// Whether a reading is of the kind that the scenario has its station for.
    pub(super) fn check_kind(
        &self,
        index: usize,
        reading: &AbsoluteReading,
    ) -> Result<(), AbsoluteError> {
        let name = reading.station.as_deref();
        let is_distance = reading.distance_m.is_some();
        match station_named(&self.belief.stations, name) {
            None if is_distance => {
                let named = |name: &str| format!("station {name:?}");
                let from = name.map_or_else(|| "no station".to_owned(), named);
                Err(AbsoluteError::NoPlace(from))
            }
            Some(station) if station.reads_distances != is_distance => {
                Err(AbsoluteError::OtherKind {
                    reading: index + 1,
                    is: if is_distance {
                        "a distance"
                    } else {
                        "a position"
                    },
                    station: station.name.clone(),
                })
            }
            _ => Ok(()),
        }
    }

    pub(super) fn is_distance(&self, place: usize) -> bool {
        self.observations[place].reading.kind() == ReadingKind::Distance
    }

    /// The readings of positions and poses, by their places.
    pub fn positions(&self) -> Vec<usize> {
        let places = 0..self.observations.len();
        places.filter(|&place| !self.is_distance(place)).collect()
    }

    /// The same with these alone.
    pub(super) fn of_positions(&self) -> Self {
        self.part_of(|place| !self.is_distance(place))
    }

    /// The stations in whose frames a place may count: those with axes, and points where there are no others.
    pub fn framing_stations(&self) -> Vec<usize> {
        let all = 0..self.stations.len();
        let (points, framing): (Vec<usize>, Vec<usize>) =
            all.partition(|&station| self.is_point(station));
        if framing.is_empty() { points } else { framing }
    }

    /// Whether distances alone are read from a station: its axes show in none of them.
    pub fn is_point(&self, station: usize) -> bool {
        let mut readings = (self.observations.iter()).filter(|each| each.setup.station == station);
        readings.all(|each| each.reading.kind() == ReadingKind::Distance)
    }

    /// Whether distances are read.
    pub fn reads_distances(&self) -> bool {
        let mut readings = self.observations.iter();
        readings.any(|each| each.reading.kind() == ReadingKind::Distance)
    }

    /// The same where distances, and what is read beside them, are weighed by what the planner's model says of their errors: what is new in
    /// each, and what readings of one visit, or of one configuration, share, seen in the frames that the case has. What is shared is not
    /// found from their residuals.
    #[must_use]
    pub fn counting_sources(mut self) -> Self {
        if !self.reads_distances() {
            return self;
        }
        let belief = self.belief;
        let errors = (0..self.observations.len()).map(|place| {
            let setup = &self.observations[place].setup;
            let sources = belief.uncertain.sources();
            let errors = self.disturbed(place, &setup.load, sources.map(|(_, source)| source));
            if self.is_distance(place) {
                return errors;
            }
            errors.turned(&self.arm.instrument_from_base[setup.station].rotation)
        });
        let mut errors: Vec<ReadingErrors> = errors.collect();
        let setup = |visit: usize| &self.observations[self.visits[visit][0]].setup;
        let are_kept = errors.iter().any(|each| each.configuration.ncols() > 0);
        let mut shared = SharedErrors { groups: Vec::new() };
        for visits in together(
            self.visits.len(),
            |visit| setup(visit).pose(),
            |_, _| are_kept,
        ) {
            if let [visit] = visits[..]
                && let [place] = self.visits[visit][..]
            {
                errors[place] = errors[place].alone();
            }
            let numbered = visits.iter().enumerate();
            let readings = numbered.flat_map(|(number, &visit)| {
                (self.visits[visit].iter()).map(move |&place| (place, number))
            });
            let (readings, effects) = readings
                .map(|(place, number)| (place, errors[place].effects([number, visits.len()], 1)))
                .unzip();
            shared.groups.push(SharingReadings { readings, effects });
        }
        for (place, errors) in errors.iter().enumerate() {
            self.covariances[place] += errors.reading;
            self.observations[place].whitener = whitener(&self.covariances[place]);
        }
        self.sharing(shared)
    }
}
