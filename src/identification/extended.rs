//! The equations where more is uncertain than the instrument's noise: a column for each unknown of the extended
//! vector, rows weighted with the whole covariance of a reading.

use nalgebra::{Matrix6, Matrix6xX, Vector3, Vector6};

use super::case::Case;
use super::equations::PredictedRows;
use crate::measurement::Measurement;
use crate::observation::{
    DeflectionPrecision, ObservationModel, PlannedReadings, Prediction, ReadingKind, Setup,
};
use crate::robot::rotation_vector;
use crate::task::Extended;

impl Case<'_> {
    /// Predictions of all measurements, by their places, at values of the unknowns.
    pub(super) fn extended_rows<E>(
        &self,
        extended: &Extended,
        values: &[f64],
        mut predict: impl FnMut(
            &mut ObservationModel<'_>,
            usize,
            &Setup,
            ReadingKind,
            &mut Matrix6xX<f64>,
        ) -> Result<Prediction, E>,
    ) -> Result<PredictedRows, E> {
        let mut model = ObservationModel::new(extended.set(), extended.arm(), values);
        let mut derivatives = Matrix6xX::zeros(values.len());
        let mut predicted = PredictedRows::new(self.rows(), values.len());
        for (index, each) in self.measurements.iter().enumerate() {
            let (setup, kind) = setup_of(each);
            let found = predict(&mut model, index, &setup, kind, &mut derivatives)?;
            predicted.push_deflection(each, &derivatives.fixed_rows::<3>(0), found.position_m);
            if each.rotation.is_some() {
                let turned = rotation_vector(&found.rotation);
                predicted.push(&derivatives.fixed_rows::<3>(3), turned);
            }
        }
        Ok(predicted)
    }

    /// The readings of these measurements as planning sees them: of rotations, too, where some are measured. The
    /// instrument's noise is the measurements' own.
    pub(super) fn readings<'e>(&self, extended: &'e Extended) -> PlannedReadings<'e> {
        let has_rotations = self.measurements.iter().any(|each| each.rotation.is_some());
        extended.readings_of_all(DeflectionPrecision {
            sigma_m: self.sigma.weight_m(),
            rotation_sigma_rad: has_rotations.then_some(1.0),
            unloaded: extended.unloaded(),
            along_sigma_m: None,
            reads_all: true,
        })
    }

    /// What the covariance of two readings by the instrument would be, were all their noise the same. Of readings with deviations of
    /// their own, the unloaded one has a part of each: the readings' correlation is that part.
    pub(super) fn shared_noise(&self, one: &Measurement, other: &Measurement) -> Matrix6<f64> {
        let rotation = |each: &Measurement| {
            (each.rotation).map_or_else(Vector3::zeros, |rotation| rotation.sigma_rad)
        };
        let p = self.sigma_of(one).component_mul(&self.sigma_of(other));
        let r = rotation(one).component_mul(&rotation(other));
        Matrix6::from_diagonal(&Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z))
    }
}

/// The covariance of the rows that two measurements have, first in their places: of what is along a direction one alone.
pub(super) fn of_rows_there(whole: &Matrix6<f64>, of: [&Measurement; 2]) -> Matrix6<f64> {
    let shown = of.map(|each| {
        each.direction.map(|direction| {
            let mut shown = Matrix6::zeros();
            shown
                .fixed_view_mut::<1, 3>(0, 0)
                .copy_from(&direction.transpose());
            shown
        })
    });
    if shown.iter().all(Option::is_none) {
        return *whole;
    }
    let [one, other] = shown.map(|shown| shown.unwrap_or_else(Matrix6::identity));
    one * whole * other.transpose()
}

/// How a measurement was set up, and what was read.
fn setup_of(measurement: &Measurement) -> (Setup, ReadingKind) {
    let setup = Setup {
        commanded_rad: measurement.configuration_rad.clone(),
        load: measurement.load,
        hangs_on: None,
        target: 0,
        station: 0,
        approach: measurement.approach.clone(),
    };
    let kind = match measurement.rotation {
        Some(_) => ReadingKind::DeflectionAndRotation,
        None => ReadingKind::Deflection,
    };
    (setup, kind)
}
