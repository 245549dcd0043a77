//! The plans of a study, and what its runs come to.

use serde_json::{Value, json};
use thiserror::Error;

use super::design::{Designed, Wanted};
use crate::codes::Condition;
use crate::experiment::Plan;
use crate::plan::search::{SearchError, random_plan};
use crate::record::json::{merge, results};
use crate::record::study::StudyPlanMessage;
use crate::record::tally_file::{Header, PlanHeader};
use crate::scenario::Scenario;
use crate::study::tally::Tally;
use crate::study::{Conditions, Entry, EntryKind, Setting, StudyPlan, StudySource, repeated};
use crate::task::{AccuracyKind, Task};

/// Why a plan of a study is none.
#[derive(Debug, Error)]
pub enum EntryError {
    /// No plan was found.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// Whole repetitions do not make up the measurements.
    #[error("{found} measurements do not make up {wanted} by whole repetitions")]
    Repetitions {
        /// The plan's number of measurements.
        found: u32,
        /// The study's.
        wanted: u32,
    },
}

/// Designs the plan of a name for a task.
pub type Designer<'a> = &'a dyn Fn(&Task, &str, Wanted) -> Result<Designed, SearchError>;

/// The plans of a study, under all conditions for which whole repetitions make up the measurements.
///
/// # Errors
/// A plan cannot be designed, drawn or repeated.
pub fn entries(
    scenario: &Scenario,
    settings: &[Setting<'_>],
    design: Designer<'_>,
) -> Result<Vec<Entry>, EntryError> {
    let mut entries: Vec<Entry> = Vec::new();
    for (index, setting) in settings.iter().enumerate() {
        for plan in &scenario.study.plans {
            if !plan.source.fits(setting.conditions.experiments) {
                continue;
            }
            // Sigma changes no plan.
            let known = entries.iter().find(|entry| {
                let conditions = &settings[entry.setting].conditions;
                let sigma_m = setting.conditions.sigma_m;
                entry.name == plan.name
                    && Conditions {
                        sigma_m,
                        ..*conditions
                    } == setting.conditions
            });
            let kind = match known {
                Some(entry) => entry.kind.clone(),
                None => entry_kind(scenario.seed, setting, plan, design)?,
            };
            entries.push(Entry {
                name: plan.name.clone(),
                setting: index,
                kind,
            });
        }
    }
    Ok(entries)
}

/// Reads, designs or draws a plan, and repeats it as a whole.
fn entry_kind(
    seed: u64,
    setting: &Setting<'_>,
    plan: &StudyPlan,
    design: Designer<'_>,
) -> Result<EntryKind, EntryError> {
    let (task, conditions) = (&setting.task, &setting.conditions);
    let wanted = conditions.experiments;
    let whole = |plan: &Plan| {
        let found = plan.measurements();
        repeated(plan, wanted).ok_or(EntryError::Repetitions { found, wanted })
    };
    Ok(match &plan.source {
        StudySource::File { plan, .. } => {
            let mut plan = whole(plan)?;
            for experiment in &mut plan.experiments {
                experiment.load = experiment.load.scaled(conditions.load_scale);
            }
            EntryKind::Fixed(plan)
        }
        StudySource::Optimal {
            criterion,
            configurations,
            experiments,
            noise_only,
        } => {
            let wanted = Wanted {
                criterion: *criterion,
                experiments: experiments.unwrap_or(wanted),
                configurations: *configurations,
            };
            let mut task = task.clone();
            if *noise_only {
                task.belief.uncertain = None;
            }
            EntryKind::Fixed(whole(&design(&task, &plan.name, wanted)?.exact.plan)?)
        }
        StudySource::Random => EntryKind::Random(random_plan(task, wanted, seed, 0)?),
        StudySource::RandomEach => EntryKind::RandomEach,
    })
}

/// What is wrong with the loads of a study's plan files.
pub fn foreign_loads(scenario: &Scenario) -> impl Iterator<Item = Condition> {
    let wrong = |plan: &StudyPlan| match &plan.source {
        StudySource::File { plan: file, .. } => {
            scenario.task.loads.outside_plan(file, Some(&plan.name))
        }
        _ => None,
    };
    scenario.study.plans.iter().filter_map(wrong)
}

/// What the tallies say of each plan.
pub fn plan_messages(header: &Header, tallies: &[Tally]) -> Vec<StudyPlanMessage> {
    let parameters = header.parameters.len();
    let message = |(plan, tally): (&PlanHeader, &Tally)| {
        let reference = plan.reference.and_then(|other| tallies.get(other));
        let mut message = StudyPlanMessage::new(
            &plan.name,
            &plan.conditions,
            parameters,
            (tally, reference),
            (plan.account.as_ref(), plan.predicted_quantile95_m),
        );
        if header.absolute.is_some() {
            // What is left at several test poses is one robot's: its squares are not independent.
            message.nees_z = None;
        }
        message
    };
    header.plans.iter().zip(tallies).map(message).collect()
}

/// How long how many runs took.
#[derive(Debug, Clone, Copy)]
pub struct Timing {
    /// The time (s).
    pub elapsed_s: f64,
    /// The runs of each plan.
    pub runs: u64,
}

/// study.json.
pub fn study_json(header: &Header, plans: &[StudyPlanMessage], timing: Option<Timing>) -> Value {
    let reference = header.plans.iter().find_map(|plan| plan.reference);
    let json = json!({
        "gate": header.gate,
        "trials": header.trials,
        "level": header.level,
        "parameters": header.parameters,
        "reference": reference.map(|index| &header.plans[index].name),
        "plans": plans,
    });
    let mut json = results("study", &header.provenance, json);
    if let Some(absolute) = &header.absolute {
        let accuracy = AccuracyKind::Absolute.name();
        let (test_poses, groups) = (absolute.test_poses, &absolute.groups);
        merge(
            &mut json,
            json!({ "accuracy": accuracy, "test_poses": test_poses, "groups": groups }),
        );
    }
    if let Some(timing) = timing {
        let runs_per_s = timing.runs as f64 / timing.elapsed_s;
        let timing = json!({ "elapsed_s": timing.elapsed_s, "runs_per_s": runs_per_s });
        merge(&mut json, timing);
    }
    json
}
