//! The plans of a study, and what its runs come to.

use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use super::design::{Designed, Wanted};
use crate::codes::{Condition, ErrorCode};
use crate::experiment::{Candidate, Plan};
use crate::files::FileError;
use crate::plan::Criterion;
use crate::plan::absolute::{AbsolutePlanning, ReadingsWanted};
use crate::plan::search::{
    CandidateError, PlanSize, SearchError, Watch, measurements_in, random_plan,
};
use crate::record::messages::results;
use crate::record::robot_trials::RobotTrials;
use crate::record::study::StudyPlanMessage;
use crate::record::tally_file::{Header, PlanHeader};
use crate::scenario::Scenario;
use crate::study::runner::Runner;
use crate::study::tally::Tally;
use crate::study::{
    Conditions, Entry, Level, Setting, StudyError, StudyPlan, StudySource, TakenPlan,
};
use crate::task::{AccuracyKind, Task};

/// Designs the plan of a name for a task.
pub type Designer<'a> = &'a dyn Fn(&Task, &str, Wanted) -> Result<Designed, SearchError>;
/// Hears of the plan of a name that is designed of so many absolute readings.
pub type Watcher<'a> = &'a dyn Fn(&str, u32) -> Watch<'a>;

/// Refuses what there is in studies of deflections alone, by its key.
///
/// # Errors
/// The first such key.
pub fn refuse_others(scenario: &Scenario) -> Result<(), FileError> {
    let study = &scenario.study;
    let of_plan = |(index, plan): (usize, &StudyPlan)| {
        let (key, problem, hint) = match plan.source {
            StudySource::RandomEach => {
                let problem = "one random plan stands for all";
                ("kind", problem, "say kind = \"random\"")
            }
            StudySource::Optimal { criterion, .. } if criterion != Criterion::TestPose => {
                let problem = "plans are made for the test poses";
                ("criterion", problem, "leave the key out")
            }
            StudySource::Optimal {
                noise_only: true, ..
            } => {
                let problem = "plans are made for the whole";
                ("noise_only", problem, "leave the key out")
            }
            _ => return None,
        };
        Some((format!("study.plan[{index}].{key}"), problem, hint))
    };
    let problem = "robots are read in MuJoCo, and not by the linear model";
    let hint = "leave the key out, or set level = \"robot\"";
    let level =
        (study.level == Some(Level::Model)).then(|| ("study.level".to_owned(), problem, hint));
    let found = level.or_else(|| study.plans.iter().enumerate().find_map(of_plan));
    let Some((key, problem, hint)) =
        found.filter(|_| scenario.task.design.accuracy == AccuracyKind::Absolute)
    else {
        return Ok(());
    };
    let problem = format!("{problem}: design.accuracy is \"absolute\"");
    let wrong = FileError::new(&scenario.path, problem).at(key);
    Err(wrong.code(ErrorCode::OtherAccuracy).hint(hint))
}

/// The plans of a study, under all conditions for which whole repetitions make up the measurements.
///
/// # Errors
/// A plan cannot be designed, drawn or repeated, or is not possible.
pub fn entries<'a>(
    scenario: &Scenario,
    settings: &'a [Setting<'_>],
    wanted: &ReadingsWanted<'a>,
    (design, watch): (Designer<'_>, Watcher<'_>),
) -> anyhow::Result<Vec<Entry<'a>>> {
    let mut entries: Vec<Entry<'_>> = Vec::new();
    for (index, setting) in settings.iter().enumerate() {
        for plan in &scenario.study.plans {
            if !plan.source.fits(setting.conditions.experiments) {
                continue;
            }
            let taken = match setting.task.design.accuracy {
                AccuracyKind::Relative => {
                    let sigma_m = setting.conditions.sigma_m;
                    let known = entries.iter().find(|entry| {
                        let conditions = &settings[entry.setting].conditions;
                        let alike = Conditions {
                            sigma_m,
                            ..*conditions
                        };
                        entry.name == plan.name
                            && alike == setting.conditions
                            && !follows_sigma(&plan.source, &setting.task)
                    });
                    match known {
                        Some(entry) => entry.plan.clone(),
                        None => (deflections_of(scenario, setting, plan, design)?)
                            .map(TakenPlan::Deflections),
                    }
                }
                AccuracyKind::Absolute => {
                    let readings = readings_of(scenario.seed, setting, plan, wanted, watch);
                    let readings = readings.map_err(|error| {
                        let wrong = error.in_file(wanted.path);
                        let problem = format!("plan {:?}: {}", plan.name, wrong.problem);
                        FileError { problem, ..wrong }
                    })?;
                    Some(readings)
                }
            };
            entries.push(Entry {
                name: plan.name.clone(),
                setting: index,
                plan: taken,
                is_random: matches!(plan.source, StudySource::Random | StudySource::RandomEach),
            });
        }
    }
    Ok(entries)
}

/// Whether a plan depends on how large the instrument's noise is: it is designed, and something else counts beside it.
fn follows_sigma(source: &StudySource, task: &Task) -> bool {
    let belief = &task.belief;
    match source {
        StudySource::Optimal { noise_only, .. } => {
            belief.prior.is_some() || !(*noise_only || belief.uncertain.is_plain())
        }
        _ => false,
    }
}

