//! `identify`: compliances from measurements.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::files::FileError;
use elastocal::files::output::write_whole;
use elastocal::identification::diagnoses::{Diagnosis, diagnoses};
use elastocal::identification::{Case, Identification, IdentificationError, Sigma, residuals};
use elastocal::measurement::{Origin, read_measurements};
use elastocal::record::messages::{FingerprintMessage, IdentificationMessage, ProvenanceMessage};
use elastocal::record::residuals::ResidualsMessage;
use elastocal::task::Method;
use elastocal::wording::{counted, shell_word};
use serde_json::json;

use super::residuals;
use super::table::{number, table};
use super::{Common, Report, check_outputs, inputs, merge, named_by_file, results, without_effect};

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
    /// Estimate sigma from the residuals instead of taking the scenario's.
    #[arg(long)]
    sigma_from_residuals: bool,
    /// Where to write what was identified, for `compensate`.
    #[arg(long, value_name = "FILE")]
    identified_out: Option<PathBuf>,
}

impl Identify {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let origin = Origin::read(&self.measurements)?;
        let file = shell_word(&self.measurements.to_string_lossy());
        let usage = format!("elastocal identify SCENARIO --measurements {file}");
        let scenario = (self.common).load_for(&self.measurements, origin.as_ref(), &usage)?;
        let measurements = read_measurements(&self.measurements, scenario.task.belief.commands())?;
        let outputs = [("--identified-out", self.identified_out.as_deref())];
        let mut roles = inputs(&scenario);
        roles.reads("the measurements", &self.measurements);
        check_outputs(&mut roles, &outputs)?;
        let loads = measurements.iter().map(|each| &each.load);
        let loads_outside = scenario.task.loads.outside_all("measurement", loads);
        let method = self.method.unwrap_or(scenario.task.belief.method);
        self.common.say(&format!(
            "identifying {} from {}",
            scenario.task.belief.parameter_names().join(", "),
            counted(measurements.len() as u64, "measurement")
        ));
        if self.sigma_from_residuals && scenario.task.belief.prior.is_some() {
            let problem = "with what is known before, sigma has to be known, too";
            let wrong = FileError::new(&scenario.path, problem).at("robot.prior");
            return Err(wrong
                .hint("leave out --sigma-from-residuals, or the key")
                .into());
        }
        let sigma = if self.sigma_from_residuals {
            Sigma::FromResiduals(scenario.task.belief.instrument.sigma_m)
        } else {
            Sigma::Known(scenario.task.belief.instrument.sigma_m)
        };
        let case = Case {
            nominal: &scenario.task.belief.nominal,
            tool: &scenario.task.belief.calibration_tool,
            parameters: &scenario.task.belief.parameters,
            prior: scenario.task.belief.prior.as_ref(),
            measurements: &measurements,
            sigma,
            method,
        };
        let identification = (case.identify())
            .map_err(|error| explained(&self.measurements, &error, &diagnoses(&case, None)))?;
        let residuals = residuals(&case, &identification)?;
        let diagnoses = diagnoses(&case, Some(&identification));
        let mut message = IdentificationMessage::from(&identification);
        message.conditions.extend(diagnoses.iter().map(likely));
        let keys = json!({
            "sigma_from_residuals": self.sigma_from_residuals,
            "identified_with": FingerprintMessage::from(scenario.task.belief.fingerprint()),
            "scenario_file": scenario.path,
        });
        let provenance =
            ProvenanceMessage::new(&scenario).with_input("measurements", &self.measurements)?;
        let mut json = results("identify", &provenance, keys);
        merge(&mut json, serde_json::to_value(&message)?);
        let more = ResidualsMessage::new(&residuals, &diagnoses);
        merge(&mut json, serde_json::to_value(&more)?);
        let mut text = describe(&identification);
        if measurements.iter().any(|each| each.sigma_m.is_some()) {
            text += "  (sigma is the rms of those that the measurements bring)\n";
        }
        text += &format!("\n{}", residuals::describe(&identification, &residuals));
        if let Some(path) = &self.identified_out {
            write_whole(
                path,
                (serde_json::to_string_pretty(&json)? + "\n").as_bytes(),
            )?;
            text += &format!("wrote {}\n", path.display());
        }
        Ok(Report {
            json,
            text,
            conditions: (loads_outside.into_iter())
                .chain(identification.conditions())
                .chain(diagnoses.iter().map(likely))
                .collect(),
        })
    }
}

fn likely(diagnosis: &Diagnosis) -> String {
    format!("likely mistake: {}", diagnosis.text)
}

fn explained(file: &Path, error: &IdentificationError, diagnoses: &[Diagnosis]) -> FileError {
    let wrong = FileError::new(file, error.to_string());
    if !diagnoses.is_empty() {
        let all: Vec<String> = diagnoses.iter().map(likely).collect();
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

/// An identification for a person.
pub fn describe(identification: &Identification) -> String {
    let micro = |value: f64| number(Some(value * 1e6), 4);
    let rows: Vec<Vec<String>> = identification
        .parameters
        .iter()
        .map(|parameter| {
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
                row.extend(["not determined", "-", "-"].map(str::to_owned));
                row
            }
        })
        .collect();
    let mut text = table(
        &[
            "joint",
            "compliance [1e-6 rad/(N m)]",
            "standard error",
            "95 % interval",
        ],
        &rows,
    );
    text += &format!(
        "  sigma {:.4} mm, from residuals {} mm; condition number {:.2}\n",
        identification.sigma_m * 1e3,
        number(identification.residual_sigma_m.map(|sigma| sigma * 1e3), 4),
        identification.condition
    );
    text
}
