//! A plan of absolute readings as a record.

use serde::Serialize;

use super::messages::{LengthField, PlanRowMessage, PlannedReadingMessage};
use crate::plan::UncertaintyBudget;
use crate::plan::absolute::{AbsolutePlanning, DrawnWanted, PredictedAccuracy};
use crate::plan::search::{OfferedCandidates, PlanBound};
use crate::task::{AccuracyKind, Task};

/// How well an unknown is known afterwards.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictedUnknownMessage {
    /// Its name.
    pub name: String,
    /// What it is, in words.
    pub what: String,
    /// The station or target that it is of, for a page.
    #[serde(skip)]
    pub mounted: Option<String>,
    /// The unit of its value; "1" for a logarithm.
    pub unit: String,
    /// Its standard error; null where it is not determined by itself.
    pub standard_error: Option<f64>,
}

/// How accurate the tool is at a test pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PredictedPoseMessage {
    /// Its name.
    pub name: String,
    /// The rms distance (mm); null where it needs what is not determined.
    pub rho0_mm: Option<f64>,
}

/// The predicted accuracy of a plan of absolute readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AbsolutePlanMessage {
    /// What must be accurate: `absolute`, where the loaded tool is.
    pub accuracy: &'static str,
    /// The station in whose frame that counts; null where the candidates name none.
    pub frame: Option<String>,
    /// The number of readings.
    pub experiments: u32,
    /// The rms distance over the test poses (mm).
    pub rho0_mm: Option<f64>,
    /// What 95 % stay below (mm).
    pub quantile95_mm: Option<f64>,
    /// Of the distance, what the task's uncertain force makes by itself (mm), whatever is read.
    pub task_force_mm: f64,
    /// What `rho0_mm` is made of; null where there is none.
    pub uncertainty_budget: Option<UncertaintyBudget>,
    /// No plan of as many readings of the candidates is below (mm).
    pub lower_bound_rho0_mm: Option<f64>,
    /// What that rests on.
    pub bound_kind: Option<&'static str>,
    /// The bound over the prediction.
    pub efficiency: Option<f64>,
    /// At each test pose.
    pub test_poses: Vec<PredictedPoseMessage>,
    /// All unknowns.
    pub unknowns: Vec<PredictedUnknownMessage>,
    /// The readings.
    pub plan: Vec<PlanRowMessage>,
    /// What it was chosen from, or what it was read as.
    pub candidates: OfferedCandidates,
    /// How the candidates were drawn; null where they are a file's.
    pub drawn: Option<DrawnWanted>,
    /// What the prediction takes for certain although it is not, in words.
    pub assumed_exact: Vec<String>,
    /// What the scenario says and the prediction does not count, in words.
    pub not_counted: Vec<String>,
}

/// The rows of a plan: candidates by their places, and how often each is read.
pub fn planned_readings(
    task: &Task,
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
) -> Vec<PlanRowMessage> {
    let commands = task.belief.commands();
    let rows = planning.readings(plan).into_iter().zip(plan);
    rows.map(|((row, repeats), &(place, _))| PlanRowMessage {
        reads: Some(PlannedReadingMessage {
            target: row.target.clone(),
            station: row.station.clone(),
            length: LengthField(planning.length(place)),
        }),
        ..PlanRowMessage::new(&commands, &row.experiment(repeats))
    })
    .collect()
}

impl AbsolutePlanMessage {
    /// The record of a plan: candidates by their places, and how often each is read.
    pub fn new(
        task: &Task,
        planning: &AbsolutePlanning<'_>,
        plan: &[(usize, u32)],
        prediction: &PredictedAccuracy,
        bound: Option<&PlanBound>,
    ) -> Self {
        let unknowns = (planning.set().parameters().iter().enumerate())
            .filter(|(index, _)| !planning.is_elsewhere(*index, plan));
        let poses = task.test_poses.iter().zip(&prediction.poses_m);
        let proof = bound.and_then(|bound| bound.proof.as_ref());
        let of_bound = (proof.into_iter().flat_map(|proof| &proof.left_out))
            .map(|name| format!("{name}, by the bound alone"));
        Self {
            accuracy: AccuracyKind::Absolute.name(),
            frame: planning
                .stations()
                .get(prediction.station)
                .cloned()
                .flatten(),
            experiments: prediction.readings,
            rho0_mm: prediction.rho0_m().map(|value| value * 1e3),
            quantile95_mm: prediction.quantile95_m.map(|value| value * 1e3),
            task_force_mm: prediction.task_force_m * 1e3,
            uncertainty_budget: planning.uncertainty_budget(plan, prediction),
            lower_bound_rho0_mm: bound.map(|bound| bound.best * 1e3),
            bound_kind: bound.map(|bound| bound.kind.name()),
            efficiency: bound.and_then(|bound| Some(bound.best / prediction.rho0_m()?)),
            test_poses: poses
                .map(|(pose, rho0_m)| PredictedPoseMessage {
                    name: pose.name.clone(),
                    rho0_mm: rho0_m.map(|value| value * 1e3),
                })
                .collect(),
            unknowns: unknowns
                .map(|(index, each)| PredictedUnknownMessage {
                    name: each.name.clone(),
                    what: planning.words(index),
                    mounted: planning.mounted(index),
                    unit: each.unit().to_owned(),
                    standard_error: prediction.posterior.standard_error(index),
                })
                .collect(),
            plan: planned_readings(task, planning, plan),
            candidates: planning.offer.clone(),
            drawn: None,
            assumed_exact: planning
                .assumed_exact()
                .into_iter()
                .chain(of_bound)
                .collect(),
            not_counted: planning.not_counted(),
        }
    }
}
