//! Readings of one configuration, by what they tell together: targets that one visit reads share its errors.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Isometry3, Matrix6, Matrix6xX};
use rayon::prelude::*;

use super::AbsolutePlanning;
use crate::numeric::markov::ProcessPoint;
use crate::observation::{
    ConfigurationEquations, PlannedReading, ReadingErrors, SharedErrors, SharingReading,
    SharingReadings, Together, Visits, Whitener, turned_columns, visits_of,
};
use crate::plan::search::{CandidateInformation, CandidatePlan, TogetherBounds, by_configuration};

/// A reading that is taken in so many visits alike.
#[derive(Debug, Clone, Copy)]
pub struct RepeatedReading {
    /// The candidate.
    pub place: usize,
    /// The number of visits.
    pub times: u32,
    /// Which of the configuration's visits these are.
    pub visits: usize,
}

impl RepeatedReading {
    /// How one standard deviation of each effect of such errors moves it, of those that readings of its configuration share.
    pub(super) fn effects_by<'r>(
        &self,
        errors: &ReadingErrors,
        here: impl IntoIterator<Item = &'r Self>,
    ) -> Matrix6xX<f64> {
        let visits = here.into_iter().map(|each| each.visits + 1).max();
        errors.effects([self.visits, visits.unwrap_or(1)], self.times)
    }
}

