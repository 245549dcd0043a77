//! Absolute readings as the text of a measurement file.

use nalgebra::Matrix6;

use super::AbsoluteReading;
use super::columns::{
    DEFLECTION_SIGMA, POSITION, QUATERNION, ROTATION_SIGMA, TEMPERATURE, TIME, WORDS,
    covariance_columns,
};
use crate::csv::word_field;
use crate::experiment::LOAD;
use crate::quantities::units::thousandths;
use crate::robot::{Approach, Commands, Load};

/// The place of the approach among the words.
const APPROACH: usize = 3;

/// The text of a measurement file that holds these readings, all of the same kind. A column that some of them do not
/// have is left out, but for the approach, which may be known of some.
pub fn absolute_table(commands: &Commands, readings: &[AbsoluteReading]) -> String {
    let all = |has: &dyn Fn(&AbsoluteReading) -> bool| readings.iter().all(has);
    let is_pose = all(&|each| each.rotation.is_some());
    let rows = if is_pose { 6 } else { 3 };
    let has_precision = all(&|each| each.covariance.is_some());
    let is_diagonal =
        all(&|each| (each.covariance).is_none_or(|matrix| is_diagonal(&matrix, rows)));
    let has_load = readings.iter().any(|each| each.load != Load::NONE);
    let words: Vec<usize> = (0..WORDS.len())
        .filter(|&index| {
            let has = |each: &AbsoluteReading| word(each, index).is_some();
            all(&has) || (index == APPROACH && readings.iter().any(has))
        })
        .collect();
    let has_time = all(&|each| each.time_s.is_some());
    let has_temperature = all(&|each| each.temperature_c.is_some());

    let mut columns = commands.columns();
    let mut add = |is_there: bool, names: &[&str]| {
        if is_there {
            columns.extend(names.iter().map(|&name| name.to_owned()));
        }
    };
    add(has_load, &LOAD);
    let named: Vec<&str> = words.iter().map(|&index| WORDS[index]).collect();
    add(true, &named);
    add(true, &POSITION);
    add(is_pose, &QUATERNION);
    add(has_precision && is_diagonal, &DEFLECTION_SIGMA);
    add(has_precision && is_diagonal && is_pose, &ROTATION_SIGMA);
    let of_covariance = covariance_columns(rows);
    let of_covariance: Vec<&str> = of_covariance.iter().map(String::as_str).collect();
    add(has_precision && !is_diagonal, &of_covariance);
    add(has_time, &[TIME]);
    add(has_temperature, &[TEMPERATURE]);

    let mut text = columns.join(",") + "\n";
    for each in readings {
        let mut fields: Vec<String> = (commands.numbers(each.configuration_rad.as_slice()).iter())
            .map(ToString::to_string)
            .collect();
        let mut push = |values: &[f64]| fields.extend(values.iter().map(ToString::to_string));
        if has_load {
            push(each.load.wrench().as_slice());
        }
        let said = (words.iter()).map(|&index| word_field(&word(each, index).unwrap_or_default()));
        fields.extend(said);
        let mut push = |values: &[f64]| fields.extend(values.iter().map(ToString::to_string));
        push(each.position_m.map(thousandths).as_slice());
        if let (true, Some(rotation)) = (is_pose, &each.rotation) {
            let [x, y, z, w] = rotation.coords.into();
            push(&[w, x, y, z]);
        }
        if let (true, Some(covariance)) = (has_precision, &each.covariance) {
            push(&precision(covariance, rows, is_diagonal));
        }
        push(each.time_s.filter(|_| has_time).as_slice());
        push(each.temperature_c.filter(|_| has_temperature).as_slice());
        text += &fields.join(",");
        text.push('\n');
    }
    text
}

fn word(reading: &AbsoluteReading, index: usize) -> Option<String> {
    match index {
        0 => reading.target.clone(),
        1 => reading.visit.clone(),
        2 => reading.station.clone(),
        // APPROACH
        _ => reading.approach.as_ref().map(Approach::word),
    }
}

fn is_diagonal(covariance: &Matrix6<f64>, rows: usize) -> bool {
    (0..rows).all(|row| (0..row).all(|column| covariance[(row, column)] == 0.0))
}

/// The numbers of a covariance in the units of the file.
fn precision(covariance: &Matrix6<f64>, rows: usize, is_diagonal: bool) -> Vec<f64> {
    if is_diagonal {
        return (0..rows)
            .map(|row| thousandths(covariance[(row, row)].sqrt()))
            .collect();
    }
    let triangle = (0..rows).flat_map(|row| (row..rows).map(move |column| (row, column)));
    triangle.map(|place| covariance[place] * 1e6).collect()
}
