//! Measurement files: CSV that a laboratory writes by hand or by script.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;

use super::columns::{
    DEFLECTION, DEFLECTION_SIGMA, DISPLACEMENT, DISPLACEMENT_SIGMA, LOADED, LOADED_SIGMA, PLACES,
    POSITION, ROTATION, ROTATION_SIGMA, UNLOADED, UNLOADED_SIGMA, deviations,
};
use super::read_absolute::{absolute_columns, absolute_readings, absolute_reads};
use super::{AbsoluteReading, Measurement, RotationMeasurement, by_configuration};
use crate::codes::ErrorCode;
use crate::csv::{Columns, Row, Table, owned};
use crate::experiment::{
    APPROACH, DIRECTION, approach, configuration, direction, experiment_columns, load,
    reading_columns,
};
use crate::files::FileError;
use crate::parameter::Unloaded;
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION};
use crate::robot::{Commands, ReadsAlong};
use crate::task::{AccuracyKind, Belief, Station, Task};

/// Reads measurements of an arm, which may be given by its number of joints: deflections, or the positions without and
/// with the load of which they are the differences.
///
/// # Errors
/// See [`Table::read_with`]; a standard deviation must be positive, the columns of a group
/// (`sx_mm,sy_mm,sz_mm`; `rx_mrad,ry_mrad,rz_mrad,srx_mrad,sry_mrad,srz_mrad`) come together, and no two rows have
/// the same reading without a load, or all of one configuration have, as deflections rest on one of their own or on one that they
/// share.
pub fn read_measurements(
    path: &Path,
    of: impl Into<MeasuredArm>,
) -> Result<Vec<Measurement>, FileError> {
    read(path, &of.into(), false)?.deflections(path)
}

/// What measurement files are taken of.
#[derive(Debug, Clone)]
pub struct MeasuredArm {
    /// How the arm is commanded.
    pub commands: Commands,
    /// Which reading without the load deflections rest on.
    pub unloaded: Unloaded,
    /// The standard deviation (m) of what a gauge shows beside an instrument that reads all coordinates.
    pub beside_m: Option<f64>,
    /// What absolute readings of it have, where these are what is measured.
    pub absolute: Option<Vec<String>>,
    /// The stations that they are from; any where there are none.
    pub stations: Vec<Station>,
}

impl From<Commands> for MeasuredArm {
    fn from(commands: Commands) -> Self {
        Self {
            commands,
            unloaded: Unloaded::Own,
            beside_m: None,
            absolute: None,
            stations: Vec::new(),
        }
    }
}

impl From<usize> for MeasuredArm {
    fn from(joints: usize) -> Self {
        Commands::from(joints).into()
    }
}

impl From<&Belief> for MeasuredArm {
    fn from(belief: &Belief) -> Self {
        Self {
            unloaded: belief.instrument.unloaded,
            beside_m: (belief.instrument.gauge).and_then(|gauge| gauge.beside_m),
            ..belief.commands().into()
        }
    }
}

impl From<&Task> for MeasuredArm {
    fn from(task: &Task) -> Self {
        let length = task.belief.instrument.length_alone();
        let read = length.map_or_else(|| owned(&POSITION), |kind| owned(&[kind.column()]));
        Self {
            absolute: (task.design.accuracy == AccuracyKind::Absolute).then_some(read),
            stations: task.belief.stations.clone(),
            ..Self::from(&task.belief)
        }
    }
}

/// What a measurement file holds.
#[derive(Debug, Clone, PartialEq)]
pub enum MeasuredFile {
    /// Deflections, loaded minus unloaded.
    Deflections(Vec<Measurement>),
    /// Where the instrument saw its targets.
    Absolute(Vec<AbsoluteReading>),
}

/// Reads a measurement file of either kind: what its header has decides.
///
/// # Errors
/// As [`read_measurements`]; of absolute readings a quaternion must be of length 1, a covariance positive definite,
/// stations some of those that there are, and rows of one visit at the same angles.
pub fn read_measured(path: &Path, of: impl Into<MeasuredArm>) -> Result<MeasuredFile, FileError> {
    read(path, &of.into(), false)
}

impl MeasuredFile {
    /// The absolute readings of a file for a command that takes no others, with the reason, in words that follow what it holds.
    ///
    /// # Errors
    /// It holds deflections.
    pub fn absolute(self, path: &Path, why: &str) -> Result<Vec<AbsoluteReading>, FileError> {
        match self {
            Self::Absolute(readings) => Ok(readings),
            Self::Deflections(_) => Err(FileError::new(path, format!("holds deflections{why}"))
                .code(ErrorCode::OtherAccuracy)
                .hint("give a file of absolute readings")),
        }
    }

