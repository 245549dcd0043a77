//! How probable the numbers of a file are, read in one way or another.

use std::iter::successors;

use nalgebra::{DMatrix, DVector, Vector3};

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
    /// The evidence for reading the measurements of a file as `read`.
    pub fn new(case: &Case<'_>, file: &[Measurement], read: &[Measurement]) -> Self {
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
        let map = 2.0 * (log_sigma(case, read) - log_stretch(file, read));
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

/// The most probable compliances of all joints (rad/(N m)): those that fit the measurements, as far as
/// these tell, else the nominal ones.
pub fn most_probable(case: &Case<'_>, measurements: &[Measurement]) -> Option<Vec<f64>> {
    let (matrix, left) = relative_rows(case, measurements);
    let unknowns = matrix.ncols();
    let precision = DMatrix::identity(unknowns, unknowns) / (TRUST * TRUST);
    let information = matrix.tr_mul(&matrix) + precision;
    let deviation = information.cholesky()?.solve(&matrix.tr_mul(&left));
    let nominal = case.belief.sizes();
    let mut compliance = case.belief.nominal.compliance_rad_per_nm.clone();
    for (index, &joint) in case.belief.parameters.iter().enumerate() {
        compliance[joint] = nominal[index] * (1.0 + deviation[index]);
    }
    Some(compliance)
}

fn log_sigma(case: &Case<'_>, measurements: &[Measurement]) -> f64 {
    let default = Vector3::repeat(case.sigma.weight_m());
    let logarithms = |sigma: Vector3<f64>| sigma.map(f64::ln);
    let of = |each: &Measurement| {
        let rotation = each.rotation.map(|each| logarithms(each.sigma_rad).sum());
        let own = logarithms(each.sigma_m.unwrap_or(default));
        // Along a direction it is one number.
        let own = each.direction.map_or_else(|| own.sum(), |_| own.x);
        own + rotation.unwrap_or(0.0)
    };
    measurements.iter().map(of).sum()
}

/// The logarithm of the volume that readings stretch by: only units change it.
fn log_stretch(file: &[Measurement], read: &[Measurement]) -> f64 {
    let lengths = |each: &Measurement| {
        let turn = each.rotation.map_or(0.0, |each| each.vector_rad.norm());
        let numbers = each.direction.map_or(3.0, |_| 1.0);
        [(each.deflection_m.norm(), numbers), (turn, 3.0)]
    };
    let both = (file.iter().flat_map(lengths)).zip(read.iter().flat_map(lengths));
    let both = both.filter(|((before, _), (after, _))| *before > 0.0 && *after > 0.0);
    both.map(|((before, numbers), (after, _))| numbers * (after / before).ln())
        .sum()
}
