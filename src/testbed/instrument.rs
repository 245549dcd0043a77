//! The instrument: displacements with its noise become measurements.

use nalgebra::Vector3;

use super::virtual_robot::{MeasurementError, VirtualRobot};
use crate::experiment::{Experiment, Plan};
use crate::measurement::{Measurement, RotationMeasurement, by_configuration};
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::Stream;
use crate::parameter::Unloaded;
use crate::task::Instrument;

/// Two readings make a deflection: each has this share of the standard deviation of what is new in both.
pub(super) const OF_ONE_READING: f64 = std::f64::consts::FRAC_1_SQRT_2;

impl VirtualRobot {
    /// Measures every experiment of a plan as often as it says, without noise.
    pub fn measure_noise_free(
        &mut self,
        plan: &Plan,
        instrument: &Instrument,
    ) -> Result<Vec<Measurement>, MeasurementError> {
        let mut measurements = Vec::new();
        for (index, experiment) in plan.experiments.iter().enumerate() {
            let moved = self.displacement(index + 1, experiment)?;
            let shown = (moved.position_m, moved.rotation_rad);
            let measurement = measurement(experiment, instrument, shown);
            measurements.extend(std::iter::repeat_n(
                measurement,
                experiment.repeats as usize,
            ));
        }
        Ok(measurements)
    }
}

/// A plan's measurements before anything is read.
pub fn measurements_of(plan: &Plan, instrument: &Instrument) -> Vec<Measurement> {
    let nothing = (Vector3::zeros(), Vector3::zeros());
    let of_one = |each: &Experiment| {
        std::iter::repeat_n(
            measurement(each, instrument, nothing),
            each.repeats as usize,
        )
    };
    plan.experiments.iter().flat_map(of_one).collect()
}

/// A measurement of an experiment that shows this displacement (m) and rotation (rad).
pub(super) fn measurement(
    experiment: &Experiment,
    instrument: &Instrument,
    (deflection_m, vector_rad): (Vector3<f64>, Vector3<f64>),
) -> Measurement {
    let sigma = instrument.rotation_sigma_rad;
    let direction = experiment.direction;
    let beside_m = instrument.gauge.and_then(|gauge| gauge.beside_m);
    Measurement {
        configuration_rad: experiment.configuration_rad.clone(),
        load: experiment.load,
        deflection_m: direction.map_or(deflection_m, |d| d * d.dot(&deflection_m)),
        sigma_m: direction.and(beside_m).map(Vector3::repeat),
        rotation: sigma.map(|sigma| RotationMeasurement {
            vector_rad,
            sigma_rad: Vector3::repeat(sigma),
        }),
        approach: experiment.approach.clone(),
        direction,
    }
}

/// How many random numbers so many measurements take.
pub fn numbers(instrument: &Instrument, measurements: usize) -> usize {
    let rotations = instrument.rotation_sigma_rad.is_some();
    let readings = match instrument.unloaded {
        Unloaded::Own => 1,
        // The loaded one, and for each of them, if it is the first of its configuration, the unloaded one.
        Unloaded::Shared => 2,
    };
    readings * measurements * if rotations { 6 } else { 3 }
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
/// first numbers of a lane are those of the deflections, the next those of the rotations. Where deflections of one configuration
/// rest on one unloaded reading, these are the loaded ones' halves of the variance, and the next as many the unloaded ones'. Of
/// what a gauge reads counts what is along its direction, which it then rounds.
pub fn add_noise(
    measurements: &mut [Measurement],
    instrument: &Instrument,
    normals: &[[f64; LANES]],
    lane: usize,
) {
    let count = measurements.len();
    let noise = |index: usize| Vector3::from_fn(|axis, _| normals[3 * index + axis][lane]);
    let mut unloaded: Option<Vec<usize>> = None;
    if instrument.unloaded == Unloaded::Shared {
        let mut first = vec![0; count];
        for members in by_configuration(measurements) {
            for &member in &members {
                first[member] = members[0];
            }
        }
        unloaded = Some(first);
    }
    let readings = if instrument.rotation_sigma_rad.is_some() {
        2 * count
    } else {
        count
    };
    let noise = |index: usize, of_rotations: usize| match &unloaded {
        None => noise(of_rotations + index),
        Some(first) => {
            let [loaded, unloaded] = [index, readings + first[index]];
            (noise(of_rotations + loaded) - noise(of_rotations + unloaded)) * OF_ONE_READING
        }
    };
    for (index, each) in measurements.iter_mut().enumerate() {
        if let (Some(gauge), Some(direction)) = (&instrument.gauge, &each.direction) {
            each.deflection_m += noise(index, 0) * instrument.along_noise_m();
            each.deflection_m = gauge.shown(&each.deflection_m, direction);
        } else {
            each.deflection_m += noise(index, 0) * instrument.noise_m();
        }
        if let Some(rotation) = &mut each.rotation {
            rotation.vector_rad += noise(index, count).component_mul(&rotation.sigma_rad);
        }
    }
}
