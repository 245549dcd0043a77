//! `identify` on deflections.

use crate::identification::{
    Case, Identification, IdentificationError, Robustness, Sigma, UncertainEstimate,
};
use crate::measurement::{Measurement, Origin};
use crate::robot::ReadsAlong;
use crate::task::Belief;
use crate::workflow::identify::{NotIdentified, identify_measurements};

use super::Identify;
use crate::cli::command_prelude::*;
use crate::cli::residuals;

impl Identify {
    /// Compliances.
    pub(super) fn of_deflections(
        &self,
        scenario: &Scenario,
        origin: Option<&Origin>,
        measurements: &[Measurement],
    ) -> anyhow::Result<Report> {
        let loads = measurements.iter().map(|each| &each.load);
        let loads_outside = scenario.task.loads.outside_all("measurement", loads);
        let belief = &scenario.task.belief;
        let method = self.method.unwrap_or(belief.method);
        say(&self.common, belief, measurements.len());
        let is_plain = belief.uncertain.is_plain();
        if self.sigma_from_residuals && (belief.prior.is_some() || !is_plain) {
            let problem = "with what is known before, sigma has to be known, too";
            let wrong = FileError::new(&scenario.path, problem).code(ErrorCode::Scenario);
            let (key, or) = if is_plain {
                ("robot.prior", "the key")
            } else {
                ("uncertainty", "give --noise-only")
            };
            let hint = format!("leave out --sigma-from-residuals, or {or}");
            return Err(wrong.at(key).hint(hint).into());
        }
        let robustness = Robustness {
            keeps_all: self.keep_all,
            counts_discrepancy: !self.common.noise_only,
            holds_nominal: true,
        };
        let sigma = Sigma::of(belief, self.sigma_from_residuals);
        let case = Case::of_belief(belief, measurements, sigma, method);
        let identified = identify_measurements(case, robustness)
            .map_err(|problem| explained(&self.measurements, &problem))?;
        let provenance = self.common.provenance(scenario)?;
        // Another state of the scenario has another virtual robot.
        let simulated = origin
            .filter(|origin| origin.scenario_sha256 == scenario.sha256)
            .and_then(|origin| origin.simulated);
        let mut json = identified.json(
            scenario,
            measurements,
            &provenance,
            self.sigma_from_residuals,
        )?;
        json["simulated"] = json!(simulated);
        let (identification, residuals) = (&identified.identification, &identified.residuals);
        let mut text = describe(identification, belief);
        let is_own = measurements.iter().any(|each| each.sigma_m.is_some());
        if is_own && belief.instrument.reads_along() != ReadsAlong::Sometimes {
            text += "  (sigma is the rms of those that the measurements bring)\n";
        }
        text += &format!(
            "\n{}",
            residuals::residuals(
                identification,
                measurements,
                residuals,
                &identified.rejected
            )
        );
        text += &residuals::patterns(&identified.patterns);
        text += &residuals::repeats(identified.repeats.as_ref(), "deflections");
        text += &noted(&identified.notes());
        let conditions = (loads_outside.into_iter().chain(identified.conditions()))
            .chain(scenario.of_unknown_origin());
        let mut report = Report::new(json, text, conditions.collect());
        self.draw_patterns(scenario, &identified.patterns, &mut report)?;
        Ok(report)
    }
}

/// Says what is identified, and from how many measurements.
pub fn say(common: &Common, belief: &Belief, measurements: usize) {
    let (names, count) = (belief.parameter_names(), measurements as u64);
    let measurements = counted(count, "measurement");
    common.say(&format!(
        "identifying {} from {measurements}",
        names.join(", ")
    ));
}

/// Why nothing is identified, with what to do about it.
pub fn explained(file: &Path, problem: &NotIdentified) -> FileError {
    let NotIdentified { error, conditions } = problem;
    let wrong = FileError::new(file, error.to_string()).code(error.code());
    if !conditions.is_empty() {
        let all = conditions.iter().map(|each| &each.text);
        return wrong.hint(joined(all, "; "));
    }
    match error {
        IdentificationError::Equilibrium { .. } | IdentificationError::NotConverged { .. } => wrong
            .hint("check signs, units and frames of deflections and loads, or try --method linear"),
        IdentificationError::NoResiduals { .. } => {
            wrong.hint("measure more, or leave out --sigma-from-residuals")
        }
        _ => wrong,
    }
}

