//! The dialect of robots' programs that a command writes.

use std::path::Path;

use elastocal::codes::ErrorCode;
use elastocal::files::{FileError, read_text};
use elastocal::laboratory::Dialect;
use elastocal::scenario::Scenario;

/// The dialect of an option's name or file, or else the scenario's, for the scenario's robot.
pub fn dialect(option: Option<&str>, scenario: &Scenario) -> Result<Dialect, FileError> {
    let found = named(option, scenario).and_then(|dialect| {
        let checked = dialect.check_joints(scenario.task.belief.commands().len());
        checked.map_err(|error| FileError::new(&scenario.path, error.to_string()))?;
        Ok(dialect)
    });
    found.map_err(|wrong| wrong.or_code(ErrorCode::Program))
}

fn named(option: Option<&str>, scenario: &Scenario) -> Result<Dialect, FileError> {
    let (name, from) = match option {
        Some(name) => (name, Path::new("")),
        None => (
            scenario.laboratory.dialect.as_str(),
            scenario.path.parent().unwrap_or(Path::new("")),
        ),
    };
    let is_file = Path::new(name)
        .extension()
        .is_some_and(|ending| ending == "toml");
    if is_file {
        let path = from.join(name);
        let text = read_text(&path)?;
        return Dialect::read(&text).map_err(|error| FileError::new(&path, error.to_string()));
    }
    Dialect::known(name).map_err(|error| {
        let place = if option.is_some() {
            "--dialect"
        } else {
            "laboratory.dialect"
        };
        FileError::new(&scenario.path, error.to_string()).at(place)
    })
}
