//! `plan` and `evaluate` where the tool's place must be accurate, not its deflection alone.

use std::path::Path;
use std::sync::atomic::Ordering;

use clap::Args;
use elastocal::experiment::{Candidate, Experiment, Plan, read_candidates, write_candidates};
use elastocal::files::FileError;
use elastocal::identification::ParameterGroup;
use elastocal::plan::absolute::{AbsolutePlanError, AbsolutePlanning};
use elastocal::plan::search::{PlanBound, Watch};
use elastocal::record::absolute_plan::AbsolutePlanMessage;
use elastocal::record::json::merge;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use serde_json::json;

use super::candidates::{PoseArgs, left_out};
use super::interruption::ask_search;
use super::progress::bar;
use super::table::{number, table};
use super::views;
use super::written::Written;
use super::{Common, Report, results};

/// What is unknown where the tool's place must be accurate.
#[derive(Debug, Args)]
pub struct UnknownArgs {
    /// With design.accuracy = "absolute", what is unknown, frames of stations and targets always among it; what the scenario's
    /// robot.parameters name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    parameters: Vec<ParameterGroup>,
}

impl UnknownArgs {
    /// Refuses groups where deflections are planned.
    pub fn refuse(&self, scenario: &Scenario) -> Result<(), FileError> {
        if self.parameters.is_empty() {
            return Ok(());
        }
        let problem = "plans deflections, of which robot.parameters says what is unknown";
        let wrong = FileError::new(&scenario.path, problem).at("design.accuracy");
        Err(wrong.hint("leave out --parameters, or set accuracy = \"absolute\""))
    }
}

/// Refuses options that are about deflections alone.
pub fn refuse_options(scenario: &Scenario, given: &[(&str, bool)]) -> Result<(), FileError> {
    let Some((option, _)) = given.iter().find(|(_, is_given)| *is_given) else {
        return Ok(());
    };
    let problem = format!("is \"absolute\", and {option} is for plans of deflections");
    let wrong = FileError::new(&scenario.path, problem).at("design.accuracy");
    Err(wrong.hint(format!(
        "leave out {option}, or set accuracy = \"relative\""
    )))
}

/// What is written of a plan besides its record.
#[derive(Clone, Copy)]
pub struct AbsoluteOutputs<'a> {
    pub plan: Option<&'a Path>,
    pub stills: Option<&'a Path>,
}

/// A plan of absolute readings that is wanted.
pub struct AbsoluteWanted<'a> {
    pub common: &'a Common,
    pub scenario: &'a Scenario,
    pub unknown: &'a UnknownArgs,
    pub candidates: Option<&'a Path>,
    pub poses: &'a PoseArgs,
}

/// Why there is none, with the file that it is about.
fn explained(path: &Path, error: &AbsolutePlanError) -> FileError {
    let wrong = FileError::new(path, error.to_string());
    match error.hint() {
        Some(hint) => wrong.hint(hint),
        None => wrong,
    }
}

