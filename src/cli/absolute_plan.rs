//! `plan` and `evaluate` where the tool's place must be accurate, not its deflection alone.

use std::path::Path;
use std::sync::atomic::Ordering;

use clap::Args;
use elastocal::codes::{Condition, ConditionCode, ErrorCode};
use elastocal::experiment::{Candidate, read_candidates, write_candidates};
use elastocal::files::{FileError, output::write_whole};
use elastocal::identification::ParameterGroup;
use elastocal::parameter::ParameterKind;
use elastocal::plan::absolute::{
    AbsolutePlanError, AbsolutePlanning, DrawnWanted, PredictedAccuracy,
};
use elastocal::plan::search::{PlanBound, Watch};
use elastocal::record::absolute_plan::{AbsolutePlanMessage, DrawnMessage};
use elastocal::record::absolute_trials::{AbsoluteTrialsMessage, as_study};
use elastocal::record::study::StudyPlanMessage;
use elastocal::record::{candidates::CandidatesMessage, json::merge, messages::ProvenanceMessage};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::study::absolute::{AbsoluteEntry, AbsoluteRunner, AbsoluteTrials, TrialError};
use elastocal::study::{StudyError, account::Account, verdict::Kept};
use elastocal::text::wording::counted;
use elastocal::view::report::{AbsolutePageRecord, absolute_page};
use elastocal::view::stills;
use serde_json::json;

use super::candidates::{PoseArgs, left_out};
use super::conditions::{search_stopped, undetermined_by_plan};
use super::interruption::{Interrupted, STOP, ask_search};
use super::progress::{bar, show};
use super::static_compliance::add_static_compliance;
use super::table::{number, or_dash, table};
use super::uncertainty_budget::{self, BudgetArgs};
use super::views::command_line;
use super::written::Written;
use super::{Common, Report, results};

/// Where there is a page about a plan of deflections.
pub const RUN_REPORTS: &str = "`run` writes a page about plans of deflections";

/// Which accuracy it is.
pub const ABSOLUTE: &str = "An absolute accuracy: where the loaded tool is, with frames, geometry and elasticity as far as they are unknown.";

/// What is unknown where the tool's place must be accurate.
#[derive(Debug, Args)]
pub struct UnknownArgs {
    /// With design.accuracy = "absolute", what is unknown, frames of stations and targets always among it; what the scenario's
    /// robot.parameters name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    pub parameters: Vec<ParameterGroup>,
}

/// What a scenario's accuracy has none of.
fn other_accuracy(scenario: &Scenario, problem: impl Into<String>) -> FileError {
    let wrong = FileError::new(&scenario.path, problem).at("design.accuracy");
    wrong.code(ErrorCode::OtherAccuracy)
}

impl UnknownArgs {
    /// Refuses groups where deflections are planned.
    pub fn refuse(&self, scenario: &Scenario) -> Result<(), FileError> {
        if self.parameters.is_empty() {
            return Ok(());
        }
        let problem = "plans deflections, of which robot.parameters says what is unknown";
        let hint = "leave out --parameters, or set accuracy = \"absolute\"";
        Err(other_accuracy(scenario, problem).hint(hint))
    }
}

/// Refuses options that are about deflections alone.
pub fn refuse_options(scenario: &Scenario, given: &[(&str, bool)]) -> Result<(), FileError> {
    let Some((option, _)) = given.iter().find(|(_, is_given)| *is_given) else {
        return Ok(());
    };
    let problem = format!("is \"absolute\", and {option} is for plans of deflections");
    let hint = format!("leave out {option}, or set accuracy = \"relative\"");
    Err(other_accuracy(scenario, problem).hint(hint))
}

/// Refuses options that are about absolute readings alone, each with what is there instead.
pub fn refuse_where_relative(
    scenario: &Scenario,
    given: &[(&str, bool, &str)],
) -> Result<(), FileError> {
    let Some((option, _, instead)) = given.iter().find(|(_, is_given, _)| *is_given) else {
        return Ok(());
    };
    let problem = format!("is \"relative\", and {option} is for plans of absolute readings");
    Err(other_accuracy(scenario, problem).hint(format!("leave out {option}: {instead}")))
}

