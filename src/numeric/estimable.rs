//! The estimable parameters: the subspace in which measurements determine them, by the Fisher information; the rest is the
//! unidentifiable subspace (null space). One decision for planning, studies, identification and compensation.
//!
//! M is the information of all readings, in relative units: each parameter is divided by its typical
//! size, each reading by its standard deviation. A direction of unit length with M's eigenvalue l is
//! then known with a standard error of l^-1/2 typical sizes, and changing the parameters along it by
//! their typical size moves all readings together by l^1/2 standard deviations. It is *determined* if
//!
//! ```text
//! l > 1/100^2          a standard error below 100 typical sizes, and
//! c > 1e-12            more than rounding,
//! ```
//!
//! c the eigenvalues of M scaled by each parameter's own information: what is known very well of one parameter, by a prior or by its
//! readings, does not make another one undetermined.
//!
//! The first is the meaning: where a typical change moves the readings by less than a hundredth of
//! their standard deviation, the measurements tell nothing of it, a fit that follows them would run
//! far out of what a joint can be, and keeping the nominal value harms nothing else. The second
//! matters only where the readings are far better than the parameters' effect: each of M's entries is a
//! sum of N products, wrong by at most N 2^-53 of the parameters' own information; with p of them in a row,
//! p N 2^-53 stays below 1e-12 up to p N = 9000 (45 parameters from 200 readings), and the root of
//! it, 1e-6, is far more than what columns and angles lose.
//!
//! A direction's share in what somebody asks for (a compliance, the error at a test pose) is judged by
//! the same measure: it is nothing where its typical size would add less than a hundredth of the
//! standard error, or 1e-6 of the whole (rounding again).

use nalgebra::allocator::Allocator;
use nalgebra::{Cholesky, DMatrix, DVector, DefaultAllocator, Dim, Dyn, OMatrix};

use crate::numeric::factorisation::{finite_eigen, finite_svd, gram, trace_of_inverse};

/// Whatever is below this share of a standard deviation tells nothing.
const NOTHING: f64 = 0.01;
/// Eigenvalues of an information matrix below this share of the parameters' own information are rounding.
const ROUNDING: f64 = 1e-12;

/// Which directions in the space of p parameters measurements determine.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimable {
    /// The typical size of each parameter.
    typical: Vec<f64>,
    /// An orthonormal basis of what is determined, in relative units, p x r.
    basis: DMatrix<f64>,
    /// An orthonormal basis of what is not, p x (p - r).
    hidden: DMatrix<f64>,
}

impl Estimable {
    /// Decides for an information matrix (p x p) in relative units.
    pub fn new(information: &DMatrix<f64>, typical: &[f64]) -> Self {
        if Self::surely_all(information) {
            return Self::with_hidden(typical, DMatrix::zeros(typical.len(), 0));
        }
        Self::with_hidden(typical, hidden_directions(information))
    }

    /// Whether every parameter is determined beyond doubt, at less cost than the decision: the trace of
    /// the inverse is at least the inverse of the smallest eigenvalue, the trace at least the largest.
    pub fn surely_all(information: &DMatrix<f64>) -> bool {
        let Some(factor) = Cholesky::new(information.clone()) else {
            return false;
        };
        let inverse = trace_of_inverse(&factor);
        inverse * NOTHING * NOTHING < 1.0 && information.trace() * inverse * ROUNDING < 1.0
    }

    /// Decides for whitened equations: rows of unit variance, a column for each parameter.
    pub fn of_equations(matrix: &DMatrix<f64>, typical: &[f64]) -> Self {
        let mut relative = matrix.clone();
        for (mut column, typical) in relative.column_iter_mut().zip(typical) {
            column *= *typical;
        }
        Self::new(&gram(&relative), typical)
    }

    /// The decision whose outcome is known: an orthonormal basis of what is not determined, in
    /// relative units, p x (p - r).
    pub fn with_hidden(typical: &[f64], hidden: DMatrix<f64>) -> Self {
        Self {
            typical: typical.to_vec(),
            basis: complement(&hidden),
            hidden,
        }
    }

    /// What is determined of the first parameters, whatever the others are: a direction among them is not where it is
    /// part of one that is not, unless that is next to nothing beside its standard error by their `covariance` (in
    /// their own units).
    pub fn of_first(&self, covariance: &DMatrix<f64>) -> Self {
        let count = covariance.nrows();
        let typical = &self.typical[..count];
        let own = self.hidden.rows(0, count).into_owned();
        let matters = |value: f64, direction: DVector<f64>| {
            let row = direction.component_div(&DVector::from_column_slice(typical));
            let variance = (row.tr_mul(covariance) * &row)[(0, 0)].max(0.0);
            value > ROUNDING.sqrt().max(NOTHING * variance.sqrt())
        };
        let hidden = finite_svd(own).and_then(|svd| {
            let u = svd.u?;
            let singular = svd.singular_values.iter().enumerate();
            let places: Vec<usize> = singular
                .filter(|(index, value)| matters(**value, u.column(*index).into_owned()))
                .map(|(index, _)| index)
                .collect();
            Some(u.select_columns(&places))
        });
        let hidden = hidden.unwrap_or_else(|| DMatrix::zeros(count, 0));
        Self::with_hidden(typical, hidden)
    }

