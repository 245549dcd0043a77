//! `identify`: compliances from measurements.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::codes::{ConditionCode, ErrorCode};
use elastocal::files::{FileError, output::write_whole};
use elastocal::identification::{
    Identification, IdentificationError, ParameterGroup, ReadingWeights, Robustness,
    UncertainEstimate,
};
use elastocal::measurement::{
    AbsoluteReading, MeasuredFile, Measurement, Origin, controller_compensates, read_measured,
};
use elastocal::record::{json::merge, messages::ProvenanceMessage};
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use elastocal::text::wording::{counted, shell_path};
use elastocal::workflow::identify::{HowIdentified, NotIdentified, identify_measurements};
use serde_json::{Value, json};

use super::identify_absolute::Asked;
use super::study::results::noted;
use super::table::{number, or_dash, table};
use super::{Common, Report, check_outputs, inputs, named_by_file, without_effect};
use super::{identify_absolute, patterns, repeats, residuals};

/// Arguments of `identify`.
#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Identify {
    #[command(flatten)]
    pub common: Common,
    /// The measurements.
    #[arg(long, value_name = "FILE")]
    measurements: PathBuf,
    /// How; the scenario's method if not given.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Estimate sigma from the residuals instead of taking the scenario's. Of absolute readings: weigh them by the model
    /// discrepancy, too, even where their own deviations explain the residuals.
    #[arg(long)]
    sigma_from_residuals: bool,
    /// What to fit to absolute readings, frames of stations and targets always among it; what the scenario's robot.parameters
    /// name if not given.
    #[arg(long, value_enum, value_name = "GROUPS", value_delimiter = ',')]
    parameters: Vec<ParameterGroup>,
    /// Compare models with more and more parameters (frames, zeros, links, compliances, springs, payload) by blocks of joint
    /// space that they were not fitted to, and fit the one that is recommended. Of absolute readings.
    #[arg(long, conflicts_with = "parameters")]
    model_selection: bool,
    /// Another series of absolute readings of the same robot, fitted apart in the same way: inconsistent parameters
    /// are named.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Where to write a picture (SVG) of each model's residuals.
    #[arg(long, value_name = "FILE", requires = "model_selection")]
    plot_out: Option<PathBuf>,
    /// Fit readings that lie far out, too: more than 5 standard deviations from what the others say.
    #[arg(long)]
    keep_all: bool,
    /// Where to write the variance components of the residuals, as tables [[uncertainty]] for a scenario: joint error functions and
    /// discrepancy. Of absolute readings.
    #[arg(long, value_name = "FILE")]
    uncertainties_out: Option<PathBuf>,
    /// Where to write what was identified, for `compensate`.
    #[arg(long, value_name = "FILE")]
    identified_out: Option<PathBuf>,
}

