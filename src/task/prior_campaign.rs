//! The campaign behind `robot.prior`: what it found besides compliances, and how that goes with these.
//!
//! With P the precision of the compliances k by themselves, X their covariance with others s and S that of the others, s given k is
//! normal with the mean s + A (k - k), A = X^T P, and the covariance C = S - X^T P X. What is known of both together is the precision
//!
//! ```text
//! [ P + A^T C^-1 A   -A^T C^-1 ]
//! [    -C^-1 A          C^-1   ]
//! ```
//!
//! What readings could not tell from others (u) was left nominal, and is in what was found: x - D u, where no reading shows that x changes by D
//! and u by one. Where the next campaign has u among its unknowns, that is what is known, and nothing of u itself.

use nalgebra::{DMatrix, DVector};

use crate::parameter::ParameterSet;

/// A parameter that was left nominal, by name, and by how much those that were found change for one unit of it.
pub type LeftNominal = (String, Vec<(String, f64)>);

/// The error sources of an earlier identification, and what it found of them.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorCampaign {
    /// The names of the error sources that it lists.
    pub sources: Vec<String>,
    /// The parameters that it found besides compliances (o), by name,
    pub names: Vec<String>,
    /// the standard deviations that its error sources gave them,
    pub listed: Vec<Option<f64>>,
    /// their values, in their units,
    pub values: DVector<f64>,
    /// their covariance with the compliances that are to be found (p x o),
    pub cross: DMatrix<f64>,
    /// and among themselves (o x o).
    pub covariance: DMatrix<f64>,
    /// What it left nominal.
    pub left_out: Vec<LeftNominal>,
    /// The digests of its readings, and of those of campaigns before it.
    pub reading_digests: Vec<u64>,
    /// Those of the residual scale, where the covariance rests on one that was estimated.
    pub degrees_of_freedom: Option<f64>,
}

impl PriorCampaign {
    /// The precision of the compliances and of some of the others together (p + n square), where that of the compliances by themselves is
    /// this (p x p). `None` where a covariance is singular.
    pub fn together(&self, compliances: &DMatrix<f64>, others: &[usize]) -> Option<DMatrix<f64>> {
        let count = compliances.nrows();
        let cross = self.cross.select_columns(others);
        let gain = (compliances * &cross).transpose();
        let own = self.covariance.select_rows(others).select_columns(others);
        let sizes = own.diagonal().map(f64::sqrt);
        let relative = (&own - &gain * cross)
            .map_with_location(|row, column, value| value / (sizes[row] * sizes[column]));
        let inverse = relative.cholesky()?.inverse();
        let inverse =
            inverse.map_with_location(|row, column, value| value / (sizes[row] * sizes[column]));
        let pulled = &inverse * &gain;
        let mut all = DMatrix::zeros(count + others.len(), count + others.len());
        let mut corner = all.view_mut((0, 0), (count, count));
        corner.copy_from(&(compliances + gain.tr_mul(&pulled)));
        all.view_mut((count, 0), (others.len(), count))
            .copy_from(&-&pulled);
        all.view_mut((0, count), (count, others.len()))
            .copy_from(&-pulled.transpose());
        all.view_mut((count, count), (others.len(), others.len()))
            .copy_from(&inverse);
        Some(all)
    }

    /// The matrix (p x p) from a set's values to those that it found, which are what they would be if what it left nominal, from some
    /// place in the set on, were nominal.
    pub fn as_found(&self, set: &ParameterSet, from: usize) -> DMatrix<f64> {
        let place = |name: &str| set.parameters().iter().position(|each| each.name == name);
        let mut all = DMatrix::identity(set.len(), set.len());
        for (name, shift) in &self.left_out {
            let Some(column) = place(name).filter(|column| *column >= from) else {
                continue;
            };
            for (row, change) in shift {
                if let Some(row) = place(row) {
                    all[(row, column)] -= change;
                }
            }
        }
        all
    }
}
