//! Errors of readings besides the instrument's own noise: how each source moves a target, to first order at the commanded angles, and
//! those of an absolute reading by level.
//!
//! With the columns `J_j`, `z_j` of the target's Jacobian (those of the arm with its springs) and compliances k, an error of a joint
//! moves the target along its column, and a load that is off by (dF, dT) at the target by the sum of `k_j` `J_j` (`J_j` . dF + `z_j` . dT).
//! Readings that share an error share its random numbers, each by columns of its own: targets of one visit are moved together.

use nalgebra::{Matrix3, Matrix6, Matrix6x3, Matrix6xX, UnitQuaternion, Vector3, Vector6};

use super::compliances::BareArm;
use super::shown::ShownRows;
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
    /// Which of these are new each time that a load is hung.
    pub of_load: Vec<usize>,
    /// The same of what each configuration has, whatever the load and however often (6 x c).
    pub configuration: Matrix6xX<f64>,
}

/// What repeats of a length share of its rounding.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SharedRounding {
    /// Its variance (m^2); nothing where they share none.
    pub variance_m2: f64,
    /// Which of the effects of its configuration it is, among those of all its lengths that have such;
    pub column: usize,
    /// how many these are.
    pub columns: usize,
}

impl ReadingErrors {
    /// None.
    pub fn none() -> Self {
        Self {
            reading: Matrix6::zeros(),
            visit: Matrix6xX::zeros(0),
            of_load: Vec::new(),
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
        let (mut visit, mut of_load, mut configuration) = (Vec::new(), Vec::new(), Vec::new());
        for source in sources {
            let share: f64 = if source.is_of_both_readings() {
                HALF
            } else {
                1.0
            };
            let mut add = |effect: Vector6<f64>| {
                let effect = effect * share.sqrt();
                match source.level() {
                    SourceLevel::Reading => reading += effect * effect.transpose(),
                    SourceLevel::Visit => {
                        of_load.extend(source.is_of_load().then_some(visit.len()));
                        visit.push(effect);
                    }
                    _ => configuration.push(effect),
                }
            };
            let seen_at = [&state, &seen];
            for_each_effect(source, arm, seen_at, (load, &lever), station_m, &mut add);
        }
        let together = |columns: &[Vector6<f64>]| {
            Matrix6xX::from_fn(columns.len(), |row, column| columns[column][row])
        };
        Self {
            reading,
            visit: together(&visit),
            of_load,
            configuration: together(&configuration),
        }
    }

    /// The same where one visit may hang so many loads, and the reading is under one of them, from 1, or under none (0): what is new each time
    /// that a load is hung has effects of its own for each.
    pub fn under(self, [load, loads]: [usize; 2]) -> Self {
        let (known, own) = (self.visit.ncols(), self.of_load.len());
        let others = loads.saturating_sub(1);
        let mut visit = self.visit.resize_horizontally(known + others * own, 0.0);
        if let Some(before) = load.checked_sub(2) {
            for (place, &column) in self.of_load.iter().enumerate() {
                visit.swap_columns(column, known + before * own + place);
            }
        }
        Self { visit, ..self }
    }

    /// The same of what they move along a direction (unit vector, base frame), which is then the first row.
    pub fn along(mut self, direction: &Vector3<f64>) -> Self {
        let own = self.reading.fixed_view::<3, 3>(0, 0);
        let variance = direction.dot(&(own * direction));
        self.reading = Matrix6::zeros();
        self.reading[(0, 0)] = variance;
        let shown = ShownRows::Along(*direction);
        shown.of_derivatives(&mut self.visit);
        shown.of_derivatives(&mut self.configuration);
        self
    }

    /// The same in axes that are turned so from the base's: an instrument's.
    pub fn turned(&self, by: &UnitQuaternion<f64>) -> Self {
        Self {
            reading: turned_covariance(&self.reading, by),
            visit: turned_columns(&self.visit, by),
            of_load: self.of_load.clone(),
            configuration: turned_columns(&self.configuration, by),
        }
    }

    /// In how much (m^2) repeats of a length differ, without its own noise.
    pub fn spread_of_repeats(&self) -> f64 {
        self.reading[(0, 0)] + self.visit.row(0).norm_squared()
    }

    /// The same of a length whose instrument's noise, rounding among it, is counted apart: what repeats share of rounding is no longer new
    /// in each of them but its configuration's.
    pub fn rounded(mut self, rounding: &SharedRounding) -> Self {
        let known = self.configuration.ncols();
        let mut columns = self
            .configuration
            .resize_horizontally(known + rounding.columns, 0.0);
        if rounding.variance_m2 > 0.0 {
            self.reading[(0, 0)] -= rounding.variance_m2;
            columns[(0, known + rounding.column)] = rounding.variance_m2.sqrt();
        }
        self.configuration = columns;
        self
    }

    /// The same where no other reading shares any: all is new in it.
    pub fn alone(&self) -> Self {
        Self {
            reading: self.covariance(),
            ..Self::none()
        }
    }

    /// How one standard deviation of each effect moves the mean of so many repeats in one of several visits of a configuration: those of
    /// the configuration, then those of each visit.
    pub fn effects(&self, [visit, visits]: [usize; 2], times: u32) -> Matrix6xX<f64> {
        let (kept, own) = (self.configuration.ncols(), self.visit.ncols());
        let mut effects = Matrix6xX::zeros(kept + visits * own);
        effects.columns_mut(0, kept).copy_from(&self.configuration);
        (effects.columns_mut(kept + visit * own, own))
            .copy_from(&(&self.visit / f64::from(times).sqrt()));
        effects
    }

    /// Whether readings of one visit, or of one configuration, share any.
    pub fn are_shared(&self) -> bool {
        self.visit.ncols() + self.configuration.ncols() > 0
    }

    /// The covariance of what other readings may share in one reading by itself (m^2, m rad, rad^2),
    pub fn effects_covariance(&self) -> Matrix6<f64> {
        let squared = |columns: &Matrix6xX<f64>| columns * columns.transpose();
        squared(&self.visit) + squared(&self.configuration)
    }

    /// and that of them all.
    pub fn covariance(&self) -> Matrix6<f64> {
        self.reading + self.effects_covariance()
    }
}

/// Columns (6 x k; m, rad) of one frame in the axes of another.
pub fn turned_columns(columns: &Matrix6xX<f64>, by: &UnitQuaternion<f64>) -> Matrix6xX<f64> {
    let axes = by.to_rotation_matrix();
    let mut turned = columns.clone();
    for (mut part, own) in turned.column_iter_mut().zip(columns.column_iter()) {
        for rows in [0, 3] {
            let moved = axes * own.fixed_rows::<3>(rows);
            part.fixed_rows_mut::<3>(rows).copy_from(&moved);
        }
    }
    turned
}

/// The same of a covariance (m^2, m rad, rad^2).
pub fn turned_covariance(covariance: &Matrix6<f64>, by: &UnitQuaternion<f64>) -> Matrix6<f64> {
    let axes: Matrix3<f64> = by.to_rotation_matrix().into_inner();
    let mut both = Matrix6::zeros();
    both.fixed_view_mut::<3, 3>(0, 0).copy_from(&axes);
    both.fixed_view_mut::<3, 3>(3, 3).copy_from(&axes);
    let turned = both * covariance * both.transpose();
    // Rounding leaves the halves apart, and a covariance has one value for both.
    (turned + turned.transpose()) / 2.0
}

/// A joint's column of the Jacobian, position above rotation.
pub(super) fn column(state: &KinematicState, joint: usize) -> Vector6<f64> {
    let [moved, turned] = [state.position_column(joint), state.rotation_column(joint)];
    Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z)
}

