//! What readings of one configuration share.

use nalgebra::DMatrix;

use crate::experiment::Experiment;

/// The covariance of the readings of all experiments of one configuration, taken so that r readings of each that are independent
/// of one another tell as much as they do: with the mean readings' covariance C and the repeats D, it is D^1/2 C D^1/2.
#[derive(Debug, Clone)]
pub struct CovarianceTogether {
    /// By the instrument's own noise.
    pub noise: DMatrix<f64>,
    /// By each of the sources.
    pub sources: Vec<DMatrix<f64>>,
}

impl CovarianceTogether {
    /// By all.
    pub fn all(&self) -> DMatrix<f64> {
        let nothing = DMatrix::zeros(self.noise.nrows(), self.noise.ncols());
        &self.noise + (self.sources.iter()).fold(nothing, |sum, source| sum + source)
    }

    /// Makes columns (of readings, one experiment's below the other's) those of whitened readings, each of as many as there are
    /// repeats.
    pub fn whiten(&self, experiments: &[&Experiment], columns: &mut DMatrix<f64>) {
        let rows = columns.nrows() / experiments.len();
        weigh_repeats(experiments, rows, columns, 1.0);
        let covariance = self.all();
        let typical = covariance.diagonal().map(f64::sqrt);
        let factor = covariance.cholesky().map(nalgebra::Cholesky::unpack);
        // It is positive definite: the instrument's noise is in it.
        let factor = factor.unwrap_or_else(|| DMatrix::from_diagonal(&typical));
        factor.solve_lower_triangular_mut(columns);
        weigh_repeats(experiments, rows, columns, -1.0);
    }
}

/// Rows of each experiment times the root of its repeats, or over it.
fn weigh_repeats(experiments: &[&Experiment], rows: usize, columns: &mut DMatrix<f64>, power: f64) {
    for (place, experiment) in experiments.iter().enumerate() {
        let mut own = columns.rows_mut(rows * place, rows);
        own *= f64::from(experiment.repeats).sqrt().powf(power);
    }
}
