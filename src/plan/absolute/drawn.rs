//! Plans without a list of candidates: at configurations that are sampled from the task's region, and at others near those that
//! are chosen.
//!
//! What comes of it is evidence, and no proof: the region has more configurations than are looked at.

use std::collections::BTreeSet;
use std::iter::repeat_n;
use std::path::Path;
use std::sync::atomic::Ordering;

use nalgebra::DVector;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::from_rows::merged;
use super::lengths::in_range;
use super::readable::from_stations;
use super::{AbsolutePlan, AbsolutePlanning, CandidateError};
use crate::experiment::Candidate;
use crate::identification::ParameterGroup;
use crate::measurement::AbsoluteReading;
use crate::numeric::random::generator;
use crate::numeric::random::streams::{drawn_candidates, random_readings};
use crate::observation::LengthKind;
use crate::plan::Criterion;
use crate::plan::search::{
    BoundKind, CandidatePlan, PlanBound, PlanSize, Problem, RandomPlans, Watch, measure,
};
use crate::robot::Load;
use crate::task::{Loading, Station, Task, station_named};

/// After the first search, so many more, each nearer to the plan that was best: the standard deviation of each joint's step, as a share
/// of its range.
const STEPS: [f64; 5] = [0.06, 0.03, 0.015, 0.008, 0.004];
/// All these steps again, at most so often, as long as they make a plan better by this share.
const CYCLES: usize = 6;
const WORTHWHILE: f64 = 0.005;
/// Searches in each round: rounds better what one leaves.
const SEARCHES: usize = 3;
/// So many configurations are tried near each that is chosen.
const NEAR: usize = 12;

/// Where functions tie readings, so many rounds of each step,
const TIED_ROUNDS: usize = 2;
/// first near no more test poses than so many.
const MOST_POSES: usize = 4;
/// The numbers of the first rounds near test poses, and of those that mix angles.
const POSES: u64 = 100;
const MIXED: u64 = 200;

/// So many random plans are tried for one that tells the tool's place.
const RANDOM_PLANS: usize = 200;

/// How configurations are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct DrawnWanted {
    /// So many configurations at random from the scenario's region, and then others near those that were chosen.
    pub configurations: u32,
    /// Under this seed.
    pub seed: u64,
}

/// What plans of absolute readings are made of.
#[derive(Debug, Clone, Copy)]
pub struct ReadingsWanted<'a> {
    /// What is unknown besides what the scenario names.
    pub groups: &'a [ParameterGroup],
    /// What is read already.
    pub measured: &'a [AbsoluteReading],
    /// What plans are chosen from, where there is a list.
    pub candidates: Option<&'a [Candidate]>,
    /// The file of that list, or else the scenario.
    pub path: &'a Path,
    /// How many configurations are drawn where there is no list.
    pub configurations: u32,
}

