//! A first scenario for a model: what is in it, and a beginning that can be planned with.
//!
//! Nothing is asked. What a model does not say (loads, an accuracy to reach, stiffnesses) is guessed from the
//! robot's size and marked as a guess.

mod arm;
mod pose;
mod tools;
mod written;

use std::path::Path;

use self::arm::FoundArm;
use self::pose::tried;
use self::tools::Tools;
use crate::files::{FileError, absolute, read_text, way};
use crate::mujoco::Model;
use crate::scenario::Scenario;
use crate::understanding::Understanding;

/// The JSON schema with which editors complete a scenario, as its first line names it: beside the scenario.
pub const SCHEMA_FILE: &str = "elastocal.schema.json";

/// A scenario for a model, not yet in a file.
#[derive(Debug)]
pub struct Draft {
    /// The scenario's text (TOML).
    pub text: String,
    /// The robot as the program understands it, with what is implausible.
    pub understanding: Understanding,
    /// What the model has beside its arm, and what was made of it, in sentences.
    pub found: Vec<String>,
}

/// Drafts a scenario for a model (MJCF or URDF), to stand at a path. `tip` names the body or site at the
/// arm's end, where a model has several arms.
///
/// # Errors
/// What is missing in the model, or why it cannot serve.
pub fn draft(
    model_path: &Path,
    scenario_path: &Path,
    tip: Option<&str>,
) -> Result<Draft, FileError> {
    read_text(model_path)?;
    let model = Model::load(model_path)?;
    let arm = FoundArm::find(&model, tip)?;
    let tools = Tools::of(&arm)?;
    let tried = tried(&arm, &tools.calibration);
    let named = named_from(model_path, scenario_path);
    let (text, found) = written::scenario(&arm, &tools, &tried, &named)
        .map_err(|error| FileError::new(scenario_path, error.to_string()))?;
    let scenario = Scenario::check(scenario_path, &text)?;
    Ok(Draft {
        text,
        found,
        understanding: Understanding::new(&scenario),
    })
}

/// The model's path as a scenario names it: from its folder, unless they have nothing in common but the root.
fn named_from(model: &Path, scenario: &Path) -> String {
    let folder = scenario.parent().unwrap_or(Path::new(""));
    let [model, folder] = [model, folder].map(absolute);
    let is_apart = model.components().nth(1) != folder.components().nth(1);
    let named = if is_apart {
        model
    } else {
        way(&folder, &model)
    };
    named.to_string_lossy().into_owned()
}
