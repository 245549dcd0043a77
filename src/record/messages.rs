//! The JSON records of a calibration, with the unit of every number in its key.
//!
//! The command line's `--json`, results.json and the MCAP file share them. Numbers that do not
//! exist (an unidentifiable compliance, an infinite condition number) are `null`.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::Vector3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::{Map, Value, json};

use crate::calibration::CompensatedPose;
use crate::files::schema::RESULTS_VERSION;
use crate::measurement::Measurement;
use crate::observation::{LengthKind, ReadLength};
use crate::plan::{Assessment, Criterion, Experiment, Plan, Violation};
use crate::quantities::units;
use crate::robot::{Approach, Commands, Load};
use crate::scenario::Scenario;
use crate::task::AccuracyKind;
use crate::{COMMIT, VERSION};

/// What a JSON file holds and in which form, so that another version can tell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SchemaMessage {
    /// "elastocal." and the command that makes such results.
    pub name: String,
    /// The version of the form, the same for all results.
    pub version: u32,
}

impl SchemaMessage {
    /// The schema of what a command of this program prints.
    pub fn new(command: &str) -> Self {
        Self {
            name: format!("elastocal.{command}"),
            version: RESULTS_VERSION,
        }
    }
}

/// Where an output comes from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ProvenanceMessage {
    /// The version of elastocal.
    pub version: String,
    /// The commit that it was built from, with "-dirty" where its sources had been changed since.
    pub commit: String,
    /// The scenario's name.
    pub scenario: String,
    /// SHA-256 of the scenario's keys and values, without `[gate]`, and of the bytes of all files that it
    /// names: models with what they include and their meshes and height fields, and plans; in
    /// hexadecimal.
    pub scenario_sha256: String,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The kind of machine and system.
    pub platform: String,
    /// SHA-256 of the files that were given beside the scenario, by what they are: "plan",
    /// "measurements", "identified"; in hexadecimal.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs_sha256: BTreeMap<String, String>,
    /// Whether the scenario's uncertainties were left out of the belief.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub noise_only: bool,
}

impl ProvenanceMessage {
    /// The provenance of what this program makes of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            version: VERSION.to_owned(),
            commit: COMMIT.to_owned(),
            scenario: scenario.name.clone(),
            scenario_sha256: scenario.sha256.clone(),
            seed: scenario.seed,
            platform: platform(),
            inputs_sha256: BTreeMap::new(),
            noise_only: scenario.is_noise_only,
        }
    }
}

/// What results are and where they come from, and the command's keys: of those that coincide, the last.
pub fn results(
    command: &str,
    provenance: &ProvenanceMessage,
    keys: impl IntoIterator<Item = Value>,
) -> Value {
    let mut json = json!({ "schema": SchemaMessage::new(command), "provenance": provenance });
    keys.into_iter().for_each(|keys| merge(&mut json, keys));
    json
}

/// Adds the keys of one JSON object to another, or to nothing.
pub fn merge(into: &mut Value, from: Value) {
    match (into, from) {
        (Value::Object(into), Value::Object(from)) => into.extend(from),
        (into @ Value::Null, from) => *into = from,
        _ => {}
    }
}

/// What results may depend on to the last bit beyond the program, the scenario and the seed: the machine's kind and system,
/// and the instruction sets for which the numerical libraries have code of its own, such as "`x86_64` linux avx2 fma".
pub fn platform() -> String {
    #[cfg(target_arch = "x86_64")]
    let sets = [
        (" avx2", is_x86_feature_detected!("avx2")),
        (" fma", is_x86_feature_detected!("fma")),
        (" avx512f", is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let sets: [(&str, bool); 0] = [];
    let sets = sets.into_iter().filter(|(_, has)| *has);
    let sets: String = sets.map(|(name, _)| name).collect();
    format!("{} {}{sets}", std::env::consts::ARCH, std::env::consts::OS)
}

/// One row of a plan: a configuration and a load.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PlanRowMessage {
    /// The commanded joint angles (deg), and lengths (mm) of joints that slide.
    pub q_deg: Vec<f64>,
    /// Force (N) and torque (N m) in the world frame at the calibration tool; null without a load.
    pub wrench: Option<[f64; 6]>,
    /// How often it is measured, or read.
    pub repeats: u32,
    /// The side from which each joint comes to its command, `+` or `-`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub approach: Option<String>,
    /// The direction that a gauge reads along: a unit vector in the world frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// What is read and from where, of absolute readings.
    #[serde(flatten)]
    pub reads: Option<PlannedReadingMessage>,
}

/// What is read in a row of a plan of absolute readings, and from where.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PlannedReadingMessage {
    /// The site that is read; null for the calibration tool.
    pub target: Option<String>,
    /// Where the instrument stands.
    pub station: Option<String>,
    /// The nominal length that is read, where one is.
    #[serde(flatten)]
    pub length: LengthField,
}