/// Reads, designs or draws a plan of absolute readings, and repeats it as a whole.
fn readings_of<'a>(
    seed: u64,
    setting: &'a Setting<'_>,
    plan: &StudyPlan,
    wanted: &ReadingsWanted<'a>,
    watch: Watcher<'_>,
) -> Result<TakenPlan<'a>, CandidateError> {
    let (task, conditions, groups) = (&setting.task, &setting.conditions, wanted.groups);
    let measurements = conditions.experiments;
    let scaled = |rows: &[Candidate]| -> Vec<Candidate> {
        let scaled = |row: &Candidate| Candidate {
            load: row.load.map(|load| load.scaled(conditions.load_scale)),
            ..row.clone()
        };
        rows.iter().map(scaled).collect()
    };
    let candidates = wanted.candidates.map(scaled);
    let wanted = ReadingsWanted {
        candidates: candidates.as_deref(),
        ..*wanted
    };
    let (planning, mut found) = match &plan.source {
        StudySource::File { readings, .. } => {
            let planning = AbsolutePlanning::of_plan(task, groups, &scaled(readings))?;
            let plan = planning.whole();
            (planning, plan)
        }
        StudySource::Optimal {
            configurations,
            experiments,
            ..
        } => {
            let m = experiments.unwrap_or(measurements);
            let size = PlanSize::new(m, configurations.or(task.design.configurations));
            let watch = watch(&plan.name, m);
            let (planning, found) = wanted.design(task, size, seed, watch)?;
            (planning, found.plan)
        }
        StudySource::Random | StudySource::RandomEach => {
            // Random plans know of no station that tells more than they ask.
            let mut plannings = wanted.plannings(task, seed)?;
            let planning = plannings.swap_remove(plannings.len() - 1);
            let plan = planning.random(measurements, seed, 0)?;
            (planning, plan)
        }
    };
    let as_whole = times_as_whole(measurements_in(&found), measurements);
    for (_, times) in &mut found {
        *times *= as_whole;
    }
    Ok(TakenPlan::of_readings(found, planning, groups))
}

/// How often a plan of so many measurements is made as a whole until there are so many, which it is known to divide.
fn times_as_whole(once: u32, measurements: u32) -> u32 {
    (measurements / once.max(1)).max(1)
}

/// Reads, designs or draws a plan of deflections, and repeats it as a whole; none where every run has its own.
fn deflections_of(
    scenario: &Scenario,
    setting: &Setting<'_>,
    plan: &StudyPlan,
    design: Designer<'_>,
) -> anyhow::Result<Option<Plan>> {
    let (task, conditions) = (&setting.task, &setting.conditions);
    let wanted = conditions.experiments;
    let found = match &plan.source {
        StudySource::File { plan, .. } => {
            let mut plan = plan.clone();
            for experiment in &mut plan.experiments {
                experiment.load = experiment.load.scaled(conditions.load_scale);
            }
            plan
        }
        StudySource::Optimal {
            criterion,
            configurations,
            experiments,
            noise_only,
        } => {
            let configurations = configurations.or(task.design.configurations);
            let wanted = Wanted {
                criterion: *criterion,
                size: PlanSize::new(experiments.unwrap_or(wanted), configurations),
            };
            let mut task = task.clone();
            if *noise_only {
                let (joints, prior) = (task.belief.parameters.clone(), task.belief.prior.clone());
                task.belief = task.belief.of_compliances(joints, prior)?;
            }
            design(&task, &plan.name, wanted)?.exact.plan
        }
        StudySource::Random => random_plan(task, wanted, scenario.seed, 0)?,
        StudySource::RandomEach => return Ok(None),
    };
    Ok(Some(
        found.repeated(times_as_whole(found.measurements(), wanted)),
    ))
}

/// Tries a plan on so many virtual robots under a seed, unless the flag is set meanwhile; `progress` hears of each block.
///
/// # Errors
/// The plan predicts nothing, no robot could be looked at, or it was asked to stop.
pub fn try_plan(
    setting: &Setting<'_>,
    seed: u64,
    plan: TakenPlan<'_>,
    robots: u64,
    stop: &AtomicBool,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<RobotTrials, StudyError> {
    let entries = [Entry {
        name: "plan".to_owned(),
        setting: 0,
        plan: Some(plan),
        is_random: false,
    }];
    let settings = std::slice::from_ref(setting);
    let runner = Runner::new(settings, seed, Level::Robot, &entries)?.stopped_by(stop);
    let tallies = runner.run(robots, 0..runner.blocks(robots), 1, progress)?;
    RobotTrials::new(&runner, &tallies[0])
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
            (&plan.conditions, header.accuracy()),
            parameters,
            (tally, reference),
            (plan.account.as_ref(), plan.predicted_quantile95_m),
        );
        // Where every run has a plan of its own there is no account of what else is uncertain.
        let has_account = header.plans.iter().any(|each| each.account.is_some());
        if plan.account.is_none() && (plan.sha256.is_some() || !has_account) {
            message = message.judged_by_noise(tally.failed_share());
        }
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
    let all = json!({
        "gate": header.gate,
        "trials": header.trials,
        "level": header.level,
        "parameters": header.parameters,
        "reference": header.reference(),
        "plans": plans,
    });
    let absolute = header.absolute.as_ref().map(|absolute| {
        let (test_poses, groups) = (absolute.test_poses, &absolute.groups);
        json!({ "accuracy": AccuracyKind::Absolute.name(), "test_poses": test_poses, "groups": groups })
    });
    let timing = timing.map(|Timing { elapsed_s, runs }| json!({ "elapsed_s": elapsed_s, "runs_per_s": runs as f64 / elapsed_s }));
    let keys = [Some(all), absolute, timing].into_iter().flatten();
    results("study", &header.provenance, keys)
}
