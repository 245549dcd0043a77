//! Readings to first order: residuals and derivatives.

use nalgebra::{DMatrix, DVector, Matrix6xX, Vector3};

use super::super::FitError;
use super::AbsoluteCase;
use crate::observation::{Form, ObservationModel, Whitener};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};

/// One reading at an arm: rows of the position (m) above those of the rotation (rad), where it is read.
#[derive(Debug, Clone)]
pub(super) struct LinearReading {
    /// Read less predicted.
    pub residual: DVector<f64>,
    /// Derivatives of the prediction with respect to the parameters, in their units.
    pub columns: DMatrix<f64>,
    /// The same with respect to the joints' angles (rad; m where they slide).
    pub joints: DMatrix<f64>,
    /// The reading's own covariance.
    pub own: DMatrix<f64>,
}

impl AbsoluteCase<'_> {
    /// The joints that somebody commands.
    pub(super) fn commanded_joints(&self) -> Vec<usize> {
        let joints = self.arm.chain.joints.iter().enumerate();
        joints
            .filter(|(_, joint)| joint.drive.passive_at.is_none())
            .map(|(index, _)| index)
            .collect()
    }

    /// Which of these turn; the others slide.
    pub(super) fn commanded_turns(&self) -> Vec<bool> {
        let joints = self.commanded_joints().into_iter();
        joints
            .map(|joint| !self.arm.chain.joints[joint].drive.slides)
            .collect()
    }

    /// All readings at the values (p) of a set's parameters, which count from `reference`.
    pub(super) fn rows_at(
        &self,
        reference: &ElasticArm,
        set: &ParameterSet,
        values: &[f64],
        joints: &[usize],
    ) -> Result<Vec<LinearReading>, FitError> {
        let arm = set.apply(reference, values);
        let zeros = joints
            .iter()
            .map(|&joint| (ParameterKind::JointZero { joint }, None));
        // These are parameters of any chain.
        let zeros = ParameterSet::new(&arm, zeros).unwrap_or_else(|_| ParameterSet::empty());
        let mut model = ObservationModel::new(set, reference, values);
        let mut turned = ObservationModel::new(&zeros, &arm, zeros.prior().mean.as_slice());
        let mut derivatives = Matrix6xX::zeros(set.len());
        let mut of_joints = Matrix6xX::zeros(zeros.len());
        let one = Vector3::repeat(1.0);
        let observations = self.observations.iter().zip(&self.covariances);
        (observations.enumerate())
            .map(|(index, (each, covariance))| {
                let wrong = |source| FitError::Equilibrium {
                    observation: index + 1,
                    source,
                };
                let mut each = each.clone();
                each.whitener = Whitener::independent(one, one);
                let kind = each.reading.kind();
                let predicted = (turned.predict(Form::AtRest, &each.setup, kind, &mut of_joints))
                    .map_err(wrong)?;
                each.whiten(&predicted, &mut of_joints);
                let predicted = (model.predict(Form::AtRest, &each.setup, kind, &mut derivatives))
                    .map_err(wrong)?;
                let residual = each.whiten(&predicted, &mut derivatives);
                let rows = kind.rows();
                let top = |matrix: &Matrix6xX<f64>| {
                    DMatrix::from_fn(rows, matrix.ncols(), |row, column| matrix[(row, column)])
                };
                Ok(LinearReading {
                    residual: DVector::from_fn(rows, |row, _| residual[row]),
                    columns: top(&derivatives),
                    joints: top(&of_joints),
                    own: DMatrix::from_fn(rows, rows, |row, column| covariance[(row, column)]),
                })
            })
            .collect()
    }
}