/// What is written of a plan besides its record.
#[derive(Clone, Copy)]
pub struct AbsoluteOutputs<'a> {
    pub plan: Option<&'a Path>,
    pub stills: Option<&'a Path>,
    pub report: Option<&'a Path>,
}

/// What is asked of a plan besides its predicted accuracy: robots to try it on, a page, the static compliance at the test poses.
#[derive(Clone, Copy)]
pub struct EvaluatedAlso<'a> {
    pub robots: Option<u64>,
    pub page: Option<&'a Path>,
    pub static_compliance: bool,
}

/// A plan of absolute readings that is wanted.
pub struct AbsoluteWanted<'a> {
    pub common: &'a Common,
    pub scenario: &'a Scenario,
    pub unknown: &'a UnknownArgs,
    pub candidates: Option<&'a Path>,
    pub poses: &'a PoseArgs,
    pub budget: &'a BudgetArgs,
}

/// What trials of a plan came to.
struct TriedAbsolute {
    message: AbsoluteTrialsMessage,
    /// The same as a study has it.
    as_study: StudyPlanMessage,
}

/// What is reported of a plan.
struct ReportedPlan {
    message: AbsolutePlanMessage,
    provenance: ProvenanceMessage,
}

/// What is reported on: a command, the plan's file, and how candidates were drawn.
struct AskedFor<'a> {
    command: &'static str,
    plan: Option<&'a Path>,
    drawn: Option<DrawnMessage>,
}

