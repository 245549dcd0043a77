//! Files of absolute readings.

use std::collections::BTreeMap;
use std::iter;

use nalgebra::{DMatrix, Matrix6, SymmetricEigen, Vector3};

use super::AbsoluteReading;
use super::columns::{
    DEFLECTION_SIGMA, DISPLACEMENT_SIGMA, POSITION, QUATERNION, ROTATION_SIGMA, TEMPERATURE, TIME,
    WORDS, covariance_column, covariance_columns, deviations, rotation_of, triangle,
};
use crate::csv::{Columns, Row, Table, owned};
use crate::experiment::{LOAD, approach, configuration, load};
use crate::files::FileError;
use crate::observation::{LengthKind, ReadLength};
use crate::quantities::plausible::{DEVIATION, ROTATION_DEVIATION, shown};
use crate::robot::{Commands, Load};
use crate::task::{Station, wrong_station};

/// Rounding in what wrote a covariance may leave it so far from positive definite, as a share of the variances.
const LEAST_EIGENVALUE: f64 = 1e-9;

/// What is read absolutely: a position, or a length of a kind.
fn kinds() -> impl Iterator<Item = Option<LengthKind>> {
    iter::once(None).chain(LengthKind::ALL.map(Some))
}

/// The columns that each kind of absolute readings has.
pub(super) fn absolute_reads() -> Vec<Vec<&'static str>> {
    let read = |kind: Option<LengthKind>| {
        kind.map_or_else(|| POSITION.to_vec(), |kind| vec![kind.column()])
    };
    kinds().map(read).collect()
}

/// The columns that it may have in a file: of positions and poses, or of lengths of a kind.
fn columns_of(kind: Option<LengthKind>) -> Vec<String> {
    let Some(kind) = kind else {
        let of_positions = [
            &POSITION[..],
            &QUATERNION,
            &DEFLECTION_SIGMA,
            &ROTATION_SIGMA,
        ]
        .concat();
        return [owned(&of_positions), covariance_columns(6)].concat();
    };
    owned(&[kind.column(), DISPLACEMENT_SIGMA])
}

/// The columns that a file of absolute readings with such a header may have: of positions, of lengths, or of both, where each row
/// leaves the others' empty.
pub(super) fn absolute_columns(
    commands: &Commands,
    header: &[String],
    may_be_unfinished: bool,
) -> Columns {
    let numbers = [&LOAD[..], &[TIME, TEMPERATURE]].concat();
    let mut columns = Columns::of(commands.columns(), &numbers, &WORDS);
    let read = absolute_reads().into_iter().map(|read| owned(&read));
    let has = |read: &[String]| read.iter().any(|column| header.contains(column));
    let found: Vec<_> = read.zip(kinds()).filter(|(read, _)| has(read)).collect();
    let mut to_fill_in = Vec::new();
    for (read, kind) in &found {
        let mut all = columns_of(*kind);
        all.retain(|column| !columns.optional.contains(column));
        columns.required.extend_from_slice(read);
        to_fill_in.extend_from_slice(read);
        if found.len() > 1 {
            columns.blank.extend_from_slice(&all);
        }
        columns.optional.extend(all);
    }
    if may_be_unfinished {
        columns.may_be_empty = vec![to_fill_in];
    }
    columns
}

/// The readings of a table with these columns.
pub(super) fn absolute_readings(
    table: &Table<'_>,
    commands: &Commands,
    stations: &[Station],
) -> Result<Vec<AbsoluteReading>, FileError> {
    let given = AbsoluteGroups::new(table)?;
    let says_stations = table.has(&[WORDS[2]]);
    let mut readings = Vec::new();
    let mut visits: BTreeMap<String, (usize, Vec<u64>)> = BTreeMap::new();
    for row in table.rows() {
        let reading = given.reading(&row, commands)?;
        let wrong = wrong_station(stations, reading.station.as_deref());
        if let Some([problem, hint]) = wrong.filter(|_| says_stations) {
            return Err(row.wrong(problem).hint(hint));
        }
        if let Some(visit) = &reading.visit {
            let bits: Vec<u64> = (reading.configuration_rad.iter())
                .map(|q| q.to_bits())
                .collect();
            let (line, known) = (visits.entry(visit.clone())).or_insert((row.line(), bits.clone()));
            if *known != bits {
                let problem = format!(
                    "visit: found {visit:?} at other joint angles than in line {line}; the readings of one visit are at the same commanded angles"
                );
                return Err(row.wrong(problem));
            }
        }
        readings.push(reading);
    }
    Ok(readings)
}

