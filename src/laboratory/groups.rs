//! What is measured together: stops under one load, with the instrument at one station.

use std::iter;

use nalgebra::{DVector, Vector3};

use super::side::Side;
use super::ways::Way;
use crate::experiment::{Experiment, Plan};
use crate::observation::ReadLength;
use crate::parameter::Unloaded;
use crate::plan::absolute::{AbsolutePlanning, RepeatedReading};
use crate::robot::{EquilibriumSolver, Load};
use crate::task::Belief;

/// One place where the robot stands and is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// The experiments of the plan that are measured here, as indices.
    pub experiments: Vec<usize>,
    /// The commanded configuration (rad, m).
    pub configuration: DVector<f64>,
    /// What hangs on the robot; nothing for the position without a load.
    pub load: Option<Load>,
    /// Whether it is hung just before the approach, in place of what hung there; or where the robot stands.
    pub changes_load: bool,
    /// Whether the robot stands there already.
    pub is_in_place: bool,
    /// The direction that a gauge reads along, which is set here where nothing hangs yet.
    pub direction: Option<Vector3<f64>>,
    /// What it meets there, by the nominal robot; none without one, or where the robot does not rest.
    pub at_gauge: Option<AtGauge>,
    /// Where the instrument stands, where absolute readings say it.
    pub station: Option<String>,
    /// Whether it is set up there just before.
    pub changes_station: bool,
    /// What is read, once each, of absolute readings: as many as experiments.
    pub targets: Vec<String>,
    /// The length that each of them is about, where that is read.
    pub lengths: Vec<Option<ReadLength>>,
    /// How often the instrument is read.
    pub readings: u32,
    /// The side from which it is approached.
    pub side: Side,
    /// Where the approach begins (rad, m); none where there is no room for one.
    pub approach: Option<DVector<f64>>,
    /// The way there from the stop before, or from the first safe pose.
    pub way: Way,
}

/// What a gauge meets, by the nominal robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtGauge {
    /// Where the target is without the load (m, world frame).
    pub target_m: Vector3<f64>,
    /// The displacement along its direction by the load (m).
    pub displacement_m: f64,
}

impl AtGauge {
    pub(super) fn of(belief: &Belief, each: &Experiment) -> Option<Self> {
        let direction = each.direction?;
        let mut solver = EquilibriumSolver::new(belief.nominal.chain.len());
        let q = each.configuration_rad.as_slice();
        let [target_m, loaded_m] = belief.nominal_rests_m(&mut solver, q, &each.load)?;
        Some(Self {
            target_m,
            displacement_m: direction.dot(&(loaded_m - target_m)),
        })
    }

    /// Where the target is (mm), in words.
    pub fn near(&self) -> String {
        let [x, y, z] = (self.target_m * 1e3).into();
        format!("({x:.0}, {y:.0}, {z:.0})")
    }

    /// The displacement (mm), in words.
    pub fn shows(&self) -> String {
        format!("{:+.2}", self.displacement_m * 1e3)
    }
}

impl Stop {
    /// Whether a gauge is set to zero here, before the load is hung.
    pub const fn sets_gauge(&self) -> bool {
        self.direction.is_some() && self.load.is_none()
    }
}

/// Visits under the same loads, with the instrument at one station.
#[derive(Default)]
pub(super) struct Group {
    /// What hangs in each visit in turn.
    pub loads: Vec<Option<Load>>,
    pub station: Option<String>,
    /// Whether the robot stands there already.
    pub is_in_place: bool,
    /// Whether the members come in the order in which they were visited without a load.
    pub is_as_unloaded: bool,
    /// The experiments that are measured in one visit, with the number of readings; of several loads each is read once.
    pub members: Vec<(Vec<usize>, u32)>,
}

impl Group {
    /// What hangs in a visit in turn, where this hangs before: that first, if the order need not be kept.
    pub fn in_turn(&self, hanging: Option<Load>, keep_order: bool) -> Vec<Option<Load>> {
        let mut loads = self.loads.clone();
        let first = loads.iter().position(|load| *load == hanging);
        if let Some(first) = first.filter(|_| !keep_order) {
            loads[..=first].rotate_right(1);
        }
        loads
    }