/// Why there is none, with the file that it is about.
pub fn explained(path: &Path, error: &AbsolutePlanError) -> FileError {
    let wrong = FileError::new(path, error.to_string()).code(ErrorCode::AbsolutePlan);
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

    /// Designs a plan of candidates, or of so many configurations that are drawn.
    pub fn design(
        &self,
        [experiments, configurations]: [u32; 2],
        drawn: u32,
        outputs: AbsoluteOutputs<'_>,
    ) -> anyhow::Result<Report> {
        let bar = bar(self.common.quiet, "searching the plan");
        let progress = |done: usize, all: usize, _: f64| show(&bar, done, all);
        let stop = ask_search();
        let watch = Watch {
            stop,
            progress: &progress,
        };
        let sizes = [experiments, configurations];
        let readings = counted(experiments.into(), "absolute reading");
        let (planning, found) = if let Some(path) = self.candidates {
            let planning = self.planning(path, &self.read(path)?)?;
            self.common.say(&format!(
                "designing a plan of {readings} among {}",
                counted(planning.candidates.len() as u64, "candidate")
            ));
            let found = planning
                .design(sizes, self.scenario.seed, watch)
                .map_err(|error| explained(path, &error))?;
            (planning, found)
        } else {
            self.common.say(&format!(
                "designing a plan of {readings} at sampled configurations"
            ));
            let wanted = DrawnWanted {
                configurations: drawn,
                seed: self.scenario.seed,
            };
            let (task, groups) = (&self.scenario.task, &self.unknown.parameters);
            AbsolutePlanning::design_anywhere(task, groups, wanted, sizes, watch)
                .map_err(|error| explained(&self.scenario.path, &error))?
        };
        bar.finish_and_clear();
        super::interruption::searched();
        let asked = AskedFor {
            command: "plan",
            plan: None,
            drawn: (self.candidates.is_none()).then_some(DrawnMessage {
                configurations: drawn,
                seed: self.scenario.seed,
            }),
        };
        let (mut report, shown) =
            self.report(&asked, &planning, &found.plan, found.bound.as_ref())?;
        let [searches, agreeing] = found.searches;
        merge(
            &mut report.json,
            json!({ "searches": searches, "searches_agreeing": agreeing }),
        );
        report.text +=
            &format!("Of {searches} searches for the plan, {agreeing} ended within 0.1 % of it.\n");
        if stop.load(Ordering::Relaxed) {
            report.conditions.push(search_stopped());
        }
        let mut written = Written::default();
        let readings = planning.readings(&found.plan);
        report.text += &self.write(&readings, outputs, &mut written);
        if let Some(path) = outputs.report {
            let conditions = &report.conditions;
            let page = self.page(path, &shown, &readings, (None, conditions))?;
            report.text += &written.noted(path, page);
        }
        report.conditions.extend(written.conditions());
        Ok(report)
    }

    /// Writes the page of a plan.
    fn page(
        &self,
        path: &Path,
        shown: &ReportedPlan,
        readings: &[(&Candidate, u32)],
        (trials, conditions): (Option<&TriedAbsolute>, &[Condition]),
    ) -> anyhow::Result<Result<(), FileError>> {
        let page = absolute_page(&AbsolutePageRecord {
            scenario: self.scenario,
            plan: &shown.message,
            trials: trials.map(|tried| (&tried.message, &tried.as_study)),
            provenance: &shown.provenance,
            stills: &stills::figures_of_readings(self.scenario, readings),
            conditions,
            command: &command_line(),
        })?;
        Ok(write_whole(path, page.as_bytes()))
    }

    /// Writes a plan and its pictures where that is wanted, and tells of it.
    fn write(
        &self,
        readings: &[(&Candidate, u32)],
        outputs: AbsoluteOutputs<'_>,
        written: &mut Written,
    ) -> String {
        let mut text = String::new();
        if let Some(path) = outputs.plan {
            let rows: Vec<Candidate> = (readings.iter())
                .map(|&(candidate, repeats)| Candidate {
                    most: Some(repeats),
                    ..candidate.clone()
                })
                .collect();
            let rows = write_candidates(path, self.scenario.task.belief.commands(), &rows);
            text += &written.noted(path, rows);
        }
        if let Some(path) = outputs.stills {
            text += &written.save(path, &stills::sheet_of_readings(self.scenario, readings));
        }
        text
    }

    /// Says the predicted accuracy of a plan, and how near it is to the best of the candidates, where there are some.
    pub fn evaluate(&self, plan: &Path, also: EvaluatedAlso<'_>) -> anyhow::Result<Report> {
        let rows = self.read(plan)?;
        let planning = self.of_plan(plan, &rows)?;
        planning
            .check_whole()
            .map_err(|error| explained(plan, &error))?;
        let all = planning.whole();
        let bound = match self.candidates {
            None => None,
            Some(path) => {
                let among = self.planning(path, &self.read(path)?)?;
                let chosen = places_among(&among, &planning.candidates).map_err(|problem| {
                    FileError::new(plan, problem).code(ErrorCode::CandidateFile)
                })?;
                among
                    .bound(&chosen)
                    .map_err(|error| explained(path, &error))?
            }
        };
        let asked = AskedFor {
            command: "evaluate",
            plan: Some(plan),
            drawn: None,
        };
        let (mut report, shown) = self.report(&asked, &planning, &all, bound.as_ref())?;
        if also.static_compliance {
            let posterior = planning.prediction(&all).posterior;
            let known = planning.known_arm(&posterior);
            add_static_compliance(&mut report, &known, &self.scenario.task.test_poses)?;
        }
        let trials = match also.robots {
            Some(robots) => Some(self.try_plan(planning, all, robots)?),
            None => None,
        };
        let message = (trials.as_ref()).map(|tried| &tried.message);
        merge(&mut report.json, json!({ "trials": message }));
        if let Some(message) = message {
            report.text += &describe_trials(message);
            report.conditions.extend(unkept(message));
        }
        if let Some(path) = also.page {
            let mut written = Written::default();
            let readings: Vec<(&Candidate, u32)> = (rows.iter())
                .map(|row| (row, row.most.unwrap_or(1)))
                .collect();
            let conditions = &report.conditions;
            let page = self.page(path, &shown, &readings, (trials.as_ref(), conditions))?;
            report.text += &written.noted(path, page);
            report.conditions.extend(written.conditions());
        }
        Ok(report)
    }

    /// Draws robots that are read as a plan says, and looks at what is left.
    fn try_plan(
        &self,
        planning: AbsolutePlanning<'_>,
        plan: Vec<(usize, u32)>,
        robots: u64,
    ) -> anyhow::Result<TriedAbsolute> {
        let Scenario {
            task, truth, seed, ..
        } = self.scenario;
        let entries = [AbsoluteEntry {
            name: "plan".to_owned(),
            planning,
            plan,
            is_random: false,
        }];
        let runner = AbsoluteRunner::new((task, truth), &self.unknown.parameters, *seed, &entries)?;
        let runner = runner.stopped_by(&STOP);
        let bar = bar(self.common.quiet, "robots");
        bar.set_length(robots);
        let trials = AbsoluteTrials::new(&runner, robots, &|done| bar.inc(done));
        bar.finish_and_clear();
        super::interruption::searched();
        let trials = match trials {
            Err(TrialError::Runs(StudyError::Stopped)) => return Err(Interrupted.into()),
            other => other?,
        };
        let prediction = runner.predictions().next();
        let account = prediction
            .and_then(|prediction| Account::of_absolute(task, truth, &entries[0], prediction))
            .ok_or(TrialError::NoPrediction)?;
        let readings = entries[0].plan.iter().map(|(_, times)| times).sum();
        Ok(TriedAbsolute {
            message: AbsoluteTrialsMessage::new(&trials, &account),
            as_study: as_study(&trials, &account, readings),
        })
    }

    fn report(
        &self,
        asked: &AskedFor<'_>,
        planning: &AbsolutePlanning<'_>,
        plan: &[(usize, u32)],
        bound: Option<&PlanBound>,
    ) -> anyhow::Result<(Report, ReportedPlan)> {
        let task = &self.scenario.task;
        let prediction = planning.prediction(plan);
        let mut message = AbsolutePlanMessage::new(task, planning, plan, &prediction, bound);
        message.drawn = asked.drawn;
        let provenance = ProvenanceMessage::new(self.scenario)
            .with_optional("plan", asked.plan)?
            .with_optional("test_poses", self.poses.path())?
            .with_optional("candidates", self.candidates)?;
        let mut json = results(
            asked.command,
            &provenance,
            json!({ "gate": self.scenario.gate }),
        );
        merge(&mut json, serde_json::to_value(&message)?);
        let mut conditions: Vec<Condition> = (prediction.left.as_ref().err())
            .map(|names| {
                let names = names.join(", ");
                undetermined_by_plan(&format!(
                    "the tool's place at the test poses, which depends on {names}"
                ))
            })
            .into_iter()
            .chain(undetermined_compliances(planning, plan, &prediction))
            .collect();
        let file =
            (self.candidates).map_or_else(String::new, |path| format!(" in {}", path.display()));
        let offered = counted(planning.offered as u64, "candidate") + &file;
        let left = planning.offered - planning.candidates.len();
        let left_out = if asked.drawn.is_some() {
            drawn_words(&message)
        } else {
            left_out(&offered, left, &planning.left_out)
        };
        let mut written = Written::default();
        let budget = message.uncertainty_budget.as_ref();
        let told = self.budget.write(budget, &mut written);
        conditions.extend(written.conditions());
        let report = Report::new(json, describe(&message) + &left_out + &told, conditions);
        let shown = ReportedPlan {
            message,
            provenance,
        };
        Ok((report, shown))
    }
}

