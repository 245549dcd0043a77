//! `next`: what to measure next, after some of a plan is measured.

use std::ops::RangeInclusive;
use std::sync::atomic::Ordering;

use crate::experiment::{Experiment, write_candidates};
use crate::identification::{AbsoluteCase, Case, Robustness};
use crate::laboratory::next::{Remaining, Rest, measured_plan, not_measured, rest};
use crate::measurement::read_measured_so_far;
use crate::plan::absolute::{AbsolutePlanning, PredictedAccuracy, ReadingsWanted};
use crate::plan::search::CandidateError;
use crate::plan::{
    Assessment, Feasibility, Plan, Violation, read_plan, rho0_m, take_nearest_turns, write_plan,
};
use crate::quantities::{limits::MOST_EXPERIMENTS, plausible::ACCURACY};
use crate::record::absolute_plan::planned_readings;
use crate::record::messages::plan_messages;
use crate::workflow::identify::{contradictions, identify_measurements};

use super::command_prelude::*;
use super::identified::refuse_prior;
use super::identify::deflections::{self, explained};
use super::interruption::STOP;
use super::plan_args::{ReadingsArgs, offered};
use super::planned::{search_stopped, undetermined_by_plan};
use super::progress::search;

#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["out"])))]
pub struct Next {
    #[command(flatten)]
    pub common: Common,
    /// What is measured so far.
    #[arg(long, value_name = "FILE")]
    measurements: PathBuf,
    /// The plan that is being measured: its rest is compared, and --skip counts its experiments.
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Experiments of the plan that turned out impossible: others take their place.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', requires = "plan")]
    skip: Vec<usize>,
    /// How much new configurations differ from those (deg); in some joint.
    #[arg(long, value_name = "DEG", default_value_t = 10.0, value_parser = angle)]
    skip_within_deg: f64,
    /// The accuracy that is wanted at the test poses (rms, um): as few measurements as give it.
    #[arg(long, value_name = "UM", value_parser = |text: &str| ACCURACY.parse(text))]
    accuracy_um: Option<f64>,
    /// The number of measurements in all; that of the plan or the scenario if not given. With --accuracy-um at most so many.
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_EXPERIMENTS)))]
    experiments: Option<u32>,
    #[command(flatten)]
    readings: ReadingsArgs,
    /// Where to write what is to be measured next.
    #[arg(long, value_name = "FILE")]
    plan_out: Option<PathBuf>,
}

/// With --accuracy-um, so many measurements are tried beside those that are there.
const MORE: u32 = 12;
/// What is said of the search.
const PLANNING: &str = "planning what to measure next";

fn angle(text: &str) -> Result<f64, String> {
    let angle = text.parse::<f64>().ok();
    angle
        .filter(|angle| (0.0..=180.0).contains(angle))
        .ok_or_else(|| "0 to 180 degrees are allowed".to_owned())
}

