//! Likely input errors of absolute readings: how they would have to be read for frames alone to explain them.
//!
//! Geometry may take up a joint's sign or a quarter of a turn as if a maker could have built it. Frames cannot: as it is read, a right table is off by
//! what robots are off by, a wrong one by much more. An input error is named where reading the table without it leaves a quarter at most.

use rayon::prelude::*;

use super::super::absolute::AbsoluteCase;
use super::super::frames::{MountedFrames, RobustFrames, median_or_zero, reach};
use super::catalogue::{self, Correction, InputError};
use super::condition;
use crate::codes::Condition;

/// Frames alone leave less than this share of how far positions reach, whatever robot it is.
const LOOKED_AT: f64 = 5e-3;
/// An input error explains a table where no more than this share is left without it.
const EXPLAINS: f64 = 0.25;
/// Of two errors the one of fewer joints, unless another one leaves less than this share of what it leaves.
const CLEARLY: f64 = 0.5;
/// So many readings are enough to see it.
const ENOUGH: usize = 80;
/// Stations may have been changed after so many parts of the table.
const PARTS: usize = 8;

impl AbsoluteCase<'_> {
    /// The input error that explains why frames alone do not explain the readings; none where they do, or where none explains it.
    pub fn likely_input_error(&self) -> Option<Condition> {
        let positions = self.positions();
        let step = positions.len().div_ceil(ENOUGH).max(1);
        let looked_at: Vec<usize> = positions.into_iter().step_by(step).collect();
        let some = self.part_of(|index| looked_at.binary_search(&index).is_ok());
        let sights = some.sights();
        let robust = RobustFrames::guessed(&sights, some.stations.len(), &some.link_from_tools());
        let as_it_is_m = robust.median_m;
        // What an instrument errs by is no error of the table.
        let is_explained = (LOOKED_AT * reach(&sights)).max(self.belief.instrument.sigma_m);
        if as_it_is_m <= is_explained {
            return None;
        }
        // Where positions hardly differ, whatever makes the robot's hardly differ would leave little of them.
        let explained_m = EXPLAINS * as_it_is_m.min(reach(&sights));
        let explaining = |errors: Vec<InputError>| {
            let left: Vec<f64> = (errors.par_iter())
                .map(|error| some.left_without(error, &looked_at))
                .collect();
            // An earlier one unless a later one is clearly better.
            let is_better = |next: usize, best: usize| left[next] < CLEARLY * left[best];
            let best = (0..errors.len())
                .reduce(|best, next| if is_better(next, best) { next } else { best });
            let best = best.filter(|&best| left[best] <= explained_m)?;
            let moved = match errors[best].change {
                Correction::StationMoved(near) => Some(self.moved_from(near)),
                _ => None,
            };
            let moved = moved.map(catalogue::station_moved);
            let mut words = format!(
                "{}. Residuals of frames alone: {:.2} mm so, {:.2} mm as read (medians)",
                moved.as_ref().unwrap_or(&errors[best]).words,
                left[best] * 1e3,
                as_it_is_m * 1e3
            );
            // Positions may not tell a joint's sign from a hand: errors of other kinds that explain them alike.
            let mut named = vec![errors[best].kind];
            for (place, other) in errors.iter().enumerate() {
                let is_alike = left[place] <= explained_m && !is_better(best, place);
                if is_alike && !named.contains(&other.kind) {
                    named.push(other.kind);
                    words += &format!(". Or, {:.2} mm so: {}", left[place] * 1e3, other.words);
                }
            }
            Some(words)
        };
        let mut readings = some.observations.iter();
        let has_rotations = readings.any(|each| each.reading.kind().rows() == 6);
        let [reversed, offsets, units, swapped, from_before] =
            catalogue::of_commands(&self.arm.chain);
        let (mut simple, several): (Vec<_>, Vec<_>) =
            (reversed.into_iter()).partition(|error| error.reversed.len() == 1);
        simple.extend(offsets);
        simple.extend(catalogue::of_sights(has_rotations));
        simple.extend(units.into_iter().chain(swapped).chain(from_before));
        let moved = |part: usize| looked_at[part * looked_at.len() / PARTS];
        simple.extend((1..PARTS).map(|part| catalogue::station_moved(moved(part))));
        let words = explaining(simple).or_else(|| explaining(several))?;
        Some(condition(&words))
    }

    /// The first reading after the instrument was moved near one: by the frames of readings that are surely before and after, those in between
    /// are of the ones or of the others.
    fn moved_from(&self, near: usize) -> usize {
        let (positions, mut sights) = (self.positions(), self.sights());
        let count = positions.len();
        let place = positions.partition_point(|&position| position < near);
        let part = count / PARTS;
        let [low, high] = [place.saturating_sub(part), (place + part).min(count)];
        let stations = self.stations.len();
        for sight in &mut sights[high..] {
            sight.station += stations;
        }
        let sure = [&sights[..low], &sights[high..]].concat();
        let frames = MountedFrames::guessed(&sure, 2 * stations, &self.link_from_tools());
        let before = frames.left(&sights[low..high]);
        for sight in &mut sights[low..high] {
            sight.station += stations;
        }
        let after = frames.left(&sights[low..high]);
        // By how much more each cut leaves than the first one, at the beginning.
        let more = before.iter().zip(&after).scan(0.0, |sum, (before, after)| {
            *sum += before - after;
            Some(*sum)
        });
        let cuts = (1..).zip(more);
        let best = cuts.fold(
            (0, 0.0),
            |best, cut| if cut.1 < best.1 { cut } else { best },
        );
        positions.get(low + best.0).copied().unwrap_or(near)
    }

    /// What frames alone leave of the readings, which are at these places of a table, without an error (m, a median, with rotations as
    /// lengths).
    fn left_without(&self, error: &InputError, places: &[usize]) -> f64 {
        let mut case = self.clone();
        for each in &mut case.observations {
            error.correct_commands(&mut each.setup.commanded_rad);
        }
        let mut sights = case.sights();
        for (place, sight) in sights.iter_mut().enumerate() {
            match &error.change {
                Correction::Sight(change) => change(sight),
                Correction::StationMoved(first) if places[place] >= *first => {
                    sight.station += self.stations.len();
                }
                _ => {}
            }
        }
        let stations = sights.iter().map(|sight| sight.station + 1);
        let stations = stations.fold(self.stations.len(), usize::max);
        let frames = MountedFrames::guessed(&sights, stations, &self.link_from_tools());
        median_or_zero(frames.left(&sights))
    }
}