/// Measurements are said to tell something where they make it known better than before by more than this share.
const TOLD: f64 = 0.95;

/// Whether they do, by a standard error and the standard deviation before; where nothing was known before, whatever they tell.
fn is_told(error: Option<f64>, before: Option<f64>) -> bool {
    error
        .zip(before)
        .is_none_or(|(error, before)| error < TOLD * before)
}

/// What else is uncertain, as far as the measurements tell something of it.
fn uncertain(identification: &Identification) -> String {
    let small = |value: Option<f64>| or_dash(value, |value| format!("{value:.3e}"));
    let is_told = |each: &&UncertainEstimate| is_told(each.standard_error, each.prior_deviation);
    let row = |each: &UncertainEstimate| {
        vec![
            each.name.clone(),
            small(each.value),
            small(each.standard_error),
            small(each.prior_deviation),
            each.unit.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = (identification.uncertain.iter().filter(is_told))
        .map(row)
        .collect();
    let silent = identification.uncertain.len() - rows.len();
    let mut text = String::new();
    if !rows.is_empty() {
        let header = "uncertain | value | standard error | before | unit";
        text += &format!("\n{}", table(header, rows));
    }
    if silent > 0 {
        text += &format!(
            "  the measurements say next to nothing of {}\n",
            counted(silent as u64, "other uncertain parameter")
        );
    }
    text
}

/// The compliances of which the measurements tell next to nothing beside what was known before.
fn known_before(identification: &Identification, belief: &Belief) -> String {
    let parameters = identification.parameters.iter();
    let only_before = parameters
        .zip(belief.prior_deviations())
        .filter(|(each, before)| {
            let error = each.estimate.map(|estimate| estimate.standard_error);
            !is_told(error, *before)
        });
    naming(
        only_before.map(|(each, _)| &each.name),
        "  the measurements say next to nothing of the compliance of {}: as known before\n",
    )
}

/// An identification for a person.
pub fn describe(identification: &Identification, belief: &Belief) -> String {
    let micro = |value: f64| number(Some(value * 1e6), 4);
    let rows = identification.parameters.iter().map(|parameter| {
        let mut row = vec![parameter.name.clone()];
        if let Some(estimate) = parameter.estimate {
            let interval = estimate.interval95.map(micro).join(" to ");
            row.extend([
                micro(estimate.value),
                micro(estimate.standard_error),
                interval,
            ]);
        } else {
            let mut stays = identification.stays_nominal.iter();
            let is_nominal = stays.any(|each| each.name == parameter.name);
            let why = if is_nominal {
                "nominal"
            } else {
                "not determined"
            };
            row.extend([why, "-", "-"].map(str::to_owned));
        }
        row
    });
    let header = format!(
        "joint | compliance [{}] | standard error | 95 % interval",
        belief.compliance_unit("1e-6")
    );
    let mut text = table(&header, rows);
    text += &known_before(identification, belief);
    text += &uncertain(identification);
    text += &format!(
        "  sigma {:.4} mm, from residuals {} mm; condition number {:.2}\n",
        identification.sigma_m * 1e3,
        number(identification.residual_sigma_m.map(|sigma| sigma * 1e3), 4),
        identification.condition
    );
    let shown = |value: f64| format!("{:.4} mm", value * 1e3);
    if let Some(both) = belief.instrument.both_sigmas(shown) {
        text += &format!("  (sigma is the rms over all that is read: given are {both})\n");
    }
    if let Some([position_m, _]) = identification.discrepancy {
        text += &format!(
            "  Model discrepancy {:.4} mm in each coordinate, which the standard errors count.\n",
            position_m * 1e3
        );
    }
    text
}
