//! Plan files: CSV with the units in the column names.

use std::path::Path;

use nalgebra::DVector;

use super::{Experiment, Plan};
use crate::codes::ErrorCode;
use crate::csv::{Columns, Row, Table};
use crate::files::FileError;
use crate::files::output::write_whole;
use crate::quantities::limits::MOST_MEASUREMENTS;
use crate::quantities::plausible::faint_load;
use crate::robot::{Approach, Commands, Load};

/// The columns that name a load: force and torque in the world frame.
pub const LOAD: [&str; 6] = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"];
/// The column of words that says from which side a configuration is approached.
pub const APPROACH: &str = "approach";
/// How often an experiment is measured.
const REPEATS: &str = "repeats";

/// The columns that name a configuration and a load.
pub fn experiment_columns(commands: &Commands) -> Vec<String> {
    (commands.columns().into_iter())
        .chain(LOAD.map(str::to_owned))
        .collect()
}

/// The configuration (rad, m) and load of a row with [`experiment_columns`].
pub fn configuration_and_load(row: &Row<'_>, commands: &Commands) -> (DVector<f64>, Load) {
    let load = Load {
        force_n: row.vector([LOAD[0], LOAD[1], LOAD[2]]),
        torque_nm: row.vector([LOAD[3], LOAD[4], LOAD[5]]),
    };
    (configuration(row, commands), load)
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

/// Reads a plan for an arm, which may be given by its number of joints.
///
/// # Errors
/// See [`Table::read`]; `repeats` must be a whole number from 1, and no load zero.
pub fn read_plan(path: &Path, commands: impl Into<Commands>) -> Result<Plan, FileError> {
    plan_of(path, &commands.into()).map_err(|wrong| wrong.or_code(ErrorCode::PlanFile))
}

fn plan_of(path: &Path, commands: &Commands) -> Result<Plan, FileError> {
    let mut columns = experiment_columns(commands);
    columns.push(REPEATS.to_owned());
    let side = vec![APPROACH.to_owned()];
    let columns = Columns {
        required: columns,
        optional: side.clone(),
        words: side,
        ..Columns::default()
    };
    let table = Table::read_with(path, &columns)?;
    let experiments = table
        .rows()
        .map(|row| {
            let repeats = row.get(REPEATS);
            if repeats.fract() != 0.0 || !(1.0..=f64::from(MOST_MEASUREMENTS)).contains(&repeats) {
                return Err(row.wrong(format!(
                    "repeats: found {repeats}; a whole number from 1 to {MOST_MEASUREMENTS} is allowed"
                )));
            }
            let (configuration_rad, load) = configuration_and_load(&row, commands);
            if load == Load::NONE {
                return Err(row.wrong("found a load of zero, which deflects nothing"));
            }
            if let Some(problem) = faint_load(&load.wrench()) {
                return Err(row.wrong(problem));
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked to be a whole number from 1 to 1e6"
            )]
            let repeats = repeats as u32;
            Ok(Experiment {
                configuration_rad,
                load,
                repeats,
                approach: approach(&row, commands)?,
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let plan = Plan { experiments };
    let all = plan.experiments.iter().map(|each| u64::from(each.repeats));
    let all: u64 = all.sum();
    if all > u64::from(MOST_MEASUREMENTS) {
        let problem = format!(
            "found {all} measurements, repeats counted; at most {MOST_MEASUREMENTS} are allowed"
        );
        return Err(FileError::new(path, problem).at("repeats"));
    }
    Ok(plan)
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

/// Writes a plan for an arm, which may be given by its number of joints.
pub fn write_plan(
    path: &Path,
    commands: impl Into<Commands>,
    plan: &Plan,
) -> Result<(), FileError> {
    let commands = commands.into();
    let mut columns = experiment_columns(&commands);
    columns.push(REPEATS.to_owned());
    let says_sides = (plan.experiments.iter()).any(|each| each.approach.is_some());
    if says_sides {
        columns.push(APPROACH.to_owned());
    }
    let mut text = columns.join(",") + "\n";
    for each in &plan.experiments {
        text += &experiment_fields(&commands, &each.configuration_rad, &each.load).join(",");
        text += &format!(",{}", each.repeats);
        if says_sides {
            text.push(',');
            text += &(each.approach.as_ref()).map_or_else(String::new, Approach::field);
        }
        text.push('\n');
    }
    write_whole(path, text.as_bytes())
}
