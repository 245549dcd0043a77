//! What may be read from all stations, and from fewer.
//!
//! What readings cannot tell apart an identification takes as the planner's model has it. A station of whose frame something is known, such as
//! a level table, may tell it, and it is unknown then. So plans that do without such a station are predicted with fewer unknowns, and may be better.

use super::{AbsolutePlan, AbsolutePlanning, CandidateError, ReadingsWanted};
use crate::experiment::Candidate;
use crate::plan::search::{Watch, measurements_in};
use crate::task::Task;

/// Plans do without any of so many stations of whose frames something is known, and of more without all of them.
const FEW: usize = 4;

impl ReadingsWanted<'_> {
    /// What may be read under a seed: from all stations first, and without some where fewer parameters are unknown then.
    ///
    /// # Errors
    /// As [`planning`](Self::planning).
    pub fn plannings<'t>(
        &self,
        task: &'t Task,
        seed: u64,
    ) -> Result<Vec<AbsolutePlanning<'t>>, CandidateError> {
        let all = self.planning(task, seed)?;
        let known = all.known_stations();
        let apart = if known.len() > FEW { known.len() } else { 1 };
        let parts: Vec<&[usize]> = known.chunks(apart).collect();
        let mut plannings = vec![all];
        for subset in 1..1_usize << parts.len() {
            let places = (0..parts.len()).filter(|place| subset >> place & 1 == 1);
            let without = places
                .map(|place| parts[place])
                .collect::<Vec<_>>()
                .concat();
            let all = &plannings[0];
            let rows = all.offered().iter().enumerate();
            let rows = rows.filter(|(place, _)| !without.contains(&all.station_of(*place)));
            let rows: Vec<Candidate> = rows.map(|(_, row)| row.clone()).collect();
            // The others alone may tell nothing.
            let fewer = self.of_rows(task, &rows).ok();
            let fewer = fewer.filter(|fewer| fewer.unknowns() < all.unknowns());
            let offer = all.offer.clone();
            plannings.extend(fewer.map(|fewer| AbsolutePlanning { offer, ..fewer }));
        }
        Ok(plannings)
    }

    /// The best plans of rising numbers of readings that are found by some search among what may be read, with that: those of which the last one
    /// predicts least. No plan of any is below their bounds.
    pub(super) fn best_of<'t>(
        plannings: Vec<AbsolutePlanning<'t>>,
        watch: Watch<'_>,
        search: impl Fn(
            &mut AbsolutePlanning<'t>,
            Watch<'_>,
        ) -> Result<Vec<AbsolutePlan>, CandidateError>,
    ) -> Result<(AbsolutePlanning<'t>, Vec<AbsolutePlan>), CandidateError> {
        let parts = plannings.len();
        let mut found = Vec::new();
        let mut wrong = None;
        for (number, mut planning) in plannings.into_iter().enumerate() {
            match watch.part(number, parts, |here| search(&mut planning, here)) {
                Ok(plans) => found.push((planning, plans)),
                Err(error) => wrong = wrong.or(Some(error)),
            }
        }
        let rho0_m = |(planning, plans): &(AbsolutePlanning<'_>, Vec<AbsolutePlan>)| {
            let last = plans.last();
            let rho0_m = last.and_then(|last| planning.prediction(&last.plan).rho0_m());
            rho0_m.unwrap_or(f64::INFINITY)
        };
        let best = found.iter().map(rho0_m).enumerate();
        let best = best.min_by(|(_, one), (_, other)| one.total_cmp(other));
        let Some((best, _)) = best else {
            return Err(wrong.unwrap_or_else(CandidateError::undetermined));
        };
        let (planning, mut plans) = found.swap_remove(best);
        for plan in &mut plans {
            let size = measurements_in(&plan.plan);
            for (_, others) in &found {
                let other = (others.iter()).find(|other| measurements_in(&other.plan) == size);
                let other = other.and_then(|other| other.bound.as_ref());
                plan.bound = match (plan.bound.take(), other) {
                    (Some(own), Some(other)) if other.best < own.best => Some(other.clone()),
                    (own, other) => own.filter(|_| other.is_some()),
                };
            }
        }
        Ok((planning, plans))
    }
}

impl AbsolutePlanning<'_> {
    /// How many parameters are unknown besides frames.
    fn unknowns(&self) -> usize {
        let all = self.set.parameters().iter();
        all.filter(|each| !each.kind.is_mounted()).count()
    }

    /// The stations of whose frames something is known, by their numbers.
    fn known_stations(&self) -> Vec<usize> {
        let is_known = |station: &usize| {
            let kinds = self.case.base_kinds(*station).into_iter();
            let mut places = kinds.filter_map(|kind| self.set.index_of(kind));
            places.any(|place| self.set.parameters()[place].prior_deviation.is_some())
        };
        (0..self.stations().len()).filter(is_known).collect()
    }
}
