//! Prior information on parameters.

use nalgebra::{DMatrix, DVector};

use crate::numeric::factorisation::finite_eigen;
use crate::numeric::posterior::Posterior;

/// Eigenvalues below this share of the largest are rounding.
const ROUNDING: f64 = 1e-12;

/// What is known of all parameters before any reading: a normal distribution of their values.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The mean (p).
    pub mean: DVector<f64>,
    /// The inverse of the covariance (p x p); zero rows where nothing is known.
    pub precision: DMatrix<f64>,
}

impl Prior {
    /// What an earlier identification tells of `count` parameters, of which its own are those at
    /// `places`; the others have the means of `nominal`. What it did not determine it does not tell.
    /// `None` where its covariance is singular within what it determined.
    pub fn of_posterior(posterior: &Posterior, places: &[usize], nominal: &[f64]) -> Option<Self> {
        let own = posterior.precision()?;
        let count = nominal.len();
        let mut mean = DVector::from_column_slice(nominal);
        let mut precision = DMatrix::zeros(count, count);
        for (row, &place) in places.iter().enumerate() {
            mean[place] = posterior.mean[row];
            for (column, &other) in places.iter().enumerate() {
                precision[(place, other)] = own[(row, column)];
            }
        }
        Some(Self { mean, precision })
    }

    /// The same where nothing is known of one of the parameters any more, whose value is taken to be this: what is known of the others
    /// is their marginal distribution.
    pub fn without(mut self, place: usize, mean: f64) -> Self {
        let own = self.precision[(place, place)];
        if own > 0.0 {
            let column = self.precision.column(place).into_owned();
            self.precision.ger(-own.recip(), &column, &column, 1.0);
        }
        self.precision.row_mut(place).fill(0.0);
        self.precision.column_mut(place).fill(0.0);
        self.mean[place] = mean;
        self
    }

    /// The precision in units of typical sizes (p), p x p.
    pub fn relative(&self, typical: &[f64]) -> DMatrix<f64> {
        DMatrix::from_fn(typical.len(), typical.len(), |row, column| {
            self.precision[(row, column)] * typical[row] * typical[column]
        })
    }

    /// The orthogonal directions of which something is known, in units of typical sizes, with its precision.
    fn known(&self, typical: &[f64]) -> Vec<(f64, DVector<f64>)> {
        let Some(eigen) = finite_eigen(&self.relative(typical)) else {
            return Vec::new();
        };
        let least = ROUNDING * eigen.eigenvalues.max();
        let vectors = eigen.eigenvectors.column_iter();
        (eigen.eigenvalues.iter().copied().zip(vectors))
            .filter(|(precision, _)| *precision > least)
            .map(|(precision, vector)| (precision, vector.into_owned()))
            .collect()
    }

    /// Standard deviations where something is known, else typical sizes: what is known far better than the rest hides none of it. A
    /// precision that is rounding beside the others is none.
    fn own_sizes(&self, typical: &[f64]) -> Vec<f64> {
        let relative = self.relative(typical).diagonal();
        let least = ROUNDING * relative.amax();
        let each = typical.iter().zip(&relative);
        each.map(|(typical, own)| {
            if *own > least {
                typical / own.sqrt()
            } else {
                *typical
            }
        })
        .collect()
    }

    /// The precision as whitened equations, r x p: rows of unit variance that parameters times them equal those
    /// of the mean. `typical` sizes (p) keep units apart.
    pub fn rows(&self, typical: &[f64]) -> DMatrix<f64> {
        let typical = &self.own_sizes(typical);
        let known = self.known(typical);
        DMatrix::from_fn(known.len(), typical.len(), |row, column| {
            let (precision, vector) = &known[row];
            precision.sqrt() * vector[column] / typical[column]
        })
    }