/// Which groups of columns a file has.
struct AbsoluteGroups {
    has_load: bool,
    is_pose: bool,
    has_covariance: bool,
    /// The columns that each kind has.
    of_kinds: Vec<(Option<LengthKind>, Vec<String>)>,
}

impl AbsoluteGroups {
    fn new(table: &Table<'_>) -> Result<Self, FileError> {
        let is_pose = table.has_group(&QUATERNION)?;
        let all_covariances = covariance_columns(6);
        let all_covariances: Vec<&str> = all_covariances.iter().map(String::as_str).collect();
        let of_rotation = |column: &&str| column.contains('r');
        let lost = [&ROTATION_SIGMA[..], &all_covariances].concat();
        let mut lost = lost.into_iter().filter(of_rotation);
        if let Some(found) = lost.find(|column| !is_pose && table.has(&[column])) {
            let problem = format!("found {found:?} without {:?}", QUATERNION[0]);
            return Err(table.wrong_header(problem));
        }
        let sigma = [DEFLECTION_SIGMA, ROTATION_SIGMA].concat();
        let has_deviations = table.has_group(&sigma[..if is_pose { 6 } else { 3 }])?;
        let covariance = all_covariances.iter().find(|column| table.has(&[column]));
        if let Some(found) = covariance.filter(|_| has_deviations) {
            let problem = format!(
                "found {:?} and {found:?}: standard deviations or a covariance are allowed",
                DEFLECTION_SIGMA[0]
            );
            return Err(table.wrong_header(problem));
        }
        let has_covariance = covariance.is_some();
        if has_covariance {
            let is_asked = |column: &&str| is_pose || !of_rotation(column);
            let asked: Vec<&str> = all_covariances.into_iter().filter(is_asked).collect();
            table.has_group(&asked)?;
        }
        let of_kinds = kinds().map(|kind| {
            let mut columns = columns_of(kind);
            columns.retain(|column| table.has(&[column]));
            (kind, columns)
        });
        Ok(Self {
            has_load: table.has_group(&LOAD)?,
            is_pose,
            has_covariance,
            of_kinds: of_kinds.collect(),
        })
    }

    /// The kind of lengths that a row is of, where it is no position; where a file has several, the columns of the others are empty.
    fn kind(&self, row: &Row<'_>) -> Result<Option<LengthKind>, FileError> {
        let mut lengths = LengthKind::ALL.into_iter();
        let kind = lengths.find(|kind| !row.get(kind.column()).is_nan());
        let name = kind.map_or("position", LengthKind::name);
        let is_empty = |column: &&String| row.get(column).is_nan();
        let columns = |is_own: bool| {
            let some = (self.of_kinds.iter()).filter(move |each| (each.0 == kind) == is_own);
            some.flat_map(|(_, columns)| columns)
        };
        let own: Vec<&String> = columns(true).collect();
        if let Some(column) = own.iter().find(|column| is_empty(column)) {
            return Err(row.wrong(format!("{column}: is empty, and the row is of a {name}")));
        }
        let mut others = columns(false).filter(|column| !own.contains(column));
        if let Some(column) = others.find(|column| !is_empty(column)) {
            let problem = format!(
                "{column}: found {} beside {}; a row is of a position or of one length",
                shown(row.get(column)),
                own[0]
            );
            return Err(row.wrong(problem));
        }
        Ok(kind)
    }

