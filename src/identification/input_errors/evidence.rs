//! How probable the numbers of a file are, read in one way or another.

use std::iter::successors;

use nalgebra::{DMatrix, DVector, Vector3};

use super::super::discrepancy::three_rows;
use super::super::{Case, Sigma};
use crate::measurement::Measurement;

/// The standard deviation of a compliance about its nominal value, as a share of that.
const TRUST: f64 = 0.5;
/// The steps of ln v in which the best v is searched.
const STEP: f64 = 0.05;

/// What speaks for a reading of measurements.
pub struct ReadingEvidence {
    /// Minus twice the logarithm of the probability density of the numbers in the file.
    pub value: f64,
    /// The weighted sum of squares that is left with the most probable compliances, those of the
    /// compliances about the nominal ones included.
    pub square: f64,
    /// The root of the weighted mean square.
    pub rms: f64,
    /// The factor by which all compliances together differ from the nominal ones.
    pub scale: f64,
}

impl ReadingEvidence {
    /// The evidence for reading the measurements of a case as `read`.
    pub fn new(case: &Case<'_>, read: &[Measurement]) -> Self {
        let (matrix, values) = relative_rows(case, read);
        let predicted = matrix.column_sum();
        let scale = 1.0 + predicted.dot(&values) / predicted.norm_squared();
        let (numbers, any_sigma) = (values.len(), matches!(case.sigma, Sigma::FromResiduals(_)));
        // Numbers b ~ N(0, v (1 + B B^T / v)), by the singular values of B, b's coordinates along them and the square of what is left of b.
        let svd = (matrix * TRUST).svd(true, false);
        let vectors = svd.u.unwrap_or_default();
        let coordinates = vectors.tr_mul(&values);
        let rest = (&values - vectors * &coordinates).norm_squared();
        let singular = || svd.singular_values.iter().map(|value| value * value);
        // The weighted sum of squares of noise and compliances for noise of v times its variance.
        let square = |v: f64| {
            let terms = coordinates.iter().zip(singular());
            let terms =
                terms.map(|(coordinate, value)| coordinate * coordinate / (1.0 + value / v));
            (rest + terms.sum::<f64>()) / v
        };
        let at = |log_v: f64| {
            let v = log_v.exp();
            let determinant: f64 = singular().map(|value| (value / v).ln_1p()).sum();
            (numbers as f64 + 2.0) * log_v + square(v) + determinant
        };
        // The smallest value over v >= 1, or over any v where sigma is not known.
        let largest = (rest + coordinates.norm_squared()).max(1.0).ln() + 1.0;
        let smallest = if any_sigma { -largest.max(60.0) } else { 0.0 };
        let steps = successors(Some(smallest), |v| (*v < largest).then_some(v + STEP));
        let least = steps.map(at).fold(f64::INFINITY, f64::min);
        // What maps the file's numbers to those that are read turns densities into densities.
        let each = case.measurements.iter().zip(read);
        let map: f64 = each
            .map(|(file, read)| 2.0 * log_of_map(case, file, read))
            .sum();
        Self {
            value: least + map,
            square: square(1.0),
            rms: (square(1.0) / numbers.max(1) as f64).sqrt(),
            scale,
        }
    }
}

/// Whitened rows (N x p) by the compliances as multiples of the nominal ones, and what these leave of the measurements (N).
fn relative_rows(case: &Case<'_>, measurements: &[Measurement]) -> (DMatrix<f64>, DVector<f64>) {
    let nominal = case.belief.sizes();
    let mut rows = case.with(measurements).first_order(&nominal);
    for (mut column, nominal) in rows.matrix.column_iter_mut().zip(&nominal) {
        column *= *nominal;
    }
    (rows.matrix, rows.left)
}

/// The deflections (m) that measurements of all coordinates have by the most probable compliances: those that fit these, as far as they
/// tell, else the nominal ones.
pub fn most_probable(case: &Case<'_>, measurements: &[Measurement]) -> Option<Vec<Vector3<f64>>> {
    let (matrix, left) = relative_rows(case, measurements);
    let unknowns = matrix.ncols();
    let precision = DMatrix::identity(unknowns, unknowns) / (TRUST * TRUST);
    let information = matrix.tr_mul(&matrix) + precision;
    let deviation = information.cholesky()?.solve(&matrix.tr_mul(&left));
    let nominal = DVector::from_vec(case.belief.sizes());
    let values = nominal.component_mul(&deviation.add_scalar(1.0));
    let case = case.with(measurements);
    let left = case.first_order(values.as_slice()).own_left;
    let each = case.rows_of_each().zip(measurements);
    let predicted = each
        .map(|(rows, each)| each.deflection_m - three_rows(&left.rows_range(rows).into_owned(), 0));
    Some(predicted.collect())
}

/// The logarithm of a reading's standard deviations, and of the volume that reading a measurement of the file so stretches by: only units
/// change that.
fn log_of_map(case: &Case<'_>, file: &Measurement, read: &Measurement) -> f64 {
    let sigma_m = read
        .sigma_m
        .unwrap_or(Vector3::repeat(case.sigma.weight_m()));
    let (numbers, own) = match read.direction {
        Some(_) => (1.0, sigma_m.x.ln()),
        None => (3.0, sigma_m.map(f64::ln).sum()),
    };
    let stretch = |numbers: f64, [before, after]: [f64; 2]| {
        let is_any = before > 0.0 && after > 0.0;
        if is_any {
            numbers * (after / before).ln()
        } else {
            0.0
        }
    };
    let both = [file, read];
    let turns = both.map(|each| each.rotation.map_or(0.0, |each| each.vector_rad.norm()));
    let rotation = (read.rotation).map_or(0.0, |each| each.sigma_rad.map(f64::ln).sum());
    let moved = both.map(|each| each.deflection_m.norm());
    own + rotation - stretch(numbers, moved) - stretch(3.0, turns)
}