    /// The stop of a member under one of the loads after another stop, where the robot may stand already.
    pub fn stop(
        &self,
        plan: &Plan,
        (member, load, is_in_place): (usize, Option<Load>, bool),
        last: Option<&Stop>,
        sides: &[(Side, Option<DVector<f64>>)],
    ) -> Stop {
        let (mut experiments, mut readings) = self.members[member].clone();
        if self.loads.len() > 1 {
            let here = load.unwrap_or(Load::NONE).as_set();
            experiments.retain(|&index| plan.experiments[index].load.as_set() == here);
            readings = u32::try_from(experiments.len()).unwrap_or(u32::MAX);
        }
        let is_in_place = is_in_place || self.is_in_place;
        let (side, approach) = &sides[experiments[0]];
        Stop {
            configuration: plan.experiments[experiments[0]].configuration_rad.clone(),
            load,
            changes_load: load.is_some() && last.is_none_or(|last| last.load != load),
            direction: plan.experiments[experiments[0]].direction,
            at_gauge: None,
            station: self.station.clone(),
            changes_station: self.station.is_some()
                && last.is_none_or(|last| last.station != self.station),
            targets: Vec::new(),
            lengths: Vec::new(),
            experiments,
            readings,
            side: side.clone(),
            is_in_place,
            approach: approach.clone().filter(|_| !is_in_place),
            way: Way::default(),
        }
    }
}

/// The first of the loads met so far that is set alike: one weight is hung once, whatever digits nobody sets.
fn first_alike(met: &mut Vec<Load>, load: Load) -> Load {
    let alike = |each: &Load| each.as_set() == load.as_set();
    if let Some(first) = met.iter().copied().find(alike) {
        return first;
    }
    met.push(load);
    load
}

/// Whether the robot is approached alike for two experiments before a load is hung: to the bit, since a deflection is a
/// difference at the same commanded angles. Plans that are designed have one configuration's angles alike.
pub(super) fn stand_alike(one: &Experiment, other: &Experiment) -> bool {
    one.configuration_rad == other.configuration_rad && one.approach == other.approach
}

/// The groups of experiments of a plan of deflections, by their places: all configurations without a load, then those of each load.
/// Where the instrument drifts, those of each load are visited without it just before, so that the times between the readings of deflections
/// are alike. Repeats that are visits are made in rounds.
pub(super) fn groups_of_loads(
    belief: &Belief,
    plan: &Plan,
    places: &[usize],
    keep_order: bool,
) -> Vec<Group> {
    let loads = by_load(plan, places, keep_order);
    let drifts = belief.uncertain.has_drift();
    let is_apart = drifts && belief.instrument.unloaded == Unloaded::Own;
    let size = if is_apart { 1 } else { loads.len().max(1) };
    let groups = loads.chunks(size).flat_map(|loads| {
        let mut places: Vec<usize> = loads.iter().flat_map(|(_, own)| own.clone()).collect();
        places.sort_unstable();
        let loaded = loads.iter().map(|(load, places)| Group {
            loads: vec![Some(*load)],
            is_as_unloaded: drifts,
            members: (places.iter())
                .map(|&index| (vec![index], plan.experiments[index].repeats))
                .collect(),
            ..Group::default()
        });
        let unloaded = unloaded(belief, plan, &places);
        [unloaded].into_iter().chain(loaded).collect::<Vec<_>>()
    });
    if belief.repeats_are_visits() {
        groups.flat_map(|group| rounds(plan, group)).collect()
    } else {
        groups.collect()
    }
}

/// The experiments under each load, by their places; under one load after the other, if the order is kept.
fn by_load(plan: &Plan, places: &[usize], keep_order: bool) -> Vec<(Load, Vec<usize>)> {
    let (mut all, mut met) = (Vec::<(Load, Vec<usize>)>::new(), Vec::new());
    for &index in places {
        let load = first_alike(&mut met, plan.experiments[index].load);
        let last = all.len().saturating_sub(1);
        let known = (all.iter_mut().enumerate())
            .find(|(place, (own, _))| (!keep_order || *place == last) && *own == load);
        match known {
            Some((_, (_, places))) => places.push(index),
            None => all.push((load, vec![index])),
        }
    }
    all
}

/// The configurations of some experiments without a load.
fn unloaded(belief: &Belief, plan: &Plan, places: &[usize]) -> Group {
    let mut members: Vec<(Vec<usize>, u32)> = Vec::new();
    for &index in places {
        let experiment = &plan.experiments[index];
        let same = (members.iter_mut())
            .find(|(members, _)| stand_alike(&plan.experiments[members[0]], experiment));
        let needed = match belief.instrument.unloaded {
            // Each measurement has a reading without a load of its own: deflections share no error.
            Unloaded::Own => experiment.repeats,
            Unloaded::Shared => u32::from(same.is_none()),
        };
        match same {
            Some((members, readings)) => {
                members.push(index);
                *readings += needed;
            }
            None => members.push((vec![index], needed)),
        }
    }
    Group {
        loads: vec![None],
        members,
        ..Group::default()
    }
}