    fn reading(&self, row: &Row<'_>, commands: &Commands) -> Result<AbsoluteReading, FileError> {
        let [target, visit, station, _] = WORDS;
        let kind = self.kind(row)?;
        let is_pose = self.is_pose && kind.is_none();
        let number = |column: &str| Some(row.get(column)).filter(|value| !value.is_nan());
        Ok(AbsoluteReading {
            configuration_rad: configuration(row, commands),
            load: if self.has_load {
                load(row)?
            } else {
                Load::NONE
            },
            target: row.name(target)?,
            station: row.name(station)?,
            visit: row.name(visit)?,
            position_m: match kind {
                Some(_) => Vector3::zeros(),
                None => row.vector(POSITION) * 1e-3,
            },
            rotation: is_pose.then(|| rotation_of(row)).transpose()?,
            length: kind.map(|kind| length(row, kind)).transpose()?,
            covariance: self.covariance(row, kind)?,
            approach: approach(row, commands)?,
            time_s: number(TIME),
            temperature_c: number(TEMPERATURE),
        })
    }

    fn covariance(
        &self,
        row: &Row<'_>,
        kind: Option<LengthKind>,
    ) -> Result<Option<Matrix6<f64>>, FileError> {
        let mut covariance = Matrix6::identity();
        let is_pose = self.is_pose && kind.is_none();
        let own = kind.map_or(DEFLECTION_SIGMA, |_| [DISPLACEMENT_SIGMA; 3]);
        if !row.get(own[0]).is_nan() {
            let position = deviations(row, own, &DEVIATION)?;
            let rotation = is_pose
                .then(|| deviations(row, ROTATION_SIGMA, &ROTATION_DEVIATION))
                .transpose()?;
            let rotation = rotation.iter().flat_map(|vector| vector.iter());
            for (index, sigma) in position.iter().chain(rotation).enumerate() {
                covariance[(index, index)] = sigma * sigma;
            }
        } else if self.has_covariance && kind.is_none() {
            for (one, other) in triangle(if is_pose { 6 } else { 3 }) {
                let value = row.get(&covariance_column(one, other)) * 1e-6;
                covariance[(one, other)] = value;
                covariance[(other, one)] = value;
            }
            definite(&covariance).map_err(|problem| row.wrong(problem))?;
        } else {
            return Ok(None);
        }
        Ok(Some(covariance))
    }
}

/// A length of a kind.
fn length(row: &Row<'_>, kind: LengthKind) -> Result<ReadLength, FileError> {
    let column = kind.column();
    let found = row.get(column);
    if kind.is_positive() && found <= 0.0 {
        let problem = format!(
            "{column}: found {}; a positive number is allowed",
            shown(found)
        );
        return Err(row.wrong(problem));
    }
    Ok(ReadLength {
        kind,
        length_m: found * 1e-3,
    })
}

/// Whether a matrix with units of m and rad is the covariance of a reading, whose deviations are plausible.
pub(super) fn definite(covariance: &Matrix6<f64>) -> Result<(), String> {
    let deviation = covariance.diagonal().map(f64::sqrt);
    let is_wrong = |row: &usize| !DEVIATION.allows(deviation[*row] * 1e3);
    if let Some(row) = (0..6).find(is_wrong) {
        let found = shown(covariance[(row, row)] * 1e6);
        return Err(format!(
            "{}: found {found}; a variance is allowed, a positive number from 1e-18 to 1e8",
            covariance_column(row, row)
        ));
    }
    let relative = DMatrix::from_fn(6, 6, |row, column| {
        covariance[(row, column)] / (deviation[row] * deviation[column])
    });
    let least = SymmetricEigen::new(relative).eigenvalues.min();
    if least < LEAST_EIGENVALUE {
        return Err(format!(
            "the covariance is not positive definite: the smallest eigenvalue of its correlations is {least:.1e}"
        ));
    }
    Ok(())
}
