//! What to measure next, after some of a plan is measured.

use nalgebra::DVector;

use crate::compensation::{predicted_error, test_pose_matrix};
use crate::experiment::{Experiment, Plan};
use crate::identification::Identification;
use crate::measurement::Measurement;
use crate::plan::search::{
    Bound, ExactDesign, Problem, SearchError, Watch, approximate_design, exact_design,
};
use crate::plan::{Criterion, posterior};
use crate::posterior::NotDetermined;
use crate::posterior::Posterior;
use crate::task::{Forbidden, Task};

/// The plan that measurements have carried out: experiments in the order of their first measurement.
#[must_use]
pub fn measured_plan(measurements: &[Measurement]) -> Plan {
    let mut plan = Plan::default();
    for each in measurements {
        let same = plan.experiments.iter_mut().find(|known| {
            known.configuration_rad == each.configuration_rad && known.load == each.load
        });
        match same {
            Some(known) => known.repeats += 1,
            None => plan.experiments.push(Experiment {
                configuration_rad: each.configuration_rad.clone(),
                load: each.load,
                repeats: 1,
            }),
        }
    }
    plan
}

/// The task that is left: the robot as it was identified, what is measured as mandatory, and without what
/// has turned out impossible, as far around it as given (rad).
#[must_use]
pub fn task_left(
    task: &Task,
    identification: &Identification,
    measured: Plan,
    impossible: &[DVector<f64>],
    within_rad: f64,
) -> Task {
    let mut left = task.clone();
    (left.belief.nominal.compliance_rad_per_nm).clone_from(&identification.compliance_rad_per_nm);
    left.design.mandatory = measured;
    left.design.configurations = None;
    left.region
        .forbidden
        .extend(impossible.iter().map(|configuration_rad| Forbidden {
            configuration_rad: configuration_rad.clone(),
            within_rad,
        }));
    left
}

/// The rms distance that compensation leaves over a task's test poses (m), by what is known.
///
/// # Errors
/// A test pose depends on what is not determined.
pub fn accuracy(task: &Task, posterior: &Posterior) -> Result<f64, NotDetermined> {
    let mut sum = 0.0;
    for pose in &task.test_poses {
        let matrix = test_pose_matrix(&task.belief, pose, &task.belief.parameters);
        sum += pose.weight * predicted_error(&matrix, posterior)?.powi(2);
    }
    Ok(sum.sqrt())
}

/// What is known after a plan, whatever is read.
#[must_use]
pub fn after(task: &Task, plan: &Plan) -> Posterior {
    posterior(&task.belief, plan)
}

/// How many measurements a campaign is to have in all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// So many.
    Measurements(u32),
    /// As few as give this accuracy (m), but no more than so many.
    Accuracy(f64, u32),
}

/// The rest of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// What is measured and what is to be measured.
    pub design: ExactDesign,
    /// What is to be measured.
    pub plan: Plan,
    /// The accuracy that both promise (m).
    pub rho0_m: f64,
    /// No rest of as many measurements promises a smaller one (m), as far as is known.
    pub bound_m: Option<f64>,
    /// Whether the goal is reached.
    pub is_reached: bool,
}

/// Plans the rest of a campaign; the task is what is left, see [`task_left`].
///
/// # Errors
/// No plan is possible.
pub fn rest(task: &Task, goal: Goal, seed: u64, watch: Watch<'_>) -> Result<Rest, SearchError> {
    let measured = task.design.mandatory.measurements();
    let (first, last) = match goal {
        Goal::Measurements(count) => (count, count),
        Goal::Accuracy(_, most) => (measured + 1, most.max(measured + 1)),
    };
    let mut result = None;
    for total in first..=last {
        let mut task = task.clone();
        task.design.experiments = total;
        match planned(&task, total, seed, watch) {
            Ok(mut rest) => {
                rest.is_reached = match goal {
                    Goal::Measurements(_) => true,
                    Goal::Accuracy(wanted_m, _) => rest.rho0_m <= wanted_m,
                };
                let is_reached = rest.is_reached;
                result = Some(Ok(rest));
                if is_reached {
                    break;
                }
            }
            // More measurements may do.
            Err(error @ SearchError::Singular { .. }) => result = result.or(Some(Err(error))),
            Err(error) => return Err(error),
        }
        if watch.stop.load(std::sync::atomic::Ordering::Relaxed) {
            break;
        }
    }
    result.unwrap_or(Err(SearchError::Singular {
        experiments: measured,
        parameters: task.belief.parameters.len(),
    }))
}

fn planned(task: &Task, total: u32, seed: u64, watch: Watch<'_>) -> Result<Rest, SearchError> {
    let problem = Problem::new(task, Criterion::TestPose);
    let approximate = approximate_design(&problem, seed)?;
    let design = exact_design(&problem, &approximate, total, total, seed, watch)?;
    let bound = Bound::new(task, &approximate);
    let mandatory = task.design.mandatory.experiments.len();
    Ok(Rest {
        plan: Plan {
            experiments: design.plan.experiments[mandatory..].to_vec(),
        },
        rho0_m: design.cost.sqrt(),
        bound_m: bound.of_size(total).ok().map(|bound| bound.best),
        design,
        is_reached: false,
    })
}
