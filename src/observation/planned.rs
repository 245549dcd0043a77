//! Readings that are planned: the one way in which planning, promises and studies see them.

use std::borrow::Cow;

use nalgebra::{Matrix3, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::braced::BareArm;
use super::compliances::ComplianceRows;
use super::first_order::FirstOrder;
use super::observed::ObservedRows;
use super::off_springs::OffSpring;
use super::reading::DeflectionPrecision;
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource};
use crate::robot::{Approach, KinematicState, Kinematics, Load};

/// The precision where nothing is read, as at a test pose.
pub const NOTHING_READ: DeflectionPrecision = DeflectionPrecision {
    sigma_m: 1.0,
    rotation_sigma_rad: None,
};

/// The readings of an arm at one of its tools, at nominal parameters: derivatives with respect to parameters in units
/// of their sizes, and covariances.
#[derive(Debug, Clone)]
pub struct PlannedReadings<'a> {
    arm: BareArm<'a>,
    /// The arm's geometry at the last configuration.
    state: KinematicState,
    rows: PlannedRows<'a>,
}

/// What the rows of the readings' derivatives come from.
#[derive(Debug, Clone)]
enum PlannedRows<'a> {
    /// Of compliances alone, where only the instrument's noise disturbs: in closed form, with gradients.
    Compliances(Box<ComplianceRows<'a>>),
    /// Of any parameters in deflections of an arm without springs beside the joints' own: the same.
    Deflections(Box<FirstOrder<'a>>),
    /// Of any others.
    Others(Box<ObservedRows<'a>>),
}

impl<'a> PlannedReadings<'a> {
    /// The readings at one of an arm's tools. Derivatives are in units of the parameters' `sizes` (p).
    #[must_use]
    pub fn new(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
        precision: DeflectionPrecision,
        sources: &'a [ReadingSource],
    ) -> Self {
        // Where joints stand off their springs by what they carry, the arm's weight counts, and with it what it carries.
        let is_laden = arm.payload.is_some()
            && (set.parameters().iter()).any(|each| OffSpring::of(arm, each.kind).is_some());
        let is_bare = !arm.chain.elements.has_springs() && !is_laden;
        let rows = if precision.rows() == 3 && is_bare {
            let sigma_m = precision.sigma_m;
            let model = FirstOrder::new(arm, target, set, sizes, sigma_m, sources);
            PlannedRows::Deflections(Box::new(model))
        } else {
            let model = ObservedRows::new(arm, target, set, sizes, precision, sources);
            PlannedRows::Others(Box::new(model))
        };
        let bare = BareArm {
            chain: &arm.chain,
            compliance_rad_per_nm: &arm.compliance_rad_per_nm,
            tool: &arm.tools[target],
        };
        Self::of(bare, rows)
    }

    /// The readings where the compliances of some joints alone are to be found, and only the instrument's noise
    /// disturbs.
    #[must_use]
    pub fn of_compliances(
        arm: BareArm<'a>,
        joints: &[usize],
        sizes: &[f64],
        precision: DeflectionPrecision,
    ) -> Self {
        let rows = ComplianceRows::new(arm, joints, sizes, precision);
        Self::of(arm, PlannedRows::Compliances(Box::new(rows)))
    }

    fn of(arm: BareArm<'a>, rows: PlannedRows<'a>) -> Self {
        Self {
            state: KinematicState::new(arm.chain.len()),
            arm,
            rows,
        }
    }

    /// The same where nothing is read, as at a test pose: see [`FirstOrder::uncompensated`].
    #[must_use]
    pub fn at_test_pose(
        arm: &'a ElasticArm,
        target: usize,
        set: &ParameterSet,
        sizes: &[f64],
    ) -> Self {
        Self::new(arm, target, set, sizes, NOTHING_READ, &[])
    }

    /// See [`FirstOrder::set_repeats`].
    pub fn set_repeats(&mut self, repeats: u32) {
        match &mut self.rows {
            // Repeats share nothing of the instrument's noise.
            PlannedRows::Compliances(_) => {}
            PlannedRows::Deflections(model) => model.set_repeats(repeats),
            PlannedRows::Others(model) => model.set_repeats(repeats),
        }
    }

    /// See [`FirstOrder::come_from`].
    pub fn come_from(&mut self, approach: Option<&Approach>) {
        match &mut self.rows {
            PlannedRows::Compliances(_) => {}
            PlannedRows::Deflections(model) => model.come_from(approach),
            PlannedRows::Others(model) => model.come_from(approach),
        }
    }

    /// The acceleration of gravity (m/s^2).
    #[must_use]
    pub const fn gravity_m_s2(&self) -> Vector3<f64> {
        self.arm.chain.gravity_m_s2
    }

    /// The number of a reading's rows: 3, or 6 where rotations are read.
    #[must_use]
    pub const fn rows(&self) -> usize {
        match &self.rows {
            PlannedRows::Compliances(model) => model.rows(),
            PlannedRows::Deflections(_) => 3,
            PlannedRows::Others(model) => model.rows(),
        }
    }

    /// The number p of parameters.
    #[must_use]
    pub fn parameters(&self) -> usize {
        match &self.rows {
            PlannedRows::Compliances(model) => model.parameters(),
            PlannedRows::Deflections(model) => model.parameters(),
            PlannedRows::Others(model) => model.parameters(),
        }
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        let BareArm { chain, tool, .. } = self.arm;
        chain.at(tool).update(q, &mut self.state);
        match &mut self.rows {
            PlannedRows::Compliances(model) => model.stand(q, &self.state),
            PlannedRows::Deflections(model) => model.stand(q, &self.state),
            PlannedRows::Others(model) => model.move_to(q),
        }
    }

    /// The arm's geometry at the last configuration.
    #[must_use]
    pub const fn state(&self) -> &KinematicState {
        &self.state
    }

    /// The same with the springs beside the joints' own at work, see [`KinematicState::brace`].
    #[must_use]
    pub fn seen(&self) -> Cow<'_, KinematicState> {
        if let PlannedRows::Compliances(model) = &self.rows {
            return Cow::Borrowed(model.seen(&self.state));
        }
        let mobility = self.state.mobility(self.arm.compliance_rad_per_nm);
        mobility.map_or(Cow::Borrowed(&self.state), |mobility| {
            let mut state = self.state.clone();
            state.brace(&mobility);
            Cow::Owned(state)
        })
    }

    /// Writes the derivatives of a reading (6 x p); one of three rows leaves the last three to be ignored.
    pub fn derivatives(&self, load: &Load, matrix: &mut Matrix6xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.derivatives(&self.state, load, matrix),
            PlannedRows::Deflections(model) => {
                let mut three = Matrix3xX::zeros(matrix.ncols());
                model.derivatives(load, &mut three);
                matrix.fixed_rows_mut::<3>(0).copy_from(&three);
            }
            PlannedRows::Others(model) => model.derivatives(load, matrix),
        }
    }

    /// See [`FirstOrder::uncompensated`].
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.uncompensated(&self.state, load, matrix),
            PlannedRows::Deflections(model) => model.uncompensated(load, matrix),
            PlannedRows::Others(model) => model.uncompensated(load, matrix),
        }
    }

    /// What one of the sources adds to a reading's covariance (m^2, m rad, rad^2), what repeats share as often as it
    /// is shared.
    #[must_use]
    pub fn covariance_of(&self, source: usize, load: &Load) -> Matrix6<f64> {
        match &self.rows {
            PlannedRows::Compliances(_) => Matrix6::zeros(),
            PlannedRows::Deflections(model) => of_positions(&model.covariance_of(source, load)),
            PlannedRows::Others(model) => model.covariance_of(source, load),
        }
    }

    /// What all sources add to the instrument's noise.
    #[must_use]
    pub fn covariance_of_all(&self, load: &Load) -> Matrix6<f64> {
        let sources = 0..self.sources().len();
        sources.map(|source| self.covariance_of(source, load)).sum()
    }

    /// What the repeats of an experiment share of it.
    #[must_use]
    pub fn covariance_shared(&self, load: &Load) -> Matrix6<f64> {
        let one = |source: usize| match &self.rows {
            PlannedRows::Compliances(_) => Matrix6::zeros(),
            PlannedRows::Deflections(model) => of_positions(&model.covariance_of_one(source, load)),
            PlannedRows::Others(model) => model.covariance_of_one(source, load),
        };
        let sources = self.sources().iter().enumerate();
        sources
            .filter(|(_, source)| source.is_shared_by_repeats())
            .map(|(index, _)| one(index))
            .sum()
    }

    fn sources(&self) -> &[ReadingSource] {
        match &self.rows {
            PlannedRows::Compliances(_) => &[],
            PlannedRows::Deflections(model) => model.sources(),
            PlannedRows::Others(model) => model.sources(),
        }
    }

    /// Writes the derivatives of the whitened reading: 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match &self.rows {
            PlannedRows::Compliances(model) => model.observe(&self.state, load, matrix),
            PlannedRows::Deflections(model) => model.observe(load, matrix),
            PlannedRows::Others(model) => model.observe(load, matrix),
        }
    }

    /// Adds the derivatives of a cost of the information A^T A of the whitened rows A with respect to the joint angles
    /// to `gradient` (n). `factor` is that with respect to A.
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        match &mut self.rows {
            PlannedRows::Compliances(model) => {
                model.pull_back(&self.state, load, factor, gradient);
            }
            PlannedRows::Deflections(model) => {
                model.pull_back(load, factor, gradient);
            }
            PlannedRows::Others(model) => model.pull_back(load, factor, gradient),
        }
    }

    /// The same with respect to the force.
    pub fn force_gradient(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        match &mut self.rows {
            PlannedRows::Compliances(model) => model.force_gradient(&self.state, factor),
            PlannedRows::Deflections(model) => model.pull_back(load, factor, &mut []),
            PlannedRows::Others(model) => model.force_gradient(load, factor),
        }
    }
}

/// Of positions alone: rotations are not disturbed.
pub(super) fn of_positions(covariance: &Matrix3<f64>) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(covariance);
    whole
}
