//! What an identified file says twice must agree: a number that somebody altered contradicts another.

use std::path::Path;

use crate::files::FileError;
use crate::quantities::plausible::shown;

/// Rounding in what is said twice, as a share of its size.
const ROUNDING: f64 = 1e-9;

/// Whether what a file says of an estimate goes together, each with its key: its value, its variance, and where they are said its standard
/// error and its 95 % interval, about the value or, of a logarithm, by a factor to either side.
///
/// # Errors
/// What does not, by its key.
pub fn agree_of_estimate(
    path: &Path,
    (value_key, value): (&str, f64),
    variance: (&str, f64),
    standard_error: (&str, Option<f64>),
    interval95: (&str, Option<[f64; 2]>),
) -> Result<(), FileError> {
    if let (key, Some(error)) = standard_error {
        let root = variance.1.max(0.0).sqrt();
        agree(path, (key, error), (variance.0, root))?;
    }
    let (key, Some([low, high])) = interval95 else {
        return Ok(());
    };
    let off = (f64::midpoint(low, high) - value).abs();
    let is_about_it = off <= ROUNDING * (value.abs() + (high - low).abs());
    if is_about_it || (low * high - value * value).abs() <= ROUNDING * (value * value) {
        return Ok(());
    }
    let found = format!("{} to {}", shown(low), shown(high));
    Err(contradiction(path, key, &found, (value_key, value)))
}

/// Whether a number and what another key says of it are the same.
///
/// # Errors
/// They are not, by the key of the first.
pub fn agree(path: &Path, (key, found): (&str, f64), other: (&str, f64)) -> Result<(), FileError> {
    let size = found.abs().max(other.1.abs());
    if (found - other.1).abs() <= ROUNDING * size {
        return Ok(());
    }
    Err(contradiction(path, key, &shown(found), other))
}

fn contradiction(path: &Path, key: &str, found: &str, (other, says): (&str, f64)) -> FileError {
    let says = shown(says);
    let problem = format!(
        "found {found}; by {other} it is {says}: the file was altered since it was written"
    );
    let wrong = FileError::new(path, problem).at(key);
    wrong.hint("identify again with `elastocal identify --identified-out`")
}
