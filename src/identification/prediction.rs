//! Validation: measurements that were not fitted, with what is predicted for them.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use thiserror::Error;

use super::Case;
use super::equations::{EquationSource, Equations, rows_of};
use super::error::IdentificationError;
use crate::numeric::posterior::{NotDetermined, Posterior};
use crate::task::Method;

/// A measurement beside its prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Predicted {
    /// The measured deflection less the predicted one (m).
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

/// Why there is no prediction.
#[derive(Debug, Error)]
pub enum PredictionError {
    /// There are no measurements, or the robot gives way under a load.
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    /// What is measured depends on what was not identified.
    #[error("measurement {measurement}: what is predicted depends on compliances: {source}")]
    NotDetermined {
        /// The measurement, from 1.
        measurement: usize,
        /// Which.
        source: NotDetermined,
    },
    /// Displacements along a direction were measured.
    #[error(
        "displacements along a direction are not validated: deflections are needed, with all three coordinates"
    )]
    AlongDirection,
    /// There is no covariance to judge by.
    #[error("the covariance of what was identified is none")]
    Singular,
}

impl Case<'_> {
    /// The measurements beside what a posterior of the unknowns predicts for them. What was known before is in the
    /// posterior.
    ///
    /// # Errors
    /// A measurement has no prediction, or the posterior is none.
    pub fn predictions(&self, posterior: &Posterior) -> Result<Predictions, PredictionError> {
        if self.measurements.is_empty() {
            return Err(IdentificationError::NoMeasurements.into());
        }
        if self
            .measurements
            .iter()
            .any(|each| each.direction.is_some())
        {
            return Err(PredictionError::AlongDirection);
        }
        let source = self.equation_source();
        let (matrix, residual) = self.against(&source, &posterior.mean)?;
        let known = &matrix * &posterior.covariance * matrix.transpose();
        let size = source.rows();
        let factor = (&known + DMatrix::identity(size, size))
            .cholesky()
            .ok_or(PredictionError::Singular)?;
        let (mut own_rows, mut differences) =
            (matrix.clone(), DMatrix::from_columns(&[residual.column(0)]));
        source.take_weights_off(&mut own_rows);
        source.take_weights_off(&mut differences);
        let mut each = Vec::new();
        let readings = source.covariances().into_iter().zip(source.first_rows());
        for (index, (measurement, (reading_m2, row))) in
            self.measurements.iter().zip(readings).enumerate()
        {
            let rows = matrix.rows(row, rows_of(measurement)).into_owned();
            (posterior.variance_of(&rows)).map_err(|source| PredictionError::NotDetermined {
                measurement: index + 1,
                source,
            })?;
            let deflection = own_rows.rows(row, 3);
            let known = deflection * &posterior.covariance * deflection.transpose();
            each.push(Predicted {
                difference_m: differences.fixed_view::<3, 1>(row, 0).into_owned(),
                rotation_difference_rad: (measurement.rotation)
                    .map(|_| differences.fixed_view::<3, 1>(row + 3, 0).into_owned()),
                known_m2: known.fixed_view::<3, 3>(0, 0).into_owned(),
                reading_m2,
            });
        }
        Ok(Predictions {
            each,
            square: residual.dot(&factor.solve(&residual)),
            freedom: size,
        })
    }

    /// The whitened rows of the measurements alone at values of the unknowns (p), and what is left of each.
    pub(super) fn against(
        &self,
        source: &EquationSource<'_>,
        values: &[f64],
    ) -> Result<(DMatrix<f64>, DVector<f64>), IdentificationError> {
        let Equations {
            matrix,
            right_hand_side,
        } = match self.method {
            Method::Linear => {
                let mut equations = source.linear();
                // Where more is uncertain they are for a change from nominal values.
                let nominal = match source.uncertain {
                    Some(_) => source.nominal_values(),
                    None => vec![0.0; values.len()],
                };
                let change = DVector::from_column_slice(values) - DVector::from_vec(nominal);
                equations.right_hand_side -= &equations.matrix * change;
                equations
            }
            Method::Nonlinear => source.nonlinear(values)?,
        };
        let rows = source.rows();
        Ok((
            matrix.rows(0, rows).into_owned(),
            right_hand_side.rows(0, rows).into_owned(),
        ))
    }
}
