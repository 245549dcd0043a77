//! A plan as it is carried out: stops in an order with few changes of load and short moves.
//!
//! A deflection is the difference of two positions at the same commanded angles, without and with a load. All
//! configurations are visited without a load first, then for one load after the other those that it belongs
//! to: there are no fewer changes of load than different loads. Each configuration is approached from the same
//! side every time, so that backlash and friction are the same in both positions.
//!
//! Where the instrument drifts, the configurations of each load are visited without it just before, and with it in the same order: the
//! times between the two readings of deflections are alike then, as predictions have them.
//!
//! Where something is new at each visit, repeats are visits: the k-th of all configurations are one round, so that the robot leaves a
//! configuration before it comes there again. Otherwise repeats are readings of one visit.
//!
//! Where the laboratory hangs loads in place, the robot stands at each configuration until both positions are read. A gauge on its stand
//! loses its zero when the robot leaves: it is set for each measurement, and the load hung in place.
//!
//! Of absolute readings a stop is one visit, in which all its targets are read. The instrument is set up at each station once, since
//! its frame is another afterwards; there, one load hangs after the other, beginning with the one that hangs already, in rounds. Where
//! loads are hung in place a visit is a stop for each of its loads, the first under what hangs already.

use std::collections::BTreeSet;

use nalgebra::DVector;
use thiserror::Error;

use super::groups::{AtGauge, Group, Stop, groups_of_loads, groups_of_visits, stand_alike};
use super::order::shortest;
use super::side::{Side, wanted_side};
use super::ways::{Way, Ways, apart};
use super::{Costs, Laboratory};
use crate::codes::{Condition, ConditionCode};
use crate::experiment::{Plan, in_words};
use crate::plan::absolute::AbsolutePlanning;
use crate::robot::Load;
use crate::task::{Loading, Task};

/// What a move that is not straight costs more than one that is, and how many times as much.
const DETOUR: (f64, f64) = (1.0, 2.0);

/// Times between readings that are further from each other, or longer than is counted, by this share make another drift.
const DRIFTS: f64 = 0.25;

/// What it costs to come again to where the robot stands: it is to leave in between.
const AGAIN: f64 = 100.0;

/// Why a plan cannot be carried out.
#[derive(Debug, Clone, Error, PartialEq, Eq)]
pub enum CampaignError {
    /// No way is free of collisions.
    #[error("no way is found {from} to {to} that keeps clear of collisions{}", with(load.as_deref()))]
    NoWay {
        /// Where it begins: "from experiment 3".
        from: String,
        /// Where it ends: "experiment 4".
        to: String,
        /// What hangs on the robot, in words.
        load: Option<String>,
    },
    /// A joint cannot go there.
    #[error("{to}: {joint} would be commanded beyond its range")]
    BeyondRange {
        /// The joint's name.
        joint: String,
        /// Where: `test pose "milling"`.
        to: String,
    },
}

impl CampaignError {
    /// What to do about it.
    pub const HINT: &'static str = "name configurations in between as `safe_deg` of the scenario's table \
                                    [laboratory], or leave the experiment out";
}

fn with(load: Option<&str>) -> String {
    load.map_or_else(String::new, |load| format!(", under {load}"))
}

/// A plan as it is carried out.
#[derive(Debug, Clone, PartialEq)]
pub struct Campaign {
    /// Where the robot starts and ends (rad, m), if the laboratory names a safe pose.
    pub home: Option<DVector<f64>>,
    /// The stops in their order.
    pub stops: Vec<Stop>,
    /// The way home.
    pub return_way: Option<Way>,
    /// Whether moves were looked at for collisions.
    pub is_checked: bool,
    /// How long it takes (minutes).
    pub minutes: f64,
}

