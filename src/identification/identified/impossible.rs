//! Nominal compliances in place of identified ones that no joint has.

use nalgebra::{DMatrix, DVector};

use crate::codes::{Condition, ConditionCode};
use crate::quantities::plausible::ELASTIC_COMPLIANCE;

/// What others leave of a variance below this share is rounding.
const ROUNDING: f64 = 1e-12;

/// Takes the nominal compliance for identified ones that no joint has, and all else as it goes with that: what was done, and by how much all
/// moved. What errs about the values that are taken has this shift, squared, beside the covariance. Of a compliance its place tells the
/// nominal value, its joint's name and its unit.
pub fn hold_impossible<'a>(
    values: &mut [f64],
    covariance: &DMatrix<f64>,
    compliance: impl Fn(usize) -> Option<(f64, &'a str, &'a str)>,
) -> (Vec<Condition>, DVector<f64>) {
    let found = DVector::from_column_slice(values);
    let mut given = covariance.clone();
    let (mut held, mut done): (Vec<(usize, f64)>, Vec<Condition>) = (Vec::new(), Vec::new());
    // One that moves along may become impossible in its turn.
    while let Some((place, (nominal, joint, unit))) = (0..values.len())
        .filter(|place| held.iter().all(|each| each.0 != *place))
        .filter(|&place| !ELASTIC_COMPLIANCE.allows(values[place]))
        .find_map(|place| Some((place, compliance(place)?)))
    {
        held.push((place, nominal));
        done.push(ConditionCode::ImpossibleCompliance.with(format!(
            "the identified compliance of {joint} is {:.3e} {unit}, which no joint has: replaced by the nominal value, the \
             other parameters conditioned on it",
            values[place]
        )));
        let (off, own) = (nominal - values[place], given[(place, place)]);
        if own > ROUNDING * covariance[(place, place)] {
            let column = given.column(place).into_owned();
            for (value, with) in values.iter_mut().zip(&column) {
                *value += with * (off / own);
            }
            given.ger(-own.recip(), &column, &column, 1.0);
        }
    }
    for (place, nominal) in held {
        values[place] = nominal;
    }
    let shift = DVector::from_column_slice(values) - found;
    (done, shift)
}
