//! Which absolute readings to take next.

use std::ops::RangeInclusive;
use std::sync::atomic::Ordering;

use elastocal::codes::ErrorCode;
use elastocal::experiment::write_candidates;
use elastocal::files::FileError;
use elastocal::identification::AbsoluteCase;
use elastocal::measurement::{AbsoluteReading, MeasuredFile, read_measured_so_far};
use elastocal::plan::absolute::{
    AbsolutePlanError, AbsolutePlanning, PredictedAccuracy, ReadingsWanted,
};
use elastocal::plan::search::Watch;
use elastocal::record::absolute_plan::planned_readings;
use elastocal::record::messages::ProvenanceMessage;
use elastocal::scenario::Scenario;
use elastocal::task::Task;
use elastocal::text::wording::counted;
use serde_json::json;

use super::{MORE, Next};
use crate::cli::conditions::search_stopped;
use crate::cli::interruption::{STOP, ask_search, searched};
use crate::cli::plan::drawn_words;
use crate::cli::plan_args::left_out;
use crate::cli::progress::{bar, show};
use crate::cli::table::table;
use crate::cli::written::Written;
use crate::cli::{Report, results};

impl Next {
    /// Of absolute readings: beside those that are taken, as the scenario has the robot.
    pub(super) fn absolute(&self, scenario: &Scenario) -> anyhow::Result<Report> {
        let task = &scenario.task;
        self.check(scenario)?;
        let taken = self.taken(task)?;
        let measured = u32::try_from(taken.len()).unwrap_or(u32::MAX);
        let (candidates, seed) = (self.readings.candidates(scenario)?, scenario.seed);
        let wanted = ReadingsWanted {
            measured: &taken,
            ..self.readings.wanted(scenario, candidates.as_deref())
        };
        let drawn = wanted.drawn(seed);
        let wrong = |error: AbsolutePlanError| error.in_file(wanted.path);
        let mut planning = wanted.planning(task, seed).map_err(wrong)?;
        let so_far = planning.prediction(&[]);
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
        let offered = counted(planning.offer.offered as u64, "candidate");
        let mut text = format!(
            "{} so far: {}\n{}",
            counted(measured.into(), "absolute reading"),
            described(&planning, &so_far),
            match drawn {
                Some(drawn) => drawn_words(drawn, &planning.offer),
                None => left_out(
                    &offered,
                    self.readings.candidates.as_deref(),
                    &planning.offer
                ),
            }
        );
        let mut conditions = Vec::new();
        let found = if counts.is_empty() {
            text += "Nothing more needs to be measured.\n";
            None
        } else {
            (self.common).say("planning what to measure next");
            let bar = bar(self.common.quiet, "searching the plan");
            let watch = Watch {
                stop: ask_search(),
                progress: &|done, all, _| show(&bar, done, all),
            };
            let found = wanted.of_sizes(&mut planning, counts, wanted_m, seed, watch);
            bar.finish_and_clear();
            searched();
            found.map_err(wrong)?.pop()
        };
        let (plan, bound) = found.map_or_else(Default::default, |found| (found.plan, found.bound));
        let bound_m = bound.map(|bound| bound.best);
        conditions.extend(STOP.load(Ordering::Relaxed).then(search_stopped));
        let prediction = planning.prediction(&plan);
        let reached_m = prediction.rho0_m();
        let is_reached =
            wanted_m.is_none_or(|wanted_m| reached_m.is_some_and(|rho0| rho0 <= wanted_m));
        if !plan.is_empty() {
            text += &tell(&planning, (&plan, bound_m), &prediction);
        }
        conditions.extend(self.unreached(measured + prediction.readings, is_reached));
        let mut written = Written::default();
        if let Some(path) = &self.plan_out {
            let rows = planning.rows(&plan);
            text += &written.noted(path, write_candidates(path, task.belief.commands(), &rows));
        }
        conditions.extend(written.conditions());
        let provenance = ProvenanceMessage::new(scenario)
            .with_input("measurements", &self.measurements)?
            .with_optional("candidates", self.readings.candidates.as_deref())?;
        let millimetres = |value_m: Option<f64>| value_m.map(|value_m| value_m * 1e3);
        let json = json!({
            "accuracy": "absolute",
            "measured": measured,
            "measured_rho0_mm": millimetres(so_far.rho0_m()),
            "accuracy_um": self.accuracy_um,
            "reached": is_reached,
            "plan": planned_readings(task, &planning, &plan),
            "rho0_mm": millimetres(reached_m),
            "lower_bound_rho0_mm": millimetres(bound_m),
            "candidates": planning.offer,
            "drawn": drawn,
        });
        Ok(Report::new(
            results("next", &provenance, json),
            text,
            conditions,
        ))
    }

    /// What is read so far.
    fn taken(&self, task: &Task) -> anyhow::Result<Vec<AbsoluteReading>> {
        let wrong = |problem: String| {
            FileError::new(&self.measurements, problem).code(ErrorCode::Measurements)
        };
        match read_measured_so_far(&self.measurements, &task.belief)? {
            MeasuredFile::Absolute(readings) => {
                AbsoluteCase::placed(&task.belief, &readings)
                    .map_err(|error| wrong(error.to_string()))?;
                Ok(readings)
            }
            MeasuredFile::Deflections(_) => {
                let problem = "holds deflections; the scenario asks for an absolute accuracy";
                Err(wrong(problem.to_owned())
                    .code(ErrorCode::OtherAccuracy)
                    .into())
            }
        }
    }
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
fn tell(
    planning: &AbsolutePlanning<'_>,
    (plan, bound_m): (&[(usize, u32)], Option<f64>),
    prediction: &PredictedAccuracy,
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
    let rows = planning.readings(plan).into_iter().zip(plan);
    let rows = rows.map(|((row, times), &(place, _))| {
        vec![
            row.line.to_string(),
            planning.target(place).to_owned(),
            row.station.clone().unwrap_or_default(),
            times.to_string(),
        ]
    });
    format!(
        "{text}\n\n{}",
        table("line | target | station | times", rows)
    )
}
