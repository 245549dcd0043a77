//! The JSON schema of a scenario file: what editors complete and check.

use schemars::schema_for;
use serde_json::Value;

use super::file::File;

/// The schema of scenarios, made from what reads them.
///
/// TOML's editors take it from a first line `#:schema FILE`. Ranges of numbers, and what belongs together, are
/// [`Scenario::check`](super::Scenario::check)'s.
pub fn scenario_schema() -> Value {
    let mut schema = schema_for!(File);
    schema.insert("title".to_owned(), "elastocal scenario".into());
    schema.to_value()
}