    /// The deflections of a file for a command that takes no others.
    ///
    /// # Errors
    /// It holds absolute readings.
    pub fn deflections(self, path: &Path) -> Result<Vec<Measurement>, FileError> {
        match self {
            Self::Deflections(measurements) => Ok(measurements),
            Self::Absolute(_) => {
                let problem = format!(
                    "holds absolute readings ({}); deflections are needed here, loaded minus unloaded",
                    POSITION.join(",")
                );
                let hint = "plans and their predicted accuracies are of deflections: `identify`, `validate` and `compensate` take \
                            absolute readings";
                Err(FileError::new(path, problem)
                    .hint(hint)
                    .code(ErrorCode::OtherAccuracy))
            }
        }
    }
}

/// The same of a table that is not filled in to its end yet: rows without a reading are left out.
///
/// # Errors
/// As [`read_measured`]; and no row is filled in.
pub fn read_measured_so_far(
    path: &Path,
    of: impl Into<MeasuredArm>,
) -> Result<MeasuredFile, FileError> {
    read(path, &of.into(), true)
}

fn read(path: &Path, of: &MeasuredArm, may_be_unfinished: bool) -> Result<MeasuredFile, FileError> {
    let commands = &of.commands;
    let reads_along = commands.reads_along;
    let table = Table::read_as(path, |header| {
        let has = |column: &str| header.iter().any(|known| known == column);
        let reads_all = DEFLECTION.into_iter().chain(UNLOADED).any(has);
        if reads_along == ReadsAlong::Always
            || reads_along == ReadsAlong::Sometimes && has(DISPLACEMENT) && !reads_all
        {
            displacement_columns(commands, may_be_unfinished)
        } else if absolute_reads().iter().flatten().any(|each| has(each)) {
            absolute_columns(commands, header, may_be_unfinished)
        } else if let Some(read) = of.absolute.as_ref().filter(|_| !reads_all) {
            absolute_columns(commands, read, may_be_unfinished)
        } else {
            deflection_columns(commands, may_be_unfinished)
        }
    })?;
    let found = if absolute_reads().iter().any(|read| table.has(read)) {
        absolute_readings(&table, commands, &of.stations).map(MeasuredFile::Absolute)
    } else {
        deflections(&table, of).map(MeasuredFile::Deflections)
    };
    found.map_err(|wrong| wrong.or_code(ErrorCode::Measurements))
}

/// The columns that a file of deflections may have.
fn deflection_columns(commands: &Commands, may_be_unfinished: bool) -> Columns {
    let optional = [
        &DEFLECTION_SIGMA[..],
        &UNLOADED_SIGMA,
        &LOADED_SIGMA,
        &ROTATION,
        &ROTATION_SIGMA,
        &PLACES,
    ];
    let optional = optional.concat();
    let mut columns = Columns::of(reading_columns(commands), &optional, &[APPROACH]);
    if commands.reads_along == ReadsAlong::Sometimes {
        // What the one instrument reads the other leaves empty.
        columns.required = experiment_columns(commands);
        let of_gauge = [&DIRECTION[..], &[DISPLACEMENT, DISPLACEMENT_SIGMA]].concat();
        columns.optional.extend(owned(&of_gauge));
        let of_positions = [&DEFLECTION[..], &UNLOADED, &LOADED].concat();
        columns.blank = owned(&[&optional[..], &of_gauge, &of_positions].concat());
    }
    columns.one_of = vec![owned(&DEFLECTION), owned(&[UNLOADED, LOADED].concat())];
    if may_be_unfinished {
        // A sheet is filled in stop by stop, unloaded readings of many before the first loaded one.
        columns.may_be_empty = match commands.reads_along {
            ReadsAlong::Sometimes => {
                let all = [&DEFLECTION[..], &UNLOADED, &LOADED, &[DISPLACEMENT]];
                vec![owned(&all.concat())]
            }
            _ => [DEFLECTION, UNLOADED, LOADED]
                .map(|group| owned(&group))
                .into(),
        };
    }
    columns
}

