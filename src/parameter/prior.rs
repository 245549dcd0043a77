//! Prior information on parameters.

use nalgebra::{DMatrix, DVector};

use crate::numeric::factorisation::finite_eigen;
use crate::numeric::posterior::Posterior;

/// Eigenvalues below this share of the largest are rounding.
const ROUNDING: f64 = 1e-12;

/// Less of a precision than this share of it is what rounding leaves where the rest was taken off.
const TAKEN_OFF: f64 = 1e-9;

/// What is known of all parameters before any reading: a normal distribution of their values, or of the logarithms of some.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The mean (p).
    pub mean: DVector<f64>,
    /// The inverse of the covariance (p x p); zero rows where nothing is known.
    pub precision: DMatrix<f64>,
    /// Places of positive parameters x, with standard deviations s: besides all else ln(x/mean)/s is standard normal. The precision has
    /// that to first order about the mean, as 1/(s mean)^2.
    pub ratios: Vec<(usize, f64)>,
}

/// What is known before as the normal equations of a change from values of the parameters have it, in units of typical sizes.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorAt {
    /// The precision, p x p.
    pub precision: DMatrix<f64>,
    /// Half the gradient of the square (p).
    pub pull: DVector<f64>,
    /// The square of how far the values are from what is known, in standard deviations.
    pub square: f64,
}

impl Prior {
    /// A normal distribution.
    pub const fn new(mean: DVector<f64>, precision: DMatrix<f64>) -> Self {
        Self {
            mean,
            precision,
            ratios: Vec::new(),
        }
    }

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
        Some(Self::new(mean, precision))
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

    /// The standard deviation of the logarithm of the parameter at a place, if it is known by its ratio.
    pub fn ratio_of(&self, place: usize) -> Option<f64> {
        let own = self.ratios.iter().find(|(own, _)| *own == place);
        own.map(|(_, deviation)| *deviation)
    }

    /// The precision of the parameter at a place where it has a value, in one over the square of its unit.
    pub fn own_at(&self, place: usize, value: f64) -> f64 {
        let all = self.precision[(place, place)];
        self.ratio_of(place).map_or(all, |deviation| {
            let [of_ratio, here] = [self.mean[place], value].map(|at| (deviation * at).powi(-2));
            Self::without_ratio(all, of_ratio) + here
        })
    }

    /// What is left of a precision without that of a ratio.
    fn without_ratio(all: f64, of_ratio: f64) -> f64 {
        let others = all - of_ratio;
        if others > TAKEN_OFF * all {
            others
        } else {
            0.0
        }
    }

    /// Those of the ratios that are of some of the parameters, by their places among these.
    pub fn ratios_at(&self, indices: &[usize]) -> Vec<(usize, f64)> {
        let all = indices.iter().enumerate();
        let own = |(own, place): (usize, &usize)| Some((own, self.ratio_of(*place)?));
        all.filter_map(own).collect()
    }

    /// The precision without that of ratios (p x p).
    fn linear(&self) -> DMatrix<f64> {
        let mut precision = self.precision.clone();
        for &(place, deviation) in &self.ratios {
            let own = &mut precision[(place, place)];
            *own = Self::without_ratio(*own, (deviation * self.mean[place]).powi(-2));
        }
        precision
    }

    /// The prior at values (p), where those known by ratios are positive.
    pub fn at(&self, values: &DVector<f64>, typical: &[f64]) -> Option<PriorAt> {
        let sizes = DVector::from_column_slice(typical);
        let off = (values - &self.mean).component_div(&sizes);
        let linear = Self::new(self.mean.clone(), self.linear());
        let mut precision = linear.relative(typical);
        let mut pull = &precision * &off;
        let mut square = off.dot(&pull);
        for &(place, deviation) in &self.ratios {
            let value = values[place];
            if value <= 0.0 {
                return None;
            }
            let off = (value / self.mean[place]).ln() / deviation;
            let slope = typical[place] / (deviation * value);
            precision[(place, place)] += slope * slope;
            pull[place] += slope * off;
            square += off * off;
        }
        Some(PriorAt {
            precision,
            pull,
            square,
        })
    }

