//! `plan` and `evaluate` where the tool's place must be accurate, not its deflection alone.

use std::path::Path;
use std::sync::atomic::Ordering;

use elastocal::codes::{Condition, ConditionCode, ErrorCode};
use elastocal::experiment::{Candidate, read_candidates, write_candidates};
use elastocal::files::{FileError, output::write_whole};
use elastocal::parameter::ParameterKind;
use elastocal::plan::absolute::{AbsolutePlanning, DrawnWanted, PredictedAccuracy};
use elastocal::plan::search::{PlanBound, Watch};
use elastocal::record::absolute_plan::AbsolutePlanMessage;
use elastocal::record::json::{merge, results};
use elastocal::record::messages::ProvenanceMessage;
use elastocal::record::robot_trials::RobotTrials;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::study::verdict::Kept;
use elastocal::study::{Conditions, EntryKind, Setting, StudiedReadings, StudyError};
use elastocal::text::wording::counted;
use elastocal::view::report::{ABSOLUTE_ACCURACY, AbsolutePageRecord, absolute_page};
use elastocal::view::stills::Stills;
use elastocal::workflow::study::try_plan;
use serde_json::json;

use super::conditions::{search_stopped, undetermined_by_plan};
use super::interruption::{Interrupted, STOP, ask_search, searched};
use super::plan_args::PlanArgs;
use super::progress::{bar, show};
use super::static_compliance::add_static_compliance;
use super::table::{number, or_dash, table};
use super::views::command_line;
use super::written::Written;
use super::{Report, uncertainty_budget};

impl PlanArgs {
    /// Designs a plan of absolute readings of candidates, or of so many configurations that are drawn; and writes it, and stills of
    /// it, to files.
    pub fn design_readings(
        &self,
        scenario: &Scenario,
        sizes: [u32; 2],
        configurations: u32,
        [plan_out, stills_out]: [Option<&Path>; 2],
    ) -> anyhow::Result<Report> {
        let (task, groups, seed) = (&scenario.task, &self.parameters, scenario.seed);
        let bar = bar(self.common.quiet, "searching the plan");
        let stop = ask_search();
        let watch = Watch {
            stop,
            progress: &|done, all, _| show(&bar, done, all),
        };
        let readings = counted(sizes[0].into(), "absolute reading");
        let say = |place: &str| {
            let designing = format!("designing a plan of {readings} {place}");
            self.common.say(&designing);
        };
        let mut drawn = None;
        let (planning, found) = if let Some(path) = &self.candidates {
            let rows = read_candidates(path, task.belief.commands())?;
            let planning = AbsolutePlanning::new(task, groups, &rows);
            let planning = planning.map_err(|error| error.in_file(path))?;
            let candidates = planning.candidates.len() as u64;
            say(&format!("among {}", counted(candidates, "candidate")));
            let found = planning.design(sizes, seed, watch);
            let found = found.map_err(|error| error.in_file(path))?;
            (planning, found)
        } else {
            say("at sampled configurations");
            let wanted = DrawnWanted {
                configurations,
                seed,
            };
            drawn = Some(wanted);
            AbsolutePlanning::design_anywhere(task, groups, wanted, sizes, watch)
                .map_err(|error| error.in_file(&scenario.path))?
        };
        bar.finish_and_clear();
        searched();
        let plan = (&planning, &found.plan[..], found.bound.as_ref());
        let (mut report, message, provenance) = self.report(scenario, None, drawn, plan)?;
        let [searches, agreeing] = found.searches;
        merge(
            &mut report.json,
            json!({ "searches": searches, "searches_agreeing": agreeing }),
        );
        report.text +=
            &format!("Of {searches} searches for the plan, {agreeing} ended within 0.1 % of it.\n");
        let is_stopped = stop.load(Ordering::Relaxed);
        report.conditions.extend(is_stopped.then(search_stopped));
        let mut written = Written::default();
        let readings = planning.readings(&found.plan);
        if let Some(path) = plan_out {
            let row = |&(candidate, repeats): &(&Candidate, u32)| Candidate {
                most: Some(repeats),
                ..candidate.clone()
            };
            let rows: Vec<Candidate> = readings.iter().map(row).collect();
            let rows = write_candidates(path, task.belief.commands(), &rows);
            report.text += &written.noted(path, rows);
        }
        if let Some(path) = stills_out {
            report.text += &written.save(path, &Stills::of_readings(scenario, &readings).sheet());
        }
        let shown = (&message, &provenance);
        self.write_page(scenario, shown, &readings, None, (&mut report, written))?;
        Ok(report)
    }

