//! Readings that are planned: derivatives by the observation model at nominal parameters.

use std::cell::{RefCell, RefMut};

use nalgebra::{DVector, Matrix3xX, Matrix6, Matrix6xX, Vector3, Vector6};

use super::model::ObservationModel;
use super::reading::{ReadingKind, Setup};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet, ReadingSource};
use crate::robot::{Approach, EquilibriumSolver, KinematicState, Load, made_up};

/// How far parameters are changed to see what compensation leaves, as a share of their typical size.
const PARAMETER_SHIFT: f64 = 1e-3;

/// An arm's readings at one of its tools, at nominal parameters.
#[derive(Debug, Clone)]
pub(super) struct ObservedRows<'a> {
    arm: &'a ElasticArm,
    kind: ReadingKind,
    /// What derivatives are multiplied by, one for each of the parameters that are asked for.
    sizes: Vec<f64>,
    /// Where the joints' zeros are among the model's parameters, behind those that are asked for, if gears err.
    zeros: Vec<usize>,
    /// Whether compensation rests on the commanded angles alone, see [`Self::uncompensated`].
    is_bare: bool,
    work: RefCell<ObservedRoom>,
}

#[derive(Debug, Clone)]
struct ObservedRoom {
    model: ObservationModel<'static>,
    setup: Setup,
    rows: Matrix6xX<f64>,
    /// Whether the rows are those of the setup.
    is_predicted: bool,
}

impl<'a> ObservedRows<'a> {
    /// The readings of an arm at one of its tools, which these sources disturb. Derivatives are in units of the parameters' `sizes`
    /// (p).
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        wanted: &ParameterSet,
        sizes: &[f64],
        kind: ReadingKind,
        sources: &[ReadingSource],
    ) -> Self {
        let gears_err =
            (sources.iter()).any(|source| matches!(source, ReadingSource::TransmissionError(_)));
        // Zeros are parameters of any chain.
        let zeros = (0..arm.chain.len()).map(|joint| ParameterKind::JointZero { joint });
        let with_zeros = gears_err.then(|| wanted.with_more(arm, zeros).ok());
        let (set, zeros) = with_zeros
            .flatten()
            .unwrap_or_else(|| (wanted.clone(), Vec::new()));
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        // Where joints stand off their springs by what they carry, the arm's weight counts, and with it what it carries.
        let is_laden = arm.payload.is_some()
            && (wanted.parameters().iter()).any(|each| is_by_torque(arm, each.kind));
        Self {
            arm,
            kind,
            sizes: sizes.to_vec(),
            zeros,
            is_bare: !arm.chain.elements.has_springs() && !is_laden,
            work: RefCell::new(ObservedRoom {
                rows: Matrix6xX::zeros(set.len()),
                model: ObservationModel::of(set, arm, &nominal),
                setup: Setup {
                    commanded_rad: DVector::zeros(arm.chain.len()),
                    load: Load::NONE,
                    hangs_on: None,
                    target,
                    station: 0,
                    approach: None,
                },
                is_predicted: false,
            }),
        }
    }

    /// Whether the arm has neither springs beside the joints' own nor a payload that turns joints over their gaps.
    pub const fn is_bare(&self) -> bool {
        self.is_bare
    }

    /// See [`super::PlannedReadings::come_from`].
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        let room = self.work.get_mut();
        if room.setup.approach.as_ref() != approach {
            room.setup.approach = approach.cloned();
            room.is_predicted = false;
        }
    }

    /// See [`ObservationModel::read_along`].
    pub fn read_along(&mut self, is_along: bool) {
        let room = self.work.get_mut();
        room.is_predicted &= !room.model.read_along(is_along);
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        let room = self.work.get_mut();
        room.setup.commanded_rad.copy_from_slice(q);
        room.is_predicted = false;
    }

    /// The room with the rows of the reading under a load, in the parameters' units.
    fn predicted(&self, state: &KinematicState, load: &Load) -> RefMut<'_, ObservedRoom> {
        let mut room = self.work.borrow_mut();
        if !room.is_predicted || room.setup.load != *load {
            let ObservedRoom {
                model, setup, rows, ..
            } = &mut *room;
            setup.load = *load;
            model.predict_as_planned(Some(state), setup, self.kind, rows);
            room.is_predicted = true;
        }
        room
    }

    /// Writes the derivatives of the reading (6 x p), each with respect to its parameter in its size; a reading of
    /// three rows leaves the last three to be ignored.
    pub fn derivatives(&self, state: &KinematicState, load: &Load, matrix: &mut Matrix6xX<f64>) {
        let room = self.predicted(state, load);
        for (index, size) in self.sizes.iter().enumerate() {
            matrix.set_column(index, &(room.rows.column(index) * *size));
        }
    }

    /// Tells how errors of gears of these standard deviations (rad), one for each joint, move the reading.
    pub fn for_each_gear(
        &self,
        state: &KinematicState,
        load: &Load,
        deviations: &[f64],
        tell: &mut impl FnMut(Vector6<f64>),
    ) {
        let room = self.predicted(state, load);
        for (&place, deviation) in self.zeros.iter().zip(deviations) {
            tell(room.rows.column(place) * *deviation);
        }
    }

    /// Writes the derivatives of the reading, whitened by W, 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(
        &self,
        state: &KinematicState,
        load: &Load,
        whitener: &Matrix6<f64>,
        matrix: &mut Matrix3xX<f64>,
    ) {
        let room = self.predicted(state, load);
        let count = self.sizes.len();
        if self.kind.rows() == 3 {
            let whitener = whitener.fixed_view::<3, 3>(0, 0).into_owned();
            for (index, size) in self.sizes.iter().enumerate() {
                let own = room.rows.fixed_view::<3, 1>(0, index) * *size;
                matrix.set_column(index, &(whitener * own));
            }
            return;
        }
        for (index, size) in self.sizes.iter().enumerate() {
            let white = whitener * (room.rows.column(index) * *size);
            for block in 0..self.kind.rows() / 3 {
                let three = white.fixed_rows::<3>(3 * block);
                matrix.column_mut(block * count + index).copy_from(&three);
            }
        }
    }

    /// See [`super::PlannedReadings::add_turning_load`].
    pub fn add_turning_load(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        let room = &mut *self.work.borrow_mut();
        room.setup.load = *load;
        room.is_predicted = false;
        room.rows.fill(0.0);
        room.model.add_turning_load(&room.setup, &mut room.rows);
        for (index, size) in self.sizes.iter().enumerate() {
            let mut column = matrix.column_mut(index);
            column += room.rows.fixed_view::<3, 1>(0, index) * *size;
        }
    }

    /// See [`super::PlannedReadings::uncompensated`]. Of a bare arm the model has it at the commanded angles. Else the robot is
    /// commanded q = `q_0` - k tau with the torques tau of the load where it rests without it, so that a parameter leaves
    /// J~ d(k tau) at the loaded tool, J~ that of the arm with its springs.
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        let room = &mut *self.work.borrow_mut();
        room.setup.load = *load;
        if self.is_bare {
            room.is_predicted = false;
            room.model.uncompensated(&room.setup, &mut room.rows);
            for (index, size) in self.sizes.iter().enumerate() {
                let left = room.rows.fixed_view::<3, 1>(0, index);
                matrix.set_column(index, &(left * *size));
            }
            return;
        }
        let (setup, set) = (&room.setup, room.model.set());
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        let standing = DVector::zeros(setup.commanded_rad.len());
        let compensated = |values: &[f64], load: &Load, back: &DVector<f64>| {
            compensated(&set.apply(self.arm, values), setup, load, back)
        };
        let (nominally, state) = compensated(&nominal, load, &standing);
        let state = state.braced(&self.arm.compliance_rad_per_nm);
        // What makes up for passive joints is commanded, whatever the parameters.
        let made_up = made_up(&self.arm.chain, &state.jacobian(), nominally.as_slice());
        let made_up = made_up.unwrap_or_else(|| standing.clone());
        let back = &nominally - &made_up;
        let seen = |angles: &DVector<f64>| -> Vector3<f64> {
            let joints = angles.iter().enumerate();
            joints
                .map(|(joint, angle)| state.position_column(joint) * *angle)
                .sum()
        };
        for (index, size) in self.sizes.iter().enumerate() {
            let parameter = &set.parameters()[index];
            let left = match parameter.kind {
                ParameterKind::TaskScale => seen(&nominally),
                ParameterKind::TaskForce { axis } => {
                    let newton = Load {
                        force_n: Vector3::ith(axis.index(), 1.0),
                        torque_nm: Vector3::zeros(),
                    };
                    seen(&compensated(&nominal, &newton, &standing).0)
                }
                _ => {
                    let shift = PARAMETER_SHIFT * parameter.scale;
                    let at = |shift: f64| {
                        let mut values = nominal.clone();
                        values[index] += shift;
                        let (own, state) = compensated(&values, load, &back);
                        let compliance = set.apply(self.arm, &values).compliance_rad_per_nm;
                        let kept = state.braced(&compliance).jacobian() * &made_up;
                        (own, kept.fixed_rows::<3>(0).into_owned())
                    };
                    let [(own, kept), (before, kept_before)] = [at(shift), at(-shift)];
                    seen(&((own - before) / (2.0 * shift))) + (kept - kept_before) / (2.0 * shift)
                }
            };
            matrix.set_column(index, &(left * *size));
        }
    }
}

