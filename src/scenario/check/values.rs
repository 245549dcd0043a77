//! Texts and numbers that are allowed, by their keys, wherever these stand.
//!
//! Names and other text are one line without control characters, which would reach terminals, pages and other programs. Numbers that have
//! other keys are a matter of the file of their table: standard deviations, directions, counts.

use toml::{Table, Value};

use super::Checker;
use crate::files::FileError;
use crate::quantities::plausible::{
    ANGLE, ANGLE_WIDTH, APPROACH, AXIS_SPEED, CLEARANCE, COMPLIANCE, DEVIATION, ELEVATION, FACTOR,
    FORCE, FORCE_LIMIT, INCIDENCE, Kind, LEAST_FORCE, MASS, MINUTES, POSITION, RESOLUTION,
    ROTATION_DEVIATION, SIZE, TORQUE, TORQUE_LIMIT, WEIGHT,
};
use crate::text::{is_unseen, wrong_name};

/// The keys of each kind of numbers, and how many there are of them in an array where that is not for the robot to say. A key may be that of
/// a table from joints' names to numbers.
const NUMBERS: [(&str, Option<usize>, Kind); 26] = [
    ("rpy_deg", Some(3), ANGLE),
    ("joint_range_deg joint_range_mm", Some(2), ANGLE),
    ("q_deg safe_deg locked_deg", None, ANGLE),
    ("within_deg correlation_deg", None, ANGLE_WIDTH),
    ("approach_deg", None, APPROACH),
    ("axis_speed_deg_s", None, AXIS_SPEED),
    ("collision_clearance_mm", None, CLEARANCE),
    ("compliance_rad_per_nm", None, COMPLIANCE),
    ("sigma_mm stiffens_at_mm softens_at_mm", None, DEVIATION),
    ("tool_elevation_max_deg", None, ELEVATION),
    ("load_scale", None, FACTOR),
    ("force_n tool_force_n", Some(3), FORCE),
    ("force_max_n", None, FORCE_LIMIT),
    ("incidence_max_deg", None, INCIDENCE),
    ("force_min_n", None, LEAST_FORCE),
    ("mass_kg", None, MASS),
    (
        "station_min move_min load_change_min reading_min",
        None,
        MINUTES,
    ),
    ("position_mm centre_mm", Some(3), POSITION),
    (
        "locked_mm tool_height_min_mm tool_height_max_mm tool_radius_min_mm tool_radius_max_mm",
        None,
        POSITION,
    ),
    ("resolution_mm", None, RESOLUTION),
    ("stiffens_at_mrad softens_at_mrad", None, ROTATION_DEVIATION),
    ("size_mm", Some(3), SIZE),
    (
        "radius_mm length_mm correlation_mm range_mm range_min_mm range_max_mm",
        None,
        SIZE,
    ),
    ("torque_nm tool_torque_nm", Some(3), TORQUE),
    (
        "at_nm turned_over_at_nm joint_torque_max_nm",
        None,
        TORQUE_LIMIT,
    ),
    ("weight", None, WEIGHT),
];

impl Checker<'_> {
    /// Checks all that stands in a table under its key, the keys themselves among it.
    pub(super) fn check_table(
        &self,
        path: &str,
        own: &str,
        table: &Table,
    ) -> Result<(), FileError> {
        for (key, value) in table {
            let path = match path {
                "" => key.clone(),
                path => format!("{path}.{key}"),
            };
            if let Some(problem) = wrong_name(key) {
                return Err(self.wrong(&path, problem));
            }
            let is_of_joints = numbers(own).is_some();
            self.check_value(&path, if is_of_joints { own } else { key }, value)?;
        }
        Ok(())
    }

    fn check_value(&self, path: &str, key: &str, value: &Value) -> Result<(), FileError> {
        match value {
            Value::String(text) => match wrong_text(key, text) {
                Some(problem) => Err(self.wrong(path, problem)),
                None => Ok(()),
            },
            Value::Array(values) => {
                let count = numbers(key).and_then(|(_, count)| count);
                if let Some(count) = count.filter(|count| *count != values.len()) {
                    let problem = format!("found {} numbers; {count} are allowed", values.len());
                    return Err(self.wrong(path, problem));
                }
                (values.iter().enumerate()).try_for_each(|(index, each)| match each {
                    Value::Float(_) | Value::Integer(_) => self.check_value(path, key, each),
                    _ => self.check_value(&format!("{path}[{index}]"), key, each),
                })
            }
            Value::Table(table) => self.check_table(path, key, table),
            Value::Float(number) => self.check_number(path, key, *number),
            Value::Integer(number) => self.check_number(path, key, *number as f64),
            Value::Boolean(_) | Value::Datetime(_) => Ok(()),
        }
    }

    fn check_number(&self, path: &str, key: &str, number: f64) -> Result<(), FileError> {
        match numbers(key) {
            Some((kind, _)) => self.number(path, number, &kind).map(drop),
            None => Ok(()),
        }
    }
}

/// The kind of the numbers under a key, and how many there are in an array.
fn numbers(key: &str) -> Option<(Kind, Option<usize>)> {
    let is_it = |keys: &str| keys.split(' ').any(|each| each == key);
    let (_, count, kind) = NUMBERS.iter().find(|(keys, ..)| is_it(keys))?;
    Some((*kind, *count))
}

fn wrong_text(key: &str, text: &str) -> Option<String> {
    match key {
        "description" => {
            let is_wrong = |each: char| is_unseen(each) && !matches!(each, '\n' | '\r' | '\t');
            text.contains(is_wrong)
                .then(|| format!("found {text:?}; text without control characters is allowed"))
        }
        // The names of files may be long.
        "model" | "file" | "mandatory" => (text.is_empty() || text.contains(is_unseen))
            .then(|| format!("found {text:?}; the path of a file is allowed")),
        _ => wrong_name(text),
    }
}
