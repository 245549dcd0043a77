//! Errors of readings besides the instrument's own noise: how each source moves a target, to first order at the commanded angles, and
//! those of an absolute reading by level.
//!
//! With the columns `J_j`, `z_j` of the target's Jacobian (those of the arm with its springs) and compliances k, an error of a joint
//! moves the target along its column, and a load that is off by (dF, dT) at the target by the sum of `k_j` `J_j` (`J_j` . dF + `z_j` . dT).
//! Readings that share an error share its random numbers, each by columns of its own: targets of one visit are moved together.

use nalgebra::{Matrix6, Matrix6xX, Vector3, Vector6};

use super::compliances::BareArm;
use crate::parameter::{ReadingSource, SourceLevel, TransmissionError};
use crate::robot::{KinematicState, Kinematics, Load, Tool};

/// Of what makes a deflection's error, a reading has so much: two of them make one.
const HALF: f64 = 0.5;

/// The errors of a reading besides the instrument's noise (m, rad), in the robot's base frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadingErrors {
    /// What is new in each reading: its covariance (m^2, m rad, rad^2).
    pub reading: Matrix6<f64>,
    /// What is new at each visit: how one standard deviation of each random effect moves the target (6 x v).
    pub visit: Matrix6xX<f64>,
    /// The same of what each configuration has, whatever the load and however often (6 x c).
    pub configuration: Matrix6xX<f64>,
}

impl ReadingErrors {
    /// None.
    pub fn none() -> Self {
        Self {
            reading: Matrix6::zeros(),
            visit: Matrix6xX::zeros(0),
            configuration: Matrix6xX::zeros(0),
        }
    }

    /// Of what is uncertain where an arm's tool is read: at the angles `q` (rad), under a load at the tool that carries it, from
    /// where the instrument stands (m, in the base frame), where that is known.
    ///
    /// Joint repeatability and the instrument's range are given for deflections: each of the two readings has half the variance.
    /// Transmission errors and discrepancy are those of a configuration, whole.
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
        let seen = state.clone().braced(arm.compliance_rad_per_nm);
        let mut reading = Matrix6::zeros();
        let (mut visit, mut configuration) = (Vec::new(), Vec::new());
        for source in sources {
            let share: f64 = if source.is_of_both_readings() {
                HALF
            } else {
                1.0
            };
            let columns = effects(source, arm, [&state, &seen], (load, &lever), station_m);
            let columns = columns.into_iter().map(|column| column * share.sqrt());
            match source.level() {
                SourceLevel::Reading => {
                    let columns: Vec<_> = columns.collect();
                    reading += products(&columns, &columns);
                }
                SourceLevel::Visit => visit.extend(columns),
                _ => configuration.extend(columns),
            }
        }
        let together = |columns: &[Vector6<f64>]| {
            Matrix6xX::from_fn(columns.len(), |row, column| columns[column][row])
        };
        Self {
            reading,
            visit: together(&visit),
            configuration: together(&configuration),
        }
    }

    /// Whether readings of one visit, or of one configuration, share any.
    pub fn are_shared(&self) -> bool {
        self.visit.ncols() + self.configuration.ncols() > 0
    }

    /// The covariance of them all in one reading by itself (m^2, m rad, rad^2).
    pub fn covariance(&self) -> Matrix6<f64> {
        let squared = |columns: &Matrix6xX<f64>| columns * columns.transpose();
        self.reading + squared(&self.visit) + squared(&self.configuration)
    }
}

/// A joint's column of the Jacobian, position above rotation.
pub(super) fn column(state: &KinematicState, joint: usize) -> Vector6<f64> {
    let [moved, turned] = [state.position_column(joint), state.rotation_column(joint)];
    Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z)
}

/// How one standard deviation of each number of a source moves a target (m, rad): by joints, by a load, which acts at a place (m, from
/// the target), or by itself, read from where an instrument stands (m). The arm's geometry is that without and with the springs beside
/// the joints' own at work. Its products are a covariance.
pub(super) fn effects(
    source: &ReadingSource,
    arm: BareArm<'_>,
    [plain, seen]: [&KinematicState; 2],
    (load, lever): (&Load, &Vector3<f64>),
    station_m: Option<&Vector3<f64>>,
) -> Vec<Vector6<f64>> {
    let of_load = |force_n: Vector3<f64>, torque_nm: Vector3<f64>| -> Vector6<f64> {
        let off = Load {
            force_n,
            torque_nm: torque_nm + lever.cross(&force_n),
        };
        (arm.compliance_rad_per_nm.iter().enumerate())
            .map(|(joint, k)| column(seen, joint) * (k * plain.load_torque(joint, &off)))
            .sum()
    };
    let units = |size: f64| [0, 1, 2].map(|axis| Vector3::ith(axis, size));
    let by_itself = |moved: Vector3<f64>| Vector6::new(moved.x, moved.y, moved.z, 0.0, 0.0, 0.0);
    match source {
        ReadingSource::JointRepeatability(deviations)
        | ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
            let joints = deviations.iter().enumerate();
            let uncertain = joints.filter(|(_, deviation)| **deviation > 0.0);
            uncertain
                .map(|(joint, deviation)| column(seen, joint) * *deviation)
                .collect()
        }
        ReadingSource::LoadDirection(deviation) => units(*deviation)
            .map(|turn| of_load(turn.cross(&load.force_n), turn.cross(&load.torque_nm)))
            .to_vec(),
        ReadingSource::LoadPoint(deviation) => units(*deviation)
            .map(|shift| of_load(Vector3::zeros(), shift.cross(&load.force_n)))
            .to_vec(),
        ReadingSource::Range(noise) => {
            let apart_m = plain.tool_position - station_m.unwrap_or(&noise.from_m);
            let moved = |unit| by_itself(noise.drawn(&unit, &apart_m));
            units(1.0).map(moved).to_vec()
        }
        ReadingSource::Discrepancy(deviation) => units(*deviation).map(by_itself).to_vec(),
        ReadingSource::GaugeDirection(deviation) => {
            let deflection = of_load(load.force_n, load.torque_nm);
            let moved: Vector3<f64> = deflection.fixed_rows::<3>(0).into_owned();
            units(*deviation)
                .map(|turn| by_itself(turn.cross(&moved)))
                .to_vec()
        }
    }
}

/// The covariance of two readings that the same numbers move, the one's rows by the other's columns; of one with itself.
pub(super) fn products(of_one: &[Vector6<f64>], of_other: &[Vector6<f64>]) -> Matrix6<f64> {
    let pairs = of_one.iter().zip(of_other);
    pairs.map(|(one, other)| one * other.transpose()).sum()
}
