//! One box's Taylor model, and its largest value.

use nalgebra::{SMatrix, SVector};

use super::rounding::{UNDERFLOW, UNIT, UP};
use super::taylor::{COEFFICIENTS, ModelWorkspace, TaylorModel, VARIABLES, linear, second};

type QuadraticForm = SMatrix<f64, VARIABLES, VARIABLES>;

/// How much is added to a form's diagonal, and taken off again where it is checked to be positive semidefinite, as shares of its size:
/// Cholesky's factorisation in double precision succeeds of no form that is less positive than 1e-14 of it below zero.
const SLACK: [f64; 2] = [1e-11, 1e-12];
/// Rounds over the coordinates in search of a concave function's largest value.
const SWEEPS: usize = 12;

/// A polynomial in 1, `x_j`, T2(`x_j`), `x_i x_j` with a remainder.
#[derive(Debug, Clone, Copy)]
pub(super) struct Polynomial {
    variables: usize,
    coefficients: [f64; COEFFICIENTS],
    pub remainder: f64,
}

impl Polynomial {
    pub fn new(
        workspace: &ModelWorkspace,
        model: TaylorModel,
        lane: usize,
        variables: usize,
    ) -> Self {
        let mut coefficients = [0.0; COEFFICIENTS];
        for (to, from) in coefficients.iter_mut().zip(workspace.coefficients(model)) {
            *to = from[lane];
        }
        Self {
            variables,
            coefficients,
            remainder: workspace.remainder(model)[lane],
        }
    }

    #[cfg(test)]
    pub fn coefficient(&self, place: usize) -> f64 {
        self.coefficients[place]
    }

    pub fn slope(&self, j: usize) -> f64 {
        self.coefficients[linear(j)]
    }

    pub fn constant(&self) -> f64 {
        self.coefficients[0]
    }

    /// A bound of the largest value over the box.
    ///
    /// With |`x_i x_j`| <= (`x_i`^2 + `x_j`^2)/2 every variable stands alone: |c| t + b t^2 is largest at t = 1, or at
    /// its vertex.
    pub fn largest(&self) -> f64 {
        let c = &self.coefficients;
        let mut bend = [0.0; VARIABLES];
        for j in 0..self.variables {
            for i in 0..j {
                let half = 0.5 * c[second(i, j)].abs();
                bend[i] += half;
                bend[j] += half;
            }
        }
        let mut sum = c[0] + self.remainder;
        let mut size = c[0].abs() + self.remainder;
        for j in 0..self.variables {
            let (slope, own) = (c[linear(j)].abs(), c[second(j, j)]);
            // T2 = 2 t^2 - 1
            let square = 2.0 * own + bend[j];
            let top = if square < 0.0 && slope < -2.0 * square {
                slope * slope / (-4.0 * square)
            } else {
                slope + square
            };
            sum += top - own;
            size += slope + 2.0 * own.abs() + bend[j] + own.abs();
        }
        // Fewer than 50 roundings of what adds up to `size`. (The vertex is below slope/2 <= size.)
        sum + (64.0 * UNIT * size + UNDERFLOW) * UP
    }

    /// A bound of the largest value over the box by a concave function that is nowhere below the polynomial.
    ///
    /// With the quadratic form M, whose convex part has entries whose sizes add up to `r_i` in row i, B = 2 (diag(r) - M) is positive
    /// semidefinite, which is checked, and for any y
    ///
    /// ```text
    /// g.x + x^T M x <= sum r + g.x - x^T B x / 2 <= sum r + y^T B y / 2 + sum |g - B y|
    /// ```
    ///
    /// The last is an equality for the y where the concave function is largest.
    pub fn largest_of_concave(&self) -> f64 {
        let (c, count) = (&self.coefficients, self.variables);
        let (mut form, mut slopes) = (QuadraticForm::zeros(), SVector::<f64, VARIABLES>::zeros());
        let mut least = c[0] + self.remainder;
        let mut size = c[0].abs() + self.remainder;
        for j in 0..count {
            let own = c[second(j, j)];
            slopes[j] = c[linear(j)];
            // T2 = 2 t^2 - 1
            form[(j, j)] = 2.0 * own;
            least -= own;
            for i in 0..j {
                form[(i, j)] = c[second(i, j)] / 2.0;
                form[(j, i)] = form[(i, j)];
            }
        }
        let scale = form.abs().sum();
        size += slopes.abs().sum() + 2.0 * scale;
        if !size.is_finite() {
            return f64::INFINITY;
        }
        let eigen = form.symmetric_eigen();
        let convex = eigen.eigenvectors
            * QuadraticForm::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0)))
            * eigen.eigenvectors.transpose();
        let rows = SVector::from_fn(|row, _| {
            let sum: f64 = convex.row(row).iter().map(|entry| entry.abs()).sum();
            sum + scale * SLACK[0]
        });
        let own = (QuadraticForm::from_diagonal(&rows) - form) * 2.0;
        let shifted = own - QuadraticForm::identity() * (scale * SLACK[1]);
        let Some(factor) = shifted.cholesky() else {
            return f64::INFINITY;
        };
        let mut place = factor.solve(&slopes);
        if place.amax() > 1.0 {
            place.apply(|each| *each = each.clamp(-1.0, 1.0));
            for _ in 0..SWEEPS {
                for j in 0..count {
                    let others = own.column(j).dot(&place) - own[(j, j)] * place[j];
                    place[j] = ((slopes[j] - others) / own[(j, j)]).clamp(-1.0, 1.0);
                }
            }
        }
        let pull = own * place;
        let kept = rows.rows(0, count).sum();
        size += 4.0 * (kept + own.abs().sum());
        let top = kept + place.dot(&pull) / 2.0 + (slopes - pull).abs().sum();
        // Fewer than 500 roundings of what adds up to `size`.
        least + top + (512.0 * UNIT * size + UNDERFLOW) * UP
    }

    /// The value at the box's centre, roughly.
    pub fn middle(&self) -> f64 {
        let own: f64 = (0..self.variables)
            .map(|j| self.coefficients[second(j, j)])
            .sum();
        self.coefficients[0] - own
    }

    /// A bound of the value at the box's centre from below.
    pub fn least_at_centre(&self) -> f64 {
        let mut sum = self.coefficients[0] - self.remainder;
        let mut size = self.coefficients[0].abs() + self.remainder;
        for j in 0..self.variables {
            let own = self.coefficients[second(j, j)];
            sum -= own;
            size += own.abs();
        }
        sum - (32.0 * UNIT * size + UNDERFLOW) * UP
    }

    /// The sum with so many times another.
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = *self;
        let mut size = 0.0;
        let used = linear(self.variables);
        let pairs = sum.coefficients[..used].iter_mut().zip(&other.coefficients);
        for (to, from) in pairs {
            let product = factor * from;
            size += to.abs() + product.abs();
            *to += product;
        }
        // Two roundings each.
        sum.remainder =
            (self.remainder + factor.abs() * other.remainder + 3.0 * UNIT * size + UNDERFLOW) * UP;
        sum
    }

    /// How much each variable adds to the largest value.
    pub fn shares(&self) -> [f64; VARIABLES] {
        let c = &self.coefficients;
        let mut shares = [0.0; VARIABLES];
        for j in 0..self.variables {
            shares[j] += c[linear(j)].abs() + c[second(j, j)].abs();
            for i in 0..j {
                let half = 0.5 * c[second(i, j)].abs();
                shares[i] += half;
                shares[j] += half;
            }
        }
        shares
    }
}
