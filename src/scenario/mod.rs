//! A scenario: everything that a calibration study needs to know, read from one TOML file.
//!
//! [`Scenario::load`] either gives a scenario in which everything is consistent (the models are
//! compiled, every site exists, every number is finite and in SI units), or one error that names
//! the file, the key, what was found and what is allowed.

mod check;
mod file;
mod instrument_file;

use std::path::PathBuf;

use schemars::schema_for;
use serde_json::Value;

use self::file::File;
use crate::codes::{Condition, ConditionCode};
use crate::gate::Gate;
use crate::laboratory::Laboratory;
use crate::measurement::Origin;
use crate::mujoco::Additions;
use crate::study::{Conditions, Setting, StudySettings};
use crate::task::Task;
use crate::testbed::Truth;

/// The JSON schema of scenarios, made from what reads them: what editors complete and check.
///
/// TOML's editors take it from a first line `#:schema FILE`. Ranges of numbers, and what belongs together, are
/// [`Scenario::check`]'s.
pub fn scenario_schema() -> Value {
    let mut schema = schema_for!(File);
    schema.insert("title".to_owned(), "elastocal scenario".into());
    schema.to_value()
}

/// A plan that the scenario brings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanFile {
    /// Its name.
    pub name: String,
    /// The plan file.
    pub path: PathBuf,
}

/// A checked scenario, in SI units.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// The scenario file.
    pub path: PathBuf,
    /// The files that it names, with those that its models are made of.
    pub files: Vec<PathBuf>,
    /// The file's name without folder and ending; names the output folder.
    pub name: String,
    /// One line on what it is.
    pub description: String,
    /// SHA-256 of the scenario's keys and values, without `[gate]`, and of the bytes of all files that it
    /// names: models with what they include and their meshes and height fields, and plans; in
    /// hexadecimal.
    pub sha256: String,
    /// The seed of all random numbers.
    pub seed: u64,
    /// What plans are designed for.
    pub task: Task,
    /// The virtual robot, which only the testbed sees.
    pub truth: Truth,
    /// The plans that the scenario brings.
    pub plans: Vec<PlanFile>,
    /// Which plans a Monte Carlo study compares.
    pub study: StudySettings,
    /// What work in the laboratory costs, and how the robot is to move there.
    pub laboratory: Laboratory,
    /// Whether the belief leaves out the uncertainties that the scenario lists, see [`Scenario::noise_only`].
    pub is_noise_only: bool,
    /// What speaks against trusting what the scenario builds on.
    pub doubts: Vec<Condition>,
    /// How much worse results may get.
    pub gate: Gate,
    /// The tools and payloads that it mounts on the robot.
    pub mounted: Additions,
}

impl Scenario {
    /// The settings of the study, one for all its conditions.
    pub fn settings(&self) -> Vec<Setting<'_>> {
        let setting = |&conditions: &Conditions| Setting::new(&self.task, &self.truth, conditions);
        self.study.conditions.iter().map(setting).collect()
    }

    /// That nobody knows with which error sources its prior was identified.
    pub fn of_unknown_origin(&self) -> impl Iterator<Item = Condition> {
        let doubts = self.doubts.iter();
        let unknown = doubts.filter(|each| each.code == ConditionCode::NoFingerprint);
        unknown.cloned()
    }

    /// The scenario of a planner who knows of the instrument's noise alone; the virtual robot stays as uncertain as it
    /// is.
    pub fn noise_only(&mut self) {
        let belief = &mut self.task.belief;
        self.is_noise_only |= !belief.uncertain.is_certain();
        let prior = belief.prior.as_ref();
        if let Ok(noise_only) = belief.uncertain.noise_only(&belief.parameters, prior) {
            belief.uncertain = noise_only;
        }
    }

    /// What files that are made under this scenario say of it.
    pub fn origin(&self) -> Origin {
        Origin {
            scenario: self.path.clone(),
            scenario_sha256: self.sha256.clone(),
            simulated: None,
        }
    }
}