impl Identify {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let origin = Origin::read(&self.measurements)?;
        let file = shell_path(&self.measurements);
        let usage = format!("elastocal identify SCENARIO --measurements {file}");
        let scenario = (self.common).load_for(&self.measurements, origin.as_ref(), &usage)?;
        let measured = read_measured(&self.measurements, &scenario.task.belief)?;
        let outputs = [
            ("--identified-out", self.identified_out.as_deref()),
            ("--plot-out", self.plot_out.as_deref()),
            ("--uncertainties-out", self.uncertainties_out.as_deref()),
        ];
        let mut roles = inputs(&scenario);
        roles.reads("the measurements", &self.measurements);
        roles.may_read("the other measurements", self.against.as_deref());
        check_outputs(&mut roles, &outputs)?;
        let mut report = match measured {
            MeasuredFile::Deflections(measurements) => {
                self.of_deflections(&scenario, origin.as_ref(), &measurements)?
            }
            MeasuredFile::Absolute(readings) => self.of_absolute(&scenario, &readings)?,
        };
        if controller_compensates(&self.measurements)? {
            let words = "the controller compensated deflections itself (KUKA: $ABS_ACCUR), as the file of measurements says";
            let condition = ConditionCode::ControllerCompensates.with(words);
            let conditions = report.json.get_mut("conditions");
            if let Some(conditions) = conditions.and_then(Value::as_array_mut) {
                conditions.push(json!(condition));
            }
            report.conditions.push(condition);
        }
        if let Some(path) = &self.identified_out {
            let text = serde_json::to_string_pretty(&report.json)? + "\n";
            write_whole(path, text.as_bytes())?;
            report.text += &format!("wrote {}\n", path.display());
        }
        Ok(report)
    }

    fn of_absolute(
        &self,
        scenario: &Scenario,
        readings: &[AbsoluteReading],
    ) -> anyhow::Result<Report> {
        if let Some(Method::Linear) = self.method {
            let problem = "holds absolute readings, which no linear fit takes";
            let hint = "leave out --method";
            return Err(FileError::new(&self.measurements, problem)
                .hint(hint)
                .code(ErrorCode::OtherAccuracy)
                .into());
        }
        let weights = match (self.sigma_from_residuals, self.common.noise_only) {
            (true, _) => ReadingWeights::WithDiscrepancy,
            (false, true) => ReadingWeights::Own,
            (false, false) => ReadingWeights::AsNeeded,
        };
        self.common.say(&format!(
            "fitting the robot to {}",
            counted(readings.len() as u64, "absolute reading")
        ));
        let asked = Asked {
            groups: &self.parameters,
            weights,
            by_model_selection: self.model_selection,
            against: self.against.as_deref(),
            plot_out: self.plot_out.as_deref(),
            uncertainties_out: self.uncertainties_out.as_deref(),
            keeps_all: self.keep_all,
        };
        identify_absolute::execute(scenario, &self.measurements, readings, &asked)
    }

    /// Options that are for absolute readings alone.
    fn refuse_of_deflections(&self) -> Result<(), FileError> {
        let refused = [
            (
                self.model_selection,
                "--model-selection",
                "for which there is no model selection",
            ),
            (
                self.against.is_some(),
                "--against",
                "which are compared with no other series",
            ),
            (
                !self.parameters.is_empty(),
                "--parameters",
                "of which robot.parameters of the scenario says what to identify",
            ),
            (
                self.uncertainties_out.is_some(),
                "--uncertainties-out",
                "of which no joint error functions are estimated",
            ),
        ];
        for (is_given, option, why) in refused {
            if is_given {
                let problem = format!("holds deflections, {why}");
                let hint = format!("leave out {option}, which is for absolute readings");
                let wrong = FileError::new(&self.measurements, problem).hint(hint);
                return Err(wrong.code(ErrorCode::OtherAccuracy));
            }
        }
        Ok(())
    }

    fn of_deflections(
        &self,
        scenario: &Scenario,
        origin: Option<&Origin>,
        measurements: &[Measurement],
    ) -> anyhow::Result<Report> {
        self.refuse_of_deflections()?;
        let loads = measurements.iter().map(|each| &each.load);
        let loads_outside = scenario.task.loads.outside_all("measurement", loads);
        let method = self.method.unwrap_or(scenario.task.belief.method);
        self.common.say(&format!(
            "identifying {} from {}",
            scenario.task.belief.parameter_names().join(", "),
            counted(measurements.len() as u64, "measurement")
        ));
        if self.sigma_from_residuals && scenario.task.belief.knows_before() {
            let problem = "with what is known before, sigma has to be known, too";
            let wrong = FileError::new(&scenario.path, problem).code(ErrorCode::Scenario);
            let (key, hint) = if scenario.task.belief.uncertain.is_some() {
                (
                    "uncertainty",
                    "leave out --sigma-from-residuals, or give --noise-only",
                )
            } else {
                (
                    "robot.prior",
                    "leave out --sigma-from-residuals, or the key",
                )
            };
            return Err(wrong.at(key).hint(hint).into());
        }
        let belief = &scenario.task.belief;
        let how = HowIdentified {
            method,
            sigma_from_residuals: self.sigma_from_residuals,
            robustness: Robustness {
                keeps_all: self.keep_all,
                counts_discrepancy: !self.common.noise_only,
                holds_nominal: true,
            },
        };
        let identified = identify_measurements(belief, measurements, how)
            .map_err(|problem| explained(&self.measurements, &problem))?;
        let provenance =
            ProvenanceMessage::new(scenario).with_input("measurements", &self.measurements)?;
        // Another state of the scenario has another virtual robot.
        let simulated = origin
            .filter(|origin| origin.scenario_sha256 == scenario.sha256)
            .and_then(|origin| origin.simulated);
        let mut json = identified.json(scenario, &provenance, self.sigma_from_residuals)?;
        merge(&mut json, json!({ "simulated": simulated }));
        let (identification, residuals) = (&identified.identification, &identified.residuals);
        let mut text = describe(identification);
        if measurements.iter().any(|each| each.sigma_m.is_some()) {
            text += "  (sigma is the rms of those that the measurements bring)\n";
        }
        text += &format!(
            "\n{}",
            residuals::describe(identification, residuals, &identified.rejected)
        );
        text += &patterns::describe(&identified.patterns);
        text += &repeats::describe(identified.repeats.as_ref(), "deflections");
        text += &noted(&identified.notes());
        Ok(Report::new(
            json,
            text,
            (loads_outside.into_iter())
                .chain(identified.conditions())
                .collect(),
        ))
    }
}

