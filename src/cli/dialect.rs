//! The dialect of robots' programs that a command writes.

use std::path::Path;

use crate::codes::{Condition, ConditionCode, ErrorCode};
use crate::files::{FileError, read_text};
use crate::laboratory::{Dialect, DialectError};
use crate::scenario::Scenario;

/// The dialect of an option's name or file, or else the scenario's, for the scenario's robot.
pub fn dialect(option: Option<&str>, scenario: &Scenario) -> Result<Dialect, FileError> {
    suitable(option, scenario)?.map_err(|error| {
        let wrong = FileError::new(&scenario.path, error.to_string()).at(place(option));
        wrong.code(ErrorCode::Program).hint(DialectError::HINT)
    })
}

/// The same; none, with a condition, where the dialect is for other robots.
pub fn dialect_if_suitable(
    option: Option<&str>,
    scenario: &Scenario,
) -> Result<(Option<Dialect>, Option<Condition>), FileError> {
    Ok(match suitable(option, scenario)? {
        Ok(dialect) => (Some(dialect), None),
        Err(error) => {
            let text = format!(
                "no robot program is written: {error}; {}",
                DialectError::HINT
            );
            (None, Some(ConditionCode::NoProgram.with(text)))
        }
    })
}

const fn place(option: Option<&str>) -> &'static str {
    if option.is_some() {
        "--dialect"
    } else {
        "laboratory.dialect"
    }
}

/// A dialect, or why it is not for the scenario's robot.
fn suitable(
    option: Option<&str>,
    scenario: &Scenario,
) -> Result<Result<Dialect, DialectError>, FileError> {
    let (name, from) = match option {
        Some(name) => (name, Path::new("")),
        None => (
            scenario.laboratory.dialect.as_str(),
            scenario.path.parent().unwrap_or(Path::new("")),
        ),
    };
    let path = from.join(name);
    let dialect = if path.extension().is_some_and(|ending| ending == "toml") {
        let wrong = |error: DialectError| FileError::new(&path, error.to_string());
        read_text(&path).and_then(|text| Dialect::read(&text).map_err(wrong))
    } else {
        let wrong = |error: DialectError| FileError::new(&scenario.path, error.to_string());
        Dialect::known(name).map_err(|error| wrong(error).at(place(option)))
    };
    let dialect = dialect.map_err(|wrong| wrong.or_code(ErrorCode::Program))?;
    let checked = dialect.axes_of(&scenario.task.belief.commands()).map(drop);
    Ok(checked.map(|()| dialect))
}
