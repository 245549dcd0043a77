//! The same robot simulated in time until it rests: MuJoCo's dynamics judge the static equilibria.

use nalgebra::DVector;
use thiserror::Error;

use crate::mujoco::{ModelError, State};
use crate::robot::Load;
use crate::scenario::Robot;

/// The robot rests when no joint moves faster than this (rad/s); damping then leaves less than
/// 1e-10 m to go.
const REST_RAD_S: f64 = 1e-11;
/// Simulated time after which a robot that still moves will not rest (s).
const LONGEST_S: f64 = 60.0;

/// A robot that has come to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// The joint angles (rad).
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
/// equilibrium: elastic joints alone carry the arm.
///
/// # Errors
/// A joint has no position actuator, the model has no such site, the load cannot be applied, or the
/// robot does not settle.
pub fn settle(
    robot: &Robot,
    site: &str,
    commanded_rad: &DVector<f64>,
    load: &Load,
) -> Result<Settled, SettleError> {
    let model = robot
        .model
        .without_contacts_and_limits()
        .with_joint_compliance(&robot.compliance_rad_per_nm)?;
    let site = model.site(site)?;
    let mut state = State::new(&model);
    state.rest_at(commanded_rad.as_slice());
    state.command(commanded_rad.as_slice());
    let longest = (LONGEST_S / model.time_step_s()).ceil();
    let mut steps = 0_usize;
    loop {
        state.step_with_wrench(site, &load.force_n, &load.torque_nm)?;
        steps += 1;
        let (q, speeds) = state.coordinates();
        let speed_rad_s = speeds.iter().map(|speed| speed.abs()).fold(0.0, f64::max);
        if speed_rad_s < REST_RAD_S && steps > 10 {
            let q_rad = q.to_vec();
            state.move_to(&q_rad);
            let (tool_position_m, _) = state.site(site);
            return Ok(Settled {
                q_rad,
                tool_position_m,
                steps,
            });
        }
        let done = steps as f64 >= longest;
        if done || speed_rad_s.is_nan() {
            return Err(SettleError::StillMoving {
                speed_rad_s,
                time_s: LONGEST_S,
            });
        }
    }
}
