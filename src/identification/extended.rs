//! The equations where more is uncertain than the instrument's noise: a column for each unknown of the extended
//! vector, rows weighted with the whole covariance of a reading.

use nalgebra::{DMatrix, Matrix6, Matrix6xX, Vector3, Vector6};

use super::equations::{EquationSource, Equations, Writer, rows_of};
use super::error::IdentificationError;
use crate::measurement::{Measurement, by_configuration};
use crate::observation::{
    DeflectionPrecision, Form, ObservationModel, PlannedReadings, Prediction, ReadingKind, Setup,
};
use crate::robot::rotation_vector;
use crate::task::{Extended, Method};

impl EquationSource<'_> {
    /// To first order in compliance as planned, or through the static equilibrium at values of the unknowns.
    pub(super) fn extended(
        &self,
        extended: &Extended,
        method: Method,
        values: &[f64],
    ) -> Result<Equations, IdentificationError> {
        let size = values.len();
        let mut model = ObservationModel::new(extended.set(), extended.arm(), values);
        let mut covariances = self.readings(extended);
        let mut derivatives = Matrix6xX::zeros(size);
        let mut writer = Writer::new(self.rows(), size);
        let groups = self.sharing(extended);
        let shares = self.shares(&groups);
        for (index, each) in self.measurements.iter().enumerate() {
            let setup = Setup {
                commanded_rad: each.configuration_rad.clone(),
                load: each.load,
                target: 0,
                station: 0,
                approach: each.approach.clone(),
            };
            let kind = match each.rotation {
                Some(_) => ReadingKind::DeflectionAndRotation,
                None => ReadingKind::Deflection,
            };
            let Prediction {
                position_m,
                rotation,
            } = match method {
                Method::Linear => model.predict_as_planned(&setup, kind, &mut derivatives),
                Method::Nonlinear => model
                    .predict(Form::AtRest, &setup, kind, &mut derivatives)
                    .map_err(|error| IdentificationError::from((index, error)))?,
            };
            let mut left_m = each.deflection_m - position_m;
            if let Some(direction) = &each.direction {
                let along = derivatives.fixed_rows::<3>(0).tr_mul(direction);
                derivatives.set_row(0, &along.transpose());
                left_m = Vector3::ith(0, direction.dot(&left_m));
            }
            let left_rad = (each.rotation.as_ref())
                .map(|measured| measured.vector_rad - rotation_vector(&rotation));
            let whitener = if shares[index] {
                DMatrix::identity(rows_of(each), rows_of(each))
            } else {
                self.whitener(&mut covariances, each)
            };
            writer.push_whitened(&whitener, &derivatives, &left_m, left_rad.as_ref());
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

    /// The readings of these measurements as planning sees them: of rotations, too, where some are measured. The
    /// instrument's noise is the measurements' own.
    pub(super) fn readings<'e>(&self, extended: &'e Extended) -> PlannedReadings<'e> {
        let has = |is_there: fn(&Measurement) -> bool| self.measurements.iter().any(is_there);
        let has_rotations = has(|each| each.rotation.is_some());
        extended.readings_of_all(DeflectionPrecision {
            sigma_m: self.sigma_m,
            rotation_sigma_rad: has_rotations.then_some(1.0),
            unloaded: extended.unloaded(),
            is_along_direction: has(|each| each.direction.is_some()),
        })
    }

    /// L^-1 for the covariance L L^T of a measured deflection (1/m), and its rotation where it has one: the instrument's
    /// noise, the measurement's own where it brings some, and what else is new in each reading.
    fn whitener(&self, model: &mut PlannedReadings<'_>, measurement: &Measurement) -> DMatrix<f64> {
        let rows = rows_of(measurement);
        let covariance = self.extended_covariance(model, measurement);
        let own = covariance.view((0, 0), (rows, rows)).into_owned();
        let typical = own.diagonal().map(|variance| variance.sqrt().recip());
        (own.cholesky())
            .and_then(|factor| factor.l().try_inverse())
            .unwrap_or_else(|| DMatrix::from_diagonal(&typical))
    }

    /// Takes the weights off the whitened rows, which are then in the readings' own units.
    pub(super) fn take_extended_weights_off(&self, extended: &Extended, rows: &mut DMatrix<f64>) {
        let mut covariances = self.readings(extended);
        let groups = self.sharing(extended);
        for group in &groups {
            let factor = self.shared_factor(&mut covariances, group);
            let unweighted = factor * rows.select_rows(&group.rows);
            for (place, &row) in group.rows.iter().enumerate() {
                rows.set_row(row, &unweighted.row(place));
            }
        }
        let shares = self.shares(&groups);
        for (index, (each, row)) in self.measurements.iter().zip(self.first_rows()).enumerate() {
            if shares[index] {
                continue;
            }
            let whitener = self.whitener(&mut covariances, each);
            let mut own = rows.rows_mut(row, rows_of(each));
            // It has an inverse: it is one.
            whitener.solve_lower_triangular_mut(&mut own);
        }
    }

    /// The covariance of a measured deflection and its rotation (m^2, m rad, rad^2), whatever repeats it.
    pub(super) fn extended_covariance(
        &self,
        model: &mut PlannedReadings<'_>,
        measurement: &Measurement,
    ) -> Matrix6<f64> {
        model.read_along(measurement.direction.as_ref());
        model.move_to(measurement.configuration_rad.as_slice());
        model.covariance_of_all(&measurement.load) + self.noise(measurement)
    }

    /// That of the instrument alone.
    pub(super) fn noise(&self, measurement: &Measurement) -> Matrix6<f64> {
        self.shared_noise(measurement, measurement)
    }

    /// What the covariance of two readings by the instrument would be, were all their noise the same. Of readings with deviations of
    /// their own, the unloaded one has a part of each: the readings' correlation is that part.
    fn shared_noise(&self, one: &Measurement, other: &Measurement) -> Matrix6<f64> {
        let rotation = |each: &Measurement| {
            (each.rotation).map_or_else(Vector3::zeros, |rotation| rotation.sigma_rad)
        };
        let p = self.sigma(one).component_mul(&self.sigma(other));
        let r = rotation(one).component_mul(&rotation(other));
        Matrix6::from_diagonal(&Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z))
    }

    /// Measurements of one configuration, two or more, where they share something; else none.
    fn sharing(&self, extended: &Extended) -> Vec<SharingMeasurements> {
        if !extended.is_shared_by_configuration() {
            return Vec::new();
        }
        let firsts: Vec<usize> = self.first_rows().collect();
        let mut groups = by_configuration(self.measurements);
        groups.retain(|members| members.len() > 1);
        (groups.into_iter())
            .map(|members| {
                let rows = members.iter().flat_map(|&index| {
                    let first = firsts[index];
                    first..first + rows_of(&self.measurements[index])
                });
                SharingMeasurements {
                    rows: rows.collect(),
                    members,
                }
            })
            .collect()
    }

    /// For each measurement whether it is of a group.
    fn shares(&self, groups: &[SharingMeasurements]) -> Vec<bool> {
        let mut shares = vec![false; self.measurements.len()];
        for &member in groups.iter().flat_map(|group| &group.members) {
            shares[member] = true;
        }
        shares
    }

    /// L for the covariance L L^T of all readings of a group (m): what each reads on the diagonal, and what two of them share
    /// beside it.
    fn shared_factor(
        &self,
        model: &mut PlannedReadings<'_>,
        group: &SharingMeasurements,
    ) -> DMatrix<f64> {
        let first = &self.measurements[group.members[0]];
        model.move_to(first.configuration_rad.as_slice());
        let part = model.unloaded().shared_part();
        let mut covariance = DMatrix::zeros(group.rows.len(), group.rows.len());
        let mut at = 0;
        for (place, &one) in group.members.iter().enumerate() {
            let rows = rows_of(&self.measurements[one]);
            let mut beside = 0;
            for (other_place, &other) in group.members.iter().enumerate() {
                let columns = rows_of(&self.measurements[other]);
                let [own, another] = [one, other].map(|index| &self.measurements[index]);
                let mut block = model.covariance_shared([&own.load, &another.load]);
                if place == other_place {
                    let new = model.covariance_of_all(&own.load) - block;
                    block += new + self.noise(own);
                } else {
                    block += self.shared_noise(own, another) * part;
                }
                let mut entries = covariance.view_mut((at, beside), (rows, columns));
                entries.copy_from(&block.view((0, 0), (rows, columns)));
                beside += columns;
            }
            at += rows;
        }
        let typical = covariance.diagonal().map(f64::sqrt);
        let factor = covariance.cholesky().map(|factor| factor.l());
        factor.unwrap_or_else(|| DMatrix::from_diagonal(&typical))
    }
}

/// Measurements of one configuration, and their rows.
struct SharingMeasurements {
    members: Vec<usize>,
    rows: Vec<usize>,
}