/// A length (mm) under the key of its kind; no key where there is none. It is flattened into what has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthField(pub Option<ReadLength>);

impl Serialize for LengthField {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_map(None)?;
        if let Some(ReadLength { kind, length_m }) = self.0 {
            fields.serialize_entry(kind.column(), &(length_m * 1e3))?;
        }
        fields.end()
    }
}

impl JsonSchema for LengthField {
    fn schema_name() -> Cow<'static, str> {
        "LengthField".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let field = |kind: LengthKind| {
            let what = format!("The {} that is read (mm), where one is.", kind.name());
            let field =
                json!({ "description": what, "type": ["number", "null"], "format": "double" });
            (kind.column().to_owned(), field)
        };
        let fields: Map<_, _> = LengthKind::ALL.into_iter().map(field).collect();
        json_schema!({ "type": "object", "properties": fields })
    }
}

/// The experiments of a plan in their order.
pub fn plan_messages(commands: &Commands, plan: &Plan) -> Vec<PlanRowMessage> {
    let rows = plan.experiments.iter();
    rows.map(|row| PlanRowMessage::new(commands, row)).collect()
}

impl PlanRowMessage {
    /// The row of an experiment.
    pub fn new(commands: &Commands, experiment: &Experiment) -> Self {
        let load = Some(experiment.load).filter(|load| *load != Load::NONE);
        Self {
            q_deg: commands.numbers(experiment.configuration_rad.as_slice()),
            wrench: load.map(|load| load.wrench().into()),
            repeats: experiment.repeats,
            approach: experiment.approach.as_ref().map(Approach::word),
            direction: experiment.direction.map(Into::into),
            reads: None,
        }
    }
}

/// One experiment's outcome.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MeasurementMessage {
    /// The commanded joint angles (deg), and lengths (mm) of joints that slide.
    pub q_deg: Vec<f64>,
    /// Force (N) and torque (N m) in the world frame at the calibration tool.
    pub wrench: [f64; 6],
    /// Loaded minus unloaded position of the tool in the world frame (mm); of what a gauge reads, what is along its direction.
    pub deflection_mm: Option<[f64; 3]>,
    /// Standard deviations of the deflection, where this measurement has its own (mm).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deflection_std_mm: Option<[f64; 3]>,
    /// The tool's rotation as a rotation vector in the world frame, where it is measured (mrad).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_mrad: Option<[f64; 3]>,
    /// Standard deviations of the rotation (mrad).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_std_mrad: Option<[f64; 3]>,
    /// The direction that a gauge has read along: a unit vector in the world frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
}

impl MeasurementMessage {
    /// The record of a measurement.
    pub fn new(commands: &Commands, measurement: &Measurement) -> Self {
        let rotation = measurement.rotation.as_ref();
        Self {
            q_deg: commands.numbers(measurement.configuration_rad.as_slice()),
            wrench: measurement.load.wrench().into(),
            deflection_mm: Some(thousandfold(&measurement.deflection_m)),
            deflection_std_mm: measurement.sigma_m.as_ref().map(thousandfold),
            rotation_mrad: rotation.map(|rotation| thousandfold(&rotation.vector_rad)),
            rotation_std_mrad: rotation.map(|rotation| thousandfold(&rotation.sigma_rad)),
            direction: measurement.direction.map(Into::into),
        }
    }
}

