//! The equations where more is uncertain than the instrument's noise: a column for each unknown of the extended
//! vector, rows weighted with the whole covariance of a reading.

use nalgebra::{DVector, Matrix3, Matrix3xX, Matrix6xX, Vector3};

use super::equations::{EquationSource, Equations, Writer};
use super::error::IdentificationError;
use crate::measurement::Measurement;
use crate::observation::{FirstOrder, Form, ObservationModel, Prediction, ReadingKind, Setup};
use crate::robot::rotation_vector;
use crate::task::Extended;

impl EquationSource<'_> {
    /// To first order in compliance, at the nominal values.
    pub(super) fn extended_linear(&self, extended: &Extended) -> Equations {
        let values = self.nominal_values();
        let equations = self.extended(extended, Form::FirstOrder, &values);
        // To first order there is always a prediction.
        equations.unwrap_or_else(|_| Writer::new(0, values.len()).equations)
    }

    /// Through the static equilibrium, at values of the unknowns.
    pub(super) fn extended_nonlinear(
        &self,
        extended: &Extended,
        values: &[f64],
    ) -> Result<Equations, IdentificationError> {
        self.extended(extended, Form::AtRest, values)
    }

    fn extended(
        &self,
        extended: &Extended,
        form: Form,
        values: &[f64],
    ) -> Result<Equations, IdentificationError> {
        let size = values.len();
        let mut model = ObservationModel::new(extended.set(), extended.arm(), values);
        let mut covariances = extended.first_order_of_all(self.sigma_m);
        let mut derivatives = Matrix6xX::zeros(size);
        let mut writer = Writer::new(self.rows(), size);
        for (index, each) in self.measurements.iter().enumerate() {
            let setup = Setup {
                commanded_rad: each.configuration_rad.clone(),
                load: each.load,
                target: 0,
            };
            let kind = match each.rotation {
                Some(_) => ReadingKind::DeflectionAndRotation,
                None => ReadingKind::Deflection,
            };
            let Prediction {
                position_m,
                rotation,
            } = model
                .predict(form, &setup, kind, &mut derivatives)
                .map_err(|source| IdentificationError::Equilibrium {
                    measurement: index + 1,
                    source,
                })?;
            let whitener = self.whitener(&mut covariances, each);
            let rows = |first: usize| {
                Matrix3xX::from_fn(size, |row, column| derivatives[(first + row, column)])
            };
            writer.push(
                &(whitener * rows(0)),
                whitener * (each.deflection_m - position_m),
                &Vector3::repeat(1.0),
            );
            if let Some(measured) = &each.rotation {
                let left = measured.vector_rad - rotation_vector(&rotation);
                writer.push(&rows(3), left, &measured.sigma_rad);
            }
        }
        self.push_prior(&mut writer, Some(values));
        Ok(writer.equations)
    }

    /// L^-1 for the covariance L L^T of a measured deflection (1/m): the instrument's noise, the measurement's own
    /// where it brings some, and what else is new in each reading.
    fn whitener(&self, model: &mut FirstOrder<'_>, measurement: &Measurement) -> Matrix3<f64> {
        let sigma = self.sigma(measurement);
        model.move_to(measurement.configuration_rad.as_slice());
        let others = model.covariance_of_all(&measurement.load);
        let covariance = others + Matrix3::from_diagonal(&sigma.component_mul(&sigma));
        (covariance.cholesky())
            .and_then(|factor| factor.l().try_inverse())
            .unwrap_or_else(|| Matrix3::from_diagonal(&sigma.map(f64::recip)))
    }

    pub(super) fn extended_weights_off(&self, extended: &Extended) -> Vec<Matrix3<f64>> {
        let mut covariances = extended.first_order_of_all(self.sigma_m);
        let off = |each| {
            let whitener = self.whitener(&mut covariances, each);
            // It has an inverse: it is one.
            (whitener.solve_lower_triangular(&Matrix3::identity())).unwrap_or(Matrix3::zeros())
        };
        self.measurements.iter().map(off).collect()
    }

    /// Takes the weights off the residuals of deflections (m).
    pub(super) fn extended_residuals_m(
        &self,
        extended: &Extended,
        whitened: &DVector<f64>,
    ) -> Vec<f64> {
        let mut covariances = extended.first_order_of_all(self.sigma_m);
        let mut row = 0;
        let mut residuals = Vec::new();
        for each in self.measurements {
            let whitener = self.whitener(&mut covariances, each);
            let residual = whitened.fixed_rows::<3>(row).into_owned();
            let unweighted = whitener.solve_lower_triangular(&residual);
            residuals.extend(unweighted.unwrap_or(residual).iter());
            row += if each.rotation.is_some() { 6 } else { 3 };
        }
        residuals
    }
}
