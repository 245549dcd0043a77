//! Plans by the minutes that they take, in place of the number of measurements: repeats are cheap, changes are
//! not.

use super::{Campaign, Laboratory};
use crate::experiment::Loads;
use crate::plan::Criterion;
use crate::plan::Plan;
use crate::plan::search::{Problem, SearchError, Watch, approximate_design, exact_design};
use crate::task::Task;

/// Searches for each number of configurations: fewer than for a single plan.
const SEARCHES: usize = 24;
/// The most configurations that are tried.
const CONFIGURATIONS: u32 = 20;
/// So many more configurations in turn that gain nothing end the search.
const PATIENCE: u32 = 3;
/// More readings than these are not planned at one time.
const MEASUREMENTS: u32 = 500;

/// A plan with its promise and its time.
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

/// How many loads so many configurations need at most.
const fn loads_of(loads: &Loads, configurations: u32) -> usize {
    let configurations = configurations as usize;
    match loads {
        Loads::Fixed(_) => 1,
        Loads::List(list) if list.len() < configurations => list.len(),
        Loads::Direction { .. } | Loads::Any { .. } | Loads::List(_) => configurations,
    }
}

/// The minutes that so many measurements in so many configurations take at most, without the time that joints
/// turn: two stops for each configuration, and two readings for each measurement.
#[must_use]
pub fn work_minutes(
    loads: &Loads,
    laboratory: &Laboratory,
    experiments: u32,
    configurations: u32,
) -> f64 {
    let stops = 2 * configurations as usize;
    let changes = loads_of(loads, configurations);
    (laboratory.costs).work_min(stops, changes, 2 * experiments)
}

/// The best plans that take at most so many minutes, one for each number of configurations; the best first.
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
    let mut problem = Problem::new(task, Criterion::TestPose);
    problem.effort.searches = SEARCHES;
    let approximate = approximate_design(&problem, seed)?;
    let mandatory = task.design.mandatory.measurements();
    let fewest = u32::try_from(problem.parameters().div_ceil(3).max(1)).unwrap_or(u32::MAX);
    let mut plans: Vec<TimedPlan> = Vec::new();
    let mut idle = 0;
    for configurations in fewest.max(1)..=CONFIGURATIONS {
        let best = plans
            .iter()
            .fold(f64::INFINITY, |best, plan| best.min(plan.rho0_m));
        let mut room = minutes;
        // Ways take time, too: what they take is known when there is a plan.
        let found = (0..3).find_map(|_| {
            let experiments = most(&task.loads, laboratory, room, configurations)?;
            if experiments < mandatory {
                return None;
            }
            let sizes = [experiments, configurations];
            match exact_design(&problem, &approximate, sizes[0], sizes[1], seed, watch) {
                Ok(design) => {
                    let campaign = Campaign::new(task, laboratory, &design.plan, false).ok()?;
                    if campaign.minutes > minutes {
                        room -= campaign.minutes - minutes;
                        return None;
                    }
                    Some(Ok(TimedPlan {
                        plan: design.plan,
                        experiments,
                        configurations,
                        rho0_m: design.cost.sqrt(),
                        minutes: campaign.minutes,
                    }))
                }
                Err(SearchError::Singular { .. }) => None,
                Err(error) => Some(Err(error)),
            }
        });
        match found.transpose()? {
            Some(plan) => {
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
    plans.sort_by(|one, other| one.rho0_m.total_cmp(&other.rho0_m));
    Ok(plans)
}

/// The most measurements in so many configurations that so many minutes allow.
fn most(loads: &Loads, laboratory: &Laboratory, minutes: f64, configurations: u32) -> Option<u32> {
    let least = work_minutes(loads, laboratory, configurations, configurations);
    if least > minutes {
        return None;
    }
    let each = work_minutes(loads, laboratory, configurations + 1, configurations) - least;
    let more = if each > 0.0 {
        ((minutes - least) / each).min(f64::from(MEASUREMENTS))
    } else {
        f64::from(MEASUREMENTS)
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between zero and a bound"
    )]
    let more = more as u32;
    Some(configurations + more)
}
