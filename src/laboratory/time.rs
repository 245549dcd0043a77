//! Plans by the minutes that they take, in place of the number of measurements: repeats are cheap, changes are
//! not.

use std::collections::BTreeSet;

use super::{Campaign, Laboratory};
use crate::experiment::{Loads, Plan};
use crate::parameter::Unloaded;
use crate::plan::search::{PlanSearch, PlanSize, Problem, SearchError, Watch};
use crate::plan::{Criterion, posterior, rho0_m};
use crate::robot::ReadsAlong;
use crate::task::{Loading, Task};

/// Searches for each number of configurations: fewer than for a single plan.
const SEARCHES: usize = 24;
/// The most configurations that are tried.
const CONFIGURATIONS: u32 = 20;
/// So often a plan is searched for one number of configurations, until its time is full.
const TRIES: usize = 3;
/// So many more configurations in turn that gain nothing end the search.
const PATIENCE: u32 = 3;
/// More readings than these are not planned at one time.
const MEASUREMENTS: u32 = 500;

/// A plan with its prediction and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedPlan {
    /// The plan.
    pub plan: Plan,
    /// The number m of measurements.
    pub experiments: u32,
    /// The number of different configurations.
    pub configurations: u32,
    /// The predicted rms distance at the test poses (m).
    pub rho0_m: f64,
    /// The minutes that it takes, ways included.
    pub minutes: f64,
}

/// How often the instrument is read where a gauge reads such a share of the measurements: with and without the load for each, or without
/// it once in each configuration where all its measurements share that.
fn readings(task: &Task, size: PlanSize, along: f64) -> f64 {
    let [measurements, configurations] = [size.measurements, size.configurations].map(f64::from);
    let others = 1.0 - along;
    let without_load = match (task.belief.loading, task.belief.instrument.unloaded) {
        (Loading::Returns, Unloaded::Shared) => others * configurations + along * measurements,
        _ => measurements,
    };
    measurements + without_load
}

/// How often the robot stands somewhere, without a load and with one, for so many measurements in so many configurations.
fn stands(task: &Task, measurements: f64, configurations: f64) -> f64 {
    match (
        task.belief.repeats_are_visits(),
        task.belief.instrument.unloaded,
    ) {
        (false, _) => 2.0 * configurations,
        (true, Unloaded::Own) => 2.0 * measurements,
        (true, Unloaded::Shared) => configurations + measurements,
    }
}

/// The minutes that measurements take at most, without the time that joints turn: stops without and with a load, and the readings; a
/// load is hung in place for each of those whose share is given, and a gauge is set for each that it reads.
fn work_minutes(task: &Task, laboratory: &Laboratory, size: PlanSize, along: f64) -> f64 {
    let costs = &laboratory.costs;
    let [measurements, configurations] = [size.measurements, size.configurations].map(f64::from);
    let by_gauge = along * measurements;
    let others = measurements - by_gauge;
    let stops = (1.0 - along) * configurations;
    let changes = match &task.loads {
        Loads::Fixed(_) => 1.0,
        Loads::List(list) => (list.len() as f64).min(stops),
        Loads::Direction { .. } | Loads::Any { .. } => stops,
    };
    let work = match task.belief.loading {
        _ if others == 0.0 => [0.0; 3],
        Loading::InPlace => [1.0, others, others],
        Loading::Returns => [1.0, stands(task, others, stops), changes],
    };
    costs.work_min([by_gauge; 3], 0.0) + costs.work_min(work, readings(task, size, along))
}

/// The share of a plan's measurements that a gauge reads.
fn share_along(plan: &Plan) -> f64 {
    let along = (plan.experiments.iter()).filter(|each| each.direction.is_some());
    let along: u32 = along.map(|each| each.repeats).sum();
    f64::from(along) / f64::from(plan.measurements().max(1))
}

/// The minutes that a plan of deflections of such a size takes at least: under one load, with nothing in the way and nowhere to turn. Experiments
/// under two loads may share their configuration.
pub fn least_minutes(task: &Task, laboratory: &Laboratory, size: PlanSize) -> f64 {
    let always_returns = task.belief.loading == Loading::Returns
        && task.belief.instrument.reads_along() == ReadsAlong::Never;
    let stops = if always_returns && task.belief.repeats_are_visits() {
        // Without a load there may be one configuration.
        stands(task, f64::from(size.measurements), 1.0)
    } else {
        f64::from(size.configurations + 1)
    };
    (laboratory.costs).work_min([1.0, stops, 1.0], readings(task, size, 0.0))
}

