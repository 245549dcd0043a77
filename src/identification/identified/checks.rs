//! Whether the numbers of an identified file can be what they are said to be, and whether what it says twice agrees: a number that somebody
//! altered contradicts another.

use std::path::Path;

use nalgebra::DMatrix;

use crate::files::FileError;
use crate::numeric::factorisation::{finite_eigen, symmetric};
use crate::quantities::plausible::{Kind, shown};

/// Rounding in what is said twice, as a share of its size.
const SAID_TWICE: f64 = 1e-9;
/// Rounding in what wrote a covariance, an inverse of what is nearly singular, may leave it so far from symmetric and
/// semidefinite, as a share of the variances.
const ROUNDING: f64 = 1e-6;
/// Products of orthonormal directions are so near to one or zero.
const ORTHONORMAL: f64 = 1e-9;

/// A file whose numbers are looked at, each by its key.
#[derive(Debug, Clone, Copy)]
pub struct CheckedFile<'a>(pub &'a Path);

impl CheckedFile<'_> {
    /// What is wrong with a key.
    pub fn wrong(self, key: impl Into<String>, problem: impl Into<String>) -> FileError {
        FileError::new(self.0, problem).at(key)
    }

    /// Standard deviations of what a model leaves, which files have in thousandths of their units; none where there is none.
    pub fn sizes(self, sizes: [(&str, Option<f64>); 2]) -> Result<(), FileError> {
        for (key, size) in sizes {
            if let Some(size) = size.filter(|size| *size < 0.0) {
                return Err(self.wrong(key, format!("found {size}; zero or a size is needed")));
            }
        }
        Ok(())
    }

    /// Whether what a file says of an estimate goes together, each with its key: its value, its variance, and where they are said its standard
    /// error and its 95 % interval, about the value or, of a logarithm, by a factor to either side.
    ///
    /// # Errors
    /// What does not, by its key.
    pub fn agree_of_estimate(
        self,
        (value_key, value): (&str, f64),
        variance: (&str, f64),
        standard_error: (&str, Option<f64>),
        interval95: (&str, Option<[f64; 2]>),
    ) -> Result<(), FileError> {
        if let (key, Some(error)) = standard_error {
            let root = variance.1.max(0.0).sqrt();
            self.agree((key, error), (variance.0, root))?;
        }
        let (key, Some([low, high])) = interval95 else {
            return Ok(());
        };
        let off = (f64::midpoint(low, high) - value).abs();
        let is_about_it = off <= SAID_TWICE * (value.abs() + (high - low).abs());
        if is_about_it || (low * high - value * value).abs() <= SAID_TWICE * (value * value) {
            return Ok(());
        }
        let found = format!("{} to {}", shown(low), shown(high));
        Err(self.contradiction(key, &found, (value_key, value)))
    }

    /// Whether a number and what another key says of it are the same.
    ///
    /// # Errors
    /// They are not, by the key of the first.
    pub fn agree(self, (key, found): (&str, f64), other: (&str, f64)) -> Result<(), FileError> {
        let size = found.abs().max(other.1.abs());
        if (found - other.1).abs() <= SAID_TWICE * size {
            return Ok(());
        }
        Err(self.contradiction(key, &shown(found), other))
    }

    fn contradiction(self, key: &str, found: &str, (other, says): (&str, f64)) -> FileError {
        let says = shown(says);
        let problem = format!(
            "found {found}; by {other} it is {says}: the file was altered since it was written"
        );
        let wrong = self.wrong(key, problem);
        wrong.hint("identify again with `elastocal identify --identified-out`")
    }

    /// The covariance of so many parameters, in their units, whose variances are of a kind, from its rows at a key of a file.
    ///
    /// # Errors
    /// Where and why it is none: it is not square or has another size, a variance is negative, or it is not symmetric and
    /// positive semidefinite.
    pub fn covariance(
        self,
        key: &str,
        rows: &[Vec<f64>],
        (size, what): (usize, &str),
        kind: &Kind,
    ) -> Result<DMatrix<f64>, FileError> {
        let wrong = |place: String, problem: String| self.wrong(format!("{key}{place}"), problem);
        if rows.len() != size {
            let problem = format!("found {} rows; there are {size} {what}", rows.len());
            return Err(wrong(String::new(), problem));
        }
        if size == 0 {
            return Ok(DMatrix::zeros(0, 0));
        }
        if let Some((row, found)) = (rows.iter().enumerate()).find(|(_, row)| row.len() != size) {
            let problem = format!("found {} numbers; {size} are allowed", found.len());
            return Err(wrong(format!("[{row}]"), problem));
        }
        let matrix = DMatrix::from_fn(size, size, |row, column| rows[row][column]);
        for index in 0..size {
            (kind.check(matrix[(index, index)]))
                .map_err(|problem| wrong(format!("[{index}][{index}]"), problem))?;
        }
        let deviation = matrix.diagonal().map(f64::sqrt);
        // Scaled to a diagonal of ones, so that compliances of any size compare.
        let mut correlation = DMatrix::identity(size, size);
        for row in 0..size {
            for column in 0..size {
                let largest = deviation[row] * deviation[column];
                let (value, other) = (matrix[(row, column)], matrix[(column, row)]);
                let place = || format!("[{row}][{column}]");
                let is_small = value.abs() <= largest * (1.0 + ROUNDING);
                if !is_small {
                    let problem = format!(
                        "found {}; with these variances at most {} is allowed",
                        shown(value),
                        shown(largest)
                    );
                    return Err(wrong(place(), problem));
                }
                if (value - other).abs() > largest * ROUNDING {
                    let problem = format!(
                        "found {}, and {} at [{column}][{row}]; a covariance is symmetric",
                        shown(value),
                        shown(other)
                    );
                    return Err(wrong(place(), problem));
                }
                if largest > 0.0 && row != column {
                    correlation[(row, column)] = value / largest;
                }
            }
        }
        let eigen = finite_eigen(&correlation);
        let smallest = eigen.map_or(f64::NAN, |eigen| eigen.eigenvalues.min());
        if smallest >= -ROUNDING * size as f64 {
            return Ok(symmetric(&matrix));
        }
        let problem = format!(
            "found the eigenvalue {} of the correlations; a covariance has none below zero",
            shown(smallest)
        );
        Err(wrong(String::new(), problem))
    }

    /// Orthonormal directions at a key, among so many parameters, as columns.
    pub fn orthonormal(
        self,
        key: &str,
        directions: &[Vec<f64>],
        (size, what): (usize, &str),
    ) -> Result<DMatrix<f64>, FileError> {
        if let Some(found) = directions.iter().find(|direction| direction.len() != size) {
            let problem = format!("found {} values; there are {size} {what}", found.len());
            return Err(self.wrong(key, problem));
        }
        let hidden = DMatrix::from_fn(size, directions.len(), |row, column| {
            directions[column][row]
        });
        let gram = hidden.tr_mul(&hidden);
        let off = (&gram - DMatrix::identity(gram.nrows(), gram.ncols())).amax();
        if off.is_nan() || off > ORTHONORMAL {
            return Err(self.wrong(key, "these are not orthonormal: the file is damaged"));
        }
        Ok(hidden)
    }
}