    /// What the curvature by a logarithm has besides Gauss-Newton's, as precisions at places in units of typical sizes: where readings, whose
    /// right-hand side of the normal equations is `right` (p, likewise), draw a value x that is below the mean to nothing, -right/x.
    pub fn beside_gauss_newton<'a>(
        &'a self,
        values: &'a DVector<f64>,
        typical: &'a [f64],
        right: &'a DVector<f64>,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let drawn = (self.ratios.iter())
            .filter(|(place, _)| right[*place] < 0.0 && values[*place] < self.mean[*place]);
        drawn.map(move |&(place, _)| (place, -right[place] * typical[place] / values[place]))
    }

    /// A change from values (p) as a step of a fit: what is known by its ratio changes by a factor, no step by more than e.
    pub fn step_from(&self, values: &DVector<f64>, mut change: DVector<f64>) -> DVector<f64> {
        let logarithm = |(place, _): &(usize, f64)| (change[*place] / values[*place]).abs();
        let share = self.ratios.iter().map(logarithm).fold(1.0, f64::max);
        change /= share;
        for &(place, _) in &self.ratios {
            change[place] = values[place] * (change[place] / values[place]).exp_m1();
        }
        change
    }

    /// The [rows](Self::rows) of a change from values (p), and what these leave of each (r), where those known by ratios are positive.
    pub fn rows_at(
        &self,
        rows: &DMatrix<f64>,
        values: &DVector<f64>,
    ) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut off = rows * (&self.mean - values);
        let mut rows = rows.clone();
        let first = rows.nrows() - self.ratios.len();
        for (row, &(place, deviation)) in (first..).zip(&self.ratios) {
            let (mean, value) = (self.mean[place], values[place]);
            if value <= 0.0 {
                return None;
            }
            rows[(row, place)] *= mean / value;
            off[row] = (mean / value).ln() / deviation;
        }
        Some((rows, off))
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
    /// of the mean. `typical` sizes (p) keep units apart. Those of ratios come last.
    pub fn rows(&self, typical: &[f64]) -> DMatrix<f64> {
        let linear = Self::new(self.mean.clone(), self.linear());
        let typical = &linear.own_sizes(typical);
        let known = linear.known(typical);
        DMatrix::from_fn(
            known.len() + self.ratios.len(),
            typical.len(),
            |row, column| match known.get(row) {
                Some((precision, vector)) => precision.sqrt() * vector[column] / typical[column],
                None => match self.ratios[row - known.len()] {
                    (place, deviation) if place == column => (deviation * self.mean[place]).recip(),
                    _ => 0.0,
                },
            },
        )
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
        let mean = DVector::from_vec(vec![1e-6, 2e-6]);
        let prior = Prior::new(mean, dmatrix![1e12, 1e-6; 1e-6, 3e-5]);
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

    /// What is known of a logarithm is linear at the mean; elsewhere its pull is the slope of its square, and rows say what equations do.
    #[test]
    fn ratios_are_normal_in_the_logarithm() {
        let (mean, deviation) = (DVector::from_vec(vec![2.0, 5.0]), 0.5);
        let plain = Prior::new(mean.clone(), dmatrix![3.0, 0.5; 0.5, 1.0]);
        let mut prior = plain.clone();
        prior.precision[(1, 1)] += (deviation * 5.0_f64).powi(-2);
        prior.ratios = vec![(1, deviation)];
        let typical = [1.0, 10.0];
        let at_mean = prior.at(&mean, &typical).expect("positive");
        let error = (&at_mean.precision - prior.relative(&typical)).amax();
        assert!(error < 1e-12 * at_mean.precision.amax() && at_mean.square == 0.0);
        let square = |x: f64, y: f64| {
            let off = DVector::from_vec(vec![x, y]) - &mean;
            off.dot(&(&plain.precision * &off)) + ((y / 5.0).ln() / deviation).powi(2)
        };
        let values = DVector::from_vec(vec![3.0, 40.0]);
        let found = prior.at(&values, &typical).expect("positive");
        assert!((found.square / square(3.0, 40.0) - 1.0).abs() < 1e-12);
        let slope = (square(3.0, 40.001) - square(3.0, 39.999)) / 0.002 / 2.0;
        assert!((found.pull[1] / typical[1] - slope).abs() < 1e-6 * slope);
        let (rows, off) = prior
            .rows_at(&prior.rows(&typical), &values)
            .expect("positive");
        let sizes = DMatrix::from_diagonal(&DVector::from_row_slice(&typical));
        let again = &sizes * rows.tr_mul(&rows) * &sizes;
        assert!((again - &found.precision).amax() < 1e-12 * found.precision.amax());
        let pull = &sizes * rows.tr_mul(&off);
        assert!((pull + &found.pull).amax() < 1e-12 * found.pull.amax());
        let negative = DVector::from_vec(vec![3.0, -1.0]);
        assert!(prior.at(&negative, &typical).is_none());
    }

    /// What is known a billion times better than the rest hides none of it.
    #[test]
    fn a_very_good_prior_hides_no_other() {
        let prior = Prior::new(DVector::zeros(2), dmatrix![1e18, 0.0; 0.0, 1.0]);
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