/// Why nothing is identified, with what to do about it.
pub fn explained(file: &Path, problem: &NotIdentified) -> FileError {
    let NotIdentified { error, conditions } = problem;
    let wrong = FileError::new(file, error.to_string()).code(error.code());
    if !conditions.is_empty() {
        let all: Vec<&str> = conditions.iter().map(|each| each.text.as_str()).collect();
        return wrong.hint(all.join("; "));
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

/// Of what the measurements make something known by so much less than before, they are said to tell something.
const TOLD: f64 = 0.95;

/// What else is uncertain, as far as the measurements tell something of it.
fn uncertain(identification: &Identification) -> String {
    let small = |value: Option<f64>| or_dash(value, |value| format!("{value:.3e}"));
    let is_told = |each: &&UncertainEstimate| match (each.estimate, each.prior_deviation) {
        (Some(estimate), Some(before)) => estimate.standard_error < TOLD * before,
        _ => true,
    };
    let row = |each: &UncertainEstimate| {
        vec![
            each.name.clone(),
            small(each.estimate.map(|estimate| estimate.value)),
            small(each.estimate.map(|estimate| estimate.standard_error)),
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

/// An identification for a person.
pub fn describe(identification: &Identification) -> String {
    let micro = |value: f64| number(Some(value * 1e6), 4);
    let rows = identification.parameters.iter().map(|parameter| {
        if let Some(estimate) = parameter.estimate {
            vec![
                parameter.name.clone(),
                micro(estimate.value),
                micro(estimate.standard_error),
                format!(
                    "{} to {}",
                    micro(estimate.interval95[0]),
                    micro(estimate.interval95[1])
                ),
            ]
        } else {
            let mut row = vec![parameter.name.clone()];
            let stays = &identification.stays_nominal;
            let is_nominal = stays.iter().any(|each| each.name == parameter.name);
            let why = if is_nominal {
                "nominal"
            } else {
                "not determined"
            };
            row.extend([why, "-", "-"].map(str::to_owned));
            row
        }
    });
    let mut text = table(
        "joint | compliance [1e-6 rad/(N m)] | standard error | 95 % interval",
        rows,
    );
    text += &uncertain(identification);
    text += &format!(
        "  sigma {:.4} mm, from residuals {} mm; condition number {:.2}\n",
        identification.sigma_m * 1e3,
        number(identification.residual_sigma_m.map(|sigma| sigma * 1e3), 4),
        identification.condition
    );
    if let Some(discrepancy) = identification.discrepancy {
        text += &format!(
            "  Model discrepancy {:.4} mm in each coordinate, which the standard errors count.\n",
            discrepancy.position_m * 1e3
        );
    }
    text
}
