//! Readings that are planned, by the observation model itself: rotations among them, and arms with springs beside the
//! joints' own, such as a gravity compensator.
//!
//! Derivatives are those of [`ObservationModel`] at nominal parameters.

use std::cell::RefCell;

use nalgebra::{Cholesky, DVector, Matrix3, Matrix3xX, Matrix6, Matrix6xX, Vector3, Vector6};

use super::braced::BareArm;
use super::model::ObservationModel;
use super::reading::{DeflectionPrecision, Setup, Whitener, of_positions};
use super::reading_errors::moved_by;
use crate::parameter::{
    ElasticArm, ParameterKind, ParameterSet, ReadingSource, TransmissionError, counted_times,
};
use crate::robot::{Approach, EquilibriumSolver, KinematicState, Kinematics, Load};

/// How far parameters are changed to see what compensation leaves, as a share of their typical size.
const PARAMETER_SHIFT: f64 = 1e-3;

/// An arm's readings at one of its tools, at nominal parameters.
#[derive(Debug, Clone)]
pub struct ObservedRows<'a> {
    arm: &'a ElasticArm,
    target: usize,
    precision: DeflectionPrecision,
    sources: &'a [ReadingSource],
    /// How often an experiment is repeated.
    repeats: f64,
    /// From which side configurations are approached.
    approach: Option<Approach>,
    /// What derivatives are multiplied by, one for each of the parameters that are asked for.
    sizes: Vec<f64>,
    /// The parameters, and behind them the zeros of joints whose gears err.
    set: ParameterSet,
    /// Where the joints' zeros are in the set, if gears err.
    zeros: Vec<usize>,
    q: Vec<f64>,
    work: RefCell<ObservedRoom>,
}

#[derive(Debug, Clone)]
struct ObservedRoom {
    model: ObservationModel<'static>,
    rows: Matrix6xX<f64>,
    state: KinematicState,
}

