//! The instrument: displacements with its noise become measurements.

use nalgebra::Vector3;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::virtual_robot::{MeasurementError, VirtualRobot};
use crate::measurement::{Measurement, RotationMeasurement};
use crate::plan::Plan;
use crate::scenario::Instrument;

impl VirtualRobot {
    /// Measures every experiment of a plan as often as it says. The noise of every coordinate is
    /// independent and normal, with the instrument's standard deviation.
    ///
    /// # Errors
    /// The first experiment that has no stable equilibrium.
    pub fn measure(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
        noise: &mut impl Rng,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let mut measurements = self.measure_noise_free(plan, instrument)?;
        for each in &mut measurements {
            each.deflection_m += normal(noise) * instrument.sigma_m;
            if let Some(rotation) = &mut each.rotation {
                rotation.vector_rad += normal(noise).component_mul(&rotation.sigma_rad);
            }
        }
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
            };
            measurements.extend(std::iter::repeat_n(
                measurement,
                experiment.repeats as usize,
            ));
        }
        Ok(measurements)
    }
}

fn normal(noise: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(noise))
}
