//! The plans of a study of absolute readings.

use std::path::Path;

use thiserror::Error;

use crate::codes::ErrorCode;
use crate::experiment::Candidate;
use crate::files::FileError;
use crate::identification::ParameterGroup;
use crate::plan::Criterion;
use crate::plan::absolute::{AbsolutePlanError, AbsolutePlanning, DrawnWanted};
use crate::plan::search::Watch;
use crate::scenario::Scenario;
use crate::study::absolute::AbsoluteEntry;
use crate::study::{Level, StudySource};

/// What plans of a study of absolute readings are made of.
#[derive(Debug, Clone, Copy)]
pub struct AbsoluteStudyWanted<'a> {
    /// What is unknown besides what the scenario names.
    pub groups: &'a [ParameterGroup],
    /// What plans are chosen from, where there is a list.
    pub candidates: Option<&'a [Candidate]>,
    /// How many configurations are drawn where there is none.
    pub configurations: u32,
}

/// A plan of a study is none.
#[derive(Debug, Error)]
#[error("plan {plan:?}: {error}")]
pub struct AbsoluteEntryError {
    /// The plan's name.
    pub plan: String,
    /// Why it is none.
    pub error: Box<AbsolutePlanError>,
}

/// Refuses what there is in studies of deflections alone, by its key.
///
/// # Errors
/// The first such key.
pub fn check(scenario: &Scenario) -> Result<(), FileError> {
    let study = &scenario.study;
    let wrong = |key: &str, problem: &str, hint: &str| {
        let problem = format!("{problem}: design.accuracy is \"absolute\"");
        Err(FileError::new(&scenario.path, problem)
            .at(key.to_owned())
            .code(ErrorCode::OtherAccuracy)
            .hint(hint.to_owned()))
    };
    if study.level == Some(Level::Model) {
        return wrong(
            "study.level",
            "robots are read in MuJoCo, and not by the linear model",
            "leave the key out, or set level = \"robot\"",
        );
    }
    if study.conditions.len() > 1 {
        let hint = "leave the table out, and make a study for each";
        return wrong("study.sweep", "nothing is swept", hint);
    }
    for (index, plan) in study.plans.iter().enumerate() {
        let key = |name: &str| format!("study.plan[{index}].{name}");
        match plan.source {
            StudySource::RandomEach => {
                let problem = "one random plan stands for all";
                return wrong(&key("kind"), problem, "say kind = \"random\"");
            }
            StudySource::Optimal { criterion, .. } if criterion != Criterion::TestPose => {
                let problem = "plans are made for the test poses";
                return wrong(&key("criterion"), problem, "leave the key out");
            }
            StudySource::Optimal {
                noise_only: true, ..
            } => {
                let problem = "plans are made for the whole";
                return wrong(&key("noise_only"), problem, "leave the key out");
            }
            _ => {}
        }
    }
    Ok(())
}

/// The plans of a study, each with as many readings as it has; `watch` is told of each by its name.
///
/// # Errors
/// A plan cannot be designed or drawn, or is not possible.
pub fn entries<'a, 'w>(
    scenario: &'a Scenario,
    wanted: &AbsoluteStudyWanted<'_>,
    watch: &dyn Fn(&str, u32) -> Watch<'w>,
) -> Result<Vec<AbsoluteEntry<'a>>, AbsoluteEntryError> {
    let measurements = (scenario.study.conditions.first())
        .map_or(scenario.task.design.experiments, |each| each.experiments);
    let entry = |name: &str, source: &StudySource| {
        let task = &scenario.task;
        let watch = |m: u32| watch(name, m);
        let drawn = DrawnWanted {
            configurations: wanted.configurations,
            seed: scenario.seed,
        };
        let (planning, plan) = match source {
            StudySource::File { readings, .. } => {
                let planning = AbsolutePlanning::of_plan(task, wanted.groups, readings)?;
                let plan = planning.whole();
                (planning, plan)
            }
            StudySource::Optimal {
                configurations,
                experiments,
                ..
            } => {
                let m = experiments.unwrap_or(measurements);
                let sizes = [m, configurations.unwrap_or(m)];
                if let Some(rows) = wanted.candidates {
                    let planning = AbsolutePlanning::new(task, wanted.groups, rows)?;
                    let found = planning.design(sizes, scenario.seed, watch(m))?;
                    (planning, found.plan)
                } else {
                    let (planning, found) = AbsolutePlanning::design_anywhere(
                        task,
                        wanted.groups,
                        drawn,
                        sizes,
                        watch(m),
                    )?;
                    (planning, found.plan)
                }
            }
            StudySource::Random | StudySource::RandomEach => {
                let planning = match wanted.candidates {
                    Some(rows) => AbsolutePlanning::new(task, wanted.groups, rows)?,
                    None => AbsolutePlanning::anywhere(task, wanted.groups, drawn)?,
                };
                let plan = planning.random(measurements, scenario.seed)?;
                (planning, plan)
            }
        };
        Ok(AbsoluteEntry {
            name: name.to_owned(),
            plan: repeated(plan, measurements),
            planning,
            is_random: matches!(source, StudySource::Random | StudySource::RandomEach),
        })
    };
    (scenario.study.plans.iter())
        .map(|plan| {
            entry(&plan.name, &plan.source).map_err(|error| AbsoluteEntryError {
                plan: plan.name.clone(),
                error: Box::new(error),
            })
        })
        .collect()
}

/// A plan repeated as a whole until it has so many readings, which it is known to divide.
fn repeated(plan: Vec<(usize, u32)>, readings: u32) -> Vec<(usize, u32)> {
    let once: u32 = plan.iter().map(|(_, times)| times).sum();
    let times = readings / once.max(1);
    plan.into_iter()
        .map(|(place, each)| (place, each * times.max(1)))
        .collect()
}

/// Names the file that a plan's error is about.
pub fn explained(path: &Path, wrong: &AbsoluteEntryError) -> FileError {
    let error = FileError::new(path, wrong.to_string()).code(ErrorCode::AbsolutePlan);
    match wrong.error.hint() {
        Some(hint) => error.hint(hint),
        None => error,
    }
}