    /// The number r of independent combinations of parameters that are determined.
    pub fn rank(&self) -> usize {
        self.basis.ncols()
    }

    /// Whether every parameter is determined.
    pub fn is_complete(&self) -> bool {
        self.hidden.ncols() == 0
    }

    /// An orthonormal basis of what is determined, in relative units, p x r.
    pub const fn basis(&self) -> &DMatrix<f64> {
        &self.basis
    }

    /// An orthonormal basis of what is not determined, in relative units, p x (p - r).
    pub const fn hidden(&self) -> &DMatrix<f64> {
        &self.hidden
    }

    /// A basis of what is determined, in the parameters' own units, p x r.
    pub fn basis_in_units(&self) -> DMatrix<f64> {
        let mut basis = self.basis.clone();
        for (mut row, typical) in basis.row_iter_mut().zip(&self.typical) {
            row *= *typical;
        }
        basis
    }

    /// Derivatives by the parameters (p x c) by coordinates of what is determined (r x c).
    pub fn coordinates<C: Dim>(&self, mut columns: OMatrix<f64, Dyn, C>) -> OMatrix<f64, Dyn, C>
    where
        DefaultAllocator: Allocator<Dyn, C>,
    {
        self.scale(&mut columns);
        if self.is_complete() {
            return columns;
        }
        self.basis.tr_mul(&columns)
    }

    /// Changes in coordinates of what is determined (r x c) as those of the parameters (p x c).
    pub fn in_units<C: Dim>(&self, columns: OMatrix<f64, Dyn, C>) -> OMatrix<f64, Dyn, C>
    where
        DefaultAllocator: Allocator<Dyn, C>,
    {
        let mut columns = if self.is_complete() {
            columns
        } else {
            &self.basis * columns
        };
        self.scale(&mut columns);
        columns
    }

    fn scale<C: Dim>(&self, columns: &mut OMatrix<f64, Dyn, C>)
    where
        DefaultAllocator: Allocator<Dyn, C>,
    {
        for mut column in columns.column_iter_mut() {
            let values = column.iter_mut().zip(&self.typical);
            values.for_each(|(value, typical)| *value *= typical);
        }
    }

    /// A change of the parameters (p) in coordinates of what is determined (r).
    pub fn coordinates_of(&self, change: &DVector<f64>) -> DVector<f64> {
        let typical = DVector::from_column_slice(&self.typical);
        self.basis.tr_mul(&change.component_div(&typical))
    }

    /// A covariance in coordinates of what is determined (r x r) as that of the parameters (p x p).
    pub fn covariance(&self, within: DMatrix<f64>) -> DMatrix<f64> {
        self.in_units(self.in_units(within).transpose())
    }

    /// The typical size of each parameter.
    pub fn typical(&self) -> &[f64] {
        &self.typical
    }

    /// Whether a parameter is determined by itself, which the determined part leaves uncertain by `standard_error` (in its own unit).
    pub fn determines(&self, index: usize, standard_error: f64) -> bool {
        let typical = self.typical[index];
        is_nothing(
            typical * self.hidden.row(index).norm(),
            typical,
            standard_error,
        )
    }

    /// The parameters whose undetermined part matters to `rows` (r x p, in the parameters' own units),
    /// which the determined part leaves uncertain by `standard_error` (root of the sum over the rows);
    /// none where the rows are determined.
    pub fn missing(&self, rows: &DMatrix<f64>, standard_error: f64) -> Vec<usize> {
        if self.is_complete() {
            return Vec::new();
        }
        let mut relative = rows.clone();
        for (mut column, typical) in relative.column_iter_mut().zip(&self.typical) {
            column *= *typical;
        }
        let outside = &relative * &self.hidden;
        if is_nothing(outside.norm(), relative.norm(), standard_error) {
            return Vec::new();
        }
        // Back among the parameters, leaving out what rounding leaves of the others.
        let outside = outside * self.hidden.transpose();
        let largest = outside.amax();
        let matters = |&index: &usize| outside.column(index).amax() > ROUNDING.sqrt() * largest;
        (0..self.typical.len()).filter(matters).collect()
    }
}