/// Tells how one standard deviation of each number of a source moves a target (m, rad): by joints, by a load, which acts at a place (m,
/// from the target), or by itself, read from where an instrument stands (m). The arm's geometry is that without and with the springs
/// beside the joints' own at work. Products of them are a covariance. Does not allocate.
pub(super) fn for_each_effect(
    source: &ReadingSource,
    arm: BareArm<'_>,
    [plain, seen]: [&KinematicState; 2],
    (load, lever): (&Load, &Vector3<f64>),
    station_m: Option<&Vector3<f64>>,
    tell: &mut impl FnMut(Vector6<f64>),
) {
    let (force, torque) = (&load.force_n, &load.torque_nm);
    let by_itself = |moved: &Matrix3<f64>| {
        let mut effects = Matrix6x3::zeros();
        effects.fixed_view_mut::<3, 3>(0, 0).copy_from(moved);
        effects
    };
    let mut beside = None;
    // Of what has three axes.
    let (effects, deviation) = match source {
        ReadingSource::JointRepeatability(deviations)
        | ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
            for (joint, deviation) in deviations.iter().enumerate() {
                if *deviation > 0.0 {
                    tell(column(seen, joint) * *deviation);
                }
            }
            return;
        }
        ReadingSource::LoadDirection(deviation) => {
            let turns = |moved: &Vector3<f64>, turned: &Vector3<f64>| {
                force.cross(&(moved + turned.cross(lever))) + torque.cross(turned)
            };
            (by_torques(arm, [plain, seen], turns), *deviation)
        }
        ReadingSource::LoadPoint(deviation) => {
            let shifts = |_: &Vector3<f64>, turned: &Vector3<f64>| force.cross(turned);
            (by_torques(arm, [plain, seen], shifts), *deviation)
        }
        ReadingSource::Range(noise) => {
            let apart_m = plain.tool_position - station_m.unwrap_or(&noise.from_m);
            let drawn = |axis| noise.drawn(&Vector3::ith(axis, 1.0), &apart_m);
            let moved = Matrix3::from_columns(&[0, 1, 2].map(drawn));
            (by_itself(&moved), 1.0)
        }
        ReadingSource::Discrepancy(error) => {
            (by_itself(&Matrix3::identity()), error.in_reading_m(load))
        }
        ReadingSource::GaugeDirection(deviation) => {
            let at_target = Load {
                force_n: *force,
                torque_nm: torque + lever.cross(force),
            };
            let joints = arm.compliance_rad_per_nm.iter().enumerate();
            let moved: Vector3<f64> = joints
                .map(|(joint, k)| {
                    seen.position_column(joint) * (k * plain.load_torque(joint, &at_target))
                })
                .sum();
            // Its cosine is off by t^2 of what moves along it, too.
            beside = Some(column_of(&(moved * deviation.powi(2))));
            (by_itself(&-moved.cross_matrix()), *deviation)
        }
    };
    for effect in effects.column_iter() {
        tell(effect * deviation);
    }
    if let Some(beside) = beside {
        tell(beside);
    }
}

/// A displacement (m) without a rotation.
fn column_of(moved: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(moved.x, moved.y, moved.z, 0.0, 0.0, 0.0)
}

/// How a target follows the axes of a vector, which each joint's torque follows in this way: by the joint's columns of the Jacobian.
fn by_torques(
    arm: BareArm<'_>,
    [plain, seen]: [&KinematicState; 2],
    follows: impl Fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>,
) -> Matrix6x3<f64> {
    let mut effects = Matrix6x3::zeros();
    for (joint, k) in arm.compliance_rad_per_nm.iter().enumerate() {
        let (moved, turned) = (plain.position_column(joint), plain.rotation_column(joint));
        effects += column(seen, joint) * (follows(&moved, &turned) * *k).transpose();
    }
    effects
}
