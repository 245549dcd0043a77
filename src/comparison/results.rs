//! Results files as they are compared: their numbers by plan and quantity, and under which settings
//! they were made.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::IgnoredAny;
use serde::{Deserialize, Deserializer};

use super::Aspect;
use crate::files::{FileError, schema::read_results, typed::from_json};
use crate::gate::{Gate, Quantity};
use crate::record::messages::{ProvenanceMessage, SchemaMessage};

/// The name of a plan that results give none.
pub const ONLY_PLAN: &str = "plan";

/// A number's name: of which plan, what, and of which joint or test pose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Key {
    /// The plan's name; [`ONLY_PLAN`] where the results are of one plan without a name.
    pub plan: String,
    /// What it is.
    pub quantity: Quantity,
    /// The joint or the test pose, where there are several.
    pub of: Option<String>,
}

/// A number.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultNumber {
    /// What it is.
    pub key: Key,
    /// It, in the unit of [`Quantity::unit`]; none where there is no such number.
    pub value: Option<f64>,
    /// Its standard error; zero where it is computed and not estimated.
    pub standard_error: f64,
}

/// Which question results answer, in one aspect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// What must be the same for the question to be the same.
    pub identity: String,
    /// For a person.
    pub shown: String,
}

/// A results file.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultsFile {
    /// The file.
    pub path: PathBuf,
    /// Which command's results, in which form.
    pub schema: SchemaMessage,
    /// Where they come from.
    pub provenance: ProvenanceMessage,
    /// The scenario's tolerances.
    pub gate: Gate,
    /// What was asked.
    pub answers: BTreeMap<Aspect, Answer>,
    /// The plans' names.
    pub plans: Vec<String>,
    /// All numbers.
    pub numbers: Vec<ResultNumber>,
}

#[derive(Deserialize)]
struct Head {
    schema: SchemaMessage,
    provenance: ProvenanceMessage,
    #[serde(default)]
    gate: Gate,
}

/// What `plan` and `evaluate` say, and `run` of each plan.
#[derive(Deserialize)]
struct PredictedPlan {
    experiments: u32,
    parameters: Vec<String>,
    #[serde(deserialize_with = "there")]
    rho0_mm: Option<f64>,
    #[serde(deserialize_with = "there")]
    efficiency: Option<f64>,
    compliance_std_rad_per_nm: Vec<Option<f64>>,
    violations: Vec<IgnoredAny>,
}

#[derive(Deserialize)]
struct DesignedResults {
    criterion: String,
    configurations: Option<u32>,
}

#[derive(Deserialize)]
struct RunResults {
    experiments: u32,
    plans: Vec<RunPlanResults>,
}

#[derive(Deserialize)]
struct RunPlanResults {
    name: String,
    assessment: PredictedPlan,
    test_poses: Vec<PoseResults>,
}

#[derive(Deserialize)]
struct PoseResults {
    name: String,
    #[serde(deserialize_with = "there")]
    residual_mm: Option<f64>,
}

#[derive(Deserialize)]
struct StudyResults {
    trials: u64,
    level: String,
    plans: Vec<StudyPlanResults>,
}

#[derive(Deserialize)]
struct StudyPlanResults {
    name: String,
    experiments: u32,
    sigma_mm: f64,
    load_scale: f64,
    failed: u64,
    #[serde(deserialize_with = "there")]
    mean_mm: Option<f64>,
    mean_std_mm: Option<f64>,
    #[serde(deserialize_with = "there")]
    predicted_rms_mm: Option<f64>,
}

/// A number or null, but not nothing.
fn there<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Option::deserialize(deserializer)
}

