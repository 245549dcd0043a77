//! The rows of a foreign table as readings.

use nalgebra::{DVector, Matrix6, SymmetricEigen, Vector3};

use super::columns::{ReadingColumns, What};
use super::resolved::{ForeignNumber, Resolver, Word};
use crate::files::FileError;
use crate::measurement::{AbsoluteReading, Measurement, absolute_table, deflection_table};
use crate::quantities::plausible::{self, Kind};
use crate::robot::{Approach, Load};
use crate::text::wrong_name;

/// Correlations whose smallest eigenvalue is less than this leave some rotation without any error.
const LEAST_EIGENVALUE: f64 = 1e-9;

impl ReadingColumns {
    /// The measurement file of these rows.
    pub fn text(
        &self,
        resolver: &Resolver<'_>,
        rows: &[&(usize, Vec<String>)],
    ) -> Result<String, FileError> {
        match &self.place {
            What::Deflection { values, deviations } => {
                let measurement = |row: &&(usize, Vec<String>)| {
                    let (configuration_rad, load) = self.setup(resolver, row)?;
                    Ok(Measurement {
                        configuration_rad,
                        load,
                        deflection_m: position(resolver, row, "deflection", values)?,
                        sigma_m: deviations_in(
                            resolver,
                            row,
                            deviations.as_deref(),
                            (1e3, &plausible::DEVIATION),
                        )?,
                        rotation: None,
                        approach: None,
                    })
                };
                let all = rows
                    .iter()
                    .map(measurement)
                    .collect::<Result<Vec<_>, FileError>>()?;
                deflection_table(resolver.table_path, &self.commands, &all)
            }
            What::Absolute { .. } => {
                let all = (rows.iter())
                    .map(|row| self.reading(resolver, row))
                    .collect::<Result<Vec<_>, _>>()?;
                Ok(absolute_table(&self.commands, &all))
            }
        }
    }

    /// The joint angles and the load of a row.
    fn setup(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
    ) -> Result<(DVector<f64>, Load), FileError> {
        let mut angles = Vec::new();
        for (index, (number, slides)) in self.joints.iter().enumerate() {
            let value = number.of(resolver, row)?;
            let shown = if *slides {
                value * 1e3
            } else {
                value.to_degrees()
            };
            let kind = if *slides {
                &plausible::POSITION
            } else {
                &plausible::ANGLE
            };
            check(resolver, row, &format!("joint[{index}]"), kind, shown)?;
            angles.push(value);
        }
        let mut wrench = [0.0; 6];
        for (numbers, start) in [(&self.force, 0), (&self.torque, 3)] {
            for (index, number) in numbers.iter().flatten().enumerate() {
                let kind = if start == 0 {
                    &plausible::FORCE
                } else {
                    &plausible::TORQUE
                };
                let value = number.of(resolver, row)?;
                wrench[start + index] = check(resolver, row, "load", kind, value)?;
            }
        }
        if let Some(weight) = &self.weight {
            wrench[2] = -check(
                resolver,
                row,
                "weight",
                &plausible::FORCE,
                weight.of(resolver, row)?,
            )?;
            // No weight is no minus zero.
            wrench[2] += 0.0;
        }
        Ok((DVector::from_vec(angles), Load::from_wrench(wrench)))
    }

