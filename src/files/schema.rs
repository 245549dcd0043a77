//! Which JSON files of its own this program reads: every reader asks here.

use std::ops::RangeInclusive;
use std::path::Path;

use serde_json::Value;
use serde_json::error::Category;

use super::unique_keys::UniqueKeys;
use super::{FileError, read_text};
use crate::codes::ErrorCode;

/// The version of the form of results that this program writes.
pub const RESULTS_VERSION: u32 = 2;
/// The versions of results that this program reads.
const READABLE: RangeInclusive<u64> = 2..=RESULTS_VERSION as u64;

/// Reads a results file of one of these commands, in a form that this program knows: its text and
/// its JSON. `hint` says which file is wanted.
///
/// # Errors
/// It cannot be read, is no such file, or of a version that is not read.
pub fn read_results(
    path: &Path,
    commands: &[&str],
    hint: &str,
) -> Result<(String, Value), FileError> {
    let text = read_text(path)?;
    let UniqueKeys(json) = serde_json::from_str(&text).map_err(|error| {
        let problem = match error.classify() {
            Category::Data => error.to_string(),
            _ => format!("is not JSON: {error}"),
        };
        FileError::new(path, problem).hint(hint)
    })?;
    let wrong = |problem: String| FileError::new(path, problem).at("schema.name").hint(hint);
    let name = json["schema"]["name"].as_str().unwrap_or_default();
    let Some(command) = name.strip_prefix("elastocal.") else {
        return Err(wrong("is not a results file of elastocal".to_owned()));
    };
    // Another version may have other names, so its number comes first.
    let is_known = commands.contains(&command);
    let maker = if is_known { command } else { "..." };
    let version = &json["schema"]["version"];
    let renew = format!("elastocal {maker}");
    check_version(path, "schema.version", version, READABLE, &renew)?;
    if !is_known {
        let commands = listed(commands);
        return Err(wrong(format!(
            "found {name:?}; results of {commands} are needed"
        )));
    }
    Ok((text, json))
}

/// Whether this program reads a version of a form; `renew` is the command that writes today's.
///
/// # Errors
/// The version is newer or older, or none.
pub fn check_version(
    path: &Path,
    key: &str,
    found: &Value,
    readable: RangeInclusive<u64>,
    renew: &str,
) -> Result<(), FileError> {
    let (oldest, newest) = readable.into_inner();
    let program = format!("this elastocal ({})", crate::VERSION);
    let wrong =
        |problem: String| (FileError::new(path, problem).at(key)).code(ErrorCode::OtherVersion);
    match found.as_u64() {
        Some(version) if version > newest => Err(wrong(format!(
            "found {version}; {program} reads up to {newest}"
        ))
        .hint("read it with the elastocal that wrote it, or with a newer one")),
        Some(version) if version < oldest => Err(wrong(format!(
            "found {version}; {program} reads no version before {oldest}"
        ))
        .hint(format!("make the file anew with `{renew}`"))),
        Some(_) => Ok(()),
        None => Err(wrong(format!("found {found}; a version is a whole number"))
            .hint(format!("make the file anew with `{renew}`"))),
    }
}

/// "run, plan and study".
fn listed(words: &[&str]) -> String {
    match words {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => words.concat(),
    }
}
