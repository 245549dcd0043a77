//! How probable the numbers of a file are, read in one way or another.

use nalgebra::{DMatrix, DVector};

use super::super::equations::Equations;
use super::super::{Case, Sigma};
use crate::measurement::Measurement;

/// The standard deviation of a compliance about its nominal value, as a share of that.
const TRUST: f64 = 0.5;
/// The steps of ln v in which the best v is searched.
const STEP: f64 = 0.05;

/// What speaks for a reading of measurements.
#[derive(Debug, Clone, Copy)]
pub struct ReadingEvidence {
    /// Minus twice the logarithm of the probability density of the numbers in the file.
    pub value: f64,
    /// The weighted sum of squares that is left with the most probable compliances, those of the
    /// compliances about the nominal ones included.
    pub square: f64,
    /// How many numbers were read.
    pub numbers: usize,
    /// The factor by which all compliances together differ from the nominal ones.
    pub scale: f64,
}

impl ReadingEvidence {
    /// The evidence for reading the measurements of a file as `read`.
    pub fn new(case: &Case<'_>, file: &[Measurement], read: &[Measurement]) -> Self {
        let Equations {
            matrix,
            right_hand_side,
        } = relative_equations(case, read);
        let predicted = matrix.column_sum();
        let scale = predicted.dot(&right_hand_side) / predicted.norm_squared();
        let numbers = matrix.nrows();
        let marginal = Marginal::new(matrix * TRUST, &(right_hand_side - predicted));
        // What maps the file's numbers to those that are read turns densities into densities.
        let map = 2.0 * (log_sigma(case, read) - log_stretch(file, read));
        Self {
            value: marginal.minimum(matches!(case.sigma, Sigma::FromResiduals(_))) + map,
            square: marginal.square(1.0),
            numbers,
            scale,
        }
    }

    /// The root of the weighted mean square.
    pub fn rms(self) -> f64 {
        (self.square / self.numbers.max(1) as f64).sqrt()
    }
}

/// Whitened equations whose unknowns are the compliances as multiples of the nominal ones.
fn relative_equations(case: &Case<'_>, measurements: &[Measurement]) -> Equations {
    // What is known before is wider here.
    let case = Case {
        prior: None,
        uncertain: None,
        held: &[],
        ..case.with(measurements)
    };
    let source = case.equation_source();
    let mut equations = source.linear();
    let nominal = case.nominal.typical_rad_per_nm(case.parameters);
    for (mut column, nominal) in equations.matrix.column_iter_mut().zip(&nominal) {
        column *= *nominal;
    }
    equations
}

/// The most probable compliances of all joints (rad/(N m)): those that fit the measurements, as far as
/// these tell, else the nominal ones.
pub fn most_probable(case: &Case<'_>, measurements: &[Measurement]) -> Option<Vec<f64>> {
    let Equations {
        matrix,
        right_hand_side,
    } = relative_equations(case, measurements);
    let unknowns = matrix.ncols();
    let precision = DMatrix::identity(unknowns, unknowns) / (TRUST * TRUST);
    let deviation = matrix.tr_mul(&(right_hand_side - matrix.column_sum()));
    let deviation = (matrix.tr_mul(&matrix) + precision)
        .cholesky()?
        .solve(&deviation);
    let nominal = case.nominal.typical_rad_per_nm(case.parameters);
    let mut compliance = case.nominal.compliance_rad_per_nm.clone();
    for (index, &joint) in case.parameters.iter().enumerate() {
        compliance[joint] = nominal[index] * (1.0 + deviation[index]);
    }
    Some(compliance)
}

/// The sum of the logarithms of all standard deviations.
fn log_sigma(case: &Case<'_>, measurements: &[Measurement]) -> f64 {
    let default = case.sigma.weight_m();
    let of = |each: &Measurement| -> f64 {
        let deflection: f64 = (0..3)
            .map(|axis| each.sigma_m.map_or(default, |sigma| sigma[axis]).ln())
            .sum();
        let rotation = each.rotation.map_or(0.0, |rotation| {
            rotation.sigma_rad.iter().map(|sigma| sigma.ln()).sum()
        });
        deflection + rotation
    };
    measurements.iter().map(of).sum()
}

/// The logarithm of the volume that readings stretch by: only units change it.
fn log_stretch(file: &[Measurement], read: &[Measurement]) -> f64 {
    let length = |each: &Measurement| each.deflection_m.norm();
    let turn = |each: &Measurement| {
        each.rotation
            .map_or(0.0, |rotation| rotation.vector_rad.norm())
    };
    let stretch = |before: f64, after: f64| {
        if before > 0.0 && after > 0.0 {
            3.0 * (after / before).ln()
        } else {
            0.0
        }
    };
    (file.iter().zip(read))
        .map(|(file, read)| stretch(length(file), length(read)) + stretch(turn(file), turn(read)))
        .sum()
}

/// Numbers b ~ N(0, v (1 + B B^T / v)), by the singular values of B.
struct Marginal {
    equations: f64,
    singular_values: DVector<f64>,
    /// Coordinates of b along the left singular vectors.
    coordinates: DVector<f64>,
    /// The square of what is left of b.
    rest: f64,
}

impl Marginal {
    fn new(matrix: DMatrix<f64>, values: &DVector<f64>) -> Self {
        let svd = matrix.svd(true, false);
        let Some(u) = &svd.u else {
            unreachable!("the left factor was asked for");
        };
        let coordinates = u.tr_mul(values);
        let rest = (values - u * &coordinates).norm_squared();
        Self {
            equations: values.len() as f64,
            singular_values: svd.singular_values,
            coordinates,
            rest,
        }
    }

    /// The weighted sum of squares of noise and compliances for noise of v times its variance.
    fn square(&self, v: f64) -> f64 {
        let terms = (self.coordinates.iter().zip(self.singular_values.iter()))
            .map(|(coordinate, value)| coordinate * coordinate / (1.0 + value * value / v));
        (self.rest + terms.sum::<f64>()) / v
    }

    fn at(&self, log_v: f64) -> f64 {
        let v = log_v.exp();
        let determinant: f64 = (self.singular_values.iter())
            .map(|value| (value * value / v).ln_1p())
            .sum();
        (self.equations + 2.0) * log_v + self.square(v) + determinant
    }

    /// The smallest value over v >= 1, or over any v where sigma is not known.
    fn minimum(&self, any: bool) -> f64 {
        let all = self.rest + self.coordinates.norm_squared();
        let largest = all.max(1.0).ln() + 1.0;
        let smallest = if any { -largest.max(60.0) } else { 0.0 };
        let mut best = (self.at(smallest), smallest);
        let mut log_v = smallest;
        while log_v < largest {
            log_v += STEP;
            let value = self.at(log_v);
            if value < best.0 {
                best = (value, log_v);
            }
        }
        best.0
    }
}