/// The columns that a gauge's file may have.
fn displacement_columns(commands: &Commands, may_be_unfinished: bool) -> Columns {
    let mut required = reading_columns(commands);
    required.push(DISPLACEMENT.to_owned());
    let mut columns = Columns::of(required, &[DISPLACEMENT_SIGMA], &[APPROACH]);
    if may_be_unfinished {
        columns.may_be_empty = vec![owned(&[DISPLACEMENT])];
    }
    columns
}

/// Deflections, and what a gauge reads of them.
fn deflections(table: &Table<'_>, of: &MeasuredArm) -> Result<Vec<Measurement>, FileError> {
    let commands = &of.commands;
    let columns = Given::new(table)?;
    let mut measurements = Vec::new();
    for row in table.rows() {
        let direction = direction(&row, commands)?;
        let (deflection_m, sigma_m, rotation) = match &direction {
            Some(direction) => {
                let along = displacement_m(&row)?;
                let sigma_m = along_sigma_m(&row)?;
                let beside_m = of.beside_m.map(Vector3::repeat);
                (direction * along, sigma_m.or(beside_m), None)
            }
            None => (
                columns.deflection_m(&row)?,
                columns.sigma_m(&row)?,
                columns.rotation(&row)?,
            ),
        };
        measurements.push(Measurement {
            configuration_rad: configuration(&row, commands),
            load: load(&row)?,
            deflection_m,
            sigma_m,
            rotation,
            approach: approach(&row, commands)?,
            direction,
        });
    }
    if columns.has_positions {
        check_unloaded(table, &columns, &measurements, of.unloaded)?;
    }
    Ok(measurements)
}

/// Which groups of columns a file has.
struct Given {
    has_positions: bool,
    /// The columns of its own standard deviations: of the deflection, or of its two positions.
    deviations: Vec<[&'static str; 3]>,
    has_rotation: bool,
    has_places: bool,
}

impl Given {
    fn new(table: &Table<'_>) -> Result<Self, FileError> {
        let of_deflection = table.has_group(&DEFLECTION_SIGMA)?;
        let of_positions = table.has_group(&[UNLOADED_SIGMA, LOADED_SIGMA].concat())?;
        let (has_positions, has_places) = (table.has(&UNLOADED), table.has_group(&PLACES)?);
        let wrong = |problem: String| Err(table.wrong_header(problem));
        if of_deflection && of_positions {
            let (one, other) = (DEFLECTION_SIGMA[0], UNLOADED_SIGMA[0]);
            return wrong(format!(
                "found {one:?} and {other:?}: the deviations of the deflection or of the positions are allowed"
            ));
        }
        for (has, column) in [(of_positions, UNLOADED_SIGMA[0]), (has_places, PLACES[0])] {
            if has && !has_positions {
                return wrong(format!("found {column:?} without {:?}", UNLOADED[0]));
            }
        }
        Ok(Self {
            has_positions,
            deviations: match (of_deflection, of_positions) {
                (true, _) => vec![DEFLECTION_SIGMA],
                (_, true) => vec![UNLOADED_SIGMA, LOADED_SIGMA],
                _ => Vec::new(),
            },
            has_rotation: table.has_group(&[ROTATION, ROTATION_SIGMA].concat())?,
            has_places,
        })
    }

    /// What tells the reading without a load from others, and in words: its number, or else its configuration and what it shows.
    fn unloaded(&self, row: &Row<'_>, measurement: &Measurement) -> (Vec<u64>, String) {
        let bits = |value: &f64| value.to_bits();
        if self.has_places {
            let place = [PLACES[0], PLACES[1]].map(|column| row.get(column));
            let words = format!("reading {} at stop {}", place[1], place[0]);
            return (place.iter().map(bits).collect(), words);
        }
        let q = measurement.configuration_rad.iter().map(bits);
        let shown = row.vector(UNLOADED);
        let words = format!("{}, {}, {}", shown.x, shown.y, shown.z);
        (q.chain(shown.iter().map(bits)).collect(), words)
    }

    fn deflection_m(&self, row: &Row<'_>) -> Result<Vector3<f64>, FileError> {
        let deflection = if self.has_positions {
            row.vector(LOADED) - row.vector(UNLOADED)
        } else {
            row.vector(DEFLECTION)
        };
        if !row.get(DISPLACEMENT).is_nan() || deflection.iter().any(|each| each.is_nan()) {
            let problem = format!(
                "a row without a direction ({}) is not a gauge's: its whole deflection is needed, and no {DISPLACEMENT}",
                DIRECTION.join(",")
            );
            return Err(row.wrong(problem));
        }
        Ok(deflection * 1e-3)
    }

