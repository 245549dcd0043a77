//! Validation: measurements that were not fitted, with what is predicted for them.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::Case;
use super::discrepancy::{six_rows, three_rows};
use super::equations::PredictedRows;
use super::error::{FitResult, IdentificationError};
use crate::numeric::posterior::Posterior;
use crate::task::Method;

/// A measurement beside its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Predicted {
    /// The measured deflection less the predicted one (m); of a displacement along a direction what is along it, as in the covariances.
    pub difference_m: Vector3<f64>,
    /// The same of the rotation (rad), where it is measured.
    pub rotation_difference_rad: Option<Vector3<f64>>,
    /// The covariance of the predicted deflection: of what is identified, and of what else is uncertain and shared
    /// by all measurements (m^2).
    pub known_m2: Matrix3<f64>,
    /// The covariance of the reading: the instrument's noise, and what else is new in each reading (m^2).
    pub reading_m2: Matrix3<f64>,
}

/// Measurements beside their predictions.
#[derive(Debug, Clone, PartialEq)]
pub struct Predictions {
    /// In the order of the measurements.
    pub each: Vec<Predicted>,
    /// r^T S^-1 r for all differences r together, rotations among them, and their covariance S: chi-square if what
    /// is known is right.
    pub square: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
}

impl Predictions {
    /// The probability of differences as large as these.
    pub fn probability(&self) -> f64 {
        ChiSquared::new(self.freedom as f64).map_or(1.0, |law| law.sf(self.square))
    }
}

impl Case<'_> {
    /// The measurements beside what a posterior of the unknowns predicts for them. What was known before is in the
    /// posterior.
    ///
    /// # Errors
    /// A measurement has no prediction, or the posterior is none.
    pub fn predictions(&self, posterior: &Posterior) -> FitResult<Predictions> {
        if self.measurements.is_empty() {
            return Err(IdentificationError::NoMeasurements);
        }
        let rows = self.against(&posterior.mean)?;
        let known = &rows.matrix * &posterior.covariance * rows.matrix.transpose();
        let size = self.rows();
        let factor = (&known + DMatrix::identity(size, size))
            .cholesky()
            .ok_or(IdentificationError::Singular)?;
        let mut each = Vec::new();
        let readings = self.covariances().into_iter().zip(self.rows_of_each());
        for (index, (reading, own)) in readings.enumerate() {
            let whitened = rows.matrix.rows_range(own.clone()).into_owned();
            (posterior.variance_of(&whitened)).map_err(|source| {
                IdentificationError::NotDetermined {
                    measurement: index + 1,
                    source,
                }
            })?;
            let known = rows.own_matrix.rows_range(own.clone());
            let known = six_rows(&(known * &posterior.covariance * known.transpose()));
            let left = rows.own_left.rows_range(own).into_owned();
            let along = self.measurements[index].direction;
            let position = |of: &Matrix6<f64>| match along {
                Some(along) => along * along.transpose() * of[(0, 0)],
                None => of.fixed_view::<3, 3>(0, 0).into_owned(),
            };
            each.push(Predicted {
                difference_m: along.map_or_else(|| three_rows(&left, 0), |along| along * left[0]),
                rotation_difference_rad: (left.len() > 3).then(|| three_rows(&left, 3)),
                known_m2: position(&known),
                reading_m2: position(&reading),
            });
        }
        Ok(Predictions {
            each,
            square: rows.left.dot(&factor.solve(&rows.left)),
            freedom: size,
        })
    }

    /// The rows of the measurements alone at values of the unknowns (p).
    pub(super) fn against(&self, values: &[f64]) -> FitResult<MeasuredRows> {
        Ok(match self.method {
            Method::Linear => self.first_order(values),
            Method::Nonlinear => MeasuredRows::new(self, self.predicted(values, &mut Vec::new())?),
        })
    }

    /// The same to first order in compliance.
    pub(super) fn first_order(&self, values: &[f64]) -> MeasuredRows {
        let mut predicted = self.predicted_linearly();
        let nominal = DVector::from_vec(self.belief.values());
        let change = DVector::from_column_slice(values) - nominal;
        predicted.values += &predicted.derivatives * change;
        MeasuredRows::new(self, predicted)
    }
}

/// The rows of measurements, what was known before left aside.
pub(super) struct MeasuredRows {
    /// Whitened (N x p), and what is left of each.
    pub matrix: DMatrix<f64>,
    pub left: DVector<f64>,
    /// The same in the readings' own units.
    pub own_matrix: DMatrix<f64>,
    pub own_left: DVector<f64>,
}

impl MeasuredRows {
    fn new(case: &Case<'_>, predicted: PredictedRows) -> Self {
        let (own_matrix, own_left) = (predicted.derivatives, case.read() - predicted.values);
        let (mut matrix, mut left) = (own_matrix.clone(), own_left.clone());
        let whitening = case.whitening();
        whitening.whiten(&mut matrix);
        whitening.whiten(&mut left);
        Self {
            matrix,
            left,
            own_matrix,
            own_left,
        }
    }
}
