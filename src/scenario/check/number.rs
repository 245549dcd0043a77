//! Numbers that are allowed.

use super::Checker;
use crate::files::FileError;

impl Checker<'_> {
    pub(super) fn finite(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.wrong(key, format!("found {value}; a finite number is allowed")))
        }
    }

    pub(super) fn positive(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(self.wrong(key, format!("found {value}; a positive number is allowed")))
        }
    }

    pub(super) fn not_negative(&self, key: &str, value: f64) -> Result<f64, FileError> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(self.wrong(
                key,
                format!("found {value}; zero or a positive number is allowed"),
            ))
        }
    }

    pub(super) fn one_per_joint<'a>(
        &self,
        key: &str,
        values: &'a [f64],
        joints: usize,
    ) -> Result<&'a [f64], FileError> {
        if values.len() == joints {
            Ok(values)
        } else {
            Err(self.wrong(
                key,
                format!(
                    "found {} numbers; the robot has {joints} joints",
                    values.len()
                ),
            ))
        }
    }
}
