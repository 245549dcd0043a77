//! Why a model's file cannot serve.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::messages;
use crate::codes::ErrorCode;

/// Why an MJCF file cannot serve.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file is missing or cannot be read.
    #[error("{path}: cannot be read: {source}")]
    Read {
        /// The model file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// MuJoCo's compiler refuses the file.
    #[error("{path}: MuJoCo refuses the model: {message}")]
    Compile {
        /// The model file.
        path: PathBuf,
        /// MuJoCo's own words.
        message: String,
    },
    /// The file is written in another language than MJCF, or names files as others do.
    #[error("{path}: {problem}")]
    Foreign {
        /// The model file.
        path: PathBuf,
        /// What it is.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// MuJoCo cannot be left alone with the file.
    #[error("{path}: {problem}")]
    Untrusted {
        /// The model file.
        path: PathBuf,
        /// Why.
        problem: String,
        /// What to do about it.
        hint: Option<String>,
    },
    /// The model has nothing of that name.
    #[error("{path}: the model has no {kind} named {name:?}; it has: {known}")]
    Unknown {
        /// The model file.
        path: PathBuf,
        /// What was looked for, such as "site".
        kind: &'static str,
        /// The name that was given.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// The model has an element that can move the arm's rest and that the statics do not know.
    #[error("{path}: {element}: {problem}")]
    Statics {
        /// The model file.
        path: PathBuf,
        /// The element, such as `joint "joint_2"`.
        element: String,
        /// What it says and what that would do.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// The file cannot be written again with other numbers.
    #[error("{path}: cannot be written with what was identified: {problem}")]
    NotWritten {
        /// The model file.
        path: PathBuf,
        /// What is in the way.
        problem: String,
    },
    /// MuJoCo cannot apply a load.
    #[error("{path}: MuJoCo cannot apply the load: {message}")]
    Load {
        /// The model file.
        path: PathBuf,
        /// MuJoCo's own words.
        message: String,
    },
    /// The model is not a serial arm of hinges and slides.
    #[error("{path}: not a serial arm of hinges and slides: {reason}")]
    NotSerial {
        /// The model file.
        path: PathBuf,
        /// What is in the way.
        reason: String,
    },
}

/// What a list of names says that has none.
pub(super) const NONE: &str = "none";

impl ModelError {
    /// Its kind.
    pub const fn code(&self) -> ErrorCode {
        match self {
            Self::Read { .. } => ErrorCode::Unreadable,
            Self::Compile { .. } | Self::Untrusted { .. } | Self::Load { .. } => ErrorCode::Model,
            Self::Foreign { .. } => ErrorCode::ModelFormat,
            Self::Unknown { .. } => ErrorCode::ModelName,
            Self::Statics { .. } => ErrorCode::ModelStatics,
            Self::NotSerial { .. } => ErrorCode::NotSerial,
            Self::NotWritten { .. } => ErrorCode::ModelNotWritten,
        }
    }

    /// What to do about it, where that can be told.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Statics { hint, .. } | Self::Foreign { hint, .. } => Some(hint),
            Self::Untrusted { hint, .. } => hint.as_deref(),
            Self::Unknown {
                kind: "site",
                known,
                ..
            } if known == NONE => Some(
                "mark each tool's tip with <site name=\"...\" pos=\"x y z\"/> inside the body that carries it, or mount the tool in the scenario ([[robot.tool]]); the scenario names these sites",
            ),
            _ => None,
        }
    }
}

/// What MuJoCo, or a check in its place, refuses.
pub(super) fn refused(path: &Path, message: impl AsRef<str>) -> ModelError {
    ModelError::Compile {
        path: path.to_owned(),
        message: messages::one_line(&[message.as_ref()]),
    }
}