/// Of some plans, each with the minutes that it takes at least, the one that takes the least time with all its ways, and the minutes;
/// those between whose experiments no way is found are left out.
pub fn quickest<T>(
    plans: impl Iterator<Item = (f64, T)>,
    minutes: impl Fn(&T) -> Option<f64>,
) -> Option<(f64, T)> {
    let mut plans: Vec<(f64, T)> = plans.collect();
    plans.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut best: Option<(f64, T)> = None;
    for (at_least, plan) in plans {
        let is_below = |minutes: f64| best.as_ref().is_none_or(|(least, _)| minutes < *least);
        if !is_below(at_least) {
            break;
        }
        if let Some(minutes) = minutes(&plan).filter(|minutes| is_below(*minutes)) {
            best = Some((minutes, plan));
        }
    }
    best
}

/// The best plans that take at most so many minutes with all their ways, one for each number of configurations; the
/// best first. Where a gauge stands beside a tracker, those of the tracker alone among them: what a search gives the gauge to read may
/// take longer than there is time for.
///
/// # Errors
/// No plan is possible, or none in that time.
pub fn plans_within(
    task: &Task,
    laboratory: &Laboratory,
    minutes: f64,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Vec<TimedPlan>, SearchError> {
    let mut plans = plans_of(task, laboratory, minutes, seed, watch)?;
    if let Some(by_tracker) = task.by_tracker_alone() {
        // It may not determine by itself what is asked for.
        let others = plans_of(&by_tracker, laboratory, minutes, seed, watch);
        plans.extend(others.unwrap_or_default());
    }
    plans.sort_by(|one, other| one.rho0_m.total_cmp(&other.rho0_m));
    let mut known = BTreeSet::new();
    plans.retain(|plan| known.insert(plan.configurations));
    Ok(plans)
}

/// The same of what a task's instruments may read, in any order.
fn plans_of(
    task: &Task,
    laboratory: &Laboratory,
    minutes: f64,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Vec<TimedPlan>, SearchError> {
    let mut problem = Problem::new(task, Criterion::TestPose);
    problem.effort.searches = SEARCHES;
    let fewest = problem.fewest();
    let mut search = TimeSearch {
        plans: PlanSearch::new(problem, seed)?,
        laboratory,
        minutes,
    };
    let mut plans: Vec<TimedPlan> = Vec::new();
    // What the ways of the plan before took for each configuration, and how much of it a gauge read: all, or no one knows yet.
    let is_gauge = task.belief.instrument.reads_along() == ReadsAlong::Always;
    let (mut way_min, mut along) = (0.0, f64::from(u8::from(is_gauge)));
    let mut idle = 0;
    for configurations in fewest..=CONFIGURATIONS {
        let best = (plans.iter()).fold(f64::INFINITY, |best, plan| best.min(plan.rho0_m));
        let expected = (way_min * f64::from(configurations), along);
        match search.plan(configurations, expected, watch)? {
            Some((plan, ways_min)) => {
                way_min = ways_min / f64::from(configurations);
                along = share_along(&plan.plan);
                idle = if plan.rho0_m < best { 0 } else { idle + 1 };
                plans.push(plan);
            }
            None if !plans.is_empty() => idle += 1,
            None => {}
        }
        if idle >= PATIENCE {
            break;
        }
    }
    Ok(plans.into_iter().map(|plan| search.filled(plan)).collect())
}

/// What plans of a time are searched with.
struct TimeSearch<'a> {
    plans: PlanSearch<'a>,
    laboratory: &'a Laboratory,
    minutes: f64,
}

impl TimeSearch<'_> {
    /// The same plan with what there is time left for: repeats, each time of the experiment that leaves least.
    fn filled(&self, mut timed: TimedPlan) -> TimedPlan {
        let task = self.plans.problem.task;
        let again = |plan: &Plan, index: usize| {
            let mut plan = plan.clone();
            plan.experiments[index].repeats += 1;
            let rho0_m = rho0_m(task, &posterior(&task.belief, &plan))?;
            Some((rho0_m, plan))
        };
        while timed.experiments < MEASUREMENTS {
            let all = 0..timed.plan.experiments.len();
            let mut better: Vec<(f64, Plan)> =
                all.filter_map(|index| again(&timed.plan, index)).collect();
            better.retain(|(rho0_m, _)| *rho0_m < timed.rho0_m);
            better.sort_by(|one, other| one.0.total_cmp(&other.0));
            let in_time = better.into_iter().find_map(|(rho0_m, plan)| {
                let campaign = Campaign::new(task, self.laboratory, &plan, false).ok()?;
                (campaign.minutes <= self.minutes).then_some((rho0_m, campaign.minutes, plan))
            });
            let Some((rho0_m, minutes, plan)) = in_time else {
                break;
            };
            timed = TimedPlan {
                experiments: timed.experiments + 1,
                configurations: timed.configurations,
                plan,
                rho0_m,
                minutes,
            };
        }
        timed
    }

    /// The plan of as many measurements in so many configurations as there is time for, where the ways take so many
    /// minutes and a gauge reads such a share of them, as is expected; with the minutes that the ways do take.
    fn plan(
        &mut self,
        configurations: u32,
        (expected_min, expected_along): (f64, f64),
        watch: Watch<'_>,
    ) -> Result<Option<(TimedPlan, f64)>, SearchError> {
        let (task, laboratory, minutes) = (self.plans.problem.task, self.laboratory, self.minutes);
        let fits = |ways_min: f64, along: f64| {
            let count = most(
                (task, laboratory),
                minutes - ways_min,
                configurations,
                along,
            );
            count.filter(|count| *count >= task.design.mandatory.measurements())
        };
        // Work and ways may take less than is expected: the fewest measurements are tried where the least work leaves time for them.
        let fewest = configurations.max(task.design.mandatory.measurements());
        let least = PlanSize {
            measurements: fewest,
            configurations,
        };
        let mut are_fewest_left = least_minutes(task, laboratory, least) <= minutes;
        let (mut found, mut ways_min, mut along) = (None, expected_min, expected_along);
        let (mut made, mut too_many) = (fewest - 1, MEASUREMENTS + 1);
        // The ways are known when there is a plan, and hardly depend on how often each experiment is measured.
        for _ in 0..TRIES {
            let wanted = match fits(ways_min, along) {
                Some(experiments) => experiments,
                None if found.is_some() => made,
                None if are_fewest_left => fewest,
                None => break,
            };
            // What a gauge reads, and so how long all takes, may change with the number: between too many and those that there are.
            let experiments = if (made + 1..too_many).contains(&wanted) {
                wanted
            } else {
                u32::midpoint(made, too_many)
            };
            if experiments <= made {
                break;
            }
            are_fewest_left &= experiments > fewest;
            let size = PlanSize {
                measurements: experiments,
                configurations,
            };
            let plan = match self.plans.best(size, watch, &[]) {
                Ok(design) => design.plan,
                Err(SearchError::Singular { .. }) => break,
                Err(error) => return Err(error),
            };
            let Ok(campaign) = Campaign::new(task, laboratory, &plan, false) else {
                break;
            };
            along = share_along(&plan);
            ways_min = campaign.minutes - work_minutes(task, laboratory, size, along);
            if campaign.minutes <= minutes {
                let timed = TimedPlan {
                    rho0_m: rho0_m(task, &posterior(&task.belief, &plan)).unwrap_or(f64::INFINITY),
                    plan,
                    experiments,
                    configurations,
                    minutes: campaign.minutes,
                };
                (found, made) = (Some((timed, ways_min)), experiments);
                if fits(ways_min, along).is_none_or(|more| more <= experiments) {
                    break;
                }
            } else {
                too_many = experiments;
            }
        }
        Ok(found)
    }
}

/// The most measurements in so many configurations that so many minutes allow, where a gauge reads such a share of them.
fn most(
    (task, laboratory): (&Task, &Laboratory),
    minutes: f64,
    configurations: u32,
    along: f64,
) -> Option<u32> {
    let work = |measurements| {
        let size = PlanSize {
            measurements,
            configurations,
        };
        work_minutes(task, laboratory, size, along)
    };
    let least = work(configurations);
    if least > minutes {
        return None;
    }
    let each = work(configurations + 1) - least;
    // All that are planned at one time, where a reading takes none.
    let more = if each > 0.0 {
        (minutes - least) / each
    } else {
        f64::INFINITY
    };
    let more = more.min(f64::from(MEASUREMENTS));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between zero and a bound"
    )]
    let more = more as u32;
    Some(configurations + more)
}
