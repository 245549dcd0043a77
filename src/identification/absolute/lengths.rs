//! Lengths among absolute readings: from stations that do not show all coordinates.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Isometry3, Translation3, Vector3};

use super::super::frames::MountedFrames;
use super::{AbsoluteCase, FitResult, IdentificationError};
use crate::experiment::numbered;
use crate::measurement::AbsoluteReading;
use crate::numeric::quantisation::shared_by_repeats;
use crate::observation::{LengthKind, ReadingErrors, SharedRounding};
use crate::parameter::{ParameterKind, ParameterSet};
use crate::task::station_named;

impl AbsoluteCase<'_> {
    /// Where a station is begun with: where the robot's own world is; one that lengths are read from where the planner's model has it,
    /// with the axes of the robot's base.
    pub(super) fn placed_frame(&self, station: usize) -> Isometry3<f64> {
        let name = self.stations[station].as_deref();
        match station_named(&self.belief.stations, name).filter(|place| place.reads.is_some()) {
            Some(place) => Translation3::from(-place.position_m).into(),
            None => Isometry3::identity(),
        }
    }

    /// The position and the rotation of the base in a station's frame as the planner's model has them, where stations have the scenario's
    /// numbers; none of a station that the scenario does not have.
    pub fn base_there(&self, station: usize) -> Option<[[ParameterKind; 3]; 2]> {
        let name = self.stations[station].as_ref();
        let mut known = self.belief.stations.iter();
        (known.position(|each| Some(&each.name) == name)).map(ParameterKind::of_base)
    }

    /// What a parameter of the planner's model is here; none of frames that the readings alone find, or that are not read.
    pub fn kind_here(&self, kind: ParameterKind) -> Option<ParameterKind> {
        if !kind.is_mounted() {
            return Some(kind);
        }
        (0..self.stations.len()).find_map(|station| {
            self.length_from(station)?;
            let there = self.base_there(station)?.concat();
            let place = there.iter().position(|each| *each == kind)?;
            Some(ParameterKind::of_base(station).as_flattened()[place])
        })
    }

    /// By what parameters of a set, which move and turn stations about the robot's base, these are off at their own places c, as sources
    /// have it: d + r x c (p x p, in units).
    pub fn about_places(&self, set: &ParameterSet) -> DMatrix<f64> {
        let mut about = DMatrix::identity(set.len(), set.len());
        for (row, moved) in set.parameters().iter().enumerate() {
            let ParameterKind::BasePosition { station, axis } = moved.kind else {
                continue;
            };
            let place_m = -self.placed_frame(station).translation.vector;
            for (turned, kind) in ParameterKind::of_base(station)[1].into_iter().enumerate() {
                if let Some(column) = set.index_of(kind) {
                    let moved_m = Vector3::ith(turned, 1.0).cross(&place_m);
                    about[(row, column)] = moved_m[axis.index()];
                }
            }
        }
        about
    }

    /// Frames with those of lengths where they are begun with: closed forms are of positions.
    pub(super) fn beside_lengths(&self, mut frames: MountedFrames) -> MountedFrames {
        let stations = frames.instrument_from_base.iter_mut().enumerate();
        for (station, frame) in stations.filter(|(station, _)| self.length_from(*station).is_some())
        {
            *frame = self.arm.instrument_from_base[station];
        }
        frames
    }

    /// Whether a reading is of the kind that the scenario has its station for.
    pub(super) fn check_kind(&self, index: usize, reading: &AbsoluteReading) -> FitResult<()> {
        let name = reading.station.as_deref();
        let kind = reading.length.map(|read| read.kind);
        match (station_named(&self.belief.stations, name), kind) {
            (None, Some(kind)) => {
                let named = |name: &str| format!("station {name:?}");
                let from = name.map_or_else(|| "no station".to_owned(), named);
                Err(IdentificationError::NoPlace(kind.name(), from))
            }
            (Some(station), _) if station.reads != kind => Err(IdentificationError::OtherKind {
                reading: index + 1,
                is: kind.map_or("position", LengthKind::name),
                station: station.name.clone(),
            }),
            _ => Ok(()),
        }
    }

    /// The lengths that are read from a station; none where positions or poses are.
    pub fn length_from(&self, station: usize) -> Option<LengthKind> {
        let name = self.stations[station].as_deref();
        station_named(&self.belief.stations, name)?.reads
    }

    /// What repeats of each reading share of its rounding, by its errors besides the instrument's noise: those of one target, under one
    /// load, from one station and in one configuration.
    pub fn shared_rounding(&self, errors: &[ReadingErrors]) -> Vec<SharedRounding> {
        let mut all = vec![SharedRounding::default(); self.observations.len()];
        let each = self.observations.iter().zip(&self.covariances).zip(errors);
        for (shared, ((read, covariance), errors)) in all.iter_mut().zip(each) {
            let kind = read.reading.kind().length();
            let shows = kind.and_then(|kind| self.belief.instrument.shows_length(kind));
            let step_m = shows.map_or(0.0, |shows| shows.resolution_m);
            let own = covariance[(0, 0)];
            let variance = own + errors.spread_of_repeats();
            shared.variance_m2 = shared_by_repeats(step_m, variance, own);
        }
        if all.iter().all(|each| each.variance_m2 <= 0.0) {
            return all;
        }
        let setup = |place: usize| &self.observations[place].setup;
        let of = |place: usize| (setup(place).load, setup(place).target, setup(place).station);
        let pose = |place: usize| setup(place).pose();
        let configurations = numbered(all.len(), pose, |_, _| true);
        let alike = numbered(all.len(), pose, |one, other| of(one) == of(other));
        let mut rounded: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (place, each) in all.iter_mut().enumerate() {
            let here = rounded.entry(configurations[place]).or_default();
            if each.variance_m2 > 0.0 {
                let known = here.iter().position(|known| *known == alike[place]);
                each.column = known.unwrap_or(here.len());
                if known.is_none() {
                    here.push(alike[place]);
                }
            }
        }
        for (each, configuration) in all.iter_mut().zip(&configurations) {
            each.columns = rounded[configuration].len();
        }
        all
    }

    pub(super) fn is_length(&self, place: usize) -> bool {
        self.observations[place].reading.kind().length().is_some()
    }

    /// The readings of positions and poses, by their places.
    pub fn positions(&self) -> Vec<usize> {
        let places = 0..self.observations.len();
        places.filter(|&place| !self.is_length(place)).collect()
    }

    /// The same with these alone.
    pub(super) fn of_positions(&self) -> Self {
        self.part_of(|place| !self.is_length(place))
    }

    /// The stations in whose frames a place may count: those that positions are read from, and those of lengths where there are no others.
    pub fn framing_stations(&self) -> Vec<usize> {
        let all = 0..self.stations.len();
        let (of_lengths, framing): (Vec<usize>, Vec<usize>) =
            all.partition(|&station| self.length_from(station).is_some());
        if framing.is_empty() {
            of_lengths
        } else {
            framing
        }
    }

    /// Whether lengths are read.
    pub fn reads_lengths(&self) -> bool {
        (0..self.observations.len()).any(|place| self.is_length(place))
    }

    /// What lengths are read, in words; nothing where none are.
    pub fn lengths_in_words(&self) -> Option<String> {
        let read = |kind: &LengthKind| {
            let mut readings = self.observations.iter();
            readings.any(|each| each.reading.kind().length() == Some(*kind))
        };
        let names = LengthKind::ALL.into_iter().filter(read);
        let names: Vec<String> = names.map(|kind| format!("{}s", kind.name())).collect();
        (!names.is_empty()).then(|| names.join(" and "))
    }
}
