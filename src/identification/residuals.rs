//! Residuals and leverage measurement by measurement.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::Case;
use super::case::Sigma;
use super::equations::{EquationSource, Equations, rows_of};
use super::error::IdentificationError;
use super::estimate::Identification;
use super::outliers::RejectedReading;
use crate::numeric::least_squares::LeastSquares;
use crate::task::Method;

/// A residual whose variance is a smaller share of its measurement's says nothing: the fit goes
/// through that measurement (leverage one), and rounding is what is left.
const NO_VARIANCE: f64 = 1e-8;

/// The residual of one measurement against its own uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeasurementResidual {
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

/// The residual of each measurement.
///
/// # Errors
/// The robot gives way under a load.
pub fn residuals(
    case: &Case<'_>,
    identification: &Identification,
) -> Result<Vec<MeasurementResidual>, IdentificationError> {
    let source = case.equation_source();
    let Equations {
        matrix,
        right_hand_side,
    } = match case.method {
        Method::Linear => source.linear(),
        Method::Nonlinear => source.nonlinear(&identification.posterior.mean)?,
    };
    let estimable = &identification.posterior.estimable;
    let fit = LeastSquares::solve(&matrix, &right_hand_side, estimable);
    // What a combination of compliances does that are not determined one by one is fitted, too.
    let whitened = right_hand_side - &matrix * &fit.solution;
    let own = OwnUnits::new(&source, &matrix, &whitened);
    let judge = match case.sigma {
        Sigma::Known(_) => Judge::KnownVariance,
        Sigma::FromResiduals(_) => Judge::Residuals {
            sum_of_squares: whitened.norm_squared(),
            freedom: whitened.len() - estimable.rank(),
        },
    };
    Ok((case.measurements.iter().zip(source.first_rows()))
        .map(|(measurement, row)| {
            let rows = rows_of(measurement);
            let matrix = matrix.rows(row, rows);
            let residual = whitened.rows(row, rows).into_owned();
            let taken_up = matrix * &fit.covariance * matrix.transpose();
            let leverage = taken_up.trace();
            let coordinates = own.coordinates(row..row + rows, 1.0, (&fit.covariance, -1.0));
            let covariance = DMatrix::identity(rows, rows) - taken_up;
            judge.residual(&residual, covariance, &coordinates, leverage)
        })
        .collect())
}

/// Residuals of the measurements that were fitted, and in their places those of the measurements that were not; `case` has all.
///
/// # Errors
/// The robot gives way under a load.
pub fn with_rejected(
    mut residuals: Vec<MeasurementResidual>,
    case: &Case<'_>,
    identification: &Identification,
    rejected: &[RejectedReading],
) -> Result<Vec<MeasurementResidual>, IdentificationError> {
    let posterior = &identification.posterior;
    for each in rejected {
        let alone = [case.measurements[each.reading].clone()];
        let alone = case.with(&alone);
        let source = alone.equation_source();
        let (matrix, residual) = alone.against(&source, &posterior.mean)?;
        let own = match case.sigma {
            Sigma::Known(_) => 1.0,
            Sigma::FromResiduals(_) => (identification.sigma_m / source.typical_sigma_m()).powi(2),
        };
        let known = &matrix * &posterior.covariance * matrix.transpose();
        let coordinates = OwnUnits::new(&source, &matrix, &residual).coordinates(
            0..residual.len(),
            own,
            (&posterior.covariance, 1.0),
        );
        let covariance = DMatrix::identity(residual.len(), residual.len()) * own + known;
        let judged = Judge::KnownVariance.residual(&residual, covariance, &coordinates, 0.0);
        residuals.insert(each.reading, judged);
    }
    Ok(residuals)
}

/// Residuals and rows without their weights: correlated coordinates of a reading are weighted together, and each has a
/// standard deviation of its own.
struct OwnUnits {
    matrix: DMatrix<f64>,
    residuals: DMatrix<f64>,
    variances: Vec<f64>,
}

