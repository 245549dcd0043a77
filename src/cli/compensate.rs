//! `compensate`: the joint angles to command at the test poses.

use std::path::{Path, PathBuf};

use clap::Args;
use elastocal::calibration::compensate_poses;
use elastocal::files::FileError;
use elastocal::identification::covariance_of;
use elastocal::measurement::Origin;
use elastocal::plausible::ELASTIC_COMPLIANCE;
use elastocal::record::messages::{IdentificationMessage, ProvenanceMessage, TestPoseMessage};
use elastocal::record::schema::read_results;
use elastocal::scenario::{Method, Scenario};
use elastocal::wording::shell_word;
use serde_json::{Value, json};

use super::table::{number, table};
use super::{Common, Report, named_by_file, results, without_effect};

/// Arguments of `compensate`.
#[derive(Debug, Args)]
#[command(mut_arg("scenario", named_by_file))]
#[command(mut_args(without_effect(&["seed", "threads", "out"])))]
pub struct Compensate {
    #[command(flatten)]
    pub common: Common,
    /// What `identify --identified-out` wrote.
    #[arg(long, value_name = "FILE")]
    identified: PathBuf,
    /// How; the scenario's method if not given.
    #[arg(long, value_enum)]
    method: Option<Method>,
}

impl Compensate {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let hint = "the file must be one that `elastocal identify --identified-out` wrote";
        let (text, json) = read_results(&self.identified, &["identify", "run"], hint)?;
        let origin = origin(&json);
        let file = shell_word(&self.identified.to_string_lossy());
        let usage = format!("elastocal compensate SCENARIO --identified {file}");
        let scenario = (self.common).load_for(&self.identified, origin.as_ref(), &usage)?;
        let (compliance, covariance) = read_identified(&self.identified, &text, hint, &scenario)?;
        let method = self.method.unwrap_or(scenario.method);
        self.common.say("compensating on the virtual robot");
        let poses = compensate_poses(&scenario, &compliance, &covariance, method)?;
        let messages: Vec<TestPoseMessage> = poses.iter().map(Into::into).collect();
        let rows: Vec<Vec<String>> = messages
            .iter()
            .map(|pose| {
                vec![
                    pose.name.clone(),
                    format!("{:.4}", pose.uncompensated_mm),
                    format!("{:.4}", pose.residual_mm),
                    number(pose.rho0_mm, 4),
                    pose.q_commanded_deg
                        .iter()
                        .map(|angle| format!("{angle:.5}"))
                        .collect::<Vec<_>>()
                        .join(" "),
                ]
            })
            .collect();
        let first = &messages[0];
        Ok(Report {
            json: results(
                "compensate",
                &ProvenanceMessage::new(&scenario),
                json!({
                    "q_commanded_deg": first.q_commanded_deg,
                    "uncompensated_mm": first.uncompensated_mm,
                    "residual_mm": first.residual_mm,
                    "rho0_mm": first.rho0_mm,
                    "test_poses": messages,
                }),
            ),
            text: table(
                &[
                    "test pose",
                    "uncompensated [mm]",
                    "compensated [mm]",
                    "predicted rms [mm]",
                    "commanded angles [deg]",
                ],
                &rows,
            ),
            conditions: Vec::new(),
        })
    }
}

/// Under which scenario it was identified, as the file says.
fn origin(json: &Value) -> Option<Origin> {
    let scenario = json["scenario_file"].as_str();
    let hash = json["provenance"]["scenario_sha256"].as_str();
    scenario.zip(hash).map(|(scenario, hash)| Origin {
        scenario: scenario.into(),
        scenario_sha256: hash.to_owned(),
    })
}

/// The compliances of all joints, nominal where none was identified, and the covariance of the
/// parameters.
fn read_identified(
    path: &Path,
    text: &str,
    hint: &str,
    scenario: &Scenario,
) -> Result<(Vec<f64>, nalgebra::DMatrix<f64>), FileError> {
    let reader = &mut serde_json::Deserializer::from_str(text);
    let message: IdentificationMessage =
        serde_path_to_error::deserialize(reader).map_err(|error| {
            let wrong = FileError::new(path, error.inner().to_string()).hint(hint);
            match error.path().to_string().as_str() {
                "." => wrong,
                key => wrong.at(key),
            }
        })?;
    let expected = scenario.parameter_names();
    if message.parameters != expected {
        let problem = format!(
            "found {}; the scenario's parameters are {}",
            message.parameters.join(", "),
            expected.join(", ")
        );
        return Err(FileError::new(path, problem).at("parameters"));
    }
    let size = expected.len();
    let wrong_size = |key: &str, found: usize| {
        let problem = format!("found {found} values; the scenario has {size} parameters");
        FileError::new(path, problem).at(key)
    };
    if message.compliance_rad_per_nm.len() != size {
        let found = message.compliance_rad_per_nm.len();
        return Err(wrong_size("compliance_rad_per_nm", found));
    }
    let covariance = &message.covariance_rad2_per_n2m2;
    if covariance.len() != size {
        return Err(wrong_size("covariance_rad2_per_n2m2", covariance.len()));
    }
    let covariance = covariance_of(covariance).map_err(|(place, problem)| {
        FileError::new(path, problem).at(format!("covariance_rad2_per_n2m2{place}"))
    })?;
    let mut compliance = scenario.nominal.compliance_rad_per_nm.clone();
    let identified = scenario
        .parameters
        .iter()
        .zip(&message.compliance_rad_per_nm);
    for (index, (&joint, value)) in identified.enumerate() {
        let Some(value) = *value else { continue };
        compliance[joint] = ELASTIC_COMPLIANCE.check(value).map_err(|problem| {
            FileError::new(path, format!("{}: {problem}", expected[index]))
                .at(format!("compliance_rad_per_nm[{index}]"))
                .hint("measure again with loads that bend this joint, or take it out of robot.parameters")
        })?;
    }
    Ok((compliance, covariance))
}
