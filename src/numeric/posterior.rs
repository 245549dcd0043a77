//! The posterior of parameters after measurements: means, covariance, and the unidentifiable subspace.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

use crate::numeric::estimable::Estimable;

/// What is known of p parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// The parameters' names.
    pub names: Vec<String>,
    /// Their values; in directions that are not determined, the nominal ones.
    pub mean: Vec<f64>,
    /// The covariance of what is determined (eq. 13), p x p; nothing of the rest is in it.
    pub covariance: DMatrix<f64>,
    /// What is determined.
    pub estimable: Estimable,
}

/// What somebody asks for depends on combinations of parameters that are not determined.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{} {}", joined(parameters), if parameters.len() == 1 { "is not determined" } else { "are not determined one by one" })]
pub struct NotDetermined {
    /// The parameters that are in these combinations.
    pub parameters: Vec<String>,
}

fn joined(names: &[String]) -> String {
    names.join(", ")
}

impl Posterior {
    /// The variance of C x, summed over the rows of C (r x p): trace(C cov C^T). For the matrix of a test
    /// pose (m N m/rad) and compliances it is `rho_0`^2 (m^2), eqs. 18 to 20.
    ///
    /// # Errors
    /// C x depends on what is not determined.
    pub fn variance_of(&self, rows: &DMatrix<f64>) -> Result<f64, NotDetermined> {
        let variance = (rows * &self.covariance * rows.transpose())
            .trace()
            .max(0.0);
        let missing = self.estimable.missing(rows, variance.sqrt());
        if missing.is_empty() {
            return Ok(variance);
        }
        let parameters = missing.iter().map(|&index| self.names[index].clone());
        Err(NotDetermined {
            parameters: parameters.collect(),
        })
    }

    /// The standard error of a parameter; `None` where it is not determined by itself.
    pub fn standard_error(&self, index: usize) -> Option<f64> {
        let standard_error = self.covariance[(index, index)].max(0.0).sqrt();
        (self.estimable.determines(index, standard_error)).then_some(standard_error)
    }

    /// What is known of the first parameters alone, whatever the others are.
    pub fn of_first(&self, count: usize) -> Self {
        let covariance = self.covariance.view((0, 0), (count, count)).into_owned();
        Self {
            names: self.names[..count].to_vec(),
            mean: self.mean[..count].to_vec(),
            estimable: self.estimable.of_first(&covariance),
            covariance,
        }
    }

    /// The inverse of the covariance within what is determined, and zero in what is not (p x p). `None`
    /// where the covariance is singular there.
    pub fn precision(&self) -> Option<DMatrix<f64>> {
        let mut from = self.estimable.basis().clone();
        for (mut row, typical) in from.row_iter_mut().zip(self.estimable.typical()) {
            row /= *typical;
        }
        let covariance = from.tr_mul(&self.covariance) * &from;
        let inverse = covariance.cholesky()?.inverse();
        Some(&from * inverse * from.transpose())
    }

    /// The normalised error squared of `error` (p), of which only what is determined counts: chi-square
    /// with [`Estimable::rank`] degrees of freedom if the covariance is right. `None` where the
    /// covariance is none.
    pub fn normalised_square(&self, error: &DVector<f64>) -> Option<f64> {
        if self.estimable.is_complete() {
            let factor = self.covariance.clone().cholesky()?;
            return Some(error.dot(&factor.solve(error)));
        }
        // In relative units, with what is not determined made regular: cov + s H H^T, and an error without a part along H.
        let typical = DVector::from_column_slice(self.estimable.typical());
        let hidden = self.estimable.hidden();
        let mut error = error.component_div(&typical);
        error -= hidden * hidden.tr_mul(&error);
        let mut covariance = self.covariance.clone();
        for (mut column, one) in covariance.column_iter_mut().zip(&typical) {
            column.component_div_assign(&typical);
            column /= *one;
        }
        let scale = covariance.trace() / self.estimable.rank().max(1) as f64;
        covariance.gemm(scale, hidden, &hidden.transpose(), 1.0);
        let factor = covariance.cholesky()?;
        Some(error.dot(&factor.solve(&error)))
    }
}