impl Next {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let (scenario, _) = (self.common).load_measured("next", &self.measurements)?;
        self.common.refuse_others("next", &scenario)?;
        self.common.check_files(&scenario, None)?;
        match scenario.task.design.accuracy {
            AccuracyKind::Absolute => self.absolute(&scenario),
            AccuracyKind::Relative => self.deflections(&scenario),
        }
    }

    /// Of deflections.
    fn deflections(&self, scenario: &Scenario) -> anyhow::Result<Report> {
        let (task, commands) = (&scenario.task, scenario.task.belief.commands());
        let measured = read_measured_so_far(&self.measurements, &task.belief)?;
        let again = refuse_prior(scenario, &self.measurements, &measured)?;
        let measurements = measured.deflections(&self.measurements)?;
        let given = (self.plan.as_ref()).map(|path| read_plan(path, commands.clone()));
        let given = given.transpose()?;
        let belief = &task.belief;
        deflections::say(&self.common, belief, measurements.len());
        let case = Case::as_believed(belief, &measurements);
        let identified = identify_measurements(case, Robustness::NONE)
            .map_err(|problem| explained(&self.measurements, &problem))?;
        let identification = &identified.identification;
        let so_far = measured_plan(&measurements);
        let measured = so_far.measurements();
        let impossible = self.impossible(given.as_ref(), &so_far)?;
        let within_rad = self.skip_within_deg.to_radians();
        let mut left = Remaining::new(task, identification, &measurements, &impossible, within_rad);
        left.planned = given.as_ref().map(|plan| self.not_done(plan, &so_far));
        let reached_m = rho0_m(&left.task, &identification.posterior);
        let total = (self.experiments)
            .or_else(|| given.as_ref().map(Plan::measurements))
            .unwrap_or(task.design.experiments);
        let conditions = identified.conditions().chain(scenario.of_unknown_origin());
        let mut conditions: Vec<Condition> = conditions.collect();
        let mut text = again + &deflections::describe(identification, belief);
        text += &format!(
            "\n{} of {} so far, at the compliances as identified: {}\n",
            counted(measured.into(), "measurement"),
            counted(so_far.experiments.len() as u64, "experiment"),
            describe(reached_m)
        );
        let wanted_m = self.accuracy_um.map(|accuracy| accuracy * 1e-6);
        let is_reached =
            matches!((reached_m, wanted_m), (Some(reached), Some(wanted)) if reached <= wanted);
        // What is mandatory is measured whatever is reached.
        let mandatory = left.task.design.mandatory.measurements();
        let more = |total: u32| total.saturating_sub(measured).max(mandatory);
        let counts = match (wanted_m, self.experiments) {
            (Some(_), most) => mandatory.max(1)..=most.map_or(MORE.max(mandatory), more).max(1),
            (None, _) => more(total)..=more(total),
        };
        let is_done = mandatory == 0 && (is_reached || *counts.end() == 0);
        let found = if is_done {
            text += if is_reached {
                "That is the accuracy that is wanted: nothing more needs to be measured.\n"
            } else {
                "All is measured.\n"
            };
            None
        } else {
            let mut found = search(&self.common, PLANNING, |watch| {
                rest(&left, counts, wanted_m, scenario.seed, watch)
            })?;
            take_nearest_turns(&left.task, scenario.laboratory.home(), &mut found.plan);
            Some(found)
        };
        let is_enough = |found: &Rest| wanted_m.is_none_or(|wanted_m| found.rho0_m <= wanted_m);
        let is_reached = is_reached || found.as_ref().is_some_and(is_enough);
        let empty = Plan::default();
        let next = found.as_ref().map_or(&empty, |found| &found.plan);
        // Where nothing is planned there is no other rest to set it beside.
        let old = left.planned.as_ref().filter(|_| found.is_some());
        // As much work as the new rest.
        let old = old.filter(|old| old.measurements() == next.measurements());
        let old_m = old.and_then(|old| left.rho0_m(old));
        if let Some(found) = &found {
            text += &tell(found, old_m);
            let all = measured + found.plan.measurements();
            conditions.extend(self.unreached(all, is_reached));
            let violations = Feasibility::new(&left.task).violations(&found.plan);
            let of_experiments = violations.iter().filter(|each| each.experiment.is_some());
            let violation = |each: &Violation| ConditionCode::Violation.with(each.to_string());
            conditions.extend(of_experiments.map(violation));
            let of_plan = Assessment::new(&left.task, &found.plan, None).conditions;
            let is_near = |each: &Condition| each.code == ConditionCode::NearConfigurations;
            conditions.extend(of_plan.into_iter().filter(is_near));
        }
        let found = found.as_ref();
        let rho0_m = found.map(|found| found.rho0_m).or(reached_m);
        let bound_m = found.and_then(|found| found.bound_m);
        let mut keys = self.keys(measured, is_reached, [reached_m, rho0_m, bound_m]);
        keys["plan"] = json!(plan_messages(&commands, next));
        keys["old_rest_rho0_mm"] = json!(old_m.map(|rho0_m| rho0_m * 1e3));
        let write = |path: &Path| write_plan(path, commands.clone(), next);
        self.report(scenario, keys, &write, (text, conditions))
    }

    /// Of absolute readings: beside those that are taken, as the scenario has the robot.
    fn absolute(&self, scenario: &Scenario) -> anyhow::Result<Report> {
        let task = &scenario.task;
        let why = "; the scenario asks for an absolute accuracy";
        let measured = read_measured_so_far(&self.measurements, task)?;
        let again = refuse_prior(scenario, &self.measurements, &measured)?;
        let taken = measured.absolute(&self.measurements, why)?;
        let case = AbsoluteCase::placed(&task.belief, &taken).map_err(|error| {
            FileError::new(&self.measurements, error.to_string()).code(ErrorCode::Measurements)
        })?;
        let visited = u32::try_from(case.different()).unwrap_or(u32::MAX);
        let configurations = task.design.configurations;
        let configurations = configurations.map(|most| most.saturating_sub(visited).max(1));
        let measured = u32::try_from(taken.len()).unwrap_or(u32::MAX);
        let (candidates, seed) = (self.readings.candidates(scenario)?, scenario.seed);
        let wanted = ReadingsWanted {
            measured: &taken,
            ..self.readings.wanted(scenario, candidates.as_deref())
        };
        let drawn = wanted.drawn(seed);
        let wrong = |error: CandidateError| error.in_file(wanted.path);
        let mut plannings = wanted.plannings(task, seed).map_err(wrong)?;
        let predicted = plannings.iter().map(|each| each.prediction(&[]));
        let mut predicted: Vec<PredictedAccuracy> = predicted.collect();
        let rho0_m = |place: &usize| predicted[*place].rho0_m().unwrap_or(f64::INFINITY);
        let places = 0..predicted.len();
        let place = places.min_by(|one, other| rho0_m(one).total_cmp(&rho0_m(other)));
        let place = place.unwrap_or_default();
        let so_far = predicted.swap_remove(place);
        let wanted_m = self.accuracy_um.map(|accuracy| accuracy * 1e-6);
        let is_reached =
            (so_far.rho0_m().zip(wanted_m)).is_some_and(|(rho0, wanted)| rho0 <= wanted);
        let left = |total: u32| total.saturating_sub(measured);
        let counts = match (wanted_m, self.experiments) {
            _ if is_reached => RangeInclusive::new(1, 0),
            (Some(_), most) => 1..=most.map_or(MORE, left),
            (None, total) => {
                let more = left(total.unwrap_or(task.design.experiments));
                more.max(1)..=more
            }
        };
        let mut text = format!(
            "{again}{} so far: {}\n{}",
            counted(measured.into(), "absolute reading"),
            described(&plannings[place], &so_far),
            offered(
                drawn,
                self.readings.candidates.as_deref(),
                &plannings[place].offer
            )
        );
        let mut conditions = contradictions(&task.belief, &taken, &self.readings.parameters);
        let (planning, found) = if counts.is_empty() {
            text += "Nothing more needs to be measured.\n";
            (plannings.swap_remove(place), None)
        } else {
            let found = search(&self.common, PLANNING, |watch| {
                wanted.of_sizes(plannings, (counts, configurations), wanted_m, seed, watch)
            });
            let (planning, mut found) = found.map_err(wrong)?;
            (planning, found.pop())
        };
        let (plan, bound) = found.map_or_else(Default::default, |found| (found.plan, found.bound));
        let unplaced = planning.unplaced_stations(&plan);
        conditions.extend(unplaced.iter().map(|words| undetermined_by_plan(words)));
        let bound_m = bound.map(|bound| bound.best);
        let prediction = planning.prediction(&plan);
        let reached_m = prediction.rho0_m();
        let is_reached =
            wanted_m.is_none_or(|wanted_m| reached_m.is_some_and(|rho0| rho0 <= wanted_m));
        if !plan.is_empty() {
            let is_drawn = drawn.is_some();
            text += &tell_readings(&planning, (&plan, bound_m), &prediction, is_drawn);
        }
        conditions.extend(self.unreached(measured + prediction.readings, is_reached));
        let mut keys = self.keys(measured, is_reached, [so_far.rho0_m(), reached_m, bound_m]);
        keys["accuracy"] = json!("absolute");
        keys["plan"] = json!(planned_readings(task, &planning, &plan));
        keys["candidates"] = json!(planning.offer);
        keys["drawn"] = json!(drawn);
        let rows = planning.rows(&plan);
        let write = |path: &Path| write_candidates(path, task.belief.commands(), &rows);
        self.report(scenario, keys, &write, (text, conditions))
    }

    /// What is said of all plans: the rms distance (m) by what is measured and by all together, and what no other rest is below.
    fn keys(&self, measured: u32, is_reached: bool, distances_m: [Option<f64>; 3]) -> Value {
        let [measured_mm, rho0_mm, bound_mm] =
            distances_m.map(|value_m| value_m.map(|value_m| value_m * 1e3));
        json!({
            "measured": measured,
            "measured_rho0_mm": measured_mm,
            "accuracy_um": self.accuracy_um,
            "reached": is_reached,
            "rho0_mm": rho0_mm,
            "lower_bound_rho0_mm": bound_mm,
        })
    }

    /// Writes what is to be measured, and reports it.
    fn report(
        &self,
        scenario: &Scenario,
        keys: Value,
        write: &dyn Fn(&Path) -> Result<(), FileError>,
        (text, mut conditions): (String, Vec<Condition>),
    ) -> anyhow::Result<Report> {
        conditions.extend(STOP.load(Ordering::Relaxed).then(search_stopped));
        let mut report = Report::new(keys, text, conditions);
        if let Some(path) = &self.plan_out {
            report.noted(path, write(path));
        }
        Ok((self.common).report("next", scenario, report)?)
    }

    /// What is left of a plan.
    fn not_done(&self, plan: &Plan, measured: &Plan) -> Plan {
        let is_kept = |(index, _): &(usize, &Experiment)| !self.skip.contains(&(index + 1));
        let kept = plan.experiments.iter().enumerate().filter(is_kept);
        let experiments = kept.map(|(_, each)| each.clone()).collect();
        not_measured(&Plan { experiments }, measured)
    }

    /// That the goal is not reached, where it is not.
    fn unreached(&self, all: u32, is_reached: bool) -> Option<Condition> {
        let count = counted(all.into(), "measurement");
        let wanted = self.accuracy_um.filter(|_| !is_reached)?;
        Some(ConditionCode::OutOfReach.with(format!("{count} do not reach {wanted} um")))
    }

    /// The configurations that turned out impossible: of experiments that are not measured.
    fn impossible(
        &self,
        plan: Option<&Plan>,
        measured: &Plan,
    ) -> Result<Vec<nalgebra::DVector<f64>>, FileError> {
        let (Some(plan), Some(path)) = (plan, &self.plan) else {
            return Ok(Vec::new());
        };
        let count = plan.experiments.len();
        let left = not_measured(plan, measured);
        let configuration = |&number: &usize| {
            let index = number.checked_sub(1).filter(|index| *index < count);
            let wrong = |problem: String| {
                (FileError::new(path, problem).at("--skip")).code(ErrorCode::PlanFile)
            };
            let allowed = || wrong(format!("found {number}; 1 to {count} are allowed"));
            let experiment = &plan.experiments[index.ok_or_else(allowed)?];
            let is_it = |left: &Experiment| {
                let whole = Experiment {
                    repeats: experiment.repeats,
                    ..left.clone()
                };
                whole == *experiment
            };
            if !left.experiments.iter().any(is_it) {
                return Err(wrong(format!("found {number}, which is measured")));
            }
            Ok(experiment.configuration_rad.clone())
        };
        self.skip.iter().map(configuration).collect()
    }
}

