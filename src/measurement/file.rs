//! Measurement files: CSV that a laboratory writes by hand or by script.

use std::path::Path;

use nalgebra::Vector3;

use super::{Measurement, Origin, RotationMeasurement};
use crate::csv::{Row, Table};
use crate::experiment::{configuration_and_load, experiment_columns, experiment_fields};
use crate::files::FileError;
use crate::files::output::write_whole;
use crate::plausible::{DEVIATION, Kind, ROTATION_DEVIATION, faint_load, shown};
use crate::robot::Commands;
use crate::units::thousandths;

const DEFLECTION: [&str; 3] = ["dx_mm", "dy_mm", "dz_mm"];
const DEFLECTION_SIGMA: [&str; 3] = ["sx_mm", "sy_mm", "sz_mm"];
const ROTATION: [&str; 3] = ["rx_mrad", "ry_mrad", "rz_mrad"];
const ROTATION_SIGMA: [&str; 3] = ["srx_mrad", "sry_mrad", "srz_mrad"];

/// Reads measurements of an arm, which may be given by its number of joints.
///
/// # Errors
/// See [`Table::read`]; a standard deviation must be positive, and the columns of a group
/// (`sx_mm,sy_mm,sz_mm`; `rx_mrad,ry_mrad,rz_mrad,srx_mrad,sry_mrad,srz_mrad`) come together.
pub fn read_measurements(
    path: &Path,
    commands: impl Into<Commands>,
) -> Result<Vec<Measurement>, FileError> {
    let commands = commands.into();
    let mut required = experiment_columns(&commands);
    required.extend(DEFLECTION.map(str::to_owned));
    let optional: Vec<_> = [DEFLECTION_SIGMA, ROTATION, ROTATION_SIGMA]
        .concat()
        .into_iter()
        .map(str::to_owned)
        .collect();
    let table = Table::read(path, &required, &optional)?;
    let has_sigma = whole_group(&table, &DEFLECTION_SIGMA)?;
    let has_rotation = whole_group(&table, &[ROTATION, ROTATION_SIGMA].concat())?;
    table
        .rows()
        .map(|row| {
            let (configuration_rad, load) = configuration_and_load(&row, &commands);
            if let Some(problem) = faint_load(&load.wrench()) {
                return Err(row.wrong(problem));
            }
            Ok(Measurement {
                configuration_rad,
                load,
                deflection_m: row.vector(DEFLECTION) * 1e-3,
                sigma_m: has_sigma
                    .then(|| deviations(&row, DEFLECTION_SIGMA, &DEVIATION))
                    .transpose()?,
                rotation: has_rotation
                    .then(|| {
                        Ok(RotationMeasurement {
                            vector_rad: row.vector(ROTATION) * 1e-3,
                            sigma_rad: deviations(&row, ROTATION_SIGMA, &ROTATION_DEVIATION)?,
                        })
                    })
                    .transpose()?,
            })
        })
        .collect()
}

fn whole_group(table: &Table<'_>, group: &[&str]) -> Result<bool, FileError> {
    let present: Vec<_> = group.iter().filter(|column| table.has(&[column])).collect();
    if present.is_empty() || present.len() == group.len() {
        Ok(!present.is_empty())
    } else {
        let problem = format!("found {present:?}; these columns come together: {group:?}");
        Err(table.wrong_header(problem))
    }
}

fn deviations(row: &Row<'_>, columns: [&str; 3], kind: &Kind) -> Result<Vector3<f64>, FileError> {
    let sigma = row.vector(columns);
    if sigma.iter().all(|&value| kind.allows(value)) {
        Ok(sigma * 1e-3)
    } else {
        let problem = format!(
            "{}: found {}, {}, {}; {}",
            columns.join(","),
            shown(sigma.x),
            shown(sigma.y),
            shown(sigma.z),
            kind.allowed()
        );
        Err(row.wrong(problem))
    }
}

/// Writes measurements of an arm of n joints that were made under a scenario, which comments name.
///
/// # Errors
/// As [`write_measurements`].
pub fn write_measurements_under(
    origin: &Origin,
    path: &Path,
    commands: impl Into<Commands>,
    measurements: &[Measurement],
) -> Result<(), FileError> {
    let text = text_of(path, &commands.into(), measurements)?;
    write_whole(path, (origin.comments() + &text).as_bytes())
}

/// Writes measurements of an arm, which may be given by its number of joints.
///
/// # Errors
/// The file cannot be written; or some measurements have standard deviations or rotations and some
/// have none, which the columns of a file cannot say.
pub fn write_measurements(
    path: &Path,
    commands: impl Into<Commands>,
    measurements: &[Measurement],
) -> Result<(), FileError> {
    write_whole(
        path,
        text_of(path, &commands.into(), measurements)?.as_bytes(),
    )
}

fn text_of(
    path: &Path,
    commands: &Commands,
    measurements: &[Measurement],
) -> Result<String, FileError> {
    let has = |what, is_there: fn(&Measurement) -> bool| match measurements
        .iter()
        .filter(|each| is_there(each))
        .count()
    {
        0 => Ok(false),
        count if count == measurements.len() => Ok(true),
        count => {
            let all = measurements.len();
            let problem = format!("{count} of {all} measurements have {what}; all or none may");
            Err(FileError::new(path, problem))
        }
    };
    let has_sigma = has("standard deviations", |each| each.sigma_m.is_some())?;
    let has_rotation = has("rotations", |each| each.rotation.is_some())?;
    let mut columns = experiment_columns(commands);
    columns.extend(DEFLECTION.map(str::to_owned));
    if has_sigma {
        columns.extend(DEFLECTION_SIGMA.map(str::to_owned));
    }
    if has_rotation {
        columns.extend(ROTATION.map(str::to_owned));
        columns.extend(ROTATION_SIGMA.map(str::to_owned));
    }
    let mut text = columns.join(",") + "\n";
    for each in measurements {
        let mut fields = experiment_fields(commands, &each.configuration_rad, &each.load);
        let mut push = |vector: &Vector3<f64>| {
            fields.extend(vector.iter().map(|&value| thousandths(value).to_string()));
        };
        push(&each.deflection_m);
        if let (true, Some(sigma)) = (has_sigma, &each.sigma_m) {
            push(sigma);
        }
        if let (true, Some(rotation)) = (has_rotation, &each.rotation) {
            push(&rotation.vector_rad);
            push(&rotation.sigma_rad);
        }
        text += &fields.join(",");
        text.push('\n');
    }
    Ok(text)
}