    /// Says the predicted accuracy of a plan, and how near it is to the best of the candidates, where there are some; tries it on so
    /// many robots.
    pub fn evaluate_readings(
        &self,
        scenario: &Scenario,
        file: &Path,
        robots: Option<u64>,
        static_compliance: bool,
    ) -> anyhow::Result<Report> {
        let task = &scenario.task;
        let rows = read_candidates(file, task.belief.commands())?;
        let planning = AbsolutePlanning::of_plan(task, &self.parameters, &rows);
        let planning = planning.map_err(|error| error.in_file(file))?;
        let plan = planning.whole();
        let mut bound = None;
        if let Some(path) = &self.candidates {
            let candidates = read_candidates(path, task.belief.commands())?;
            let among = AbsolutePlanning::new(task, &self.parameters, &candidates);
            let among = among.map_err(|error| error.in_file(path))?;
            let chosen = places_among(&among, &planning.candidates)
                .map_err(|problem| FileError::new(file, problem).code(ErrorCode::CandidateFile))?;
            bound = (among.bound(&chosen)).map_err(|error| error.in_file(path))?;
        }
        let whole = (&planning, &plan[..], bound.as_ref());
        let (mut report, message, provenance) = self.report(scenario, Some(file), None, whole)?;
        if static_compliance {
            let posterior = planning.prediction(&plan).posterior;
            let known = planning.known_arm(&posterior);
            add_static_compliance(&mut report, &known, &task.test_poses)?;
        }
        let measurements = planning.prediction(&plan).readings;
        let kind = EntryKind::Readings(Box::new(StudiedReadings {
            planning,
            plan,
            groups: &self.parameters,
            is_random: false,
        }));
        let trials = robots
            .map(|robots| self.try_plan(scenario, kind, measurements, robots))
            .transpose()?;
        let tried = trials.as_ref();
        merge(
            &mut report.json,
            json!({ "trials": tried.map(RobotTrials::json) }),
        );
        if let Some(tried) = tried {
            report.text += &describe_trials(tried);
            report.conditions.extend(unkept(tried));
        }
        let readings: Vec<(&Candidate, u32)> = (rows.iter())
            .map(|row| (row, row.most.unwrap_or(1)))
            .collect();
        let written = Written::default();
        let (shown, trials) = ((&message, &provenance), trials.as_ref());
        self.write_page(scenario, shown, &readings, trials, (&mut report, written))?;
        Ok(report)
    }

    /// Writes the page of a plan, where that is wanted, and says of all files that were written what became of them.
    fn write_page(
        &self,
        scenario: &Scenario,
        (plan, provenance): (&AbsolutePlanMessage, &ProvenanceMessage),
        readings: &[(&Candidate, u32)],
        trials: Option<&RobotTrials>,
        (report, mut written): (&mut Report, Written),
    ) -> anyhow::Result<()> {
        if let Some(path) = &self.report_out {
            let page = absolute_page(&AbsolutePageRecord {
                scenario,
                plan,
                trials,
                provenance,
                stills: &Stills::of_readings(scenario, readings).figures(),
                conditions: &report.conditions,
                command: &command_line(),
            })?;
            report.text += &written.noted(path, write_whole(path, page.as_bytes()));
        }
        report.conditions.extend(written.conditions());
        Ok(())
    }

    /// Tries a plan on virtual robots.
    pub fn try_plan(
        &self,
        scenario: &Scenario,
        kind: EntryKind<'_>,
        measurements: u32,
        robots: u64,
    ) -> anyhow::Result<RobotTrials> {
        let conditions = Conditions::plain(&scenario.task, measurements);
        let setting = Setting::new(&scenario.task, &scenario.truth, conditions);
        let bar = bar(self.common.quiet, "robots");
        bar.set_length(robots);
        let watch = (&STOP, &(|done| bar.inc(done)) as _);
        let trials = try_plan(&setting, scenario.seed, kind, robots, watch);
        bar.finish_and_clear();
        searched();
        match trials {
            Err(StudyError::Stopped) => Err(Interrupted.into()),
            trials => Ok(trials?),
        }
    }