impl ReadingsWanted<'_> {
    /// How configurations are drawn under a seed, where there is no list.
    pub fn drawn(&self, seed: u64) -> Option<DrawnWanted> {
        let configurations = self.configurations;
        (self.candidates.is_none()).then_some(DrawnWanted {
            configurations,
            seed,
        })
    }

    /// What may be read: the rows of the list, or what is drawn under a seed: each configuration without and with a load, of the
    /// calibration and of the machining tool, from each station.
    ///
    /// # Errors
    /// No configuration is possible; and see [`CandidateError`].
    pub fn planning<'t>(
        &self,
        task: &'t Task,
        seed: u64,
    ) -> Result<AbsolutePlanning<'t>, CandidateError> {
        let rows = match self.candidates {
            Some(rows) => merged(rows),
            None => sampled_candidates(task, self.configurations, seed)?,
        };
        self.of_rows(task, &rows)
    }

    /// The same of any rows.
    pub(super) fn of_rows<'t>(
        &self,
        task: &'t Task,
        rows: &[Candidate],
    ) -> Result<AbsolutePlanning<'t>, CandidateError> {
        AbsolutePlanning::of_rows(task, self.groups, self.measured, rows)
    }

    /// The best plan that is found of so many readings, of so many different candidates.
    ///
    /// # Errors
    /// No configuration is possible; and see [`CandidateError`].
    pub fn design<'t>(
        &self,
        task: &'t Task,
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<(AbsolutePlanning<'t>, AbsolutePlan), CandidateError> {
        let plannings = self.plannings(task, seed)?;
        let (planning, mut placed) = Self::best_of(plannings, watch, |planning, here| {
            let found = self.design_from(planning, (&[], CYCLES), size, seed, here)?;
            self.placed(planning, vec![found])
        })?;
        Ok((planning, placed.remove(0)))
    }

    /// The same of what may be read, and no worse than a plan that is known: rows, and how often each is read. Where configurations are
    /// drawn, others near those that are chosen may be read, too, in so many cycles of steps, and there is no bound yet.
    pub(super) fn design_from(
        &self,
        planning: &AbsolutePlanning<'_>,
        (known, cycles): (&[(Candidate, u32)], usize),
        size: PlanSize,
        seed: u64,
        watch: Watch<'_>,
    ) -> Result<PlanOfRows, CandidateError> {
        if self.candidates.is_some() {
            let known: Vec<CandidatePlan> = planning.plan_of(known).into_iter().collect();
            let found = planning.design_from(&known, size, seed, watch)?;
            return Ok(PlanOfRows::new(planning, found));
        }
        let of_rows = |rows: &[Candidate]| self.of_rows(planning.task, rows);
        let rounds = Rounds {
            size,
            seed,
            again: if planning.ties_all() { TIED_ROUNDS } else { 1 },
            cycles,
            watch,
        };
        let offered = planning.offered();
        let near = near_test_poses(planning.task, offered, seed);
        let first = rounds.search(&of_rows(&merged(&[offered, &near].concat()))?, None, 0);
        let rows: Vec<Candidate> = known.iter().map(|(row, _)| row.clone()).collect();
        let known = of_rows(&rows).ok().and_then(|own| {
            let found = AbsolutePlan {
                plan: own.plan_of(known)?,
                bound: None,
                searches: [0; 2],
            };
            Some(PlanOfRows::new(&own, found)).filter(|known| known.rho0_m.is_finite())
        });
        if known.is_none() {
            return Ok(rounds.bettered(first?, planning, of_rows));
        }
        // One that is worse so far may end better.
        let starts = first.into_iter().chain(known).enumerate();
        let ends = starts.map(|(number, start)| {
            watch.part(number, 2, |watch| {
                Rounds { watch, ..rounds }.bettered(start, planning, of_rows)
            })
        });
        let best = ends.min_by(|one, other| one.rho0_m.total_cmp(&other.rho0_m));
        best.ok_or_else(CandidateError::undetermined)
    }

    /// Plans by the places of what they read. Where configurations are drawn, that may be read besides from then on, and no plan of as
    /// many readings of all of it is below their bounds.
    ///
    /// # Errors
    /// They do not determine the tool's place.
    pub(super) fn placed(
        &self,
        planning: &mut AbsolutePlanning<'_>,
        found: Vec<PlanOfRows>,
    ) -> Result<Vec<AbsolutePlan>, CandidateError> {
        if self.candidates.is_some() || found.is_empty() {
            return Ok(found.into_iter().map(|each| each.found).collect());
        }
        let chosen = found.iter().flat_map(|each| &each.rows);
        let rows = planning.offered().iter().chain(chosen.map(|(row, _)| row));
        let rows: Vec<Candidate> = rows.cloned().collect();
        *planning = AbsolutePlanning {
            offer: planning.offer.clone(),
            ..self.of_rows(planning.task, &rows)?
        };
        let placed = found.into_iter().map(|each| {
            // Those that were chosen are possible.
            let plan = planning.plan_of(&each.rows).unwrap_or_default();
            // All that were sampled are looked at, and there are others.
            let bound = planning.bound(&plan)?.map(|all| PlanBound {
                kind: BoundKind::Evidence,
                proof: None,
                ..all
            });
            let searches = each.found.searches;
            Ok(AbsolutePlan {
                plan,
                bound,
                searches,
            })
        });
        placed.collect()
    }
}

/// A plan, and what it predicts.
pub(super) struct PlanOfRows {
    found: AbsolutePlan,
    /// What it reads, and how often each.
    pub rows: Vec<(Candidate, u32)>,
    /// Infinite where it does not determine the tool's place, or the frame of a station that it reads from.
    pub rho0_m: f64,
}

impl PlanOfRows {
    fn new(planning: &AbsolutePlanning<'_>, found: AbsolutePlan) -> Self {
        let rows = planning.readings(&found.plan).into_iter();
        let rho0_m = planning.prediction(&found.plan).rho0_m();
        let is_fitted = planning.unplaced_stations(&found.plan).is_empty();
        Self {
            rows: rows.map(|(row, times)| (row.clone(), times)).collect(),
            rho0_m: rho0_m.filter(|_| is_fitted).unwrap_or(f64::INFINITY),
            found,
        }
    }
}