impl Campaign {
    /// Plans the work of a plan; in the plan's own order of experiments and loads if that is to be kept.
    ///
    /// # Errors
    /// No way is found to an experiment.
    pub fn new(
        task: &Task,
        laboratory: &Laboratory,
        plan: &Plan,
        keep_order: bool,
    ) -> Result<Self, CampaignError> {
        let stays = task.belief.loading == Loading::InPlace;
        let groups = |planner: &Planner<'_>| {
            let places = 0..plan.experiments.len();
            let (in_place, others): (Vec<usize>, Vec<usize>) =
                places.partition(|&place| stays || plan.experiments[place].direction.is_some());
            let mut groups = groups_of_loads(&task.belief, plan, &others, keep_order);
            groups.extend(planner.in_place(&in_place, keep_order));
            groups
        };
        let mut campaign = Self::in_groups(task, laboratory, plan, groups, keep_order)?;
        for stop in &mut campaign.stops {
            stop.at_gauge = AtGauge::of(&task.belief, &plan.experiments[stop.experiments[0]]);
        }
        Ok(campaign)
    }

    /// Plans the work of a plan of absolute readings, as [`new`](Self::new) does: candidates by their places, and how often each is
    /// read.
    ///
    /// # Errors
    /// No way is found to a reading.
    pub fn of_readings(
        task: &Task,
        laboratory: &Laboratory,
        (planning, plan): (&AbsolutePlanning<'_>, &[(usize, u32)]),
        keep_order: bool,
    ) -> Result<Self, CampaignError> {
        let rows = planning.readings(plan);
        let experiments = rows.iter().map(|(row, times)| row.experiment(*times));
        let made = Plan {
            experiments: experiments.collect(),
        };
        let groups = |_: &Planner<'_>| groups_of_visits(planning, plan, keep_order);
        let mut campaign = Self::in_groups(task, laboratory, &made, groups, keep_order)?;
        for stop in &mut campaign.stops {
            let target = |&index: &usize| {
                let target = planning.target(plan[index].0);
                match &rows[index].0.station {
                    Some(other) if stop.station.as_ref().is_some_and(|own| own != other) => {
                        format!("{target} from {other}")
                    }
                    _ => target.to_owned(),
                }
            };
            stop.targets = stop.experiments.iter().map(target).collect();
            let length = |&index: &usize| planning.length(plan[index].0);
            stop.lengths = stop.experiments.iter().map(length).collect();
        }
        Ok(campaign)
    }

    fn in_groups(
        task: &Task,
        laboratory: &Laboratory,
        plan: &Plan,
        groups: impl FnOnce(&Planner<'_>) -> Vec<Group>,
        keep_order: bool,
    ) -> Result<Self, CampaignError> {
        let configurations: Vec<DVector<f64>> = (plan.experiments.iter())
            .map(|each| each.configuration_rad.clone())
            .collect();
        let mut ways = Ways::new(task, &laboratory.safe_poses, &configurations);
        let mut planner = Planner {
            task,
            approach: laboratory.approach,
            blocked: blocked(&mut ways, &configurations),
            ways,
            plan,
            home: laboratory.safe_poses.first().cloned(),
        };
        let mut stops = Vec::new();
        let sides: Vec<(Side, Option<DVector<f64>>)> = (0..plan.experiments.len())
            .map(|index| planner.side(index))
            .collect();
        for group in groups(&planner) {
            let order = if keep_order {
                (0..group.members.len()).collect()
            } else if group.is_as_unloaded {
                as_unloaded(&stops, &group)
            } else {
                planner.order(stops.last(), &group)
            };
            for member in order {
                let hanging = stops.last().and_then(|last: &Stop| last.load);
                let loads = group.in_turn(hanging, keep_order).into_iter();
                for (number, load) in loads.enumerate() {
                    let of = (member, load, number > 0);
                    let mut stop = group.stop(plan, of, stops.last(), &sides);
                    stop.way = planner.way(stops.last(), &stop)?;
                    stops.push(stop);
                }
            }
        }
        let return_way = match (&planner.home, stops.last()) {
            (Some(home), Some(last)) => {
                let home = home.clone();
                planner.find(&last.configuration, &home, last.load)
            }
            _ => None,
        };
        let mut campaign = Self {
            home: planner.home,
            stops,
            return_way,
            is_checked: task.region.collision_clearance_m.is_some(),
            minutes: 0.0,
        };
        campaign.minutes = campaign.minutes_of(laboratory);
        Ok(campaign)
    }

    /// What must be looked at as it is carried out.
    pub fn conditions(&self, laboratory: &Laboratory) -> Vec<Condition> {
        let mut conditions = Vec::new();
        conditions.extend(self.stays_between_visits());
        let without: BTreeSet<usize> = (self.stops.iter())
            .filter(|stop| stop.approach.is_none() && !stop.is_in_place)
            .flat_map(|stop| stop.experiments.iter().copied())
            .collect();
        if !without.is_empty() && laboratory.approach > 0.0 {
            let without: Vec<String> = (without.iter())
                .map(|index| (index + 1).to_string())
                .collect();
            conditions.push(ConditionCode::OneSidedApproach.with(format!(
                "there is no room to approach experiment {} from one side",
                without.join(", ")
            )));
        }
        if self.home.is_some() && self.return_way.is_none() {
            let words = "no way is found back to the first safe pose";
            conditions.push(ConditionCode::NoWay.with(words));
        }
        conditions
    }

    /// How many times the instrument is set up: once, or at each station, or a gauge for each measurement.
    pub fn set_ups(&self) -> usize {
        let is_set = |stop: &&Stop| stop.changes_station || stop.sets_gauge();
        let reads_all = |stop: &Stop| stop.station.is_none() && stop.direction.is_none();
        let once = usize::from(self.stops.iter().any(reads_all));
        self.stops.iter().filter(is_set).count() + once
    }

    /// How many times a load is hung.
    pub fn load_changes(&self) -> usize {
        self.stops.iter().filter(|stop| stop.changes_load).count()
    }

    /// How often the instrument is read.
    pub fn readings(&self) -> u32 {
        self.stops.iter().map(|stop| stop.readings).sum()
    }

    /// At which stop an experiment is measured without a load for what is read under it at a stop, both as indices, and how many
    /// readings of other experiments come before its own there, where readings are no one else's.
    pub fn without_load(&self, plan: &Plan, experiment: usize, loaded: usize) -> (usize, u32) {
        let place = unloaded_stop(&self.stops, experiment, loaded);
        let others = self
            .stops
            .get(place)
            .map_or(&[][..], |stop| &stop.experiments);
        let before = others.iter().take_while(|&&other| other != experiment);
        let readings = before.map(|&other| plan.experiments[other].repeats).sum();
        (place, readings)
    }

    /// That the robot does not move between visits of one configuration, where no approach leads it away.
    fn stays_between_visits(&self) -> Option<Condition> {
        let stays = |pair: &&[Stop]| {
            let [before, stop] = [&pair[0], &pair[1]];
            let is_there = before.configuration == stop.configuration && stop.approach.is_none();
            is_there && !stop.is_in_place && !stop.changes_station && before.load == stop.load
        };
        let numbered = self.stops.windows(2).enumerate();
        let stops = numbered.filter(|(_, pair)| stays(pair));
        let stops: Vec<String> = stops.map(|(index, _)| (index + 2).to_string()).collect();
        (!stops.is_empty()).then(|| {
            ConditionCode::StaysBetweenVisits.with(format!(
                "the robot is already there at stop {}, which counts as a visit of its own",
                stops.join(", ")
            ))
        })
    }

    /// That the times between the unloaded and the loaded reading of deflections are not those for which a drift is counted.
    pub fn drifts_otherwise(&self, task: &Task, laboratory: &Laboratory) -> Option<Condition> {
        let belief = &task.belief;
        let returns = belief.loading == Loading::Returns;
        let [shortest, longest] = self
            .between_readings_min(laboratory)
            .filter(|_| returns && belief.uncertain.has_drift())?;
        let counted = laboratory.costs.between_readings_h(task.design.experiments) * 60.0;
        let is_alike = longest - shortest < DRIFTS * counted && longest < (1.0 + DRIFTS) * counted;
        (!is_alike).then(|| {
            ConditionCode::DriftIntervals.with(format!(
                "drift counts {counted:.0} min between the readings of each deflection (design.experiments = {}), and this order takes \
                 {shortest:.0} to {longest:.0} min",
                task.design.experiments
            ))
        })
    }

    /// The shortest and the longest time (min) between the unloaded and the loaded reading of deflections for which the robot returns.
    fn between_readings_min(&self, laboratory: &Laboratory) -> Option<[f64; 2]> {
        let costs = &laboratory.costs;
        let mut now = 0.0;
        let read_at = self.stops.iter().map(|stop| {
            let counts = [!stop.is_in_place, stop.changes_load].map(|is| f64::from(u8::from(is)));
            let reading = costs.work_min([0.0; 3], f64::from(stop.readings));
            now += costs.work_min([0.0, counts[0], counts[1]], 0.0) + turning_min(stop, laboratory);
            now += reading;
            now - 0.5 * reading
        });
        let read_at: Vec<f64> = read_at.collect();
        let loaded = self.stops.iter().enumerate();
        let loaded = loaded.filter(|(_, stop)| stop.load.is_some() && !stop.is_in_place);
        let between = loaded.flat_map(|(place, stop)| {
            let unloaded = move |&index: &usize| unloaded_stop(&self.stops, index, place);
            (stop.experiments.iter()).map(move |index| [unloaded(index), place])
        });
        let between = between.map(|[unloaded, loaded]| read_at[loaded] - read_at[unloaded]);
        between.fold(None, |ends: Option<[f64; 2]>, each| {
            let [low, high] = ends.unwrap_or([each; 2]);
            Some([low.min(each), high.max(each)])
        })
    }

    /// How far the joint that moves most moves, all in all (rad, m).
    pub fn travel(&self) -> f64 {
        let there = self.stops.iter().map(travel_to);
        there.sum::<f64>() + self.return_way.as_ref().map_or(0.0, |way| way.length)
    }

    /// What hangs when a stop (from 0) begins: the load of the stop before.
    pub fn load_before(&self, stop: usize) -> Option<&Load> {
        self.stops[stop.checked_sub(1)?].load.as_ref()
    }

    /// The stop at which the robot came to where a stop is, both as indices.
    pub fn came_at(&self, stop: usize) -> usize {
        let mut before = self.stops[..=stop].iter();
        before.rposition(|stop| !stop.is_in_place).unwrap_or(stop)
    }

    /// How often the robot is moved to a stop: not where a load is hung in place.
    pub fn moves(&self) -> usize {
        self.stops.iter().filter(|stop| !stop.is_in_place).count()
    }

    fn minutes_of(&self, laboratory: &Laboratory) -> f64 {
        let turning_min = self.travel() / laboratory.axis_speed_per_s / 60.0;
        let work = [self.set_ups(), self.moves(), self.load_changes()];
        let work = work.map(|count| count as f64);
        laboratory.costs.work_min(work, f64::from(self.readings())) + turning_min
    }
}

impl Costs {
    /// How long so many set-ups, stops, changes of load and readings take (minutes), without the
    /// time that joints turn.
    pub fn work_min(&self, [set_ups, stops, load_changes]: [f64; 3], readings: f64) -> f64 {
        self.station_min * set_ups
            + self.move_min * stops
            + self.load_change_min * load_changes
            + self.reading_min * readings
    }
}

/// How far the joint that moves most moves to a stop (rad, m).
fn travel_to(stop: &Stop) -> f64 {
    let start = stop.approach.as_ref();
    stop.way.length + start.map_or(0.0, |start| apart(start, &stop.configuration))
}

/// How long joints turn on the way to a stop (min).
fn turning_min(stop: &Stop, laboratory: &Laboratory) -> f64 {
    travel_to(stop) / laboratory.axis_speed_per_s / 60.0
}

/// At which stop an experiment is measured without a load for what is read under it at a stop, both as indices.
fn unloaded_stop(stops: &[Stop], experiment: usize, loaded: usize) -> usize {
    let is_of = |stop: &&Stop| stop.experiments.contains(&experiment);
    let before = stops[..loaded].iter().filter(is_of);
    let visit = before.filter(|stop| stop.load.is_some()).count();
    let numbered = stops.iter().enumerate();
    let unloaded = numbered.filter(|(_, stop)| is_of(stop) && stop.load.is_none());
    let unloaded: Vec<usize> = unloaded.map(|(place, _)| place).collect();
    let place = unloaded.get(visit).or(unloaded.first());
    place.copied().unwrap_or(0)
}

/// A group's members in the order in which they were visited without a load.
fn as_unloaded(stops: &[Stop], group: &Group) -> Vec<usize> {
    let mut order: Vec<usize> = (0..group.members.len()).collect();
    order.sort_by_key(|&member| unloaded_stop(stops, group.members[member].0[0], stops.len()));
    order
}

/// Between which configurations there is something in the straight way of the unloaded robot.
fn blocked(ways: &mut Ways<'_>, configurations: &[DVector<f64>]) -> Vec<Vec<bool>> {
    let count = configurations.len();
    let mut blocked = vec![vec![false; count]; count];
    for one in 0..count {
        for other in 0..one {
            let [from, to] = [&configurations[one], &configurations[other]];
            let is_clear =
                (ways.judge()).is_straight_clear(from.as_slice(), to.as_slice(), &[Load::NONE]);
            blocked[one][other] = !is_clear;
            blocked[other][one] = !is_clear;
        }
    }
    blocked
}

struct Planner<'a> {
    task: &'a Task,
    approach: f64,
    blocked: Vec<Vec<bool>>,
    ways: Ways<'a>,
    plan: &'a Plan,
    home: Option<DVector<f64>>,
}