/// Whether what rows (of such a norm in relative units) have in directions that are not determined is next to nothing, beside rounding or
/// beside what the determined part leaves uncertain.
fn is_nothing(outside: f64, norm: f64, standard_error: f64) -> bool {
    outside <= (ROUNDING.sqrt() * norm).max(NOTHING * standard_error)
}

/// The directions that are not determined. A parameter that shows nowhere even where all others are known
/// is a direction of its own, free of rounding.
fn hidden_directions(information: &DMatrix<f64>) -> DMatrix<f64> {
    let size = information.nrows();
    if !information.iter().all(|value| value.is_finite()) {
        return DMatrix::identity(size, size);
    }
    let diagonal = information.diagonal();
    let (shown, silent): (Vec<usize>, Vec<usize>) =
        (0..size).partition(|&index| diagonal[index] > NOTHING * NOTHING);
    let block = information.select_columns(&shown).select_rows(&shown);
    let is_all_known = !silent.is_empty() && Estimable::surely_all(&block);
    let among = if is_all_known {
        DMatrix::zeros(shown.len(), 0)
    } else if let Some(among) = hidden_among(&block) {
        among
    } else {
        return DMatrix::identity(size, size);
    };
    let mut hidden = DMatrix::zeros(size, silent.len() + among.ncols());
    for (column, &row) in silent.iter().enumerate() {
        hidden[(row, column)] = 1.0;
    }
    for (place, &row) in shown.iter().enumerate() {
        let mut own = hidden.view_mut((row, silent.len()), (1, among.ncols()));
        own.copy_from(&among.row(place));
    }
    hidden
}

/// The same of parameters that all show where the others are known. What is known far better than the rest is measured by its own
/// information, lest its rounding hide the rest.
fn hidden_among(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let least = NOTHING * NOTHING;
    let diagonal = information.diagonal();
    let is_even = diagonal.max() * ROUNDING * diagonal.len() as f64 <= least;
    let (matrix, scales, allowed) = if is_even {
        (
            information.clone(),
            DVector::repeat(diagonal.len(), 1.0),
            least,
        )
    } else {
        // M - l has as many directions below zero as S (M - l) S has (Sylvester).
        let scales = diagonal.map(|own| own.max(1.0).sqrt().recip());
        let matrix = DMatrix::from_fn(diagonal.len(), diagonal.len(), |row, column| {
            let own = if row == column { least } else { 0.0 };
            (information[(row, column)] - own) * scales[row] * scales[column]
        });
        (matrix, scales, ROUNDING)
    };
    if matrix.is_empty() {
        return Some(matrix);
    }
    let eigen = finite_eigen(&matrix)?;
    let places: Vec<usize> = (0..diagonal.len())
        .filter(|&index| eigen.eigenvalues[index] <= allowed)
        .collect();
    let mut found = eigen.eigenvectors.select_columns(&places);
    if !is_even && !places.is_empty() {
        for (mut row, scale) in found.row_iter_mut().zip(&scales) {
            row *= *scale;
        }
        found = found.qr().q();
    }
    Some(found)
}