impl<'a> ObservedRows<'a> {
    /// The model of an arm at one of its tools. Derivatives are in units of the parameters' `sizes` (p).
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        wanted: &ParameterSet,
        sizes: &[f64],
        precision: DeflectionPrecision,
        sources: &'a [ReadingSource],
    ) -> Self {
        let gears_err = sources
            .iter()
            .any(|source| matches!(source, ReadingSource::TransmissionError(_)));
        let (set, zeros) = if gears_err {
            with_zeros(arm, wanted)
        } else {
            (wanted.clone(), Vec::new())
        };
        let nominal: Vec<f64> = set.parameters().iter().map(|each| each.nominal).collect();
        let joints = arm.chain.len();
        let work = ObservedRoom {
            rows: Matrix6xX::zeros(set.len()),
            model: ObservationModel::of(set.clone(), arm, &nominal),
            state: KinematicState::new(joints),
        };
        Self {
            arm,
            target,
            precision,
            sources,
            repeats: 1.0,
            approach: None,
            sizes: sizes.to_vec(),
            set,
            zeros,
            q: vec![0.0; joints],
            work: RefCell::new(work),
        }
    }

    /// See [`super::PlannedReadings::set_repeats`].
    pub fn set_repeats(&mut self, repeats: u32) {
        self.repeats = f64::from(repeats);
    }

    /// See [`super::PlannedReadings::come_from`]; what the arm carries counts, too.
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        self.approach = approach.cloned();
    }

    /// What is new in each reading besides the instrument's noise.
    pub const fn sources(&self) -> &[ReadingSource] {
        self.sources
    }

    /// The number of a reading's rows: 3, or 6 where rotations are read.
    pub const fn rows(&self) -> usize {
        self.precision.rows()
    }

    /// The number p of parameters.
    pub const fn parameters(&self) -> usize {
        self.sizes.len()
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        self.q.copy_from_slice(q);
    }

    /// Writes the derivatives of the reading (6 x p), each with respect to its parameter in its size; a reading of
    /// three rows leaves the last three to be ignored.
    pub fn derivatives(&self, load: &Load, matrix: &mut Matrix6xX<f64>) {
        let work = &mut *self.work.borrow_mut();
        work.predict(self, load);
        for (index, size) in self.sizes.iter().enumerate() {
            matrix.set_column(index, &(work.rows.column(index) * *size));
        }
    }

    /// What one of the sources adds to a reading's covariance, whatever is repeated (m^2, m rad, rad^2).
    pub fn covariance_of_one(&self, source: usize, load: &Load) -> Matrix6<f64> {
        let work = &mut *self.work.borrow_mut();
        match &self.sources[source] {
            ReadingSource::TransmissionError(TransmissionError { deviations, .. }) => {
                work.predict(self, load);
                (self.zeros.iter().zip(deviations))
                    .map(|(&place, deviation)| {
                        let seen = work.rows.column(place) * *deviation;
                        seen * seen.transpose()
                    })
                    .sum()
            }
            source => {
                let arm = self.bare();
                arm.chain.at(arm.tool).update(&self.q, &mut work.state);
                match source.covariance_of_positions(&work.state.tool_position) {
                    Some(own) => of_positions(&own),
                    None => {
                        let seen = work.state.clone().braced(arm.compliance_rad_per_nm);
                        let at_target = (load, &Vector3::zeros());
                        let columns = moved_by(source, arm, [&work.state, &seen], at_target);
                        columns.iter().map(|each| each * each.transpose()).sum()
                    }
                }
            }
        }
    }

    fn bare(&self) -> BareArm<'a> {
        BareArm {
            chain: &self.arm.chain,
            compliance_rad_per_nm: &self.arm.compliance_rad_per_nm,
            tool: &self.arm.tools[self.target],
        }
    }

    /// See [`super::PlannedReadings::covariance_between`].
    pub fn covariance_between(&self, source: usize, [one, other]: [&Load; 2]) -> Matrix6<f64> {
        if let ReadingSource::TransmissionError(TransmissionError { deviations, .. }) =
            &self.sources[source]
        {
            let seen = |load: &Load| -> Vec<Vector6<f64>> {
                let work = &mut *self.work.borrow_mut();
                work.predict(self, load);
                (self.zeros.iter().zip(deviations))
                    .map(|(&place, deviation)| work.rows.column(place) * *deviation)
                    .collect()
            };
            let pairs = seen(one).into_iter().zip(seen(other));
            return pairs.map(|(one, other)| one * other.transpose()).sum();
        }
        let part = self.sources[source].shared_part(self.precision.unloaded);
        if part > 0.0 {
            // No load decides on any other.
            self.covariance_of_one(source, one) * part
        } else {
            Matrix6::zeros()
        }
    }

    /// What one of the sources adds to it; what repeats share as often as it is shared.
    pub fn covariance_of(&self, source: usize, load: &Load) -> Matrix6<f64> {
        self.covariance_of_one(source, load) * self.times(source)
    }

    fn times(&self, source: usize) -> f64 {
        let part = self.sources[source].shared_part(self.precision.unloaded);
        counted_times(part, self.repeats)
    }

    /// W with W C W^T = I for a reading's covariance C; rows that it does not have are zero.
    fn whitener(&self, load: &Load) -> Matrix6<f64> {
        let of_noise = counted_times(self.precision.unloaded.shared_part(), self.repeats);
        let mut covariance = self.precision.covariance() * of_noise;
        for source in 0..self.sources.len() {
            covariance += self.covariance_of(source, load);
        }
        whitener(&covariance, self.precision.rows())
    }

    /// Writes the derivatives of the whitened reading, 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        let size = self.parameters();
        let mut rows = Matrix6xX::zeros(size);
        self.derivatives(load, &mut rows);
        let whitener = self.whitener(load);
        for (index, each) in rows.column_iter().enumerate() {
            let white = whitener * each;
            for block in 0..self.precision.rows() / 3 {
                let three = white.fixed_rows::<3>(3 * block);
                matrix.column_mut(block * size + index).copy_from(&three);
            }
        }
    }

    /// See [`super::PlannedReadings::uncompensated`]. The robot is commanded q = `q_0` - k tau with the torques tau of the
    /// load where it rests without it, so that a parameter leaves J~ d(k tau) at the loaded tool, J~ that of the arm
    /// with its springs.
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        let nominal: Vec<f64> = (self.set.parameters().iter())
            .map(|each| each.nominal)
            .collect();
        let standing = DVector::zeros(self.q.len());
        let at_rest = self.compensated(&nominal, load, &standing);
        let mut state = at_rest.1;
        if let Some(mobility) = state.mobility(&self.arm.compliance_rad_per_nm) {
            state.brace(&mobility);
        }
        let seen = |angles: &DVector<f64>| -> Vector3<f64> {
            let joints = angles.iter().enumerate();
            joints
                .map(|(joint, angle)| state.position_column(joint) * *angle)
                .sum()
        };
        for (index, size) in self.sizes.iter().enumerate() {
            let parameter = &self.set.parameters()[index];
            let left = match parameter.kind {
                ParameterKind::TaskScale => seen(&at_rest.0),
                ParameterKind::TaskForce { axis } => {
                    let newton = Load {
                        force_n: Vector3::ith(axis.index(), 1.0),
                        torque_nm: Vector3::zeros(),
                    };
                    seen(&self.compensated(&nominal, &newton, &standing).0)
                }
                _ => {
                    let shift = PARAMETER_SHIFT * parameter.scale;
                    let at = |shift: f64| {
                        let mut values = nominal.clone();
                        values[index] += shift;
                        self.compensated(&values, load, &at_rest.0).0
                    };
                    seen(&((at(shift) - at(-shift)) / (2.0 * shift)))
                }
            };
            matrix.set_column(index, &(left * *size));
        }
    }

    /// The joints' own deflections (rad, m) that are compensated under a load at values of the parameters, and the arm's
    /// geometry where it rests without the load. The joints are commanded back by so much (rad, m), where their gears err by more
    /// or less.
    fn compensated(
        &self,
        values: &[f64],
        load: &Load,
        back: &DVector<f64>,
    ) -> (DVector<f64>, KinematicState) {
        let arm = self.set.apply(self.arm, values);
        let chain = arm.loaded_chain();
        let mut at_tool = chain.at(&arm.tools[self.target]);
        // A gap that the load crosses is compensated, too.
        let without = arm.offsets_rad(&self.q, self.target, &Load::NONE, self.approach.as_ref());
        let with = arm.offsets_rad(&self.q, self.target, load, self.approach.as_ref());
        let commanded: Vec<f64> = (self.q.iter().zip(&without))
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
            arm.transmission_error_rad(joint, self.q[joint] - back[joint])
                - arm.transmission_error_rad(joint, self.q[joint])
        };
        let angle = |joint: usize, _| {
            compliance[joint] * state.load_torque(joint, load)
                + (with[joint] - without[joint])
                + gear(joint)
        };
        (DVector::from_fn(chain.len(), angle), state)
    }
}