impl Planner<'_> {
    /// The side from which an experiment's configuration is approached, and where the approach begins: the
    /// same for all experiments at one configuration.
    fn side(&mut self, index: usize) -> (Side, Option<DVector<f64>>) {
        let own = &self.plan.experiments[index];
        let q = &own.configuration_rad;
        let mut loads = vec![Load::NONE];
        for each in (self.plan.experiments.iter()).filter(|each| stand_alike(each, own)) {
            if !loads.contains(&each.load) {
                loads.push(each.load);
            }
        }
        let wanted = wanted_side(self.task, own.approach.as_ref());
        let judge = self.ways.judge();
        Side::free(
            self.task,
            self.approach,
            judge,
            q,
            &loads,
            wanted.as_deref(),
        )
    }

    /// Each measurement of some experiments by itself, without the load and with it, in an order of short moves.
    fn in_place(&self, places: &[usize], keep_order: bool) -> Vec<Group> {
        let experiments = &self.plan.experiments;
        let group = |load: Option<Load>, members| Group {
            is_in_place: load.is_some(),
            loads: vec![load],
            members,
            ..Group::default()
        };
        let one = |&index: &usize| (vec![index], 1);
        let all = group(None, places.iter().map(one).collect());
        let order = if keep_order {
            (0..places.len()).collect()
        } else {
            self.order(None, &all)
        };
        let order = order.into_iter().map(|place| places[place]);
        let each = order.flat_map(|index| {
            let repeats = experiments[index].repeats as usize;
            std::iter::repeat_n(index, repeats)
        });
        each.flat_map(|index| {
            [None, Some(experiments[index].load)].map(|load| group(load, vec![one(&index)]))
        })
        .collect()
    }

    /// The order of a group's members.
    fn order(&self, last: Option<&Stop>, group: &Group) -> Vec<usize> {
        let at = |member: usize| group.members[member].0[0];
        let q = |member: usize| &self.plan.experiments[at(member)].configuration_rad;
        let start = last.map(|stop| &stop.configuration).or(self.home.as_ref());
        let is_alike = last
            .is_some_and(|last| group.loads.contains(&last.load) && last.station == group.station);
        shortest(
            group.members.len(),
            &|first| match start {
                Some(start) if is_alike && start == q(first) => AGAIN,
                Some(start) => apart(start, q(first)),
                None => 0.0,
            },
            &|one, other| {
                let straight = apart(q(one), q(other));
                if self.blocked[at(one)][at(other)] {
                    DETOUR.0 + DETOUR.1 * straight
                } else {
                    straight
                }
            },
        )
    }

    /// The way to where the approach of a stop begins. A load is hung there.
    fn way(&mut self, last: Option<&Stop>, stop: &Stop) -> Result<Way, CampaignError> {
        let start = last.map(|stop| &stop.configuration).or(self.home.as_ref());
        let Some(start) = start.cloned() else {
            // The robot is brought there by hand.
            return Ok(Way::default());
        };
        if stop.is_in_place {
            return Ok(Way::default());
        }
        let hanging = if stop.changes_load {
            last.and_then(|last| last.load)
        } else {
            stop.load
        };
        let to = stop.approach.as_ref().unwrap_or(&stop.configuration);
        self.find(&start, to, hanging)
            .ok_or_else(|| CampaignError::NoWay {
                from: last.map_or_else(
                    || "from the first safe pose".to_owned(),
                    |last| format!("from experiment {}", last.experiments[0] + 1),
                ),
                to: format!("experiment {}", stop.experiments[0] + 1),
                load: hanging.as_ref().map(in_words),
            })
    }

    /// The way between two configurations without a load and with what hangs.
    fn find(
        &mut self,
        from: &DVector<f64>,
        to: &DVector<f64>,
        hanging: Option<Load>,
    ) -> Option<Way> {
        let loads: Vec<Load> = [Load::NONE].into_iter().chain(hanging).collect();
        let mut experiments = self.plan.experiments.iter();
        let number = hanging.and_then(|load| experiments.position(|each| each.load == load));
        let number = number.map_or(0, |index| index + 1);
        self.ways.find(from, to, &loads, number)
    }
}