impl AbsoluteWanted<'_> {
    fn read(&self, path: &Path) -> Result<Vec<Candidate>, FileError> {
        read_candidates(path, self.scenario.task.belief.commands())
    }

    fn planning(&self, path: &Path, rows: &[Candidate]) -> Result<AbsolutePlanning<'_>, FileError> {
        AbsolutePlanning::new(&self.scenario.task, &self.unknown.parameters, rows)
            .map_err(|error| explained(path, &error))
    }

    fn of_plan(&self, path: &Path, rows: &[Candidate]) -> Result<AbsolutePlanning<'_>, FileError> {
        AbsolutePlanning::of_plan(&self.scenario.task, &self.unknown.parameters, rows)
            .map_err(|error| explained(path, &error))
    }

    /// Designs a plan of candidates.
    pub fn design(
        &self,
        [experiments, configurations]: [u32; 2],
        outputs: AbsoluteOutputs<'_>,
    ) -> anyhow::Result<Report> {
        let Some(path) = self.candidates else {
            let problem = "is \"absolute\", and such plans are chosen from candidates";
            let wrong = FileError::new(&self.scenario.path, problem).at("design.accuracy");
            return Err(wrong
                .hint("give --candidates FILE: joint angles, and where they are to be chosen, targets and stations")
                .into());
        };
        let planning = self.planning(path, &self.read(path)?)?;
        self.common.say(&format!(
            "designing a plan of {} among {}",
            counted(experiments.into(), "absolute reading"),
            counted(planning.candidates.len() as u64, "candidate")
        ));
        let bar = bar(self.common.quiet, "searching the plan");
        let progress = |done: usize, all: usize, _: f64| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        };
        let stop = ask_search();
        let watch = Watch {
            stop,
            progress: &progress,
        };
        let found = planning
            .design([experiments, configurations], self.scenario.seed, watch)
            .map_err(|error| explained(path, &error))?;
        bar.finish_and_clear();
        let mut report = self.report("plan", path, &planning, &found.plan, found.bound.as_ref())?;
        let [searches, agreeing] = found.searches;
        merge(
            &mut report.json,
            json!({ "searches": searches, "searches_agreeing": agreeing }),
        );
        report.text +=
            &format!("Of {searches} searches for the plan, {agreeing} ended within 0.1 % of it.\n");
        if stop.load(Ordering::Relaxed) {
            let condition = "the search was stopped: a better plan may exist";
            report.conditions.push(condition.to_owned());
        }
        let mut written = Written::default();
        report.text += &self.write(&planning, &found.plan, outputs, &mut written);
        report.conditions.extend(written.conditions());
        Ok(report)
    }

    /// Writes a plan and its pictures where that is wanted, and tells of it.
    fn write(
        &self,
        planning: &AbsolutePlanning<'_>,
        plan: &[(usize, u32)],
        outputs: AbsoluteOutputs<'_>,
        written: &mut Written,
    ) -> String {
        let mut text = String::new();
        let chosen = || {
            plan.iter()
                .map(|&(place, repeats)| (&planning.candidates[place], repeats))
        };
        if let Some(path) = outputs.plan {
            let rows: Vec<Candidate> = chosen()
                .map(|(candidate, repeats)| Candidate {
                    most: Some(repeats),
                    ..candidate.clone()
                })
                .collect();
            let rows = write_candidates(path, self.scenario.task.belief.commands(), &rows);
            text += &written.told(path, rows);
        }
        if let Some(path) = outputs.stills {
            let experiments = chosen().map(|(candidate, repeats)| Experiment {
                configuration_rad: candidate.configuration_rad.clone(),
                load: candidate.load.unwrap_or(Load::NONE),
                repeats,
                approach: candidate.approach.clone(),
            });
            let plan = Plan {
                experiments: experiments.collect(),
            };
            text += &written.told(path, views::write_stills(path, self.scenario, &plan));
        }
        text
    }

    /// Says what a plan promises, and how near it is to the best of the candidates, where there are some.
    pub fn evaluate(&self, plan: &Path) -> anyhow::Result<Report> {
        let rows = self.read(plan)?;
        let planning = self.of_plan(plan, &rows)?;
        if !planning.left_out.is_empty() {
            let reasons: Vec<String> = planning.left_out.iter().map(ToString::to_string).collect();
            let problem = format!("readings that are not possible: {}", reasons.join("; "));
            return Err(FileError::new(plan, problem).into());
        }
        let all: Vec<(usize, u32)> = (planning.candidates.iter().enumerate())
            .map(|(place, each)| (place, each.most.unwrap_or(1)))
            .collect();
        let bound = match self.candidates {
            None => None,
            Some(path) => {
                let among = self.planning(path, &self.read(path)?)?;
                let chosen = places_among(&among, &planning.candidates)
                    .map_err(|problem| FileError::new(plan, problem))?;
                among
                    .bound(&chosen)
                    .map_err(|error| explained(path, &error))?
            }
        };
        self.report("evaluate", plan, &planning, &all, bound.as_ref())
    }

    fn report(
        &self,
        command: &str,
        path: &Path,
        planning: &AbsolutePlanning<'_>,
        plan: &[(usize, u32)],
        bound: Option<&PlanBound>,
    ) -> anyhow::Result<Report> {
        let task = &self.scenario.task;
        let promise = planning.promise(plan);
        let message = AbsolutePlanMessage::new(task, planning, plan, &promise, bound);
        let role = if command == "plan" {
            "candidates"
        } else {
            "plan"
        };
        let mut provenance = ProvenanceMessage::new(self.scenario).with_input(role, path)?;
        provenance = self.poses.of(provenance)?;
        if let Some(candidates) = self.candidates {
            provenance = provenance.with_input("candidates", candidates)?;
        }
        let mut json = results(command, &provenance, json!({ "gate": self.scenario.gate }));
        merge(&mut json, serde_json::to_value(&message)?);
        let conditions = (promise.left.as_ref().err())
            .map(|names| {
                let names = names.join(", ");
                format!(
                    "the plan does not determine the tool's place at the test poses, which depends on {names}"
                )
            })
            .into_iter()
            .collect();
        let offered = counted(planning.offered as u64, "candidate");
        let left = planning.offered - planning.candidates.len();
        Ok(Report {
            json,
            text: describe(&message) + &left_out(&offered, left, &planning.left_out),
            conditions,
        })
    }
}

