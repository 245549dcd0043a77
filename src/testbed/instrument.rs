//! The instrument: displacements with its noise become measurements.

use nalgebra::Vector3;

use super::virtual_robot::{MeasurementError, VirtualRobot};
use crate::experiment::Plan;
use crate::measurement::{Measurement, RotationMeasurement};
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::task::Instrument;

impl VirtualRobot {
    /// Measures every experiment of a plan as often as it says, with the noise of run `run` under
    /// `seed`, see [`add_noise`].
    ///
    /// # Errors
    /// The first experiment that has no stable equilibrium.
    pub fn measure(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
        seed: u64,
        run: u64,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let mut measurements = self.measure_noise_free(plan, instrument)?;
        add_noise_of(&mut measurements, instrument, seed, run);
        Ok(measurements)
    }

    /// The same without noise.
    ///
    /// # Errors
    /// The first experiment that has no stable equilibrium.
    pub fn measure_noise_free(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let mut measurements = Vec::new();
        for (index, experiment) in plan.experiments.iter().enumerate() {
            let displacement = self.displacement(index + 1, experiment)?;
            let measurement = Measurement {
                configuration_rad: experiment.configuration_rad.clone(),
                load: experiment.load,
                deflection_m: displacement.position_m,
                sigma_m: None,
                rotation: instrument
                    .rotation_sigma_rad
                    .map(|sigma| RotationMeasurement {
                        vector_rad: displacement.rotation_rad,
                        sigma_rad: Vector3::repeat(sigma),
                    }),
                approach: experiment.approach.clone(),
            };
            measurements.extend(std::iter::repeat_n(
                measurement,
                experiment.repeats as usize,
            ));
        }
        Ok(measurements)
    }
}

/// How many random numbers so many measurements take.
#[must_use]
pub fn numbers(instrument: &Instrument, measurements: usize) -> usize {
    let rotations = instrument.rotation_sigma_rad.is_some();
    measurements * if rotations { 6 } else { 3 }
}

/// Adds the instrument's noise of run `run` under a seed to measurements, see [`add_noise`].
pub fn add_noise_of(
    measurements: &mut [Measurement],
    instrument: &Instrument,
    seed: u64,
    run: u64,
) {
    let mut normals = vec![[0.0; LANES]; numbers(instrument, measurements.len())];
    fill_normals(Stream::Noise, seed, run, &mut normals);
    add_noise(measurements, instrument, &normals, 0);
}

/// Adds the instrument's noise to measurements (eq. 10): independent and normal for every coordinate. The
/// first numbers of a lane are those of the deflections, the next those of the rotations.
pub fn add_noise(
    measurements: &mut [Measurement],
    instrument: &Instrument,
    normals: &[[f64; LANES]],
    lane: usize,
) {
    let count = measurements.len();
    let noise = |index: usize| Vector3::from_fn(|axis, _| normals[3 * index + axis][lane]);
    for (index, each) in measurements.iter_mut().enumerate() {
        each.deflection_m += noise(index) * instrument.sigma_m;
        if let Some(rotation) = &mut each.rotation {
            rotation.vector_rad += noise(count + index).component_mul(&rotation.sigma_rad);
        }
    }
}