/// Searches of which each goes on from the last.
#[derive(Clone, Copy)]
struct Rounds<'a> {
    size: PlanSize,
    seed: u64,
    /// How often each step is tried,
    again: usize,
    /// and all of them, at most.
    cycles: usize,
    watch: Watch<'a>,
}

impl Rounds<'_> {
    /// The best plan of what may be read; where functions tie readings, gone on from a plan that is known.
    fn search(
        &self,
        own: &AbsolutePlanning<'_>,
        known: Option<&PlanOfRows>,
        round: usize,
    ) -> Result<PlanOfRows, CandidateError> {
        let known = known.filter(|_| own.ties_all());
        let known = known.and_then(|known| own.plan_of(&known.rows));
        let searches = if known.is_some() { 0 } else { SEARCHES };
        let rounds = self.cycles * self.again * STEPS.len() + 1;
        let found = self.watch.part(round, rounds, |here| {
            own.design_by(searches, known.as_slice(), self.size, self.seed, here)
        })?;
        Ok(PlanOfRows::new(own, found))
    }

    /// The best plan, when others near what it reads may be read, too, in steps that get smaller.
    fn bettered<'t>(
        &self,
        mut best: PlanOfRows,
        planning: &AbsolutePlanning<'t>,
        of_rows: impl Fn(&[Candidate]) -> Result<AbsolutePlanning<'t>, CandidateError>,
    ) -> PlanOfRows {
        let task = planning.task;
        let steps = STEPS.iter().flat_map(|step| repeat_n(*step, self.again));
        let (cycle, mut before) = (self.again * STEPS.len(), f64::INFINITY);
        for (round, step) in (1..=self.cycles * cycle).zip(steps.cycle()) {
            if round % cycle == 1 {
                if best.rho0_m > before * (1.0 - WORTHWHILE) {
                    break;
                }
                before = best.rho0_m;
            }
            if self.watch.stop.load(Ordering::Relaxed) {
                break;
            }
            let number = round as u64;
            let chosen: Vec<Candidate> = best.rows.iter().map(|(row, _)| row.clone()).collect();
            let mut rows = near(task, &chosen, step, self.seed, number);
            if planning.ties_all() {
                rows.extend(mixed(
                    task,
                    &best.rows,
                    planning.offered(),
                    self.seed,
                    number,
                ));
                rows = merged(&rows);
            }
            let searched = of_rows(&rows).and_then(|local| self.search(&local, Some(&best), round));
            best = match searched {
                Ok(searched) if searched.rho0_m < best.rho0_m => searched,
                _ => best,
            };
        }
        best
    }
}