/// A residual's coordinate, its variance, and the measurement's.
type Coordinate = (f64, f64, f64);

impl OwnUnits {
    /// Those of whitened rows, of which what was known before stands below.
    fn new(source: &EquationSource<'_>, matrix: &DMatrix<f64>, residuals: &DVector<f64>) -> Self {
        let rows = source.rows();
        let mut matrix = matrix.rows(0, rows).into_owned();
        let mut residuals = DMatrix::from_columns(&[residuals.rows(0, rows)]);
        source.take_weights_off(&mut matrix);
        source.take_weights_off(&mut residuals);
        let all = source.covariances_of_all();
        let variances = (source.measurements.iter().zip(&all)).flat_map(|(each, covariance)| {
            (0..rows_of(each)).map(move |axis| covariance[(axis, axis)])
        });
        Self {
            matrix,
            residuals,
            variances: variances.collect(),
        }
    }

    /// The coordinates in some rows: the variance is so many times the measurement's, and with this sign what the fit knows.
    fn coordinates(
        &self,
        rows: Range<usize>,
        times: f64,
        (covariance, sign): (&DMatrix<f64>, f64),
    ) -> Vec<Coordinate> {
        rows.map(|row| {
            let columns = self.matrix.row(row);
            let known = (columns * covariance).dot(&columns);
            let own = times * self.variances[row];
            (self.residuals[row], own + sign * known, own)
        })
        .collect()
    }
}

/// What whitened residuals are compared with.
#[derive(Debug, Clone, Copy)]
enum Judge {
    /// Their variance is one.
    KnownVariance,
    /// Their variance is that of the others.
    Residuals { sum_of_squares: f64, freedom: usize },
}

impl Judge {
    /// Judges the whitened residual of a measurement with its covariance, if the variance is one, and the same coordinate by
    /// coordinate.
    fn residual(
        self,
        residual: &DVector<f64>,
        covariance: DMatrix<f64>,
        coordinates: &[Coordinate],
        leverage: f64,
    ) -> MeasurementResidual {
        let scale = match self {
            Self::KnownVariance => 1.0,
            Self::Residuals {
                sum_of_squares,
                freedom,
            } => (sum_of_squares / freedom as f64).sqrt(),
        };
        let standardised = (coordinates.iter())
            .map(|&(value, variance, own)| {
                (variance > NO_VARIANCE * own && scale > 0.0)
                    .then(|| value / variance.sqrt() / scale)
            })
            .collect();
        let eigen = SymmetricEigen::new(covariance);
        let coordinates = eigen.eigenvectors.tr_mul(residual);
        let squares: Vec<f64> = (eigen.eigenvalues.iter().zip(coordinates.iter()))
            .filter(|(variance, _)| **variance > NO_VARIANCE)
            .map(|(variance, coordinate)| coordinate * coordinate / variance)
            .collect();
        let square: f64 = squares.iter().sum();
        MeasurementResidual {
            standardised,
            leverage,
            distance: square.sqrt() / scale,
            freedom: squares.len(),
            probability: self.probability(square, squares.len()),
        }
    }

    /// The probability of a square at least as large: chi-squared, or F against the variance of the
    /// other residuals.
    fn probability(self, square: f64, freedom: usize) -> Option<f64> {
        if freedom == 0 {
            return None;
        }
        let own = freedom as f64;
        match self {
            Self::KnownVariance => Some(ChiSquared::new(own).ok()?.sf(square)),
            Self::Residuals {
                sum_of_squares,
                freedom,
            } => {
                let others = freedom as f64 - own;
                let distribution = FisherSnedecor::new(own, others).ok()?;
                let left = (sum_of_squares - square).max(0.0);
                Some(if left > 0.0 {
                    distribution.sf((square / own) / (left / others))
                } else {
                    0.0
                })
            }
        }
    }
}
