//! What of a displacement a reading shows: all three coordinates, or what is along a direction, which is then its first row.

use std::borrow::Cow;

use nalgebra::{Matrix3, Matrix3xX, Matrix6, Matrix6xX, RowVector3, Vector3, Vector6};

use super::reading::DeflectionPrecision;

/// The rows of a reading, of those of all coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ShownRows {
    /// As they are.
    All,
    /// One along a direction (world frame), times its length, of zeros where there is none; the others are zero.
    Along(Vector3<f64>),
}

impl ShownRows {
    /// Those along a direction (unit vector, world frame), in units that give them the standard deviation of the others; or without one
    /// of all coordinates, where such are read.
    pub fn of(precision: &DeflectionPrecision, direction: Option<&Vector3<f64>>) -> Self {
        match direction.filter(|_| precision.along_sigma_m.is_some()) {
            Some(direction) => Self::Along(precision.along(direction)),
            None if precision.reads_all => Self::All,
            None => Self::Along(Vector3::zeros()),
        }
    }

    /// P, by which a displacement is multiplied.
    fn matrix(self) -> Option<Matrix3<f64>> {
        let zero = RowVector3::zeros();
        match self {
            Self::All => None,
            Self::Along(direction) => {
                Some(Matrix3::from_rows(&[direction.transpose(), zero, zero]))
            }
        }
    }

    /// P J.
    pub fn of_rows(self, rows: &mut Matrix3xX<f64>) {
        if let Some(shown) = self.matrix() {
            *rows = shown * &*rows;
        }
    }

    /// The same of the position's rows.
    pub fn of_derivatives(self, rows: &mut Matrix6xX<f64>) {
        if let Some(shown) = self.matrix() {
            let along = shown * rows.fixed_rows::<3>(0);
            rows.fixed_rows_mut::<3>(0).copy_from(&along);
        }
    }

    /// The same of how a random number moves a reading.
    pub fn of_effect(self, mut effect: Vector6<f64>) -> Vector6<f64> {
        if let Some(shown) = self.matrix() {
            let along = shown * effect.fixed_rows::<3>(0);
            effect.fixed_rows_mut::<3>(0).copy_from(&along);
        }
        effect
    }

    /// W P.
    pub fn of_whitener(self, mut whitener: Matrix6<f64>) -> Matrix6<f64> {
        if let Some(shown) = self.matrix() {
            let along = whitener.fixed_view::<3, 3>(0, 0) * shown;
            whitener.fixed_view_mut::<3, 3>(0, 0).copy_from(&along);
        }
        whitener
    }

    /// P^T B: the derivative with respect to J, from that with respect to P J.
    pub fn of_factor(self, factor: &Matrix3xX<f64>) -> Cow<'_, Matrix3xX<f64>> {
        let of_all = |shown: Matrix3<f64>| Cow::Owned(shown.transpose() * factor);
        self.matrix().map_or(Cow::Borrowed(factor), of_all)
    }
}