impl ResultsFile {
    /// Reads the results of `run`, `plan`, `evaluate` or `study`.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let hint = "files to compare are results.json, study.json, or what --json prints";
        let (text, _) = read_results(path, &["run", "plan", "evaluate", "study"], hint)?;
        let head: Head = from_json(path, &text)?;
        head.gate
            .check()
            .map_err(|(key, problem)| FileError::new(path, problem).at(format!("gate.{key}")))?;
        let mut file = Self {
            path: path.to_owned(),
            schema: head.schema,
            provenance: head.provenance,
            gate: head.gate,
            answers: BTreeMap::new(),
            plans: Vec::new(),
            numbers: Vec::new(),
        };
        match file.schema.name.as_str() {
            "elastocal.run" => file.run(from_json(path, &text)?)?,
            "elastocal.study" => file.study(from_json(path, &text)?),
            "elastocal.plan" => {
                let designed: DesignedResults = from_json(path, &text)?;
                file.answer(Aspect::Criterion, designed.criterion);
                if let Some(count) = designed.configurations {
                    file.answer(Aspect::Configurations, count.to_string());
                }
                file.single(from_json(path, &text)?)?;
            }
            _ => file.single(from_json(path, &text)?)?,
        }
        file.answer_for_all();
        Ok(file)
    }

    fn answer(&mut self, aspect: Aspect, identity: String) {
        let shown = identity.clone();
        self.answers.insert(aspect, Answer { identity, shown });
    }

    /// What all results say of their question.
    fn answer_for_all(&mut self) {
        let form = format!("{} {}", self.schema.name, self.schema.version);
        self.answer(Aspect::Schema, form);
        self.answer(Aspect::Seed, self.provenance.seed.to_string());
        // A copy of a scenario under another name asks the same question.
        let identity = self.provenance.scenario_sha256.clone();
        let hash: String = identity.chars().take(12).collect();
        let shown = format!("{} {hash}", self.provenance.scenario);
        self.answers
            .insert(Aspect::Scenario, Answer { identity, shown });
        let mut sorted = self.plans.clone();
        sorted.sort_unstable();
        let [identity, shown] = [&sorted, &self.plans].map(|names| names.join(", "));
        self.answers
            .insert(Aspect::Plans, Answer { identity, shown });
    }

    fn run(&mut self, run: RunResults) -> Result<(), FileError> {
        self.answer(Aspect::Experiments, run.experiments.to_string());
        for (index, plan) in run.plans.into_iter().enumerate() {
            let name = self.add_plan(&plan.name);
            self.prediction(
                &name,
                &format!("plans[{index}].assessment."),
                plan.assessment,
            )?;
            for pose in plan.test_poses {
                let micrometres = pose.residual_mm.map(|value| value * 1e3);
                self.add(&name, Quantity::RealisedError, Some(pose.name), micrometres);
            }
        }
        Ok(())
    }

    fn study(&mut self, study: StudyResults) {
        let mut experiments: Vec<u32> = study.plans.iter().map(|plan| plan.experiments).collect();
        experiments.dedup();
        self.answer(Aspect::Trials, study.trials.to_string());
        self.answer(Aspect::Level, study.level);
        let experiments: Vec<String> = experiments.iter().map(ToString::to_string).collect();
        self.answer(Aspect::Experiments, experiments.join(", "));
        let is_swept = |name: &str| study.plans.iter().filter(|plan| plan.name == name).count() > 1;
        for plan in &study.plans {
            let (m, sigma_mm, load) = (plan.experiments, plan.sigma_mm, plan.load_scale);
            let name = self.add_plan(&if is_swept(&plan.name) {
                format!(
                    "{}, {m} measurements, {sigma_mm} mm, load {load}",
                    plan.name
                )
            } else {
                plan.name.clone()
            });
            let micrometres = |value: Option<f64>| value.map(|value| value * 1e3);
            let rho0 = micrometres(plan.predicted_rms_mm);
            self.add(&name, Quantity::Rho0, None, rho0);
            let mean = micrometres(plan.mean_mm);
            self.add(&name, Quantity::MeanError, None, mean);
            if let Some(last) = self.numbers.last_mut() {
                last.standard_error = micrometres(plan.mean_std_mm).unwrap_or(0.0);
            }
            let failed = Some(plan.failed as f64);
            self.add(&name, Quantity::FailedRuns, None, failed);
        }
    }

    fn single(&mut self, prediction: PredictedPlan) -> Result<(), FileError> {
        self.answer(Aspect::Experiments, prediction.experiments.to_string());
        let name = self.add_plan(ONLY_PLAN);
        self.prediction(&name, "", prediction)
    }

    fn prediction(
        &mut self,
        plan: &str,
        place: &str,
        prediction: PredictedPlan,
    ) -> Result<(), FileError> {
        let (names, errors) = (prediction.parameters, prediction.compliance_std_rad_per_nm);
        if names.len() != errors.len() {
            let problem = format!("found {} numbers for {} joints", errors.len(), names.len());
            let place = format!("{place}compliance_std_rad_per_nm");
            return Err(FileError::new(&self.path, problem).at(place));
        }
        let rho0 = prediction.rho0_mm.map(|value| value * 1e3);
        self.add(plan, Quantity::Rho0, None, rho0);
        self.add(plan, Quantity::Efficiency, None, prediction.efficiency);
        for (joint, error) in names.into_iter().zip(errors) {
            self.add(plan, Quantity::StandardError, Some(joint), error);
        }
        let violations = prediction.violations.len() as f64;
        self.add(plan, Quantity::Violations, None, Some(violations));
        Ok(())
    }

    fn add(&mut self, plan: &str, quantity: Quantity, of: Option<String>, value: Option<f64>) {
        let plan = plan.to_owned();
        let mut key = Key { plan, quantity, of };
        // Two test poses may share a name.
        let same = |other: &&ResultNumber| other.key == key;
        let earlier = self.numbers.iter().filter(same).count();
        if let (Some(of), 1..) = (&mut key.of, earlier) {
            *of += &format!(" ({})", earlier + 1);
        }
        self.numbers.push(ResultNumber {
            key,
            value,
            standard_error: 0.0,
        });
    }

    /// Adds a plan under a name of its own: a scenario may bring one that is named as `run` names its.
    fn add_plan(&mut self, name: &str) -> String {
        let mut own = name.to_owned();
        for number in 2.. {
            if !self.plans.contains(&own) {
                break;
            }
            own = format!("{name} ({number})");
        }
        self.plans.push(own.clone());
        own
    }
}