impl AbsolutePlanning<'_> {
    /// The readings of a plan by their configurations: those of one visit, and of visits that read the same, together.
    pub fn by_configuration(&self, plan: &[(usize, u32)]) -> Vec<Vec<RepeatedReading>> {
        let of_group = |group: CandidatePlan| -> Vec<RepeatedReading> {
            let visits = self.visits_in(&group).into_iter().enumerate();
            let readings = visits.flat_map(|(visits, Visits { count, readings })| {
                (readings.into_iter()).map(move |place| RepeatedReading {
                    place,
                    times: count,
                    visits,
                })
            });
            readings.collect()
        };
        (self.groups(plan).into_iter()).map(of_group).collect()
    }

    /// A plan's readings that share a configuration, in the order of the first.
    pub(super) fn groups(&self, plan: &[(usize, u32)]) -> Vec<CandidatePlan> {
        by_configuration(plan, &self.configurations)
    }

    /// The visits of one configuration.
    fn visits_in(&self, group: &[(usize, u32)]) -> Vec<Visits> {
        visits_of(group, |place| self.visits[place])
    }

    /// The covariance of the mean of so many readings of a candidate by what is new in each (m^2, m rad, rad^2), in the world frame.
    pub fn own_covariance(&self, place: usize, times: u32) -> Matrix6<f64> {
        (self.case.covariances[place] + self.errors[place].reading) / f64::from(times.max(1))
    }

    /// The errors that readings of a plan share, by its configurations in their order, each seen in its instrument's frame.
    pub fn shared_errors(
        &self,
        groups: &[Vec<RepeatedReading>],
        frames: &[Isometry3<f64>],
    ) -> SharedErrors {
        let together = if self.ties_all() { groups.len() } else { 1 };
        let mut next = 0;
        let of_part = |part: &[Vec<RepeatedReading>]| {
            let mut sharing = self.sharing(part, frames);
            for reading in &mut sharing.readings {
                *reading += next;
            }
            next += sharing.readings.len();
            sharing
        };
        SharedErrors {
            groups: groups.chunks(together.max(1)).map(of_part).collect(),
        }
    }

    /// The errors that readings of some configurations share, each seen in its instrument's frame: those of configurations and visits, and
    /// the joints' functions.
    pub(super) fn sharing(
        &self,
        groups: &[Vec<RepeatedReading>],
        frames: &[Isometry3<f64>],
    ) -> SharingReadings {
        let mut width = 0;
        let mut own: Vec<(usize, Matrix6xX<f64>)> = Vec::new();
        for group in groups {
            let effects = |each: &RepeatedReading| each.effects_by(&self.errors[each.place], group);
            own.extend(group.iter().map(|each| (width, effects(each))));
            width += own.last().map_or(0, |(_, effects)| effects.ncols());
        }
        let all: Vec<&RepeatedReading> = groups.iter().flatten().collect();
        let points = (all.iter()).filter_map(|each| self.functions.candidates.get(each.place));
        let points: Vec<&ProcessPoint> = points.collect();
        let roots = self.functions.roots(&points);
        let of_one = |(place, (first, own)): (usize, (usize, Matrix6xX<f64>))| {
            let more: usize = roots.iter().map(DMatrix::ncols).sum();
            let mut effects = Matrix6xX::zeros(width + more);
            effects.columns_mut(first, own.ncols()).copy_from(&own);
            let mut at = width;
            for (function, root) in roots.iter().enumerate() {
                let moved = points[place].columns.column(function) * root.row(place);
                (effects.columns_mut(at, root.ncols())).copy_from(&moved);
                at += root.ncols();
            }
            turned_columns(
                &effects,
                &frames[self.station_of(all[place].place)].rotation,
            )
        };
        SharingReadings {
            readings: (0..all.len()).collect(),
            effects: own.into_iter().enumerate().map(of_one).collect(),
        }
    }

    /// A candidate's station, by its number.
    pub fn station_of(&self, place: usize) -> usize {
        self.case.observations[place].setup.station
    }

    /// Which of the loads of its visit a candidate is read under, from 1, or none (0).
    pub fn load_of_visit(&self, place: usize) -> usize {
        self.case.loads[place][0]
    }

    fn sharing_reading(&self, place: usize) -> SharingReading<'_> {
        let mut planned: PlannedReading = self.case.observations[place].planned();
        if let Some(whitener) = Whitener::of_covariance(&self.own_covariance(place, 1)) {
            planned.whitener = whitener;
        }
        SharingReading {
            planned,
            errors: &self.errors[place],
        }
    }

    pub(super) fn equations(&self) -> ConfigurationEquations<'_> {
        ConfigurationEquations::new(&self.set, &self.case.arm, &self.set.prior().mean)
    }

    /// What readings of some configurations tell (p x p each, in typical sizes).
    pub(super) fn told_of(&self, groups: &[CandidatePlan]) -> Vec<DMatrix<f64>> {
        let of_group = |equations: &mut ConfigurationEquations<'_>, group: &CandidatePlan| {
            self.told_by(equations, group)
        };
        (groups.par_iter())
            .map_init(|| self.equations(), of_group)
            .collect()
    }

    /// The same of one configuration, beside what is measured there already.
    pub(super) fn told_by(
        &self,
        equations: &mut ConfigurationEquations<'_>,
        group: &[(usize, u32)],
    ) -> DMatrix<f64> {
        let is_here = |&(place, _): &(usize, u32)| {
            let here =
                |other: &(usize, u32)| self.configurations[other.0] == self.configurations[place];
            group.first().is_some_and(here)
        };
        let mut all: CandidatePlan = self.measured.iter().copied().filter(is_here).collect();
        if all.is_empty() {
            return self.told_together(equations, group);
        }
        let known = self.told_together(equations, &all);
        all.extend(group);
        self.told_together(equations, &all) - known
    }

    /// Whether readings that may be chosen share errors with such as are measured already: what they tell is then not bounded.
    pub(super) fn shares_with_measured(&self) -> bool {
        if self.ties_all() && !self.measured.is_empty() {
            return true;
        }
        let configurations = &self.configurations;
        let here = |place: usize| {
            let is_here = |&(each, _): &(usize, u32)| configurations[each] == configurations[place];
            self.errors[place].are_shared() && self.measured.iter().any(is_here)
        };
        self.places().into_iter().any(here)
    }

    fn told_together(
        &self,
        equations: &mut ConfigurationEquations<'_>,
        group: &[(usize, u32)],
    ) -> DMatrix<f64> {
        let readings = group.iter().map(|(place, _)| self.sharing_reading(*place));
        let readings: Vec<SharingReading<'_>> = readings.collect();
        let own = |place: usize| group.iter().position(|(each, _)| *each == place);
        let mut visits = self.visits_in(group);
        for each in visits.iter_mut().flat_map(|visit| &mut visit.readings) {
            *each = own(*each).unwrap_or(0);
        }
        equations.information(&readings, &visits)
    }

    /// Whether readings of several of some candidates, or repeats of one, do not add up.
    pub(super) fn shares(&self, places: &[usize]) -> bool {
        let keeps = |&place: &usize| self.errors[place].configuration.ncols() > 0;
        places.iter().any(keeps) || !self.several(places).is_empty()
    }

    /// The candidates of each configuration that has several of these, whose readings share errors: by their places among these.
    fn several(&self, places: &[usize]) -> Vec<Vec<usize>> {
        let mut by_number: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (index, &place) in places.iter().enumerate() {
            if self.errors[place].are_shared() {
                let here = self.configurations[place];
                by_number.entry(here).or_default().push(index);
            }
        }
        let mut groups: Vec<Vec<usize>> = by_number.into_values().collect();
        groups.retain(|group| group.len() > 1);
        groups
    }

    /// What several candidates of one configuration tell at most, within directions of the unknowns (p x d).
    pub(super) fn bounds_together(
        &self,
        places: &[usize],
        basis: &DMatrix<f64>,
    ) -> Option<TogetherBounds> {
        let groups = self.several(places);
        if groups.is_empty() {
            return None;
        }
        let within = |matrix: &DMatrix<f64>| basis.tr_mul(matrix) * basis;
        let of_group = |equations: &mut ConfigurationEquations<'_>, group: &Vec<usize>| {
            let here = group.iter().map(|&index| places[index]);
            let readings = here.clone().map(|place| self.sharing_reading(place));
            let readings: Vec<SharingReading<'_>> = readings.collect();
            let classes: Vec<usize> = here.map(|place| self.visits[place]).collect();
            let Together { once, each } = equations.bounds(&readings, &classes);
            (within(&once), each.iter().map(within).collect::<Vec<_>>())
        };
        let found: Vec<(DMatrix<f64>, Vec<DMatrix<f64>>)> = (groups.par_iter())
            .map_init(|| self.equations(), of_group)
            .collect();
        let (once, each) = (
            found.iter().map(|found| &found.0),
            found.iter().flat_map(|found| &found.1),
        );
        Some(TogetherBounds {
            groups,
            once: CandidateInformation::of_all(basis.ncols(), once),
            each: CandidateInformation::of_all(basis.ncols(), each),
        })
    }
}