/// The predicted accuracy of a plan; arrays go by `parameters`, lengths are in mm. Null is what the plan does not determine, and bounds
/// that there are none of.
pub fn assessment_json(scenario: &Scenario, assessment: &Assessment) -> Value {
    let unit = |criterion| match criterion {
        Criterion::TestPose => 1e3,
        _ => 1.0,
    };
    let millimetres = |value_m: Option<f64>| value_m.map(|value_m| value_m * 1e3);
    let criterion = |&(criterion, value): &(Criterion, Option<f64>)| {
        let value = value.map(|value| value * unit(criterion));
        (criterion.name().to_owned(), value)
    };
    let criteria: BTreeMap<String, Option<f64>> =
        assessment.criteria.iter().map(criterion).collect();
    let rho0_proof = assessment.bound().and_then(|bound| bound.proof.as_ref());
    let (criterion, asked_for) = (assessment.asked_for()).unzip();
    let bound = asked_for.and_then(|bound| bound.as_ref().ok());
    let no_bound = asked_for.and_then(|bound| bound.as_ref().err());
    let proof = bound.and_then(|bound| bound.proof.as_ref());
    let in_unit = |value: f64| criterion.map_or(value, |criterion| value * unit(criterion));
    let violation = |violation: &Violation| {
        let mut json = json!(violation);
        json["text"] = violation.to_string().into();
        json
    };
    let violations = assessment.violations.iter().map(violation);
    let mut json = json!({
        "accuracy": AccuracyKind::Relative.name(),
        "experiments": assessment.experiments,
        "parameters": scenario.task.belief.parameter_names(),
        "rho0_mm": millimetres(assessment.rho0_m),
        "quantile95_mm": millimetres(assessment.quantile95_m),
        "uncertainty_budget": assessment.uncertainty_budget,
        "compliance_std_rad_per_nm": assessment.standard_errors,
        "criteria": criteria,
        "lower_bound_rho0_mm": millimetres(assessment.bound_m()),
        "bound_kind": bound.map(|bound| bound.kind.name()),
        "criterion_bound": bound.map(|bound| in_unit(bound.best)),
        "proved_criterion_bound": proof.map(|proof| in_unit(proof.best)),
        "criterion_efficiency": assessment.criterion_efficiency(),
        "proved_lower_bound_rho0_mm": millimetres(rho0_proof.map(|proof| proof.best)),
        "proof": proof,
        "efficiency": assessment.efficiency(),
        "no_bound_reason": no_bound.map(ToString::to_string),
        "violations": violations.collect::<Vec<_>>(),
    });
    if !assessment.further.is_empty() {
        json["further_std"] = json!(assessment.further);
    }
    json
}

/// What compensation achieves at a test pose.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TestPoseMessage {
    /// The test pose's name.
    pub name: String,
    /// Its weight among the test poses.
    pub weight: f64,
    /// The joint angles to command (deg), and lengths (mm) of joints that slide.
    pub q_commanded_deg: Vec<f64>,
    /// The direction in the world frame along which alone distances count, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// The loaded tool's distance from where it is wanted, without compensation (mm); of it what counts.
    pub uncompensated_mm: f64,
    /// The same with compensation (mm).
    pub residual_mm: f64,
    /// The predicted rms of the latter (mm), eq. 20 with the covariance of the identification.
    pub rho0_mm: Option<f64>,
    /// The components of `uncompensated_mm` in the world frame.
    pub uncompensated_xyz_mm: [f64; 3],
    /// The components of `residual_mm` in the world frame.
    pub residual_xyz_mm: [f64; 3],
}

impl TestPoseMessage {
    /// The record of a compensated test pose.
    pub fn new(commands: &Commands, pose: &CompensatedPose) -> Self {
        Self {
            name: pose.name.clone(),
            weight: pose.weight,
            q_commanded_deg: commands.numbers(pose.commanded_rad.as_slice()),
            direction: pose.direction.map(Into::into),
            uncompensated_mm: pose.seen.uncompensated_m.norm() * 1e3,
            residual_mm: pose.seen.residual_m.norm() * 1e3,
            rho0_mm: pose.predicted_m.as_ref().ok().map(|value| value * 1e3),
            uncompensated_xyz_mm: thousandfold(&pose.seen.uncompensated_m),
            residual_xyz_mm: thousandfold(&pose.seen.residual_m),
        }
    }
}

/// From metres to millimetres, or from radians to milliradians.
pub(crate) fn thousandfold(vector: &Vector3<f64>) -> [f64; 3] {
    vector.map(units::thousandths).into()
}
