//! Readings that are planned: the one way in which planning, promises and studies see them.

use nalgebra::{Matrix3, Matrix3xX, Matrix6, Matrix6xX, Vector3};

use super::first_order::FirstOrder;
use super::observed::ObservedRows;
use super::reading::DeflectionPrecision;
use crate::parameter::{ElasticArm, ParameterSet, ReadingSource};
use crate::robot::{KinematicState, Load};

/// The readings of an arm at one of its tools, at nominal parameters: derivatives with respect to parameters in units
/// of their sizes, and covariances.
#[derive(Debug, Clone)]
pub enum PlannedReadings<'a> {
    /// Deflections of an arm without springs beside the joints' own: the same in closed form, with gradients.
    Deflections(Box<FirstOrder<'a>>),
    /// Any others.
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
        if precision.rows() == 3 && !arm.chain.elements.has_springs() {
            let sigma_m = precision.sigma_m;
            let model = FirstOrder::new(arm, target, set, sizes, sigma_m, sources);
            Self::Deflections(Box::new(model))
        } else {
            let rows = ObservedRows::new(arm, target, set, sizes, precision, sources);
            Self::Others(Box::new(rows))
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
        let precision = DeflectionPrecision {
            sigma_m: 1.0,
            rotation_sigma_rad: None,
        };
        Self::new(arm, target, set, sizes, precision, &[])
    }

    /// See [`FirstOrder::set_repeats`].
    pub fn set_repeats(&mut self, repeats: u32) {
        match self {
            Self::Deflections(model) => model.set_repeats(repeats),
            Self::Others(model) => model.set_repeats(repeats),
        }
    }

    /// The number p of parameters.
    #[must_use]
    pub fn parameters(&self) -> usize {
        match self {
            Self::Deflections(model) => model.parameters(),
            Self::Others(model) => model.parameters(),
        }
    }

    /// Moves to the joint angles `q` (rad).
    pub fn move_to(&mut self, q: &[f64]) {
        match self {
            Self::Deflections(model) => model.move_to(q),
            Self::Others(model) => model.move_to(q),
        }
    }

    /// Moves to the joint angles `q` (rad), where the arm with its tool has this geometry.
    pub fn stand(&mut self, q: &[f64], state: &KinematicState) {
        match self {
            Self::Deflections(model) => model.stand(q, state),
            Self::Others(model) => model.move_to(q),
        }
    }

    /// Writes the derivatives of a reading (6 x p); one of three rows leaves the last three to be ignored.
    pub fn derivatives(&self, load: &Load, matrix: &mut Matrix6xX<f64>) {
        match self {
            Self::Deflections(model) => {
                let mut three = Matrix3xX::zeros(matrix.ncols());
                model.derivatives(load, &mut three);
                matrix.fixed_rows_mut::<3>(0).copy_from(&three);
            }
            Self::Others(model) => model.derivatives(load, matrix),
        }
    }

    /// See [`FirstOrder::uncompensated`].
    pub fn uncompensated(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match self {
            Self::Deflections(model) => model.uncompensated(load, matrix),
            Self::Others(model) => model.uncompensated(load, matrix),
        }
    }

    /// What one of the sources adds to a reading's covariance (m^2, m rad, rad^2), what repeats share as often as it
    /// is shared.
    #[must_use]
    pub fn covariance_of(&self, source: usize, load: &Load) -> Matrix6<f64> {
        match self {
            Self::Deflections(model) => of_positions(&model.covariance_of(source, load)),
            Self::Others(model) => model.covariance_of(source, load),
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
        let one = |source: usize| match self {
            Self::Deflections(model) => of_positions(&model.covariance_of_one(source, load)),
            Self::Others(model) => model.covariance_of_one(source, load),
        };
        let sources = self.sources().iter().enumerate();
        sources
            .filter(|(_, source)| source.is_shared_by_repeats())
            .map(|(index, _)| one(index))
            .sum()
    }

    fn sources(&self) -> &[ReadingSource] {
        match self {
            Self::Deflections(model) => model.sources(),
            Self::Others(model) => model.sources(),
        }
    }

    /// Writes the derivatives of the whitened reading: 3 x p for positions, and 3 x p for rotations beside them.
    pub fn observe(&self, load: &Load, matrix: &mut Matrix3xX<f64>) {
        match self {
            Self::Deflections(model) => model.observe(load, matrix),
            Self::Others(model) => model.observe(load, matrix),
        }
    }

    /// Adds the derivatives of a cost of the information A^T A of the whitened rows A with respect to the joint angles
    /// to `gradient` (n). `factor` is that with respect to A.
    pub fn pull_back(&mut self, load: &Load, factor: &Matrix3xX<f64>, gradient: &mut [f64]) {
        match self {
            Self::Deflections(model) => {
                model.pull_back(load, factor, gradient);
            }
            Self::Others(model) => model.pull_back(load, factor, gradient),
        }
    }

    /// The same with respect to the force.
    pub fn force_gradient(&mut self, load: &Load, factor: &Matrix3xX<f64>) -> Vector3<f64> {
        match self {
            Self::Deflections(model) => model.pull_back(load, factor, &mut []),
            Self::Others(model) => model.force_gradient(load, factor),
        }
    }
}

fn of_positions(covariance: &Matrix3<f64>) -> Matrix6<f64> {
    let mut whole = Matrix6::zeros();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(covariance);
    whole
}