    /// A matrix L (p x r) so that the mean + L z is distributed as what is known, for r
    /// independent standard normals z; what is not known has its mean.
    pub fn spread(&self, typical: &[f64]) -> DMatrix<f64> {
        let typical = &self.own_sizes(typical);
        let known = self.known(typical);
        DMatrix::from_fn(typical.len(), known.len(), |row, column| {
            let (precision, vector) = &known[column];
            typical[row] * vector[row] / precision.sqrt()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::estimable::Estimable;
    use nalgebra::dmatrix;

    /// What rounding leaves of a parameter of which nothing is known is no knowledge: it has its mean.
    #[test]
    fn rounding_is_no_knowledge() {
        let prior = Prior {
            mean: DVector::from_vec(vec![1e-6, 2e-6]),
            precision: dmatrix![1e12, 1e-6; 1e-6, 3e-5],
        };
        let spread = prior.spread(&[1e-6, 1e-6]);
        assert_eq!(spread.ncols(), 1);
        assert!((spread[(0, 0)].abs() / 1e-6 - 1.0).abs() < 1e-9);
        assert!(spread[(1, 0)].abs() < 1e-20, "{spread}");
    }

    /// A covariance comes back from the precision, from rows and from the spread, whatever the units.
    #[test]
    fn an_identification_is_a_prior() {
        let covariance = dmatrix![4e-18, 1e-17; 1e-17, 9e-16];
        let typical = [1e-7, 2e-6];
        let information = covariance.clone().try_inverse().expect("regular");
        let relative = DMatrix::from_fn(2, 2, |row, column| {
            information[(row, column)] * typical[row] * typical[column]
        });
        let posterior = Posterior {
            names: vec!["a".to_owned(), "b".to_owned()],
            mean: vec![1.5e-7, 2.5e-6],
            covariance: covariance.clone(),
            estimable: Estimable::new(&relative, &typical),
        };
        let prior = Prior::of_posterior(&posterior, &[2, 0], &[0.0, 7.0, 0.0]).expect("regular");
        assert_eq!(prior.mean, DVector::from_vec(vec![2.5e-6, 7.0, 1.5e-7]));
        let sizes = [2e-6, 1.0, 1e-7];
        let rows = prior.rows(&sizes);
        assert_eq!(rows.nrows(), 2);
        let again = rows.tr_mul(&rows);
        for (found, expected) in again.iter().zip(&prior.precision) {
            assert!((found - expected).abs() < 1e-9 * information.amax());
        }
        let spread = prior.spread(&sizes);
        let found = &spread * spread.transpose();
        let expected = dmatrix![9e-16, 0.0, 1e-17; 0.0, 0.0, 0.0; 1e-17, 0.0, 4e-18];
        for row in 0..3 {
            for column in 0..3 {
                let size = sizes[row] * sizes[column];
                let error = found[(row, column)] - expected[(row, column)];
                assert!(error.abs() < 1e-12 * size, "{found}");
            }
        }
    }

    /// What is known a billion times better than the rest hides none of it.
    #[test]
    fn a_very_good_prior_hides_no_other() {
        let prior = Prior {
            mean: DVector::zeros(2),
            precision: dmatrix![1e18, 0.0; 0.0, 1.0],
        };
        let (rows, spread) = (prior.rows(&[1.0, 1.0]), prior.spread(&[1.0, 1.0]));
        let [precision, covariance] = [rows.tr_mul(&rows), &spread * spread.transpose()];
        for place in 0..2 {
            let expected = prior.precision[(place, place)];
            assert!((precision[(place, place)] / expected - 1.0).abs() < 1e-12);
            assert!((covariance[(place, place)] * expected - 1.0).abs() < 1e-12);
        }
    }

    /// Only a combination was determined: nothing is told of the other.
    #[test]
    fn what_was_not_determined_is_not_told() {
        let rows = dmatrix![3.0, 3.0];
        let posterior = Posterior {
            names: vec!["a".to_owned(), "b".to_owned()],
            mean: vec![1.0, 1.0],
            covariance: dmatrix![1.0 / 36.0, 1.0 / 36.0; 1.0 / 36.0, 1.0 / 36.0],
            estimable: Estimable::of_equations(&rows, &[1.0, 1.0]),
        };
        let prior = Prior::of_posterior(&posterior, &[0, 1], &[1.0, 1.0]).expect("a prior");
        let expected = rows.tr_mul(&rows);
        assert!((&prior.precision - expected).amax() < 1e-9, "{prior:?}");
        assert_eq!(prior.rows(&[1.0, 1.0]).nrows(), 1);
    }
}