    /// The standard deviation of the deflection, whose variance is the sum of those of its two positions.
    fn sigma_m(&self, row: &Row<'_>) -> Result<Option<Vector3<f64>>, FileError> {
        let mut sum: Option<Vector3<f64>> = None;
        for &columns in &self.deviations {
            let own = deviations(row, columns, &DEVIATION)?;
            sum = Some(sum.map_or(own, |sum| sum.zip_map(&own, f64::hypot)));
        }
        Ok(sum)
    }

    fn rotation(&self, row: &Row<'_>) -> Result<Option<RotationMeasurement>, FileError> {
        if !self.has_rotation {
            return Ok(None);
        }
        Ok(Some(RotationMeasurement {
            vector_rad: row.vector(ROTATION) * 1e-3,
            sigma_rad: deviations(row, ROTATION_SIGMA, &ROTATION_DEVIATION)?,
        }))
    }
}

/// The standard deviation of what a gauge shows, where the row brings one.
fn along_sigma_m(row: &Row<'_>) -> Result<Option<Vector3<f64>>, FileError> {
    let is_given = !row.get(DISPLACEMENT_SIGMA).is_nan();
    let sigma = is_given.then(|| deviations(row, [DISPLACEMENT_SIGMA; 3], &DEVIATION));
    sigma.transpose()
}

/// What a gauge shows, where it reads a row: the instrument beside it has read nothing then.
fn displacement_m(row: &Row<'_>) -> Result<f64, FileError> {
    let along = row.get(DISPLACEMENT);
    let others = [DEFLECTION, UNLOADED, LOADED].map(|columns| row.vector(columns));
    if along.is_nan()
        || others
            .iter()
            .any(|each| each.iter().any(|value| !value.is_nan()))
    {
        let problem = format!(
            "a row with a direction ({}) is a gauge's: {DISPLACEMENT} is needed, and no position or deflection",
            DIRECTION.join(",")
        );
        return Err(row.wrong(problem));
    }
    Ok(along * 1e-3)
}

/// Deflections rest on readings without a load as all that uses them takes for granted: each on one of its own, for else they would
/// share its error; or where these are shared, all of one configuration on one, and no two configurations on the same.
fn check_unloaded(
    table: &Table<'_>,
    columns: &Given,
    measurements: &[Measurement],
    unloaded: Unloaded,
) -> Result<(), FileError> {
    let rows: Vec<Row<'_>> = table.rows().collect();
    let read: Vec<(Vec<u64>, String)> = (rows.iter().zip(measurements))
        .map(|(row, measurement)| columns.unloaded(row, measurement))
        .collect();
    let alone = || (0..rows.len()).map(|row| vec![row]).collect();
    let together = match unloaded {
        Unloaded::Own => alone(),
        Unloaded::Shared => by_configuration(measurements),
    };
    let mut known: BTreeMap<&[u64], usize> = BTreeMap::new();
    for members in together {
        let first = members[0];
        // What a gauge reads rests on no reading without a load.
        if measurements[first].direction.is_some() {
            continue;
        }
        let (reading, words) = &read[first];
        if let Some(&other) = members.iter().find(|&&each| read[each].0 != *reading) {
            let problem = format!(
                "the reading without a load ({}) is not that of line {} ({words}), and with instrument.unloaded = \"shared\" all \
                 deflections of one configuration rest on one",
                read[other].1,
                rows[first].line(),
            );
            let hint = "say instrument.unloaded = \"own\" in the scenario where each row has one of its own";
            return Err(rows[other].wrong(problem).hint(hint));
        }
        let Some(same) = known.insert(reading, first) else {
            continue;
        };
        let line = rows[same].line();
        let why = match unloaded {
            Unloaded::Shared => "which is of another configuration",
            Unloaded::Own => "and deflections that share its error are taken for independent",
        };
        let problem =
            format!("the reading without a load ({words}) is that of line {line}, too, {why}");
        let mut hint = "read the instrument without a load for each row; or once in each configuration, and say \
                        instrument.unloaded = \"shared\" in the scenario"
            .to_owned();
        if !columns.has_places {
            hint += "; different readings of equal values need the columns \
                     unloaded_stop,unloaded_reading,loaded_stop,loaded_reading";
        }
        return Err(rows[first].wrong(problem).hint(hint));
    }
    Ok(())
}
