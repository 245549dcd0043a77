//! What is wrong with a model's file, as of every file.

use std::path::Path;

use super::{Model, messages};
use crate::codes::ErrorCode;
use crate::files::FileError;

/// What a list of names says that has none.
pub(super) const NONE: &str = "none";

/// What MuJoCo, or a check in its place, refuses.
pub(super) fn refused(path: &Path, message: impl AsRef<str>) -> FileError {
    let message = messages::one_line(&[message.as_ref()]);
    FileError::new(path, format!("MuJoCo refuses the model: {message}")).code(ErrorCode::Model)
}

impl Model {
    /// The error for a model that is not a serial arm of hinges and slides.
    pub fn not_serial(&self, reason: impl std::fmt::Display) -> FileError {
        let problem = format!("not a serial arm of hinges and slides: {reason}");
        FileError::new(&self.path, problem).code(ErrorCode::NotSerial)
    }

    /// The error for an element that can move the arm's rest and that the statics do not know: the element as the file has
    /// it, such as `joint "joint_2"`, what it says and what that would do, and what to do about it.
    pub(super) fn not_static(
        &self,
        element: impl std::fmt::Display,
        problem: impl std::fmt::Display,
        hint: impl Into<String>,
    ) -> FileError {
        let wrong = FileError::new(&self.path, format!("{element}: {problem}"));
        wrong.hint(hint).code(ErrorCode::ModelStatics)
    }

    /// The error where MuJoCo cannot apply a load.
    pub(super) fn not_loaded(&self, message: impl std::fmt::Display) -> FileError {
        let problem = format!("MuJoCo cannot apply the load: {message}");
        FileError::new(&self.path, problem).code(ErrorCode::Model)
    }

    /// The error for an object that the model does not have.
    pub(super) fn unknown(&self, kind: &str, name: &str, known: &[String]) -> FileError {
        let known = match known {
            [] => NONE.to_owned(),
            known => known.join(", "),
        };
        let problem = format!("the model has no {kind} named {name:?}; it has: {known}");
        let wrong = FileError::new(&self.path, problem).code(ErrorCode::ModelName);
        if kind == "site" && known == NONE {
            return wrong.hint(
                "mark each tool's tip with <site name=\"...\" pos=\"x y z\"/> inside the body that carries it, or mount the tool in the scenario ([[robot.tool]]); the scenario names these sites",
            );
        }
        wrong
    }
}
