//! Residuals and leverage measurement by measurement.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Matrix6, stack};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::Case;
use super::case::Sigma;
use super::error::FitResult;
use super::estimate::Identification;
use super::outliers::{NO_VARIANCE, RejectedReading, kept, squares_of};
use super::prediction::MeasuredRows;
use crate::numeric::least_squares::LeastSquares;
use crate::quantities::written::from_one;

/// The residual of one measurement against its own uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasurementResidual {
    /// Its measurement, from 0; from 1 in records.
    #[serde(serialize_with = "from_one")]
    pub measurement: usize,
    /// Its coordinates, those of the deflection before those of the rotation, each over its own
    /// standard deviation: that of the measurement, less what the fit took up (leverage). `None`
    /// where the fit goes through the measurement.
    pub standardised: Vec<Option<f64>>,
    /// How many of its coordinates the fit took up: the trace of its block of the hat matrix. Over all measurements it is
    /// the effective number of parameters.
    pub leverage: f64,
    /// Its Mahalanobis distance, the root of r^T (R - A cov A^T)^-1 r. Its square is what the weighted
    /// sum of squares loses if the measurement is left out.
    pub distance: f64,
    /// The number of independent coordinates in that.
    #[serde(rename = "degrees_of_freedom")]
    pub freedom: usize,
    /// The probability of a distance at least as large if the measurement is like the others;
    /// `None` where nothing is left to judge by.
    pub probability: Option<f64>,
}

/// The residual of each measurement; those that were rejected were not fitted.
///
/// # Errors
/// The robot gives way under a load.
pub fn residuals(
    case: &Case<'_>,
    identification: &Identification,
    rejected: &[RejectedReading],
) -> FitResult<Vec<MeasurementResidual>> {
    let posterior = &identification.posterior;
    let is_from_residuals = matches!(case.sigma, Sigma::FromResiduals(_));
    let measurements = kept(case.measurements, rejected);
    let fitted = case.with(&measurements);
    let mut rows = fitted.against(&posterior.mean)?;
    let values = DVector::from_column_slice(&posterior.mean);
    let (prior, before) = case.prior_rows_at(&values)?;
    let (matrix, left) = (stack![rows.matrix; prior], stack![rows.left; before]);
    let fit = LeastSquares::solve(&matrix, &left, &posterior.estimable);
    // What a combination of compliances does that are not determined one by one is fitted, too.
    let left = left - matrix * &fit.solution;
    rows.left -= &rows.matrix * &fit.solution;
    rows.own_left -= &rows.own_matrix * &fit.solution;
    let spare = left.len().saturating_sub(posterior.estimable.rank());
    let others = is_from_residuals.then(|| (left.norm_squared(), spare));
    // A fit takes what it knows off the residuals of what it was fitted to.
    let known = -fit.covariance;
    let each = fitted.rows_of_each().zip(fitted.covariances());
    let each = each.map(|(of, own)| residual((&rows, of), &own, &known, 1.0, others));
    let mut residuals: Vec<MeasurementResidual> = each.collect();
    for each in rejected {
        let alone = [case.measurements[each.reading].clone()];
        let alone = case.with(&alone);
        let ratio = is_from_residuals.then(|| identification.sigma_m / alone.typical_sigma_m());
        let variance = ratio.unwrap_or(1.0).powi(2);
        let rows = &alone.against(&posterior.mean)?;
        let (rows, own) = ((rows, 0..alone.rows()), &alone.covariances()[0]);
        let mut judged = residual(rows, own, &posterior.covariance, variance, None);
        judged.leverage = 0.0;
        residuals.insert(each.reading, judged);
    }
    for (measurement, each) in residuals.iter_mut().enumerate() {
        each.measurement = measurement;
    }
    Ok(residuals)
}

/// The residual of the measurement in some rows, by its own covariance and the one of the unknowns, which a fit takes off the first; with the
/// variance of a whitened reading. The sum of squares of all residuals, and its degrees of freedom, are given where the variance is that of the
/// others. Correlated coordinates of a reading are weighted together, and each has a standard deviation of its own.
fn residual(
    (rows, of): (&MeasuredRows, Range<usize>),
    own: &Matrix6<f64>,
    known: &DMatrix<f64>,
    variance: f64,
    others: Option<(f64, usize)>,
) -> MeasurementResidual {
    let scale = others.map_or(1.0, |(square, freedom)| (square / freedom as f64).sqrt());
    let standardised = of.clone().enumerate().map(|(axis, row)| {
        let columns = rows.own_matrix.row(row);
        let own = variance * own[(axis, axis)];
        let variance = own + (columns * known).dot(&columns);
        let value = rows.own_left[row];
        (variance > NO_VARIANCE * own && scale > 0.0).then(|| value / variance.sqrt() / scale)
    });
    let standardised = standardised.collect();
    let matrix = rows.matrix.rows_range(of.clone());
    let known = matrix * known * matrix.transpose();
    let leverage = 0.0 - known.trace();
    let own = DMatrix::identity(of.len(), of.len()) * variance;
    let squares = squares_of(&rows.left.rows_range(of).into_owned(), own + known);
    let (square, freedom): (f64, _) = (squares.iter().sum(), squares.len());
    // Of a square at least as large: chi-squared, or F against the variance of the other residuals.
    let probability = match others {
        None => ChiSquared::new(freedom as f64)
            .map(|law| law.sf(square))
            .ok(),
        Some((all, of_all)) => {
            let [own, others] = [freedom as f64, of_all as f64 - freedom as f64];
            let ratio = (square / own) / ((all - square).max(0.0) / others);
            let law = FisherSnedecor::new(own, others);
            law.map(|law| {
                if ratio.is_finite() {
                    law.sf(ratio)
                } else {
                    0.0
                }
            })
            .ok()
        }
    };
    MeasurementResidual {
        measurement: 0,
        standardised,
        leverage,
        distance: square.sqrt() / scale,
        freedom,
        probability,
    }
}
