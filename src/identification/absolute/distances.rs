//! Distances among absolute readings: from points, which have no axes, and with errors of one coordinate that visits share.

use nalgebra::{Isometry3, Translation3};

use super::case::whitener;
use super::{AbsoluteCase, AbsoluteError};
use crate::experiment::{is_one_configuration, together};
use crate::observation::{ReadingErrors, ReadingKind, SharedErrors, SharingReadings};
use crate::task::{Extended, station_named};

impl AbsoluteCase<'_> {
    /// Where a station is begun with: where the robot's own world is; the point of one that distances are read from, where the planner's
    /// model has it, with the axes of the robot's base.
    pub(super) fn placed_frame(&self, station: usize) -> Result<Isometry3<f64>, AbsoluteError> {
        if !self.is_point(station) {
            return Ok(Isometry3::identity());
        }
        let name = self.stations[station].as_deref();
        let place = station_named(&self.belief.stations, name);
        let place = place.ok_or_else(|| {
            let named = |name: &str| format!("station {name:?}");
            AbsoluteError::NoPlace(name.map_or_else(|| "no station".to_owned(), named))
        })?;
        Ok(Translation3::from(-place.position_m).into())
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

    /// The same where distances are weighed by what the planner's model says of their errors: what is new in each, and what readings of one
    /// visit, or of one configuration, share. What is shared is not found from their residuals.
    #[must_use]
    pub fn counting_sources(mut self) -> Self {
        if !self.reads_distances() {
            return self;
        }
        let belief = self.belief;
        let errors = (0..self.observations.len()).map(|place| {
            let setup = &self.observations[place].setup;
            let sources = belief.uncertain.iter().flat_map(Extended::sources);
            self.disturbed(place, &setup.load, sources.map(|(_, source)| source))
        });
        let mut errors: Vec<ReadingErrors> = errors.collect();
        let setup = |visit: usize| &self.observations[self.visits[visit][0]].setup;
        let pose = |visit: usize| (&setup(visit).commanded_rad, setup(visit).approach.as_ref());
        let are_kept = errors.iter().any(|each| each.configuration.ncols() > 0);
        let is_same = |one, other| are_kept && is_one_configuration(pose(one), pose(other));
        let mut shared = SharedErrors { groups: Vec::new() };
        for visits in together(self.visits.len(), |visit| pose(visit).0, is_same) {
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
