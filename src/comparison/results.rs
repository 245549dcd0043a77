//! Results files as they are compared: their numbers by plan and quantity, and under which settings
//! they were made.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Aspect;
use crate::files::{FileError, schema::read_results, typed::from_json};
use crate::gate::{Gate, Quantity};
use crate::record::messages::{ProvenanceMessage, SchemaMessage};
use crate::task::AccuracyKind;

/// The name of a plan that results give none.
pub const ONLY_PLAN: &str = "plan";

/// A number's name: of which plan, what, and of which joint or test pose.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
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

/// A place in a results file.
struct ResultPlace<'a> {
    path: &'a Path,
    /// Its dotted key.
    key: String,
    json: &'a Value,
}

impl<'a> ResultPlace<'a> {
    fn wrong(&self, problem: String) -> FileError {
        let wrong = FileError::new(self.path, problem);
        match &*self.key {
            "" => wrong,
            key => wrong.at(key),
        }
    }

    /// What must be under a key, if only null.
    fn get(&self, name: &str) -> Result<Self, FileError> {
        let json = self.json.get(name);
        let dot = if self.key.is_empty() { "" } else { "." };
        Ok(ResultPlace {
            path: self.path,
            key: format!("{}{dot}{name}", self.key),
            json: json.ok_or_else(|| self.wrong(format!("missing field `{name}`")))?,
        })
    }

    /// What must be under a key, as a type.
    fn read<T: Deserialize<'a>>(&self, name: &str) -> Result<T, FileError> {
        let place = self.get(name)?;
        T::deserialize(place.json).map_err(|error| place.wrong(error.to_string()))
    }

    /// A size that must be under a key, if only null.
    fn size(&self, name: &str) -> Result<Option<f64>, FileError> {
        let size: Option<f64> = self.read(name)?;
        match size {
            Some(size) if size < 0.0 => {
                let problem = format!("found {size}; zero or a positive number");
                Err(self.get(name)?.wrong(problem))
            }
            size => Ok(size),
        }
    }

    /// The elements of a list.
    fn list(&self, name: &str) -> Result<Vec<Self>, FileError> {
        let list = self.get(name)?;
        let elements = list.json.as_array();
        let elements = elements.ok_or_else(|| list.wrong("is no list".to_owned()))?;
        let element = |(index, json)| ResultPlace {
            path: self.path,
            key: format!("{}[{index}]", list.key),
            json,
        };
        Ok(elements.iter().enumerate().map(element).collect())
    }
}

/// Whether results are of an absolute accuracy.
fn is_absolute(results: &Value) -> bool {
    results["accuracy"] == AccuracyKind::Absolute.name()
}