/// The joints' own deflections (rad, m) of an arm that are compensated under a load, and the arm's geometry where it rests without the
/// load. The joints are commanded back by so much (rad, m), where their gears err by more or less.
fn compensated(
    arm: &ElasticArm,
    setup: &Setup,
    load: &Load,
    back: &DVector<f64>,
) -> (DVector<f64>, KinematicState) {
    let q = setup.commanded_rad.as_slice();
    let chain = arm.loaded_chain();
    let mut at_tool = chain.at(&arm.tools[setup.target]);
    // A gap that the load crosses is compensated, too.
    let offsets = |load: &Load| arm.offsets_rad(q, setup.target, load, setup.approach.as_ref());
    let (without, with) = (offsets(&Load::NONE), offsets(load));
    let commanded: Vec<f64> = (q.iter().zip(&without))
        .map(|(q, offset)| q + offset)
        .collect();
    let compliance = &arm.compliance_rad_per_nm;
    let mut solver = EquilibriumSolver::new(chain.len());
    let rests = solver.solve(&mut at_tool, compliance, &commanded, &Load::NONE);
    let state = if rests.is_ok() {
        solver.state().clone()
    } else {
        at_tool.state(&commanded)
    };
    let gear = |joint: usize| {
        arm.transmission_error_rad(joint, q[joint] - back[joint])
            - arm.transmission_error_rad(joint, q[joint])
    };
    let angle = |joint: usize, _| {
        compliance[joint] * state.load_torque(joint, load)
            + (with[joint] - without[joint])
            + gear(joint)
    };
    (DVector::from_fn(chain.len(), angle), state)
}

/// Whether a parameter is of a joint that stands off its spring by what it carries.
pub(super) fn is_by_torque(arm: &ElasticArm, kind: ParameterKind) -> bool {
    match kind {
        ParameterKind::JointStiffening { .. } => true,
        kind => kind.is_turned_over(arm),
    }
}