/// The compliances that a plan was to determine and does not, by name.
fn undetermined_compliances(
    planning: &AbsolutePlanning<'_>,
    plan: &[(usize, u32)],
    prediction: &PredictedAccuracy,
) -> Vec<Condition> {
    let unknowns = planning.set().parameters().iter().enumerate();
    let missing = unknowns.filter(|(index, each)| {
        matches!(each.kind, ParameterKind::JointCompliance { .. })
            && !planning.is_elsewhere(*index, plan)
            && prediction.posterior.standard_error(*index).is_none()
    });
    missing
        .map(|(index, _)| undetermined_by_plan(&planning.words(index)))
        .collect()
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
            "; no plan of as many candidates is below {bound:.5} mm (efficiency {efficiency:.4}), {}",
            if message.drawn.is_some() {
                "which were sampled: evidence, no proof"
            } else {
                "proved by looking at all"
            }
        );
    }
    text.push('\n');
    if let Some(quantile) = message.quantile95_mm {
        text += &format!("95 % stay below {quantile:.5} mm\n");
    }
    text += &format!("{ABSOLUTE}\n");
    if message.task_force_mm > 0.0 {
        text += &format!(
            "Of it, {:.5} mm are what the task's force is uncertain by, whatever is read\n",
            message.task_force_mm
        );
    }
    let common = message.common_sources.as_ref();
    text += &uncertainty_budget::describe(
        message.uncertainty_budget.as_ref(),
        common.map(|common| (&*common.names, common.rho0_mm)),
    );
    for certain in &message.assumed_exact {
        text += &format!("Assumed exact: {certain}\n");
    }
    if message.test_poses.len() > 1 {
        let rows = (message.test_poses.iter())
            .map(|pose| vec![pose.name.clone(), number(pose.rho0_mm, 5)]);
        text += &format!("\n{}", table("test pose | rho0 [mm]", rows));
    }
    let rows = (message.unknowns.iter()).map(|each| {
        let error = each.standard_error;
        let error = or_dash(error, |error| format!("{error:.3e}"));
        vec![each.name.clone(), error, each.unit.clone()]
    });
    text += &format!("\n{}\n", table("unknown | standard error | unit", rows));
    text
}

