//! TOML as JSON and back, for scenarios that are changed in Python.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde_json::Value;

/// The JSON of a TOML document.
#[pyfunction]
pub fn read_toml(text: &str) -> PyResult<String> {
    let table: Value = toml::from_str(text).map_err(wrong)?;
    Ok(table.to_string())
}

/// The TOML document of a JSON object.
#[pyfunction]
pub fn written_toml(json: &str) -> PyResult<String> {
    let table: Value = serde_json::from_str(json).map_err(wrong)?;
    toml::to_string(&table).map_err(wrong)
}

fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
