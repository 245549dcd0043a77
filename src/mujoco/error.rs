//! What is wrong with a model's file, as of every file.

use std::path::Path;

use super::messages;
use crate::codes::ErrorCode;
use crate::files::FileError;

/// What a list of names says that has none.
pub(super) const NONE: &str = "none";

/// What is refused of a model that MuJoCo takes.
pub(super) fn unsuitable(path: &Path, problem: impl AsRef<str>) -> FileError {
    FileError::new(path, messages::one_line(&[problem.as_ref()])).code(ErrorCode::Model)
}

/// What MuJoCo, or a check in its place, refuses.
pub(super) fn refused(path: &Path, message: impl AsRef<str>) -> FileError {
    let message = messages::one_line(&[message.as_ref()]);
    FileError::new(path, format!("MuJoCo refuses the model: {message}")).code(ErrorCode::Model)
}