/// The readings of a plan as candidates by their places, and how often each is read; or why it is no plan of them.
fn places_among(
    among: &AbsolutePlanning<'_>,
    rows: &[Candidate],
) -> Result<Vec<(usize, u32)>, String> {
    let mut plan: Vec<(usize, u32)> = Vec::new();
    for row in rows {
        let line = row.line;
        let Some(place) = among.candidates.iter().position(|each| is_same(each, row)) else {
            return Err(format!(
                "line {line}: this reading is none of the candidates"
            ));
        };
        let times = row.most.unwrap_or(1);
        match plan.iter_mut().find(|known| known.0 == place) {
            Some(known) => known.1 += times,
            None => plan.push((place, times)),
        }
    }
    for &(place, times) in &plan {
        let candidate = &among.candidates[place];
        if let Some(most) = candidate.most.filter(|most| *most < times) {
            let line = candidate.line;
            return Err(format!(
                "the candidate of line {line} is read {times} times, and may be {most} times"
            ));
        }
    }
    Ok(plan)
}

/// Whether a row of a plan is a candidate; a thousandth of an arc second is nothing.
fn is_same(candidate: &Candidate, row: &Candidate) -> bool {
    const SAME_RAD: f64 = 5e-9;
    let apart = &candidate.configuration_rad - &row.configuration_rad;
    let wrench = |row: &Candidate| row.load.unwrap_or(Load::NONE).wrench();
    apart.amax() <= SAME_RAD
        && wrench(candidate) == wrench(row)
        && (&candidate.target, &candidate.station, &candidate.approach)
            == (&row.target, &row.station, &row.approach)
}

fn describe(message: &AbsolutePlanMessage) -> String {
    let frame = message.frame.as_ref().map_or_else(
        || "the instrument's frame".to_owned(),
        |station| format!("the frame of station {station:?}"),
    );
    let mut text = format!(
        "{}: rho0 = {} mm in {frame}",
        counted(message.experiments.into(), "absolute reading"),
        number(message.rho0_mm, 5)
    );
    if let (Some(bound), Some(efficiency)) = (message.lower_bound_rho0_mm, message.efficiency) {
        text += &format!(
            "; no plan of as many candidates is below {bound:.5} mm (efficiency {efficiency:.4}), proved by looking at all"
        );
    }
    text.push('\n');
    if let Some(quantile) = message.quantile95_mm {
        text += &format!("95 % stay below {quantile:.5} mm\n");
    }
    text += "An absolute accuracy: where the loaded tool is, with frames, geometry and elasticity as far as they are unknown.\n";
    if message.task_force_mm > 0.0 {
        text += &format!(
            "Of it, {:.5} mm are what the task's force is uncertain by, whatever is read\n",
            message.task_force_mm
        );
    }
    for certain in &message.taken_for_certain {
        text += &format!("Taken for certain: {certain}\n");
    }
    if message.test_poses.len() > 1 {
        let rows: Vec<Vec<String>> = (message.test_poses.iter())
            .map(|pose| vec![pose.name.clone(), number(pose.rho0_mm, 5)])
            .collect();
        text += &format!("\n{}", table(&["test pose", "rho0 [mm]"], &rows));
    }
    let rows: Vec<Vec<String>> = (message.unknowns.iter())
        .map(|each| {
            let error = each.standard_error;
            let error = error.map_or_else(|| "-".to_owned(), |error| format!("{error:.3e}"));
            vec![each.name.clone(), error, each.unit.clone()]
        })
        .collect();
    text += &format!(
        "\n{}\n",
        table(&["unknown", "standard error", "unit"], &rows)
    );
    text
}