    /// What is predicted of a plan that was designed, from candidates that may be drawn, or read from a file.
    fn report(
        &self,
        scenario: &Scenario,
        file: Option<&Path>,
        drawn: Option<DrawnWanted>,
        (planning, plan, bound): (&AbsolutePlanning<'_>, &[(usize, u32)], Option<&PlanBound>),
    ) -> anyhow::Result<(Report, AbsolutePlanMessage, ProvenanceMessage)> {
        let prediction = planning.prediction(plan);
        let mut message =
            AbsolutePlanMessage::new(&scenario.task, planning, plan, &prediction, bound);
        message.drawn = drawn;
        let provenance = self.provenance(scenario, file)?;
        let command = file.map_or("plan", |_| "evaluate");
        let mut json = results(command, &provenance, json!({ "gate": scenario.gate }));
        merge(&mut json, serde_json::to_value(&message)?);
        let mut conditions = Vec::new();
        if let Err(names) = &prediction.left {
            let place = "the tool's place at the test poses, which depends on";
            conditions.push(undetermined_by_plan(&format!(
                "{place} {}",
                names.join(", ")
            )));
        }
        conditions.extend(undetermined_compliances(planning, plan, &prediction));
        let offered = counted(planning.offer.offered as u64, "candidate");
        let mut text = describe(&message);
        text += &match drawn {
            Some(drawn) => drawn_words(drawn, planning),
            None => self.left_out(&offered, &planning.offer),
        };
        let mut written = Written::default();
        let budget = message.uncertainty_budget.as_ref();
        text += &self.budget.write(budget, &mut written);
        conditions.extend(written.conditions());
        Ok((Report::new(json, text, conditions), message, provenance))
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
    text += &format!("{ABSOLUTE_ACCURACY}\n");
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
fn drawn_words(drawn: DrawnWanted, planning: &AbsolutePlanning<'_>) -> String {
    format!(
        "The candidates are {} at random (seed {}), without and with a load: {} of {} are possible; and others near those that \
         were chosen. The region has more: the bound is evidence, no proof.\n",
        counted(drawn.configurations.into(), "configuration"),
        drawn.seed,
        planning.offer.possible,
        planning.offer.offered
    )
}

/// What was seen of a prediction, for a person.
fn describe_trials(trials: &RobotTrials) -> String {
    let runs = &trials.runs;
    let mut text = format!(
        "\nOf {} sampled, read by the plan and identified: residual error {} +- {} mm rms, predicted {} mm",
        counted(runs.runs, "virtual robot"),
        number(runs.rms_mm, 5),
        number(runs.rms_std_mm, 5),
        number(runs.combined_rms_mm, 5)
    );
    if let Some(share) = trials.below_quantile95 {
        text += &format!("; {:.1} % stay below what 95 % should", share * 100.0);
    }
    text + &format!(". The prediction {}.\n", trials.outcome())
}

/// What must be looked at of simulated robots.
fn unkept(trials: &RobotTrials) -> Vec<Condition> {
    let runs = &trials.runs;
    let mut conditions = Vec::new();
    if runs.failed > 0 {
        let first = trials.first_failure.as_deref().unwrap_or_default();
        conditions.push(ConditionCode::FailedRuns.with(format!(
            "{} of {} gave no result; the first: {first}",
            runs.failed,
            counted(runs.runs + runs.failed, "simulated robot")
        )));
    }
    if trials.prediction == Kept::Exceeded {
        let micro = |value_mm: Option<f64>| number(value_mm.map(|value_mm| value_mm * 1e3), 2);
        conditions.push(ConditionCode::PredictionExceeded.with(format!(
            "residual error of simulated robots {} +- {} um rms, predicted {} um",
            micro(runs.rms_mm),
            micro(runs.rms_std_mm),
            micro(runs.combined_rms_mm)
        )));
    }
    conditions
}
