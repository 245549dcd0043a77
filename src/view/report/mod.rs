//! Pages to look at and to hand on: one file each that loads nothing, with figures as SVG. What they say stands in `view/pages`.
//!
//! - [`run_page`]: a designed plan, its calibration, and what it is shown beside.
//! - [`absolute_page`]: a plan of absolute readings, and a run of it.
//! - [`study_page`]: a Monte Carlo study.
//!
//! The numbers are those of the JSON records.

mod absolute;
mod cards;
mod distances;
mod figures;
mod study;
mod test_poses;

use std::path::Path;

use serde_json::{Value, json};

use super::markup::{PageError, page};
use super::tables;
use crate::calibration::Calibration;
use crate::codes::Condition;
use crate::identification::{IdentificationMessage, MeasurementResidual, ParameterGroup};
use crate::measurement::Measurement;
use crate::plan::UncertaintyBudget;
use crate::record::messages::{PlanRowMessage, ProvenanceMessage};
use crate::scenario::Scenario;
use crate::text::wording::{joined, micrometres, shell_path};
use crate::workflow::run::RunOutcome;
use distances::{distances, lines};
use figures::{accuracy_figure, compliances_figure, residuals_figure};
use test_poses::test_poses;

pub use absolute::{ABSOLUTE_ACCURACY, absolute_page};
pub use cards::{cards, of_readings, of_run};
pub use study::study_page;

/// What a page about a plan has, whatever is measured.
#[derive(Debug, Clone, Copy)]
pub struct PlanPage<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The robot in each configuration, see [`Stills::figures`](super::stills::Stills::figures).
    pub stills: &'a Value,
    /// What must be looked at.
    pub conditions: &'a [Condition],
    /// Where it comes from.
    pub provenance: &'a ProvenanceMessage,
    /// The command that made the page.
    pub command: &'a str,
    /// Where the plan is, or may be written.
    pub plan: &'a Path,
    /// What is unknown of absolute readings, where that was named.
    pub parameters: &'a [ParameterGroup],
}

impl PlanPage<'_> {
    /// What it shows: the budget where it has more than the instrument's noise, what is at each test pose, and the plan's rows.
    fn shown(
        &self,
        budget: Option<&UncertaintyBudget>,
        test_poses: Option<&Value>,
        plan: &[PlanRowMessage],
    ) -> Value {
        let scenario = self.scenario;
        let belief = &scenario.task.belief;
        let columns = belief.commands().columns().into_iter();
        let angles = columns.map(|column| column.replace('_', " [") + "]");
        let turns = |row: &PlanRowMessage| row.wrench.is_some_and(|wrench| wrench[3..] != [0.0; 3]);
        json!({
            "name": scenario.name,
            "description": scenario.description,
            "conditions": texts(self.conditions),
            "budget": budget.filter(|budget| budget.has_more_than_noise()),
            "test_poses": test_poses,
            "path": shell_path(&scenario.path),
            "plan": shell_path(self.plan),
            "groups": joined(self.parameters.iter().map(|group| group.word()), ","),
            "stills": self.stills,
            "reads_along": belief.instrument.reads_along(),
            "rows": plan,
            "angles": angles.collect::<Vec<_>>(),
            "has_torque": plan.iter().any(turns),
            "tool": belief.calibration_tool.name,
            "provenance": self.provenance,
            "command": self.command,
        })
    }
}

/// The report of a run as HTML.
///
/// # Errors
/// See [`PageError`].
pub fn run_page(shown: &PlanPage<'_>, outcome: &RunOutcome) -> Result<String, PageError> {
    let (scenario, evidence, own) = (shown.scenario, &outcome.evidence, &outcome.tried[0]);
    let (record, assessment) = (&own.record, &own.assessment);
    let poses = &record.test_poses;
    let rho0_mm = assessment.rho0_m.map(|value| value * 1e3);
    let test_poses = (poses.len() > 1).then(|| {
        let predicted_mm = poses.iter().map(|pose| pose.rho0_mm);
        let observed = Some((&**poses, "uncompensated"));
        test_poses(&scenario.task.test_poses, predicted_mm, rho0_mm, observed)
    });
    let budget = assessment.uncertainty_budget.as_ref();
    let of_plan = shown.shown(budget, test_poses.as_ref(), &record.plan);
    // Random plans come last.
    let lines = lines(&evidence.study, |place| place + 1 == evidence.study.len());
    let belief = &scenario.task.belief;
    let unit = belief.compliance_unit("1e-6");
    let nominal_rad_per_nm = &belief.nominal.compliance_rad_per_nm;
    let found = IdentificationMessage::new(&own.calibration.identification, nominal_rad_per_nm);
    let shown = json!({
        "page": of_plan,
        "run": of_run(scenario, outcome),
        "distances": distances(&evidence.study, &lines),
        "compliances": {
            "figure": compliances_figure(&found, &record.truth),
            "table": tables::compliances(&found, &record.truth, &unit),
        },
        "residuals": residuals_figure(&standardised(&own.calibration)),
        "both_sigmas": belief.instrument.both_sigmas(|value| micrometres(Some(value * 1e3))),
        "plans": tables::tried(&outcome.tried),
        "accuracy": accuracy_figure(evidence, assessment.experiments),
    });
    let title = format!("{}: calibration report", scenario.name);
    page(&title, "run.html", &shown)
}

/// Of each measurement the residual's coordinates over their standard deviations, and along a gauge.
fn standardised(calibration: &Calibration) -> Vec<[Option<f64>; 4]> {
    let residuals = calibration.residuals.iter().zip(&calibration.measurements);
    let each = |(residual, measured): (&MeasurementResidual, &Measurement)| {
        let value = |row: usize| residual.standardised.get(row).copied().flatten();
        match measured.direction {
            Some(_) => [None, None, None, value(0)],
            None => [value(0), value(1), value(2), None],
        }
    };
    residuals.map(each).collect()
}

/// What must be looked at, in words.
fn texts(conditions: &[Condition]) -> Vec<String> {
    conditions.iter().map(ToString::to_string).collect()
}

/// What comes several times, once.
fn each_once<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for each in all {
        if !once.contains(&each) {
            once.push(each);
        }
    }
    once
}