impl AbsolutePlanning<'_> {
    /// What may be chosen: candidates that are not measured.
    pub(super) fn offered(&self) -> &[Candidate] {
        &self.candidates[..self.candidates.len() - self.measured.len()]
    }

    /// A plan of rows, each so often, if there are some and all are candidates.
    fn plan_of(&self, rows: &[(Candidate, u32)]) -> Option<CandidatePlan> {
        let mut plan = CandidatePlan::new();
        for (row, times) in rows {
            let place = self.candidates.iter().position(|each| each == row)?;
            measure(&mut plan, place, *times);
        }
        Some(plan).filter(|plan| !plan.is_empty())
    }

    /// The median of the rms distances (m) that so many random plans predict, sampled on all threads.
    ///
    /// # Errors
    /// One of them determines nothing.
    pub fn median_random_rho0_m(
        &self,
        readings: u32,
        plans: u64,
        seed: u64,
    ) -> Result<f64, CandidateError> {
        let rho0_m = |index: u64| {
            let plan = self.random(readings, seed, index)?;
            Ok(self.prediction(&plan).rho0_m().unwrap_or(f64::INFINITY))
        };
        let predicted = (0..plans).into_par_iter().map(rho0_m);
        let mut predicted = predicted.collect::<Result<Vec<f64>, CandidateError>>()?;
        predicted.sort_by(f64::total_cmp);
        Ok(predicted[predicted.len() / 2])
    }

    /// A plan of so many readings as nobody thought of it, by its number: all from one station, which is drawn as the readings are,
    /// among them one of the machining tool; the first that tells the tool's place.
    ///
    /// # Errors
    /// None of those that are drawn does.
    pub fn random(
        &self,
        readings: u32,
        seed: u64,
        index: u64,
    ) -> Result<CandidatePlan, CandidateError> {
        let mut random = generator(seed, random_readings(index));
        let frames = self.frames();
        let machining = &self.case.belief.machining_tool.name;
        if self.unread().is_some() {
            let problem = format!("no candidate reads {machining}, whose place counts");
            let hint = format!("give candidates with the target {machining}");
            return Err(CandidateError::new(problem, Some(&hint)));
        }
        for _ in 0..RANDOM_PLANS {
            let station = frames[random.random_range(0..frames.len())];
            let mut places = self.places();
            places.retain(|&place| self.station_of(place) == station);
            let mut plan = CandidatePlan::new();
            let mut drawn = 0;
            while drawn < readings && !places.is_empty() {
                let place = places[random.random_range(0..places.len())];
                if plan.contains(&(place, self.most(place))) {
                    places.retain(|&each| each != place);
                    continue;
                }
                measure(&mut plan, place, 1);
                drawn += 1;
            }
            let reads = |&(place, _): &(usize, u32)| {
                self.case.targets[self.case.observations[place].setup.target] == *machining
            };
            if drawn == readings && plan.iter().any(reads) && self.prediction(&plan).left.is_ok() {
                return Ok(plan);
            }
        }
        let problem = format!(
            "of {RANDOM_PLANS} sampled plans of {readings} readings, none determines the tool's place at the test poses"
        );
        let hint = "give more readings (study.experiments)";
        Err(CandidateError::new(problem, Some(hint)))
    }
}

/// What may be read at sampled configurations.
fn sampled_candidates(
    task: &Task,
    configurations: u32,
    seed: u64,
) -> Result<Vec<Candidate>, CandidateError> {
    // Stations have a sight of their own, which candidates are held to.
    let mut anywhere = task.clone();
    anywhere.region.line_of_sight &= task.belief.stations.is_empty();
    let stream = drawn_candidates(0);
    let problem = Problem::new(&anywhere, Criterion::TestPose);
    let experiments = RandomPlans::new(&problem)
        .draw_of(configurations, seed, stream)
        .map_err(|error| {
            CandidateError::new(format!("no candidates could be sampled: {error}"), None)
        })?
        .experiments;
    let rows = experiments.iter().enumerate();
    let rows =
        rows.map(|(index, each)| rows_at(task, &each.configuration_rad, each.load, index + 1));
    Ok(rows.flatten().collect())
}

/// What may be read at a configuration (rad), without and with a load.
fn rows_at(task: &Task, q: &DVector<f64>, load: Load, line: usize) -> Vec<Candidate> {
    let belief = &task.belief;
    let carried = belief.calibration_tool.joints;
    let mut targets = vec![&belief.calibration_tool, &belief.machining_tool];
    targets.dedup_by(|one, other| one.name == other.name);
    // Lengths have a range, and each station its own configurations.
    let stations: Vec<Option<&Station>> = if belief.stations.iter().any(|each| each.reads.is_some())
    {
        belief.stations.iter().map(Some).collect()
    } else {
        vec![None]
    };
    let mut rows = Vec::new();
    for target in targets {
        for station in &stations {
            // A load acts at the calibration tool, and no further.
            let length = station.and_then(|station| station.reads);
            let is_loaded = target.joints <= carried && length.is_none_or(LengthKind::bears_load);
            let loads = [Some(Load::NONE), is_loaded.then_some(load)];
            rows.extend(loads.into_iter().flatten().map(|load| Candidate {
                line,
                configuration_rad: in_range(task, target, *station, q.clone()),
                load: Some(load),
                most: None,
                target: Some(target.name.clone()),
                station: station.map(|station| station.name.clone()),
                approach: None,
            }));
        }
    }
    rows
}