/// Visits of one reading each in place of several, so that the robot leaves a configuration before it comes there again.
fn rounds(plan: &Plan, group: Group) -> Vec<Group> {
    let experiment = |visit: &[usize]| &plan.experiments[visit[0]];
    let mut rounds: Vec<Vec<(Vec<usize>, u32)>> = Vec::new();
    for (experiments, readings) in group.members {
        let visits: Vec<Vec<usize>> = if readings == 1 {
            vec![experiments]
        } else {
            let repeats = |&index: &usize| plan.experiments[index].repeats as usize;
            let visits = experiments.iter();
            (visits.flat_map(|index| iter::repeat_n(vec![*index], repeats(index)))).collect()
        };
        for visit in visits {
            let comes_here =
                |(other, _): &(Vec<usize>, u32)| stand_alike(experiment(other), experiment(&visit));
            let round = rounds
                .iter()
                .position(|round| !round.iter().any(comes_here));
            match round {
                Some(round) => rounds[round].push((visit, 1)),
                None => rounds.push(vec![(visit, 1)]),
            }
        }
    }
    let round = |members| Group {
        loads: group.loads.clone(),
        station: group.station.clone(),
        members,
        ..group
    };
    rounds.into_iter().map(round).collect()
}

/// A visit of a plan of absolute readings.
struct PlannedVisit {
    station: usize,
    /// What hangs in turn.
    loads: Vec<Option<Load>>,
    /// How many visits alike there are before.
    round: u32,
    /// What is read, by its place in the plan.
    rows: Vec<usize>,
}

/// The visits of a plan of absolute readings, in the order of its configurations; no load hangs first, if the order need not be kept.
fn visits(
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
    keep_order: bool,
) -> Vec<PlannedVisit> {
    let row = |place: usize| {
        plan.iter()
            .position(|(each, _)| *each == place)
            .unwrap_or(0)
    };
    let (mut all, mut met) = (Vec::<PlannedVisit>::new(), Vec::new());
    for group in planning.by_configuration(plan) {
        let first = all.len();
        for alike in group.chunk_by(|one, other| one.visits == other.visits) {
            // Where a tracker reads, too, lengths are read beside it.
            let is_seen = |each: &&RepeatedReading| planning.setup(each.place).1.length().is_none();
            let seen = alike.iter().find(is_seen);
            let station = planning.station_of(seen.unwrap_or(&alike[0]).place);
            let mut loads = Vec::new();
            for each in alike {
                let load = planning.candidates[each.place].load;
                let load = load.filter(|load| *load != Load::NONE);
                let load = load.map(|load| first_alike(&mut met, load));
                if !loads.contains(&load) {
                    loads.push(load);
                }
            }
            if !keep_order {
                loads.sort_by_key(Option::is_some);
            }
            for _ in 0..alike[0].times {
                let before = all[first..].iter();
                let before = before.filter(|each| (each.station, &each.loads) == (station, &loads));
                all.push(PlannedVisit {
                    round: u32::try_from(before.count()).unwrap_or(u32::MAX),
                    rows: alike.iter().map(|each| row(each.place)).collect(),
                    station,
                    loads: loads.clone(),
                });
            }
        }
    }
    all
}

/// The visits of each station, one load after the other, in rounds; in the plan's own order of stations and, within a round, of loads
/// if that is to be kept.
pub(super) fn groups_of_visits(
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
    keep_order: bool,
) -> Vec<Group> {
    let mut all = visits(planning, plan, keep_order);
    let unloaded = vec![None];
    let (mut stations, mut loads) = (Vec::new(), vec![&unloaded]);
    all.sort_by_key(|visit| visit.rows[0]);
    for visit in &all {
        if !stations.contains(&visit.station) {
            stations.push(visit.station);
        }
        if !loads.contains(&&visit.loads) {
            loads.push(&visit.loads);
        }
    }
    let mut groups: Vec<Group> = Vec::new();
    for station in stations {
        let hanging = groups.last().map_or(&unloaded, |group| &group.loads);
        let rank = |visit: &PlannedVisit| {
            let place = loads.iter().position(|loads| **loads == visit.loads);
            (visit.loads != *hanging, place)
        };
        let here = all.iter().filter(|visit| visit.station == station);
        let mut here: Vec<&PlannedVisit> = here.collect();
        if keep_order {
            here.sort_by_key(|visit| visit.round);
        } else {
            here.sort_by_key(|visit| (rank(visit), visit.round));
        }
        let is_one = |one: &&PlannedVisit, other: &&PlannedVisit| {
            (&one.loads, one.round) == (&other.loads, other.round)
        };
        let member = |visit: &&PlannedVisit| {
            let readings = u32::try_from(visit.rows.len()).unwrap_or(1);
            (visit.rows.clone(), readings)
        };
        groups.extend(here.chunk_by(is_one).map(|group| Group {
            loads: group[0].loads.clone(),
            station: planning.stations()[station].clone(),
            members: group.iter().map(member).collect(),
            ..Group::default()
        }));
    }
    groups
}
