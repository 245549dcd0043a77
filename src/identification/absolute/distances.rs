//! Distances among absolute readings: from points, which have no axes, and with errors of one coordinate.

use nalgebra::{Isometry3, Translation3};

use super::case::{transferred, whitener};
use super::{AbsoluteCase, AbsoluteError};
use crate::observation::ReadingKind;
use crate::task::station_named;

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

    /// Refuses distances for what is made of three coordinates, in words.
    ///
    /// # Errors
    /// Distances are read.
    pub fn needs_positions(&self, what: &'static str) -> Result<(), AbsoluteError> {
        if self.reads_distances() {
            return Err(AbsoluteError::Distances(what));
        }
        Ok(())
    }

    /// The same where distances are weighed by what the planner's model says of the errors of each, too, none of them shared: no
    /// discrepancy is found from their residuals.
    #[must_use]
    pub fn counting_sources(mut self) -> Self {
        let belief = self.belief;
        let Some(extended) = belief.uncertain.as_ref().filter(|_| self.reads_distances()) else {
            return self;
        };
        let chain = &belief.nominal.chain;
        for place in 0..self.observations.len() {
            let setup = &self.observations[place].setup;
            let (q, tool) = (
                setup.commanded_rad.as_slice(),
                &self.arm.tools[setup.target],
            );
            let load = transferred(chain, tool, &belief.calibration_tool, q, &setup.load);
            let sources = extended.sources().map(|(_, source)| source);
            let more = self.disturbed(place, &load, sources).covariance();
            self.covariances[place] += more;
            self.observations[place].whitener = whitener(&self.covariances[place]);
        }
        self
    }
}
