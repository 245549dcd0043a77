//! Numbers and arrays that are allowed.

use super::Checker;
use crate::files::FileError;
use crate::quantities::plausible::Kind;

impl Checker<'_> {
    /// A number of a kind.
    pub(super) fn number(&self, key: &str, value: f64, kind: &Kind) -> Result<f64, FileError> {
        kind.check(value)
            .map_err(|problem| self.wrong(key, problem))
    }

    /// How many there may be of something.
    pub(super) fn at_most(&self, key: &str, found: usize, most: usize) -> Result<(), FileError> {
        if found <= most {
            return Ok(());
        }
        let problem = format!("found {found}; at most {most} are allowed");
        Err(self.wrong(key, problem))
    }

    /// An array of N numbers of a kind.
    pub(super) fn numbers<const N: usize>(
        &self,
        key: &str,
        values: &[f64],
        kind: &Kind,
    ) -> Result<[f64; N], FileError> {
        let array = <[f64; N]>::try_from(values).map_err(|_| {
            let problem = format!("found {} numbers; {N} are allowed", values.len());
            self.wrong(key, problem)
        })?;
        for value in array {
            self.number(key, value, kind)?;
        }
        Ok(array)
    }

    /// An array of numbers of a kind, one for each joint.
    pub(super) fn one_per_joint<'a>(
        &self,
        key: &str,
        values: &'a [f64],
        joints: usize,
        kind: &Kind,
    ) -> Result<&'a [f64], FileError> {
        if values.len() != joints {
            let problem = format!(
                "found {} numbers; the robot has {joints} joints",
                values.len()
            );
            return Err(self.wrong(key, problem));
        }
        for &value in values {
            self.number(key, value, kind)?;
        }
        Ok(values)
    }
}
