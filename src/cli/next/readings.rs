//! Which absolute readings to take next.

use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::atomic::Ordering;

use elastocal::codes::ErrorCode;
use elastocal::experiment::write_candidates;
use elastocal::files::FileError;
use elastocal::identification::AbsoluteCase;
use elastocal::measurement::read_measured_so_far;
use elastocal::plan::absolute::{
    AbsolutePlanError, AbsolutePlanning, PredictedAccuracy, ReadingsWanted,
};
use elastocal::record::absolute_plan::planned_readings;
use elastocal::scenario::Scenario;
use elastocal::text::wording::counted;
use serde_json::json;

use super::{MORE, Next, NextPlan, PLANNING};
use crate::cli::Report;
use crate::cli::conditions::search_stopped;
use crate::cli::interruption::STOP;
use crate::cli::plan_args::offered;
use crate::cli::progress::search;
use crate::cli::table::table;

impl Next {
    /// Of absolute readings: beside those that are taken, as the scenario has the robot.
    pub(super) fn absolute(&self, scenario: &Scenario) -> anyhow::Result<Report> {
        let task = &scenario.task;
        let why = "; the scenario asks for an absolute accuracy";
        let taken = read_measured_so_far(&self.measurements, &task.belief)?
            .absolute(&self.measurements, why)?;
        AbsoluteCase::placed(&task.belief, &taken).map_err(|error| {
            FileError::new(&self.measurements, error.to_string()).code(ErrorCode::Measurements)
        })?;
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
        let mut text = format!(
            "{} so far: {}\n{}",
            counted(measured.into(), "absolute reading"),
            described(&planning, &so_far),
            offered(drawn, self.readings.candidates.as_deref(), &planning.offer)
        );
        let mut conditions = Vec::new();
        let found = if counts.is_empty() {
            text += "Nothing more needs to be measured.\n";
            None
        } else {
            let found = search(&self.common, PLANNING, |watch| {
                wanted.of_sizes(&mut planning, counts, wanted_m, seed, watch)
            });
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
        let json = json!({
            "accuracy": "absolute",
            "plan": planned_readings(task, &planning, &plan),
            "candidates": planning.offer,
            "drawn": drawn,
        });
        let next = NextPlan {
            measured,
            measured_m: so_far.rho0_m(),
            is_reached,
            rho0_m: reached_m,
            bound_m,
        };
        let rows = planning.rows(&plan);
        let write = |path: &Path| write_candidates(path, task.belief.commands(), &rows);
        self.report(scenario, &next, &write, Report::new(json, text, conditions))
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
