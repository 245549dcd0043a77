//! Numbers, arrays and names that are allowed.

use std::fmt::Display;
use std::iter::repeat;
use std::ops::RangeInclusive;

use nalgebra::{Isometry3, Vector3};

use super::Checker;
use crate::files::FileError;
use crate::mujoco::frame;
use crate::quantities::plausible::{DIRECTION, Kind};
use crate::robot::SerialChain;
use crate::text::wording::joined;

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

    /// A count within a range.
    pub(super) fn count<T: PartialOrd + Display>(
        &self,
        key: &str,
        found: T,
        allowed: RangeInclusive<T>,
    ) -> Result<T, FileError> {
        if allowed.contains(&found) {
            return Ok(found);
        }
        let (least, most) = allowed.into_inner();
        let problem = format!("found {found}; {least} to {most} are allowed");
        Err(self.wrong(key, problem))
    }

    /// The bounds `<key>_min_mm` and `<key>_max_mm`, from mm to m.
    pub(super) fn lengths(
        &self,
        key: &str,
        bounds_mm: [Option<f64>; 2],
    ) -> Result<[Option<f64>; 2], FileError> {
        if let [Some(low), Some(high)] = bounds_mm
            && low > high
        {
            let problem = format!("found {low}; at most {key}_max_mm = {high} is allowed");
            return Err(self.wrong(&format!("{key}_min_mm"), problem));
        }
        Ok(bounds_mm.map(|bound| bound.map(|mm| mm * 1e-3)))
    }

    /// A direction, of length one.
    pub(super) fn unit(&self, key: &str, direction: &[f64]) -> Result<Vector3<f64>, FileError> {
        let three = <[f64; 3]>::try_from(direction).map_err(|_| {
            let problem = format!("found {} numbers; 3 are allowed", direction.len());
            self.wrong(key, problem)
        })?;
        for value in three {
            self.number(key, value, &DIRECTION)?;
        }
        (Vector3::from(three).try_normalize(f64::MIN_POSITIVE))
            .ok_or_else(|| self.wrong(key, "found 0, 0, 0; a direction is needed"))
    }

    /// An array of numbers, one for each joint.
    pub(super) fn one_per_joint<'a>(
        &self,
        key: &str,
        values: &'a [f64],
        joints: usize,
    ) -> Result<&'a [f64], FileError> {
        if values.len() == joints {
            return Ok(values);
        }
        let found = values.len();
        let problem = format!("found {found} numbers; the robot has {joints} joints");
        Err(self.wrong(key, problem))
    }

    /// Numbers, one for each commanded joint, in the places of `all` joints.
    pub(super) fn one_per_command(
        &self,
        key: &str,
        values: &[f64],
        chain: &SerialChain,
        mut all: Vec<f64>,
    ) -> Result<Vec<f64>, FileError> {
        let given = self.one_per_joint(key, values, chain.commanded().count())?;
        for (joint, &value) in chain.commanded().zip(given) {
            all[joint] = value;
        }
        Ok(all)
    }

    /// The joint of a name.
    pub(super) fn joint(
        &self,
        key: &str,
        chain: &SerialChain,
        name: &str,
    ) -> Result<usize, FileError> {
        let found = chain.joints.iter().position(|joint| joint.name == name);
        found.ok_or_else(|| {
            let known = names_of(chain);
            let problem = format!("found {name:?}; the robot's joints are: {known}");
            self.wrong(key, problem)
        })
    }

    /// Whether a key has the unit of a joint: that of angles where it turns, mm where it slides.
    pub(super) fn check_unit(
        &self,
        key: &str,
        joint: &str,
        slides: bool,
        unit: &str,
        of_angles: &str,
    ) -> Result<(), FileError> {
        let (moves, own) = if slides {
            ("slides", "mm")
        } else {
            ("turns", of_angles)
        };
        if unit == own {
            return Ok(());
        }
        let other = key.replacen(&format!("_{unit}"), &format!("_{own}"), 1);
        let wrong = self.wrong(key, format!("{joint} {moves}"));
        Err(wrong.hint(format!("write {other}")))
    }

    /// What is read of each table of a list, under its key; of these there are not too many.
    pub(super) fn each<T, U>(
        &self,
        key: &str,
        most: usize,
        tables: &[T],
        read: impl Fn(&str, &T) -> Result<U, FileError>,
    ) -> Result<Vec<U>, FileError> {
        self.at_most(key, tables.len(), most)?;
        let tables = tables.iter().enumerate();
        tables
            .map(|(index, table)| read(&format!("{key}[{index}]"), table))
            .collect()
    }

    /// Each table of a list has a name of its own, and there are not too many.
    pub(super) fn named<'a>(
        &self,
        key: &str,
        most: usize,
        names: impl Iterator<Item = &'a String>,
    ) -> Result<(), FileError> {
        let names: Vec<&String> = names.collect();
        self.at_most(key, names.len(), most)?;
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                let problem = format!("found {name:?} twice");
                return Err(self.wrong(&format!("{key}[{index}].name"), problem));
            }
        }
        Ok(())
    }
}

/// An array that has three numbers.
pub(super) fn vector(values: &[f64]) -> Vector3<f64> {
    Vector3::from_iterator(values.iter().copied().chain(repeat(0.0)))
}

/// A position, from mm to m.
pub(super) fn position_m(position_mm: &[f64]) -> Vector3<f64> {
    vector(position_mm) * 1e-3
}

/// The frame of the keys `position_mm` and `rpy_deg`.
pub(super) fn frame_of(position_mm: &[f64], rpy_deg: Option<&[f64]>) -> Isometry3<f64> {
    let rpy_deg: [f64; 3] = rpy_deg.map(vector).unwrap_or_default().into();
    frame(position_m(position_mm), rpy_deg.map(f64::to_radians))
}

/// A coordinate in mm or deg, in SI units.
pub(super) fn in_si(unit: &str, value: f64) -> f64 {
    match unit {
        "mm" => value * 1e-3,
        _ => value.to_radians(),
    }
}

/// The joints' names, for messages.
pub(super) fn names_of(chain: &SerialChain) -> String {
    joined(chain.joints.iter().map(|joint| &joint.name), ", ")
}