/// The rest for a person, beside what is left of the old plan (m).
fn tell(found: &Rest, old_m: Option<f64>) -> String {
    let mut text = format!(
        "{} more: {}",
        counted(found.plan.measurements().into(), "measurement"),
        describe(Some(found.rho0_m))
    );
    if let Some(bound_m) = found.bound_m {
        text += &format!(
            "; no other rest can be below {} um",
            in_um(Some(bound_m), 3)
        );
    }
    text.push('\n');
    if let Some(old_m) = old_m {
        text += &format!(
            "The rest of the plan would give {} um.\n",
            in_um(Some(old_m), 3)
        );
    }
    text
}

fn describe(rho0_m: Option<f64>) -> String {
    rho0_m.map_or_else(
        || "a test pose depends on compliances that are not determined yet".to_owned(),
        |rho0_m| format!("rho0 = {} um at the test pose", in_um(Some(rho0_m), 3)),
    )
}

/// A prediction for a person.
fn described(planning: &AbsolutePlanning<'_>, prediction: &PredictedAccuracy) -> String {
    let station = planning.stations().get(prediction.station);
    match (&prediction.left, station.and_then(Option::as_ref)) {
        (Ok(rho0_m), Some(station)) => {
            format!(
                "rho0 = {:.5} mm in the frame of station {station:?}",
                rho0_m * 1e3
            )
        }
        (Ok(rho0_m), None) => format!("rho0 = {:.5} mm", rho0_m * 1e3),
        (Err(_), _) => "they do not determine the tool's place at the test poses yet".to_owned(),
    }
}