    fn reading(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
    ) -> Result<AbsoluteReading, FileError> {
        let What::Absolute {
            position: places,
            rotation,
            deviations,
            rotation_deviations,
        } = &self.place
        else {
            return Err(wrong_row(resolver, row, "is a deflection"));
        };
        let (configuration_rad, load) = self.setup(resolver, row)?;
        let sigma = deviations_in(
            resolver,
            row,
            deviations.as_deref(),
            (1e3, &plausible::DEVIATION),
        )?;
        let turned = deviations_in(
            resolver,
            row,
            rotation_deviations.as_deref(),
            (1e3, &plausible::ROTATION_DEVIATION),
        )?;
        let mut covariance = sigma.map(|sigma| {
            let mut all = Matrix6::identity();
            for (index, sigma) in sigma.iter().enumerate() {
                all[(index, index)] = sigma * sigma;
            }
            all
        });
        let mut orientation = None;
        if let Some((convention, numbers)) = rotation {
            let values = (numbers.iter())
                .map(|number| number.of(resolver, row))
                .collect::<Result<Vec<f64>, _>>()?;
            let wrong = |problem: String| wrong_row(resolver, row, format!("rotation: {problem}"));
            orientation = Some(convention.rotation(&values).map_err(wrong)?);
            if let (Some(all), Some(sigma)) = (&mut covariance, turned) {
                let own = convention.covariance(&values, &sigma).map_err(wrong)?;
                let size = own.diagonal().map(f64::sqrt);
                let relative = own.component_div(&(size * size.transpose()));
                if SymmetricEigen::new(relative).eigenvalues.min().is_nan()
                    || SymmetricEigen::new(relative).eigenvalues.min() < LEAST_EIGENVALUE
                {
                    let problem = "the Euler angles are at their lock, where their standard deviations leave a rotation out";
                    return Err(
                        wrong(problem.to_owned()).hint("leave the line out with skip_lines")
                    );
                }
                all.fixed_view_mut::<3, 3>(3, 3).copy_from(&own);
            }
        }
        let [target, state, station, approach] = &self.words;
        let name = |key: &str, word: &Option<Word>| {
            let Some(word) = word.as_ref().map(|word| word.of(&row.1)) else {
                return Ok(None);
            };
            match wrong_name(word) {
                Some(problem) => Err(wrong_row(resolver, row, format!("{key}: {problem}"))),
                None => Ok(Some(word.to_owned())),
            }
        };
        let number = |number: &Option<ForeignNumber>| {
            number
                .as_ref()
                .map(|number| number.of(resolver, row))
                .transpose()
        };
        let temperature_c = number(&self.temperature)?;
        if let Some(value) = temperature_c {
            check(resolver, row, "temperature", &plausible::TEMPERATURE, value)?;
        }
        Ok(AbsoluteReading {
            configuration_rad,
            load,
            target: name("target", target)?,
            station: name("station", station)?,
            state: name("state", state)?,
            position_m: position(resolver, row, "position", places)?,
            rotation: orientation,
            covariance,
            approach: self.side(resolver, row, approach.as_ref())?,
            time_s: number(&self.time)?,
            temperature_c,
        })
    }

    fn side(
        &self,
        resolver: &Resolver<'_>,
        row: &(usize, Vec<String>),
        word: Option<&Word>,
    ) -> Result<Option<Approach>, FileError> {
        let Some(word) = word
            .map(|word| word.of(&row.1))
            .filter(|word| !word.is_empty())
        else {
            return Ok(None);
        };
        Approach::of_word(word, self.joints.len())
            .map(Some)
            .ok_or_else(|| {
                let problem = format!(
                    "approach: found {word:?}; + or -, or a sign for each joint, is allowed"
                );
                wrong_row(resolver, row, problem)
            })
    }
}

/// Three standard deviations of a row, where there are some.
fn deviations_in(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    numbers: Option<&[ForeignNumber]>,
    (scale, kind): (f64, &Kind),
) -> Result<Option<Vector3<f64>>, FileError> {
    let Some(numbers) = numbers else {
        return Ok(None);
    };
    let mut all = Vector3::zeros();
    for (own, number) in all.iter_mut().zip(numbers) {
        *own = number.of(resolver, row)?;
        check(resolver, row, "a standard deviation", kind, *own * scale)?;
    }
    Ok(Some(all))
}

fn wrong_row(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    problem: impl Into<String>,
) -> FileError {
    FileError::new(resolver.table_path, problem).at(format!("line {}", row.0))
}

fn check(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    what: &str,
    kind: &Kind,
    value: f64,
) -> Result<f64, FileError> {
    kind.check(value).map_err(|problem| {
        wrong_row(resolver, row, format!("{what}: {problem}"))
            .hint("is the unit in the mapping the right one?")
    })
}

fn position(
    resolver: &Resolver<'_>,
    row: &(usize, Vec<String>),
    what: &str,
    numbers: &[ForeignNumber],
) -> Result<Vector3<f64>, FileError> {
    let mut all = Vector3::zeros();
    for (own, number) in all.iter_mut().zip(numbers) {
        *own = number.of(resolver, row)?;
        check(resolver, row, what, &plausible::POSITION, *own * 1e3)?;
    }
    Ok(all)
}