/// An orthonormal basis of what is orthogonal to orthonormal columns: unit vectors as far as they are.
fn complement(hidden: &DMatrix<f64>) -> DMatrix<f64> {
    let size = hidden.nrows();
    if hidden.ncols() == 0 {
        return DMatrix::identity(size, size);
    }
    let unit = |index: usize| {
        let mut column = DVector::zeros(size);
        column[index] = 1.0;
        column
    };
    // Unit vectors that are orthogonal as they are come first; then the one that is furthest from those taken, among equals the first.
    let (open, mut left): (Vec<usize>, Vec<usize>) =
        (0..size).partition(|&index| hidden.row(index).iter().all(|&value| value == 0.0));
    let mut columns: Vec<_> = open.into_iter().map(|index| (index, unit(index))).collect();
    let mut taken = hidden.clone();
    while columns.len() + hidden.ncols() < size {
        let outside = |index: usize| 1.0 - taken.row(index).norm_squared();
        let Some(place) = (0..left.len()).reduce(|best, next| {
            let better = outside(left[next]) > outside(left[best]) + ROUNDING.sqrt();
            if better { next } else { best }
        }) else {
            break;
        };
        let index = left.remove(place);
        let mut column = unit(index);
        // Twice is enough.
        for _ in 0..2 {
            let along = taken.tr_mul(&column);
            column -= &taken * along;
        }
        column.normalize_mut();
        let width = taken.ncols();
        taken = taken.insert_column(width, 0.0);
        taken.set_column(width, &column);
        columns.push((index, column));
    }
    columns.sort_by_key(|(index, _)| *index);
    let columns: Vec<_> = columns.into_iter().map(|(_, column)| column).collect();
    if columns.is_empty() {
        DMatrix::zeros(size, 0)
    } else {
        DMatrix::from_columns(&columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn hidden_of(information: &DMatrix<f64>) -> DMatrix<f64> {
        let estimable = Estimable::new(information, &vec![1.0; information.nrows()]);
        let together = estimable.basis() * estimable.basis().transpose()
            + estimable.hidden() * estimable.hidden().transpose();
        let size = information.nrows();
        assert!((together - DMatrix::identity(size, size)).amax() < 1e-12);
        estimable.hidden().clone()
    }

    #[test]
    fn what_is_known_is_complete() {
        let estimable = Estimable::new(&dmatrix![4.0, 1.0; 1.0, 9.0], &[1.0, 1.0]);
        assert!(estimable.is_complete());
        assert_eq!(*estimable.basis(), DMatrix::identity(2, 2));
        assert!(estimable.missing(&dmatrix![1.0, 1.0], 0.1).is_empty());
    }

    /// A standard error of 99 and of 101 typical sizes.
    #[test]
    fn a_hundred_typical_sizes_are_the_limit() {
        for (error, hidden) in [(99.0_f64, 0), (101.0, 1)] {
            let information = dmatrix![1e4, 0.0; 0.0, error.powi(-2)];
            assert_eq!(hidden_of(&information).ncols(), hidden, "{error}");
        }
    }

    /// Readings that are far better than the effect: only rounding is left of the difference of two parameters.
    #[test]
    fn rounding_is_no_information() {
        for (share, hidden) in [(1e-11, 0), (1e-13, 1)] {
            let (sum, off) = (1e20 * (0.5 + share), 1e20 * (0.5 - share));
            let information = dmatrix![sum, off; off, sum];
            assert_eq!(hidden_of(&information).ncols(), hidden, "{share}");
        }
    }

    /// However well one parameter is known, what is determined of the others is the same.
    #[test]
    fn what_is_known_best_hides_nothing() {
        let rows = dmatrix![3.0, 30.0, 60.0, 1.0; 2.0, -20.0, -40.0, 5.0; 1.0, 7.0, 14.0, 2.0; 4.0, 1.0, 2.0, 9.0];
        let information = rows.tr_mul(&rows);
        for prior in [1.0, 1e6, 1e12, 1e18, 1e24] {
            let mut with = information.clone();
            with[(0, 0)] += prior;
            let hidden = hidden_of(&with);
            assert_eq!(hidden.ncols(), 1, "{prior}");
            let expected = nalgebra::dvector![0.0, 2.0, -1.0, 0.0] / 5.0_f64.sqrt();
            let along = hidden.column(0).dot(&expected).abs();
            assert!((along - 1.0).abs() < 1e-6, "{prior}: {hidden}");
        }
    }

    /// Only the first plus twice the second shows: what keeps that sum is hidden, the third is known.
    #[test]
    fn a_combination_is_told_from_its_parts() {
        let rows = dmatrix![30.0, 60.0, 0.0; -20.0, -40.0, 0.0; 0.0, 0.0, 50.0];
        let estimable = Estimable::of_equations(&rows, &[1.0, 1.0, 1.0]);
        hidden_of(&rows.tr_mul(&rows));
        assert_eq!(estimable.rank(), 2);
        assert_eq!(estimable.missing(&dmatrix![1.0, 0.0, 0.0], 0.1), [0, 1]);
        assert!(estimable.missing(&dmatrix![0.5, 1.0, 7.0], 0.1).is_empty());
        assert!(estimable.missing(&dmatrix![0.0, 0.0, 1.0], 0.1).is_empty());
        assert_eq!(estimable.missing(&dmatrix![0.0, 1.0, 1.0], 0.1), [0, 1]);
    }

    /// The typical sizes decide, not the units: the same in radians or in millionths.
    #[test]
    fn units_do_not_matter() {
        let rows = dmatrix![30.0, 0.0; 0.0, 0.005];
        let scaled = dmatrix![30e6, 0.0; 0.0, 5e3];
        let one = Estimable::of_equations(&rows, &[1.0, 1.0]);
        let other = Estimable::of_equations(&scaled, &[1e-6, 1e-6]);
        assert_eq!(one.hidden(), other.hidden());
        assert_eq!(one.missing(&dmatrix![1.0, 1.0], 0.1), [1]);
        // A row that needs so little of it that its typical size is below a hundredth of the noise.
        assert!(one.missing(&dmatrix![1.0, 9e-4], 0.1).is_empty());
    }

    #[test]
    fn numbers_that_are_none_determine_nothing() {
        let information = dmatrix![f64::NAN, 0.0; 0.0, 1.0];
        assert_eq!(Estimable::new(&information, &[1.0, 1.0]).rank(), 0);
    }
}
