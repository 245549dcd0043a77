//! The same robot simulated in time until it rests: MuJoCo's dynamics as reference for the static equilibria.

use nalgebra::{DVector, Vector3};
use thiserror::Error;

use crate::mujoco::{ModelError, State};
use crate::robot::{Load, TrueRobot};

/// The robot rests when no joint moves faster than this (rad/s); damping then leaves less than
/// 1e-10 m to go.
const REST_RAD_S: f64 = 1e-11;
/// A robot with constraints, which MuJoCo solves to a tolerance, may never be as slow as that: it rests
/// where no coordinate has moved by more than this (rad, m) ...
const STILL: f64 = 5e-11;
/// ... in this time (s).
const WINDOW_S: f64 = 0.25;
/// How fast a robot with closed loops is driven to its commands (rad/s, m/s).
const DRIVEN_RAD_S: f64 = 1.0;
/// Simulated time after which a robot that still moves will not rest (s).
const LONGEST_S: f64 = 60.0;

/// A robot that has come to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// The angles of the belief's joints (rad).
    pub q_rad: Vec<f64>,
    /// The tool's position in the world frame (m).
    pub tool_position_m: nalgebra::Vector3<f64>,
    /// The number of time steps.
    pub steps: usize,
}

/// Why a robot does not settle.
#[derive(Debug, Error)]
pub enum SettleError {
    /// The model cannot be simulated with these compliances.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The robot still moves.
    #[error("the robot still moves at {speed_rad_s:.1e} rad/s after {time_s} s of simulated time")]
    StillMoving {
        /// The fastest joint's speed (rad/s).
        speed_rad_s: f64,
        /// The simulated time (s).
        time_s: f64,
    },
}

/// Simulates the robot in time from rest at the commanded angles (rad) under gravity and a load at
/// the named site, until it rests. Contacts and joint limits are switched off, as in the static
/// equilibrium: elastic joints alone carry the arm. A robot with closed loops starts where the file draws
/// it, and is driven to its commands before it is loaded.
///
/// # Errors
/// A joint has no position actuator, the model has no such site, the load cannot be applied, or the
/// robot does not settle.
pub fn settle(
    robot: &TrueRobot,
    site: &str,
    commanded_rad: &DVector<f64>,
    load: &Load,
) -> Result<Settled, SettleError> {
    let (joints, compliance) = robot.present(&robot.compliance_rad_per_nm);
    let (_, commanded) = robot.present(commanded_rad.as_slice());
    let model = robot
        .model
        .without_contacts_and_limits()
        .with_joint_compliance(&joints, &compliance)?
        .with_heavy_locked_joints();
    let site = model.site(site)?;
    let mut state = State::new(&model);
    state.set_torque_laws(&robot.laws_by_joint());
    let mut start = model.start_coordinates();
    let mut steps = 0_usize;
    if model.has_equalities() {
        steps += drive(&mut state, &joints, site, &commanded)?;
    } else {
        for (&joint, &value) in joints.iter().zip(&commanded) {
            start[model.coordinate_of_joint(joint)] = value;
        }
        state.set_coordinates(&start);
        state.command_joints(&joints, &commanded);
    }
    let first = steps;
    let longest = (LONGEST_S / model.time_step_s()).ceil();
    let window = (WINDOW_S / model.time_step_s()).ceil();
    let mut next_look = window;
    let mut before = state.coordinates().0.to_vec();
    loop {
        state.step_with_wrench(site, &load.force_n, &load.torque_nm)?;
        steps += 1;
        let (q, speeds) = state.coordinates();
        let speed_rad_s = speeds.iter().map(|speed| speed.abs()).fold(0.0, f64::max);
        let mut rests = speed_rad_s < REST_RAD_S && steps > first + 10;
        if model.has_equalities() && (steps - first) as f64 >= next_look {
            next_look += window;
            let moved = q.iter().zip(&before).map(|(q, before)| (q - before).abs());
            rests |= moved.fold(0.0, f64::max) < STILL;
            before.copy_from_slice(q);
        }
        if rests {
            let coordinates = q.to_vec();
            state.update_kinematics();
            let (tool_position_m, _) = state.site(site);
            return Ok(Settled {
                q_rad: joints
                    .iter()
                    .map(|&joint| coordinates[model.coordinate_of_joint(joint)])
                    .collect(),
                tool_position_m,
                steps,
            });
        }
        let done = (steps - first) as f64 >= longest;
        if done || speed_rad_s.is_nan() {
            return Err(SettleError::StillMoving {
                speed_rad_s,
                time_s: LONGEST_S,
            });
        }
    }
}

/// Drives the unloaded robot from where the file draws it to its commands, and returns the number of
/// time steps.
fn drive(
    state: &mut State,
    joints: &[usize],
    site: usize,
    commanded: &[f64],
) -> Result<usize, ModelError> {
    let model = state.model().clone();
    let reference = model.start_coordinates();
    state.set_coordinates(&reference);
    let from: Vec<f64> = (joints.iter())
        .map(|&joint| reference[model.coordinate_of_joint(joint)])
        .collect();
    let way = from.iter().zip(commanded);
    let way = way.map(|(from, to)| (to - from).abs()).fold(0.0, f64::max);
    let steps = (way / DRIVEN_RAD_S / model.time_step_s()).ceil().max(1.0);
    let mut step = 0_usize;
    while (step as f64) < steps {
        step += 1;
        let share = step as f64 / steps;
        let between: Vec<f64> = (from.iter().zip(commanded))
            .map(|(from, to)| from + share * (to - from))
            .collect();
        state.command_joints(joints, &between);
        state.step_with_wrench(site, &Vector3::zeros(), &Vector3::zeros())?;
    }
    Ok(step)
}
