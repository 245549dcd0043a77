//! Plan files: CSV with the units in the column names.

use std::path::Path;

use nalgebra::DVector;

use super::{Experiment, Plan};
use crate::csv::{Row, Table};
use crate::files::FileError;
use crate::files::output::write_whole;
use crate::limits::MOST_MEASUREMENTS;
use crate::plausible::faint_load;
use crate::robot::Load;
use crate::units::degrees;

/// The columns that name a configuration and a load, for an arm of n joints.
#[must_use]
pub fn experiment_columns(joints: usize) -> Vec<String> {
    (1..=joints)
        .map(|joint| format!("q{joint}_deg"))
        .chain(["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"].map(str::to_owned))
        .collect()
}

/// The configuration (rad) and load of a row with [`experiment_columns`].
#[must_use]
pub fn configuration_and_load(row: &Row<'_>, joints: usize) -> (DVector<f64>, Load) {
    let configuration = DVector::from_iterator(
        joints,
        (1..=joints).map(|joint| row.get(&format!("q{joint}_deg")).to_radians()),
    );
    let load = Load {
        force_n: row.vector(["fx_n", "fy_n", "fz_n"]),
        torque_nm: row.vector(["tx_nm", "ty_nm", "tz_nm"]),
    };
    (configuration, load)
}

/// Reads a plan for an arm of n joints.
///
/// # Errors
/// See [`Table::read`]; `repeats` must be a whole number from 1, and no load zero.
pub fn read_plan(path: &Path, joints: usize) -> Result<Plan, FileError> {
    let mut columns = experiment_columns(joints);
    columns.push("repeats".to_owned());
    let table = Table::read(path, &columns, &[])?;
    let experiments = table
        .rows()
        .map(|row| {
            let repeats = row.get("repeats");
            if repeats.fract() != 0.0 || !(1.0..=f64::from(MOST_MEASUREMENTS)).contains(&repeats) {
                return Err(row.wrong(format!(
                    "repeats: found {repeats}; a whole number from 1 to {MOST_MEASUREMENTS} is allowed"
                )));
            }
            let (configuration_rad, load) = configuration_and_load(&row, joints);
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
#[must_use]
pub fn experiment_fields(configuration_rad: &DVector<f64>, load: &Load) -> Vec<String> {
    configuration_rad
        .iter()
        .map(|&angle| degrees(angle))
        .chain(load.wrench().iter().copied())
        .map(|value| value.to_string())
        .collect()
}

/// Writes a plan for an arm of n joints.
///
/// # Errors
/// The file cannot be written.
pub fn write_plan(path: &Path, joints: usize, plan: &Plan) -> Result<(), FileError> {
    let mut text = experiment_columns(joints).join(",") + ",repeats\n";
    for each in &plan.experiments {
        text += &experiment_fields(&each.configuration_rad, &each.load).join(",");
        text += &format!(",{}\n", each.repeats);
    }
    write_whole(path, text.as_bytes())
}