/// What may be read near test poses from the stations of candidates, under the load of one of them.
fn near_test_poses(task: &Task, offered: &[Candidate], seed: u64) -> Vec<Candidate> {
    let loads = offered.iter().filter_map(|row| row.load);
    let load = loads.max_by(|one, other| one.force_n.norm().total_cmp(&other.force_n.norm()));
    let load = load.unwrap_or(Load::NONE);
    let apart = task.test_poses.len().div_ceil(MOST_POSES);
    let poses = task.test_poses.iter().step_by(apart);
    let at: Vec<Candidate> = poses
        .flat_map(|pose| rows_at(task, &pose.configuration_rad, load, 0))
        .collect();
    let rounds = (POSES..).zip(STEPS.iter().chain(&STEPS));
    let rows: Vec<Candidate> = rounds
        .flat_map(|(round, step)| near(task, &at, *step, seed, round))
        .collect();
    let stations: BTreeSet<&Option<String>> = offered.iter().map(|row| &row.station).collect();
    let mut rows = from_stations(task, &rows).unwrap_or(rows);
    rows.retain(|row| stations.contains(&row.station));
    rows
}

/// Some candidates, and others near each: a step of each joint by a share of its range.
fn near(task: &Task, best: &[Candidate], step: f64, seed: u64, round: u64) -> Vec<Candidate> {
    let mut random = generator(seed, drawn_candidates(round));
    let ranges = &task.region.joint_range_rad;
    let mut all = best.to_vec();
    let stays = task.belief.loading == Loading::InPlace;
    for row in best {
        // Where loads are hung in place, all that hang anywhere may be read there, too.
        let is_like = |other: &&Candidate| {
            stays && (&other.target, &other.station) == (&row.target, &row.station)
        };
        let mut loads = vec![row.load];
        loads.extend(best.iter().filter(is_like).map(|other| other.load));
        loads.extend(stays.then_some(Some(Load::NONE)));
        loads.sort_by_key(|load| load.map(|load| load.bits()));
        loads.dedup();
        let under = |load| Candidate {
            load,
            ..row.clone()
        };
        let here: Vec<Candidate> = loads.into_iter().map(under).collect();
        for other in &here {
            if !all.contains(other) {
                all.push(other.clone());
            }
        }
        for _ in 0..NEAR {
            // One joint at a time as often as all together.
            let alone = (random.random::<f64>() < 0.5)
                .then(|| random.random_range(0..row.configuration_rad.len()));
            let moved = row.configuration_rad.iter().zip(ranges).enumerate();
            let moved: Vec<f64> = moved
                .map(|(joint, (angle, [low, high]))| {
                    let normal: f64 = StandardNormal.sample(&mut random);
                    if alone.is_some_and(|alone| alone != joint) {
                        return *angle;
                    }
                    (angle + step * (high - low) * normal).clamp(*low, *high)
                })
                .collect();
            let q = DVector::from_vec(moved);
            all.extend(here.iter().map(|row| self::moved(task, row, q.clone())));
        }
    }
    all
}

/// A candidate at another configuration (rad).
fn moved(task: &Task, row: &Candidate, q: DVector<f64>) -> Candidate {
    let belief = &task.belief;
    let station = station_named(&belief.stations, row.station.as_deref());
    let is_machining = row.target.as_ref() == Some(&belief.machining_tool.name);
    let target = if is_machining {
        &belief.machining_tool
    } else {
        &belief.calibration_tool
    };
    Candidate {
        configuration_rad: in_range(task, target, station, q),
        ..row.clone()
    }
}

/// Candidates that have angles of each other, or of a test pose: at equal angles a joint's function is the same. Half of them are read as
/// another is that is offered.
fn mixed(
    task: &Task,
    best: &[(Candidate, u32)],
    offered: &[Candidate],
    seed: u64,
    round: u64,
) -> Vec<Candidate> {
    let mut random = generator(seed, drawn_candidates(MIXED + round));
    let poses = task.test_poses.iter().map(|pose| &pose.configuration_rad);
    let chosen = best.iter().map(|(row, _)| &row.configuration_rad);
    let angles: Vec<&DVector<f64>> = chosen.chain(poses).collect();
    let mut all = Vec::new();
    for (row, _) in best {
        for _ in 0..NEAR {
            let mut q = row.configuration_rad.clone();
            let other = angles[random.random_range(0..angles.len())];
            // One joint, some, or all.
            let share = [0.0, 0.5, 1.0][random.random_range(0..3)];
            let alone = random.random_range(0..q.len());
            for (joint, angle) in q.iter_mut().enumerate() {
                if joint == alone || random.random::<f64>() < share {
                    *angle = other[joint];
                }
            }
            let is_another = random.random::<bool>();
            let like = if is_another {
                &offered[random.random_range(0..offered.len())]
            } else {
                row
            };
            all.push(moved(task, like, q));
        }
    }
    all
}
