//! An error as it is printed: its code, what is wrong, and what to do about it.

use std::error::Error;

use crate::calibration::CalibrationError;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::identification::IdentificationError;
use crate::plan::search::SearchError;
use crate::robot::EquilibriumError;
use crate::study::StudyError;
use crate::text::{diagnostics::say, wording::shortened};

/// More characters than this of an error nobody reads.
const LONGEST_ERROR: usize = 4000;

/// An error for people.
pub struct PrintedError {
    /// Its stable code.
    pub code: ErrorCode,
    /// What is wrong.
    pub text: String,
    /// What to do about it.
    pub hint: Option<String>,
}

impl PrintedError {
    /// What an error and its causes say; the code is that of the cause that is nearest to the root.
    pub fn of(error: &anyhow::Error) -> Self {
        let mut text = error.to_string();
        for cause in error.chain().skip(1).map(ToString::to_string) {
            // Most errors name their cause themselves.
            if !text.contains(&cause) {
                text += &format!(": {cause}");
            }
        }
        let file = error.downcast_ref::<FileError>();
        Self {
            code: (error.chain().rev().find_map(code)).unwrap_or(ErrorCode::Other),
            text: shortened(&text, LONGEST_ERROR),
            hint: (file.and_then(|error| error.hint.clone())).or_else(|| {
                error
                    .downcast_ref::<StudyError>()?
                    .hint()
                    .map(str::to_owned)
            }),
        }
    }

    /// Prints it and, on a line of its own, what to do about it.
    pub fn say(&self) {
        say(&format!("error {}: {}", self.code, self.text));
        if let Some(hint) = &self.hint {
            say(&format!("hint: {hint}"));
        }
    }
}

/// The code of an error by itself.
fn code(error: &(dyn Error + 'static)) -> Option<ErrorCode> {
    if let Some(error) = error.downcast_ref::<FileError>() {
        return Some(error.code);
    }
    if let Some(error) = error.downcast_ref::<IdentificationError>() {
        return Some(error.code());
    }
    if error.is::<EquilibriumError>() {
        return Some(ErrorCode::NoEquilibrium);
    }
    if error.is::<SearchError>() {
        return Some(ErrorCode::NoPlan);
    }
    let is_simulation = error.is::<CalibrationError>() || error.is::<StudyError>();
    is_simulation.then_some(ErrorCode::Simulation)
}