impl ObservedRoom {
    /// Fills the rows with the derivatives of the reading in the parameters' units.
    fn predict(&mut self, of: &ObservedRows<'_>, load: &Load) {
        let setup = Setup {
            commanded_rad: DVector::from_column_slice(&of.q),
            load: *load,
            target: of.target,
            station: 0,
            approach: of.approach.clone(),
        };
        let kind = of.precision.kind();
        self.model.predict_as_planned(&setup, kind, &mut self.rows);
    }
}

/// W with W C W^T = I for the first rows of a covariance C; the others are zero.
fn whitener(covariance: &Matrix6<f64>, rows: usize) -> Matrix6<f64> {
    if rows == 6 {
        let whitener = Whitener::of_covariance(covariance);
        return whitener.map_or_else(Matrix6::zeros, |whitener| *whitener.matrix());
    }
    let three: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let inverse = Cholesky::new(three).and_then(|factor| factor.l().try_inverse());
    let mut whitener = Matrix6::zeros();
    let mut own = whitener.fixed_view_mut::<3, 3>(0, 0);
    own.copy_from(&inverse.unwrap_or_else(Matrix3::zeros));
    whitener
}

/// A set with the zeros of all joints, and where these are.
fn with_zeros(arm: &ElasticArm, wanted: &ParameterSet) -> (ParameterSet, Vec<usize>) {
    let mut unknowns: Vec<(ParameterKind, Option<f64>)> = (wanted.parameters().iter())
        .map(|each| (each.kind, each.prior_deviation))
        .collect();
    let mut zeros = Vec::new();
    for joint in 0..arm.chain.len() {
        let kind = ParameterKind::JointZero { joint };
        let known = unknowns.iter().position(|(other, _)| *other == kind);
        zeros.push(known.unwrap_or(unknowns.len()));
        if known.is_none() {
            unknowns.push((kind, None));
        }
    }
    match ParameterSet::new(arm, unknowns) {
        Ok(set) => (set, zeros),
        // It was one before, and every joint has a zero.
        Err(_) => (wanted.clone(), Vec::new()),
    }
}

#[cfg(test)]
pub(super) mod tests;
