//! The equations where more is uncertain than the instrument's noise: a column for each unknown of the extended
//! vector, rows weighted with the whole covariance of a reading.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Matrix6xX, Vector3};

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
        let groups = self.repeated(extended);
        for (index, each) in self.measurements.iter().enumerate() {
            let setup = Setup {
                commanded_rad: each.configuration_rad.clone(),
                load: each.load,
                target: 0,
                station: 0,
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
            let is_repeated = groups.iter().any(|group| group.members.contains(&index));
            let whitener = if is_repeated {
                Matrix3::identity()
            } else {
                self.whitener(&mut covariances, each)
            };
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
        for group in &groups {
            let factor = self.shared_factor(&mut covariances, group);
            let equations = &mut writer.equations;
            let mut rows = equations.matrix.select_rows(&group.rows);
            let mut right = equations.right_hand_side.select_rows(&group.rows);
            if factor.solve_lower_triangular_mut(&mut rows)
                && factor.solve_lower_triangular_mut(&mut right)
            {
                for (place, &row) in group.rows.iter().enumerate() {
                    equations.matrix.set_row(row, &rows.row(place));
                    equations.right_hand_side[row] = right[place];
                }
            }
        }
        self.push_prior(&mut writer, Some(values));
        Ok(writer.equations)
    }

    /// L^-1 for the covariance L L^T of a measured deflection (1/m): the instrument's noise, the measurement's own
    /// where it brings some, and what else is new in each reading.
    fn whitener(&self, model: &mut FirstOrder<'_>, measurement: &Measurement) -> Matrix3<f64> {
        (self.extended_covariance(model, measurement).cholesky())
            .and_then(|factor| factor.l().try_inverse())
            .unwrap_or_else(|| Matrix3::from_diagonal(&self.sigma(measurement).map(f64::recip)))
    }

    /// Takes the weights off the whitened rows of deflections, which are then in the readings' own unit.
    pub(super) fn take_extended_weights_off(&self, extended: &Extended, rows: &mut DMatrix<f64>) {
        let mut covariances = extended.first_order_of_all(self.sigma_m);
        let groups = self.repeated(extended);
        for group in &groups {
            let factor = self.shared_factor(&mut covariances, group);
            let unweighted = factor * rows.select_rows(&group.rows);
            for (place, &row) in group.rows.iter().enumerate() {
                rows.set_row(row, &unweighted.row(place));
            }
        }
        for (index, (each, row)) in self.measurements.iter().zip(self.first_rows()).enumerate() {
            if groups.iter().any(|group| group.members.contains(&index)) {
                continue;
            }
            let whitener = self.whitener(&mut covariances, each);
            let mut own = rows.rows_mut(row, 3);
            // It has an inverse: it is one.
            whitener.solve_lower_triangular_mut(&mut own);
        }
    }

    /// The covariance of a measured deflection (m^2), whatever repeats it.
    pub(super) fn extended_covariance(
        &self,
        model: &mut FirstOrder<'_>,
        measurement: &Measurement,
    ) -> Matrix3<f64> {
        let sigma = self.sigma(measurement);
        model.move_to(measurement.configuration_rad.as_slice());
        let others = model.covariance_of_all(&measurement.load);
        others + Matrix3::from_diagonal(&sigma.component_mul(&sigma))
    }

    /// Measurements that repeat one another, two or more, where repeats share something; else none.
    fn repeated(&self, extended: &Extended) -> Vec<Repeated> {
        if !extended.is_shared_by_repeats() {
            return Vec::new();
        }
        let mut groups: Vec<Repeated> = Vec::new();
        for (index, (each, row)) in self.measurements.iter().zip(self.first_rows()).enumerate() {
            let is_same = |group: &&mut Repeated| {
                let first = &self.measurements[group.members[0]];
                first.configuration_rad == each.configuration_rad && first.load == each.load
            };
            let rows = row..row + 3;
            if let Some(group) = groups.iter_mut().find(is_same) {
                group.members.push(index);
                group.rows.extend(rows);
            } else {
                groups.push(Repeated {
                    members: vec![index],
                    rows: rows.collect(),
                });
            }
        }
        groups.retain(|group| group.members.len() > 1);
        groups
    }

    /// L for the covariance L L^T of all readings of a group (m): what is new in each on the diagonal, and what they share
    /// everywhere.
    fn shared_factor(&self, model: &mut FirstOrder<'_>, group: &Repeated) -> DMatrix<f64> {
        let first = &self.measurements[group.members[0]];
        model.move_to(first.configuration_rad.as_slice());
        let shared = model.covariance_shared(&first.load);
        let new = model.covariance_of_all(&first.load) - shared;
        let count = group.members.len();
        let mut covariance = DMatrix::zeros(3 * count, 3 * count);
        for one in 0..count {
            for other in 0..count {
                let mut block = shared;
                if one == other {
                    let sigma = self.sigma(&self.measurements[group.members[one]]);
                    block += new + Matrix3::from_diagonal(&sigma.component_mul(&sigma));
                }
                let mut place = covariance.fixed_view_mut::<3, 3>(3 * one, 3 * other);
                place.copy_from(&block);
            }
        }
        let typical = covariance.diagonal().map(f64::sqrt);
        let factor = covariance.cholesky().map(|factor| factor.l());
        factor.unwrap_or_else(|| DMatrix::from_diagonal(&typical))
    }
}

/// Measurements that repeat one another, and their rows.
struct Repeated {
    members: Vec<usize>,
    rows: Vec<usize>,
}