/// A matrix, row by row.
pub(crate) fn rows_of(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    let rows = matrix.row_iter();
    rows.map(|row| row.iter().copied().collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantities::plausible::VARIANCE;

    fn read(rows: &[Vec<f64>]) -> Result<DMatrix<f64>, FileError> {
        let counted = (rows.len(), "parameters");
        CheckedFile(Path::new("i.json")).covariance("covariance", rows, counted, &VARIANCE)
    }

    fn problem(rows: &[[f64; 2]]) -> Option<String> {
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
        Some(read(&rows).err()?.to_string())
    }

    #[test]
    fn what_a_covariance_can_be() {
        for good in [
            [[0.0, 0.0], [0.0, 0.0]],
            [[1e-16, 0.0], [0.0, 0.0]],
            [[1e-16, -1e-15], [-1e-15, 1e-14]],
        ] {
            assert_eq!(problem(&good), None);
        }
        for (bad, says) in [
            ([[-1e-16, 0.0], [0.0, 0.0]], "[0][0]: found -1e-16"),
            ([[1e-16, 0.0], [0.0, f64::NAN]], "[1][1]: found NaN"),
            ([[1e-16, 0.0], [0.0, 1e300]], "[1][1]: found 1e300"),
            ([[1e-16, 2e-16], [2e-16, 1e-16]], "[0][1]: found 2e-16"),
            ([[1e-16, 0.0], [1e-17, 1e-16]], "symmetric"),
            ([[1e-16, 0.0], [1e-21, 1e-16]], "symmetric"),
        ] {
            let found = problem(&bad).expect("is none");
            assert!(found.contains(says), "{found}");
        }
        // What rounding left is away, by the variances and not by the number itself.
        let nearly = [vec![1e-16, 1e-24], vec![-1e-24, 1e-16]];
        let found = read(&nearly).expect("a covariance");
        assert_eq!(found, found.transpose());
        assert!(read(&[]).is_ok_and(|nothing| nothing.is_empty()));
        // Each pair is possible, but not all three at once.
        let mut rows = vec![vec![-0.9; 3]; 3];
        (0..3).for_each(|index| rows[index][index] = 1.0);
        let problem = read(&rows).expect_err("is none").to_string();
        assert!(problem.contains("eigenvalue -0.8"), "{problem}");
    }
}
