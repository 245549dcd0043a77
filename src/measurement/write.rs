//! Writes measurement files, and such to fill in.

use std::path::Path;

use nalgebra::{DVector, Vector3};

use super::columns::{
    DEFLECTION, DEFLECTION_SIGMA, LOADED, PLACES, ROTATION, ROTATION_SIGMA, UNLOADED,
};
use super::{Measurement, Origin};
use crate::experiment::{APPROACH, experiment_columns, experiment_fields};
use crate::files::{FileError, output::write_whole};
use crate::quantities::units::thousandths;
use crate::robot::{Approach, Commands, Load};

/// A measurement that is to be made.
#[derive(Debug, Clone)]
pub struct RowToFillIn<'a> {
    /// The number of the stop without a load, from 1, and that of the reading there.
    pub unloaded: [usize; 2],
    /// The same with the load.
    pub loaded: [usize; 2],
    /// The commanded configuration (rad, m).
    pub configuration_rad: &'a DVector<f64>,
    /// The load.
    pub load: &'a Load,
    /// The side from which the configuration is approached, where the table is to say.
    pub approach: Option<Approach>,
}

/// A table in which the positions without and with the load are to be filled in; where rotations are measured, with
/// that standard deviation (rad), they are, too.
pub fn table_to_fill_in<'a>(
    commands: &Commands,
    rotation_sigma_rad: Option<f64>,
    rows: impl Iterator<Item = RowToFillIn<'a>>,
) -> String {
    let mut columns: Vec<String> = PLACES.map(str::to_owned).into();
    columns.extend(experiment_columns(commands));
    columns.extend(
        [UNLOADED, LOADED]
            .concat()
            .iter()
            .map(|&column| column.to_owned()),
    );
    let mut to_fill = vec![String::new(); 6];
    if let Some(sigma_rad) = rotation_sigma_rad {
        columns.extend(
            [ROTATION, ROTATION_SIGMA]
                .concat()
                .iter()
                .map(|&column| column.to_owned()),
        );
        to_fill.resize(9, String::new());
        to_fill.resize(12, thousandths(sigma_rad).to_string());
    }
    let rows: Vec<RowToFillIn<'_>> = rows.collect();
    let says_sides = rows.iter().any(|row| row.approach.is_some());
    if says_sides {
        columns.push(APPROACH.to_owned());
    }
    let mut text = columns.join(",") + "\n";
    for row in rows {
        let places = [row.unloaded, row.loaded].concat();
        let mut fields: Vec<String> = places.iter().map(ToString::to_string).collect();
        fields.extend(experiment_fields(commands, row.configuration_rad, row.load));
        fields.extend_from_slice(&to_fill);
        if says_sides {
            fields.push((row.approach.as_ref()).map_or_else(String::new, Approach::field));
        }
        text += &fields.join(",");
        text.push('\n');
    }
    text
}

/// Writes measurements of an arm of n joints that were made under a scenario, which comments name.
pub fn write_measurements_under(
    origin: &Origin,
    path: &Path,
    commands: impl Into<Commands>,
    measurements: &[Measurement],
) -> Result<(), FileError> {
    let text = deflection_table(path, &commands.into(), measurements)?;
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
        deflection_table(path, &commands.into(), measurements)?.as_bytes(),
    )
}

/// The text of a file of deflections.
///
/// # Errors
/// Some of them have standard deviations or rotations and some have none.
pub fn deflection_table(
    path: &Path,
    commands: &Commands,
    measurements: &[Measurement],
) -> Result<String, FileError> {
    let has = |what, is_there: fn(&Measurement) -> bool| match (measurements.iter())
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
    let says_sides = measurements.iter().any(|each| each.approach.is_some());
    if says_sides {
        columns.push(APPROACH.to_owned());
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
        if says_sides {
            fields.push((each.approach.as_ref()).map_or_else(String::new, Approach::field));
        }
        text += &fields.join(",");
        text.push('\n');
    }
    Ok(text)
}