/// The rest for a person.
fn tell_readings(
    planning: &AbsolutePlanning<'_>,
    (plan, bound_m): (&[(usize, u32)], Option<f64>),
    prediction: &PredictedAccuracy,
    is_drawn: bool,
) -> String {
    let mut text = format!(
        "{} more: {}",
        counted(prediction.readings.into(), "absolute reading"),
        described(planning, prediction)
    );
    if let Some(bound_m) = bound_m {
        text += &format!(
            "; no other rest of these candidates is below {:.5} mm",
            bound_m * 1e3
        );
    }
    let commands = planning.task().belief.commands();
    let rows = planning.readings(plan).into_iter().zip(plan);
    let rows = rows.map(|((row, times), &(place, _))| {
        let listed = |numbers: &[f64], digits| {
            joined(numbers.iter().map(|each| number(Some(*each), digits)), " ")
        };
        let which = if is_drawn {
            listed(&commands.numbers(row.configuration_rad.as_slice()), 2)
        } else {
            row.line.to_string()
        };
        let force = row.load.map(|load| listed(load.force_n.as_slice(), 1));
        let station = row.station.clone().unwrap_or_default();
        let target = planning.target(place).to_owned();
        vec![
            which,
            force.unwrap_or_default(),
            target,
            station,
            times.to_string(),
        ]
    });
    let which = if is_drawn {
        "joint angles [deg]"
    } else {
        "line"
    };
    let header = format!("{which} | force [N] | target | station | times");
    format!("{text}\n\n{}", table(&header, rows))
}
