//! Absolute readings weighed by what the planner's model says of their errors besides the instrument's.

use super::AbsoluteCase;
use super::case::whitener;
use crate::experiment::together;
use crate::observation::{ReadingErrors, SharedErrors, SharingReadings};

impl AbsoluteCase<'_> {
    /// The same where lengths, and what is read beside them, are weighed by [all errors](Self::counting_sources) from the beginning: what is
    /// shared is not found from their residuals.
    #[must_use]
    pub fn counting_sources_of_lengths(self) -> Self {
        if self.reads_lengths() {
            self.counting_sources()
        } else {
            self
        }
    }

    /// The same weighed by what the planner's model says of the readings' errors: what is new in each, and what readings of one visit, or of
    /// one configuration, share, seen in the frames that the case has. Joint error functions are no matter of single readings.
    #[must_use]
    pub fn counting_sources(mut self) -> Self {
        let uncertain = &self.belief.uncertain;
        let are_functions = !self.reads_lengths() && !uncertain.joint_functions().is_empty();
        if self.is_sharing_known || are_functions {
            return self;
        }
        let mut errors = self.listed_errors();
        let rounding = self.shared_rounding(&errors);
        let is_any = rounding.iter().any(|each| each.columns > 0);
        if !is_any && uncertain.sources().next().is_none() {
            return self;
        }
        if is_any {
            let both = errors.into_iter().zip(&rounding);
            errors = both.map(|(own, each)| own.rounded(each)).collect();
        }
        let setup = |visit: usize| &self.observations[self.visits[visit][0]].setup;
        let are_kept = errors.iter().any(|each| each.configuration.ncols() > 0);
        let mut shared = SharedErrors { groups: Vec::new() };
        let pose = |visit| setup(visit).pose();
        for visits in together(self.visits.len(), pose, |_, _| are_kept) {
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

    /// The same weighed by the instrument and by what else the planner's model has as new in each reading, alone.
    #[must_use]
    pub fn counting_reading_errors(mut self) -> Self {
        if !self.is_sharing_known {
            let errors = self.listed_errors();
            for (covariance, errors) in self.covariances.iter_mut().zip(errors) {
                *covariance += errors.reading;
            }
        }
        self
    }

    /// What the planner's model says of each reading's errors besides the instrument's, in the frame that it is read in.
    fn listed_errors(&self) -> Vec<ReadingErrors> {
        let of_one = |place: usize| {
            let setup = &self.observations[place].setup;
            let sources = self.belief.uncertain.sources();
            let errors = self.disturbed(place, &setup.load, sources.map(|(_, source)| source));
            if self.is_length(place) {
                return errors;
            }
            errors.turned(&self.arm.instrument_from_base[setup.station].rotation)
        };
        (0..self.observations.len()).map(of_one).collect()
    }
}