impl ResultsFile {
    /// Reads the results of `run`, `plan`, `evaluate` or `study`.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let hint = "files to compare are results.json, study.json, or what --json prints";
        let (text, json) = read_results(path, &["run", "plan", "evaluate", "study"], hint)?;
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
        let results = ResultPlace {
            path,
            key: String::new(),
            json: &json,
        };
        match file.schema.name.as_str() {
            "elastocal.run" => file.run(&results)?,
            "elastocal.study" => file.study(&results)?,
            name => {
                if name == "elastocal.plan" && !is_absolute(&json) {
                    file.answer(Aspect::Criterion, results.read("criterion")?);
                    if let Some(count) = json["configurations"].as_u64() {
                        file.answer(Aspect::Configurations, count.to_string());
                    }
                }
                let experiments: u32 = results.read("experiments")?;
                file.answer(Aspect::Experiments, experiments.to_string());
                let plan = file.add_plan(ONLY_PLAN);
                file.prediction(&plan, &results)?;
            }
        }
        file.answer_for_all();
        Ok(file)
    }

    fn answer(&mut self, aspect: Aspect, identity: String) {
        self.answer_shown(aspect, [identity.clone(), identity]);
    }

    fn answer_shown(&mut self, aspect: Aspect, [identity, shown]: [String; 2]) {
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
        self.answer_shown(Aspect::Scenario, [identity, shown]);
        let counted = ["those of the scenario", "noise alone"];
        let counted = counted[usize::from(self.provenance.noise_only)];
        self.answer(Aspect::Errors, counted.to_owned());
        let mut inputs = self.provenance.inputs_sha256.clone();
        inputs.remove("plan");
        if !inputs.is_empty() {
            let each = |length: usize| {
                let inputs = inputs.iter().map(|(name, hash)| {
                    let hash: String = hash.chars().take(length).collect();
                    format!("{name} {hash}")
                });
                inputs.collect::<Vec<_>>().join(", ")
            };
            self.answer_shown(Aspect::Inputs, [usize::MAX, 12].map(each));
        }
        let mut sorted = self.plans.clone();
        sorted.sort_unstable();
        let names = [&sorted, &self.plans].map(|names| names.join(", "));
        self.answer_shown(Aspect::Plans, names);
    }

    fn run(&mut self, run: &ResultPlace<'_>) -> Result<(), FileError> {
        let experiments: u32 = run.read("experiments")?;
        self.answer(Aspect::Experiments, experiments.to_string());
        for plan in run.list("plans")? {
            let name = self.add_plan(plan.read("name")?);
            self.prediction(&name, &plan.get("assessment")?)?;
            for pose in plan.list("test_poses")? {
                let of = Some(pose.read("name")?);
                let residual_mm = pose.size("residual_mm")?;
                self.add(&name, Quantity::RealisedError, of, residual_mm);
            }
        }
        Ok(())
    }

    fn study(&mut self, study: &ResultPlace<'_>) -> Result<(), FileError> {
        let trials: u64 = study.read("trials")?;
        self.answer(Aspect::Trials, trials.to_string());
        self.answer(Aspect::Level, study.read("level")?);
        let plans = study.list("plans")?;
        let mut experiments = Vec::new();
        for plan in &plans {
            let m: u32 = plan.read("experiments")?;
            let mut name: String = plan.read("name")?;
            let same = (plans.iter()).filter(|other| other.json["name"] == plan.json["name"]);
            if same.count() > 1 {
                let [sigma_mm, load]: [f64; 2] = [plan.read("sigma_mm")?, plan.read("load_scale")?];
                name += &format!(", {m} measurements, {sigma_mm} mm, load {load}");
            }
            let name = self.add_plan(&name);
            // That of the noise alone depends on the robots that were sampled where more is listed.
            let keys = ["combined_rms_mm", "predicted_rms_mm"];
            let key = keys[usize::from(plan.json.get(keys[0]).is_none())];
            self.add(&name, Quantity::Rho0, None, plan.size(key)?);
            self.add(&name, Quantity::MeanError, None, plan.size("mean_mm")?);
            if let Some(last) = self.numbers.last_mut() {
                let error_mm: Option<f64> = plan.size("mean_std_mm")?;
                last.standard_error = error_mm.unwrap_or(0.0) * 1e3;
            }
            self.add(&name, Quantity::FailedRuns, None, plan.size("failed")?);
            experiments.push(m.to_string());
        }
        experiments.dedup();
        self.answer(Aspect::Experiments, experiments.join(", "));
        Ok(())
    }

    /// What `plan` and `evaluate` say, and `run` of each plan; of absolute readings no more than the accuracy is compared.
    fn prediction(&mut self, plan: &str, prediction: &ResultPlace<'_>) -> Result<(), FileError> {
        self.add(plan, Quantity::Rho0, None, prediction.size("rho0_mm")?);
        let efficiency = prediction.size("efficiency")?;
        self.add(plan, Quantity::Efficiency, None, efficiency);
        if is_absolute(prediction.json) {
            return Ok(());
        }
        let names: Vec<String> = prediction.read("parameters")?;
        let key = "compliance_std_rad_per_nm";
        let errors: Vec<Option<f64>> = prediction.read(key)?;
        if let Some(error) = errors.iter().flatten().find(|error| **error < 0.0) {
            let problem = format!("found {error}; zero or a positive number");
            return Err(prediction.get(key)?.wrong(problem));
        }
        if names.len() != errors.len() {
            let problem = format!("found {} numbers for {} joints", errors.len(), names.len());
            return Err(prediction.get(key)?.wrong(problem));
        }
        for (joint, error) in names.into_iter().zip(errors) {
            self.add(plan, Quantity::StandardError, Some(joint), error);
        }
        let violations = prediction.list("violations")?.len() as f64;
        self.add(plan, Quantity::Violations, None, Some(violations));
        Ok(())
    }

    /// Adds a number, lengths in mm.
    fn add(&mut self, plan: &str, quantity: Quantity, of: Option<String>, value: Option<f64>) {
        let plan = plan.to_owned();
        let mut key = Key { plan, quantity, of };
        // Two test poses may share a name.
        let same = |other: &&ResultNumber| other.key == key;
        let earlier = self.numbers.iter().filter(same).count();
        if let (Some(of), 1..) = (&mut key.of, earlier) {
            *of += &format!(" ({})", earlier + 1);
        }
        let factor = if quantity.unit() == "um" { 1e3 } else { 1.0 };
        self.numbers.push(ResultNumber {
            key,
            value: value.map(|value| value * factor),
            standard_error: 0.0,
        });
    }

    /// Adds a plan under a name of its own: a scenario may bring one that is named as `run` names its.
    fn add_plan(&mut self, name: &str) -> String {
        let others = (2..).map(|number| format!("{name} ({number})"));
        let mut names = std::iter::once(name.to_owned()).chain(others);
        let own = names.find(|own| !self.plans.contains(own));
        let own = own.unwrap_or_default();
        self.plans.push(own.clone());
        own
    }
}
