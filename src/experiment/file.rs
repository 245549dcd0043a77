//! Columns of configurations and loads in CSV files, with the units in their names.

use nalgebra::{DVector, Vector3};

use crate::csv::{Row, Sheet};
use crate::files::FileError;
use crate::quantities::plausible::faint_load;
use crate::robot::{Approach, Commands, Load, ReadsAlong};

/// The columns that name a load: force and torque in the world frame.
pub const LOAD: [&str; 6] = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"];
/// The column of words that says from which side a configuration is approached.
pub const APPROACH: &str = "approach";

/// The columns that name the direction along which a gauge reads: a unit vector in the world frame.
pub const DIRECTION: [&str; 3] = ["direction_x", "direction_y", "direction_z"];
/// A direction's length may be so far from 1: four decimals.
const NEARLY_ONE: f64 = 1e-3;

/// The columns that name a configuration and a load.
pub fn experiment_columns(commands: &Commands) -> Vec<String> {
    (commands.columns().into_iter())
        .chain(LOAD.map(str::to_owned))
        .collect()
}

/// The load of a row with its columns.
///
/// # Errors
/// It is next to nothing, but not zero.
pub fn load(row: &Row<'_>) -> Result<Load, FileError> {
    let load = Load {
        force_n: row.vector([LOAD[0], LOAD[1], LOAD[2]]),
        torque_nm: row.vector([LOAD[3], LOAD[4], LOAD[5]]),
    };
    match faint_load(&load.wrench()) {
        Some(problem) => Err(row.wrong(problem)),
        None => Ok(load),
    }
}

/// The configuration (rad, m) of a row that has its columns.
pub fn configuration(row: &Row<'_>, commands: &Commands) -> DVector<f64> {
    let written = commands.columns();
    let written: Vec<f64> = written.iter().map(|column| row.get(column)).collect();
    commands.configuration(&written)
}

/// The side from which the configuration of a row is approached, where the file says.
///
/// # Errors
/// The word is not a sign for all joints, or one for each.
pub fn approach(row: &Row<'_>, commands: &Commands) -> Result<Option<Approach>, FileError> {
    let word = row.word(APPROACH).filter(|word| !word.is_empty());
    let Some(word) = word else {
        return Ok(None);
    };
    let joints = commands.len();
    Approach::of_word(word, joints).map(Some).ok_or_else(|| {
        row.wrong(format!(
            "{APPROACH}: found {word:?}; + or - for all joints is allowed, or {joints} signs, one for each joint; or nothing \
             where it is not known"
        ))
    })
}

/// The same of a plan, all of whose joints turn positively where a column of sides has nothing.
///
/// # Errors
/// As [`approach`].
pub fn planned_approach(row: &Row<'_>, commands: &Commands) -> Result<Option<Approach>, FileError> {
    let usual = row
        .word(APPROACH)
        .map(|_| Approach(vec![true; commands.len()]));
    Ok(approach(row, commands)?.or(usual))
}

/// The fields of a configuration and a load, in the order of [`experiment_columns`].
pub fn experiment_fields(
    commands: &Commands,
    configuration_rad: &DVector<f64>,
    load: &Load,
) -> Vec<String> {
    (commands.numbers(configuration_rad.as_slice()).into_iter())
        .chain(load.wrench().iter().copied())
        .map(|value| value.to_string())
        .collect()
}

/// The columns that name a configuration, a load and, for a gauge, its direction.
pub fn reading_columns(commands: &Commands) -> Vec<String> {
    let mut columns = experiment_columns(commands);
    if commands.reads_along != ReadsAlong::Never {
        columns.extend(DIRECTION.map(str::to_owned));
    }
    columns
}

/// The direction of a row, for a gauge; none where the row may leave it empty, and does.
///
/// # Errors
/// Its length is not 1.
pub fn direction(row: &Row<'_>, commands: &Commands) -> Result<Option<Vector3<f64>>, FileError> {
    let direction = row.vector(DIRECTION);
    let is_empty = direction.iter().all(|each| each.is_nan());
    if commands.reads_along == ReadsAlong::Never
        || commands.reads_along == ReadsAlong::Sometimes && is_empty
    {
        return Ok(None);
    }
    let length = direction.norm();
    if (length - 1.0).abs() <= NEARLY_ONE {
        return Ok(Some(direction / length));
    }
    let problem = format!(
        "{}: found a vector of length {length:.4}; 1 is allowed, to {NEARLY_ONE}",
        DIRECTION.join(",")
    );
    Err(row.wrong(problem))
}

/// The fields of a configuration, a load and a direction, in the order of [`reading_columns`].
pub fn reading_fields(
    commands: &Commands,
    configuration_rad: &DVector<f64>,
    load: &Load,
    direction: Option<&Vector3<f64>>,
) -> Vec<String> {
    let mut fields = experiment_fields(commands, configuration_rad, load);
    if commands.reads_along != ReadsAlong::Never {
        fields.extend(fields_of(direction.map(|each| (*each).into())));
    }
    fields
}

/// Numbers as fields; empty ones where there are none.
pub fn fields_of<const N: usize>(values: Option<[f64; N]>) -> Vec<String> {
    let empty = || vec![String::new(); N];
    values.map_or_else(empty, |values| values.map(|each| each.to_string()).into())
}

/// The columns of a direction, which rows may leave empty where some are read along none.
pub fn blank_directions(commands: &Commands) -> Vec<String> {
    match commands.reads_along {
        ReadsAlong::Sometimes => DIRECTION.map(str::to_owned).into(),
        _ => Vec::new(),
    }
}

/// Adds the side of approach to a table, where some row says it.
pub fn add_approach<R>(sheet: &mut Sheet<'_, R>, side: impl Fn(&R) -> Option<&Approach>) {
    if sheet.of.iter().any(|row| side(row).is_some()) {
        sheet.add(&[APPROACH], |row| {
            vec![side(row).map_or_else(String::new, Approach::field)]
        });
    }
}
