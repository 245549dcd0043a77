//! What disturbs an absolute reading besides the instrument's own noise, to first order at the commanded angles.
//!
//! With the columns `J_j`, `z_j` of the target's Jacobian (those of the arm with its springs) and compliances k, an error of a joint
//! moves the target along its column, and a load that is off by (dF, dT) at the target by the sum of `k_j` `J_j` (`J_j` . dF + `z_j` . dT).

use nalgebra::{Matrix6, Vector3, Vector6};

use super::braced::BareArm;
use super::reading::of_positions;
use crate::parameter::ReadingSource;
use crate::robot::{KinematicState, Kinematics, Load, Tool};

/// Of what makes a deflection's error, a reading has so much: two of them make one.
const HALF: f64 = 0.5;

/// The covariance of a reading's errors besides the instrument's noise (m^2, m rad, rad^2), in the robot's base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AbsoluteErrors {
    /// What is new in each reading.
    pub own: Matrix6<f64>,
    /// What all readings of one stand share.
    pub shared: Matrix6<f64>,
}

impl AbsoluteErrors {
    /// None.
    pub const NONE: Self = Self {
        own: Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6])),
        shared: Matrix6::from_array_storage(nalgebra::ArrayStorage([[0.0; 6]; 6])),
    };

    /// Of what is uncertain where an arm's tool is read: at the angles `q` (rad), under a load at the tool that carries it, from
    /// where the instrument stands (m, in the base frame), where that is known.
    ///
    /// Joints that return, and the instrument's range, are told of deflections: each of the two readings has half the variance.
    /// Errors of gears and discrepancy are those of a stand, whole.
    pub fn new<'a>(
        arm: BareArm<'_>,
        q: &[f64],
        (carrier, load): (&Tool, &Load),
        station_m: Option<&Vector3<f64>>,
        sources: impl IntoIterator<Item = &'a ReadingSource>,
    ) -> Self {
        let mut state = KinematicState::new(arm.chain.len());
        arm.chain.at(carrier).update(q, &mut state);
        let carried_m = state.tool_position;
        arm.chain.at(arm.tool).update(q, &mut state);
        let lever = carried_m - state.tool_position;
        let plain = state.clone();
        let seen = state.braced(arm.compliance_rad_per_nm);
        let column = |joint: usize| -> Vector6<f64> {
            let [moved, turned] = [seen.position_column(joint), seen.rotation_column(joint)];
            Vector6::from_fn(|row, _| if row < 3 { moved[row] } else { turned[row - 3] })
        };
        let of_joints = |deviations: &[f64], share: f64| -> Matrix6<f64> {
            (deviations.iter().enumerate())
                .map(|(joint, deviation)| {
                    let moved = column(joint);
                    moved * moved.transpose() * (deviation * deviation * share)
                })
                .sum()
        };
        let of_loads = |deviation: f64, change: &dyn Fn(&Vector3<f64>) -> Load| -> Matrix6<f64> {
            (0..3)
                .map(|axis| {
                    let off = change(&Vector3::ith(axis, deviation));
                    let moved: Vector6<f64> = (arm.compliance_rad_per_nm.iter().enumerate())
                        .map(|(joint, k)| column(joint) * (k * plain.load_torque(joint, &off)))
                        .sum();
                    moved * moved.transpose()
                })
                .sum()
        };
        let at_target = |force_n: Vector3<f64>, torque_nm: Vector3<f64>| Load {
            force_n,
            torque_nm: torque_nm + lever.cross(&force_n),
        };
        let mut errors = Self::NONE;
        for source in sources {
            match source {
                ReadingSource::JointRepeatability(deviations) => {
                    errors.own += of_joints(deviations, HALF);
                }
                ReadingSource::TransmissionError(deviations) => {
                    errors.shared += of_joints(deviations, 1.0);
                }
                ReadingSource::LoadDirection(deviation) => {
                    errors.own += of_loads(*deviation, &|turn| {
                        at_target(turn.cross(&load.force_n), turn.cross(&load.torque_nm))
                    });
                }
                ReadingSource::LoadPoint(deviation) => {
                    errors.own += of_loads(*deviation, &|shift| {
                        at_target(Vector3::zeros(), shift.cross(&load.force_n))
                    });
                }
                ReadingSource::Range(noise) => {
                    let apart = plain.tool_position - station_m.unwrap_or(&noise.from_m);
                    errors.own += of_positions(&(noise.covariance(&apart) * HALF));
                }
                ReadingSource::Discrepancy(_) => {
                    let own = source.covariance_of_positions(&plain.tool_position);
                    errors.shared += own.as_ref().map_or_else(Matrix6::zeros, of_positions);
                }
            }
        }
        errors
    }

    /// Whether there are none that the readings of one stand share.
    pub fn is_new_each_time(&self) -> bool {
        self.shared.amax() == 0.0
    }

    /// The covariance of the mean of so many readings of one stand, with the instrument's own of each.
    pub fn of_mean(&self, instrument: &Matrix6<f64>, readings: u32) -> Matrix6<f64> {
        self.shared + (instrument + self.own) / f64::from(readings.max(1))
    }
}