/// How candidates were drawn, and what is not said of others.
fn drawn_words(message: &AbsolutePlanMessage) -> String {
    let Some(drawn) = &message.drawn else {
        return String::new();
    };
    let CandidatesMessage {
        offered, possible, ..
    } = &message.candidates;
    format!(
        "The candidates are {} at random (seed {}), without and with a load: {possible} of {offered} are possible; and others near those that \
         were chosen. The region has more: the bound is evidence, no proof.\n",
        counted(drawn.configurations.into(), "configuration"),
        drawn.seed
    )
}

/// What was seen of a prediction, for a person.
fn describe_trials(trials: &AbsoluteTrialsMessage) -> String {
    let judged = trials.robots - trials.failed;
    let mut text = format!(
        "\nOf {} sampled, read by the plan and identified: residual error {:.5} +- {:.5} mm rms, predicted {:.5} mm",
        counted(judged, "virtual robot"),
        trials.rms_mm,
        trials.rms_std_mm,
        trials.predicted_rms_mm
    );
    if let Some(share) = trials.below_quantile95 {
        text += &format!("; {:.1} % stay below what 95 % should", share * 100.0);
    }
    text + &format!(
        ". The prediction {}.\n",
        match trials.prediction {
            "holds" => "holds".to_owned(),
            _ => format!("is {}", trials.verdict),
        }
    )
}

/// What must be looked at of simulated robots.
fn unkept(trials: &AbsoluteTrialsMessage) -> Vec<Condition> {
    let mut conditions = Vec::new();
    if trials.failed > 0 {
        let first = trials.first_failure.as_deref().unwrap_or_default();
        conditions.push(ConditionCode::FailedRuns.with(format!(
            "{} of {} gave no result; the first: {first}",
            trials.failed,
            counted(trials.robots, "simulated robot")
        )));
    }
    if trials.prediction == Kept::Exceeded.name() {
        conditions.push(ConditionCode::PredictionExceeded.with(format!(
            "residual error of simulated robots {:.2} +- {:.2} um rms, predicted {:.2} um",
            trials.rms_mm * 1e3,
            trials.rms_std_mm * 1e3,
            trials.predicted_rms_mm * 1e3
        )));
    }
    conditions
}
