//! Virtual readings of a plan of absolute readings: what an instrument would write down in a run, a row for each reading.

use std::f64::consts::FRAC_1_SQRT_2;

use nalgebra::{
    Isometry3, Matrix6, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3,
    Vector6,
};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use thiserror::Error;

use crate::experiment::{Candidate, Experiment};
use crate::measurement::AbsoluteReading;
use crate::mujoco::ModelError;
use crate::numeric::random::normal::{LANES, fill_normals};
use crate::numeric::random::streams::{FRAMES, Stream, frames_of_trial};
use crate::numeric::random::{draws, generator};
use crate::plan::absolute::AbsolutePlanning;
use crate::robot::{EquilibriumError, Load};
use crate::task::{Task, station_named};
use crate::testbed::{ReadRobots, SeenFrom, Truth, compliances_of_run};

/// The instrument is within such a cube about the robot (m).
const AWAY_M: f64 = 3.0;

/// Why there are no readings.
#[derive(Debug, Error)]
pub enum VirtualReadingError {
    /// The virtual robot lacks something.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// It does not rest.
    #[error("line {line}: {error}")]
    Rest {
        /// The line of the plan.
        line: usize,
        /// Why it does not.
        error: EquilibriumError,
    },
}

/// All readings of a plan in a run under a seed, each with the instrument's own covariance: the robot differs in what the scenario lists
/// as uncertain, the instrument's frames are anywhere, and each reading has noise. The first readings do not depend on how many follow.
///
/// # Errors
/// The virtual robot lacks what is read, or does not rest.
pub fn virtual_readings(
    task: &Task,
    truth: &Truth,
    planning: &AbsolutePlanning<'_>,
    [seed, run]: [u64; 2],
) -> Result<Vec<AbsoluteReading>, VirtualReadingError> {
    let belief = &task.belief;
    let plan = planning.readings(&planning.whole());
    let own_tool = &belief.calibration_tool.name;
    let target_of = |row: &Candidate| row.target.clone().unwrap_or_else(|| own_tool.clone());
    let targets: Vec<String> = plan.iter().map(|(row, _)| target_of(row)).collect();
    let count = plan.iter().map(|&(_, times)| times as usize).sum();
    let mut robots = ReadRobots::new(belief, truth, targets.iter().map(String::as_str))?;
    robots.become_run_of(&compliances_of_run(truth, seed, run), count, [seed, run])?;
    let frames = frames_of_run(planning.stations().len(), [seed, run]);
    let mut noise = vec![[0.0; LANES]; 6 * count];
    fill_normals(Stream::Noise, seed, run, &mut noise);
    // One of the two readings that make a deflection.
    let sigma_m = FRAC_1_SQRT_2 * belief.instrument.sigma_m;
    let sigma_rad = belief
        .instrument
        .rotation_sigma_rad
        .map(|sigma| FRAC_1_SQRT_2 * sigma);
    let [m, rad] = [sigma_m, sigma_rad.unwrap_or(0.0)].map(|sigma| sigma * sigma);
    let covariance = Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
    let mut readings: Vec<AbsoluteReading> = Vec::with_capacity(count);
    for (&(row, times), target) in plan.iter().zip(targets) {
        let experiment = Experiment {
            configuration_rad: row.configuration_rad.clone(),
            load: row.load.unwrap_or(Load::NONE),
            repeats: 1,
            approach: row.approach.clone(),
        };
        let station = station_named(&task.stations, row.station.as_deref());
        let seen = SeenFrom {
            target: &target,
            station_m: station.map(|station| station.position_m),
        };
        let named = |name: &Option<String>| *name == row.station;
        let place = planning.stations().iter().position(named);
        let frame = place.map_or_else(Isometry3::identity, |place| frames[place]);
        let first = readings.len();
        for own in first..first + times as usize {
            let (at_m, axes) = (robots.read(&experiment, seen, [own, first])).map_err(|error| {
                VirtualReadingError::Rest {
                    line: row.line,
                    error,
                }
            })?;
            let off = |from: usize| Vector3::from_fn(|axis, _| noise[6 * own + from + axis][0]);
            let turned = |sigma: f64| {
                let axes =
                    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
                UnitQuaternion::new(off(3) * sigma) * frame.rotation * axes
            };
            readings.push(AbsoluteReading {
                configuration_rad: row.configuration_rad.clone(),
                load: experiment.load,
                target: Some(target.clone()),
                station: row.station.clone(),
                state: None,
                position_m: (frame * Point3::from(at_m)).coords + off(0) * sigma_m,
                rotation: sigma_rad.map(turned),
                covariance: Some(covariance),
                approach: row.approach.clone(),
                time_s: None,
                temperature_c: None,
            });
        }
    }
    Ok(readings)
}

/// The frame of each station in a run: anywhere about the robot.
fn frames_of_run(stations: usize, [seed, run]: [u64; 2]) -> Vec<Isometry3<f64>> {
    let mut random = generator(seed, frames_of_trial(run));
    let mut anywhere = || {
        let [x, y, z] = [(); 3].map(|()| AWAY_M * (2.0 * random.random::<f64>() - 1.0));
        let [w, i, j, k] = [(); 4].map(|()| StandardNormal.sample(&mut random));
        [x, y, z, w, i, j, k]
    };
    let mut numbers: Vec<f64> = (0..stations).flat_map(|_| anywhere()).collect();
    draws::pass(FRAMES, [seed, run], &mut numbers);
    let frame = |&[x, y, z, w, i, j, k]: &[f64; 7]| {
        let turned = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        Isometry3::from_parts(Translation3::new(x, y, z), turned)
    };
    numbers.as_chunks().0.iter().map(frame).collect()
}
