//! Gauss-Newton within what is determined, with halved steps, and with the curvature that residuals bring where they are large.
//!
//! ```text
//! |L^-1 (y - h(x))|^2 + |P (x - m)|^2 -> min      over x = x0 + B z
//! ```
//!
//! with readings y, their prediction h and covariance L L^T, and what is known before. B (p x r) spans what readings and prior determine
//! together, which is decided beforehand.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::super::error::{FitResult, IdentificationError};

/// A fit is found when the next step would change no unknown by more than this share of its typical size ...
const NOTHING: f64 = 1e-10;
/// ... or is shorter than this in standard errors, unless a problem says otherwise.
pub const CONVERGED: f64 = 1e-6;
/// A step this short in standard errors may end in the rounding of the sum of squares.
const SHORT: f64 = 1e-3;
/// After so many steps a short one is enough: readings that the model explains badly make the steps small and many. A fit that is within a
/// standard error then is not awaited if its steps, shrinking as the last one did, would not be short after all that are allowed.
const PATIENCE: usize = 20;
/// Nearly linear fits take three to six steps; far starts take some more.
const MAXIMUM_ITERATIONS: usize = 60;
/// See [`FitProblem::nearly_linear`].
pub const NEARLY_LINEAR: usize = 6;
/// Steps that become no shorter than this share of those before are slow.
const SLOW: f64 = 0.1;
/// Directions in which a change of the gradient tells less than this share of itself teach nothing.
const UNTAUGHT: f64 = 1e-8;
/// Sums of squares that differ by this share may be the same.
const ROUNDING: f64 = 1e-12;
/// A step that leads where there is no equilibrium, or that raises the sum of squares, is halved so often at most.
const HALVINGS: usize = 20;

/// What is fitted.
pub trait FitProblem {
    /// What a problem keeps of its equations.
    type Kept;

    /// Changes by a smaller share of typical sizes need not lower the sum of squares.
    const SMALL: f64 = 0.0;

    /// The equations at values of the unknowns (p), with their solution.
    fn at(&mut self, values: DVector<f64>) -> FitResult<FitPlace<Self::Kept>>;

    /// A step in coordinates of what is determined (r) as a change from values of the unknowns (p), no longer than what the model can
    /// follow.
    fn change(&self, values: &DVector<f64>, step: &DVector<f64>) -> DVector<f64>;

    /// A change of the unknowns (p) in coordinates of what is determined (r).
    fn coordinates(&self, change: &DVector<f64>) -> DVector<f64>;

    /// How short a step has to be in standard errors, after one that was as long as `before`.
    fn tolerance(&self, now: &FitPlace<Self::Kept>, before: Option<f64>) -> f64;

    /// After so many steps the curvature of what those that hardly become shorter leave is learnt.
    fn nearly_linear(&self) -> usize {
        NEARLY_LINEAR
    }

    /// Whether no values can explain the readings, as two places say one after the other.
    fn is_hopeless(&self, _before: &FitPlace<Self::Kept>, _now: &FitPlace<Self::Kept>) -> bool {
        false
    }
}

/// Equations at values of the unknowns, linear in their change, with their solution; in coordinates of what is determined.
pub struct FitPlace<Kept> {
    /// The unknowns (p).
    pub values: DVector<f64>,
    /// The sum of squares, with that of what was known before.
    pub square: f64,
    /// Of the normal equations (r x r).
    pub information: DMatrix<f64>,
    /// Their right-hand side (r).
    pub gradient: DVector<f64>,
    /// What solves them (r).
    pub step: DVector<f64>,
    pub kept: Kept,
}

impl<Kept> FitPlace<Kept> {
    /// The step's length in standard errors.
    pub fn length(&self) -> f64 {
        self.gradient.dot(&self.step).max(0.0).sqrt()
    }
}

/// The place from which no step leads further, and the number of steps, with one to spare. Where there is no hope, it is where the fit
/// begins.
pub fn gauss_newton<Problem: FitProblem>(
    problem: &mut Problem,
    start: FitPlace<Problem::Kept>,
) -> FitResult<(FitPlace<Problem::Kept>, usize)> {
    let begun = start.values.clone();
    let mut now = start;
    let mut before: Option<FitPlace<Problem::Kept>> = None;
    let mut curvature: Option<DMatrix<f64>> = None;
    for iterations in 1..=MAXIMUM_ITERATIONS {
        let length = now.length();
        let is_enough = iterations > PATIENCE && length <= SHORT;
        let is_nothing = now.step.amax() <= NOTHING;
        let last = before.as_ref().map(FitPlace::length);
        if length <= problem.tolerance(&now, last) || is_enough || is_nothing {
            return Ok((now, iterations));
        }
        if let Some(before) = &before {
            let steps_left = (MAXIMUM_ITERATIONS - iterations) as f64;
            let last_length = length * (length / before.length()).powf(steps_left);
            if iterations > PATIENCE && length < 1.0 && last_length > SHORT {
                break;
            }
            if problem.is_hopeless(before, &now) {
                return Ok((problem.at(begun)?, iterations));
            }
            let is_slow = iterations > problem.nearly_linear() && length > SLOW * before.length();
            if is_slow || curvature.is_some() {
                let moved = problem.coordinates(&(&now.values - &before.values));
                curvature = learnt(&moved, before, &now, curvature);
            }
        }
        // A step by the curvature, too, where it is better.
        let curved = curvature.as_ref().and_then(|curvature| {
            let step = Cholesky::new(&now.information + curvature)?.solve(&now.gradient);
            let found = problem
                .at(&now.values + problem.change(&now.values, &step))
                .ok()?;
            let is_nearer =
                found.length() < now.length() && found.square <= now.square * (1.0 + ROUNDING);
            (found.square < now.square || is_nearer).then_some(found)
        });
        let next = if let Some(next) = curved {
            next
        } else {
            curvature = None;
            halved_step(problem, &now)?
        };
        before = Some(std::mem::replace(&mut now, next));
    }
    let step = now.length();
    Err(IdentificationError::NotConverged { step })
}

/// The next place by the linear model, after as much of the step as does not make the fit worse.
fn halved_step<Problem: FitProblem>(
    problem: &mut Problem,
    now: &FitPlace<Problem::Kept>,
) -> FitResult<FitPlace<Problem::Kept>> {
    let (mut change, mut size) = (problem.change(&now.values, &now.step), now.step.amax());
    let step = now.length();
    let mut reason = IdentificationError::NotConverged { step };
    for _ in 0..=HALVINGS {
        let may_rise = step <= SHORT || size < Problem::SMALL;
        reason = match problem.at(&now.values + &change) {
            Ok(found) if may_rise || found.square <= now.square * (1.0 + ROUNDING) => {
                return Ok(found);
            }
            Ok(_) => IdentificationError::NotConverged { step },
            Err(error) => error,
        };
        change *= 0.5;
        size *= 0.5;
    }
    Err(reason)
}

/// How the residuals bend the sum of squares otherwise than the linear model, as far as known, corrected by how the gradient
/// changed along a step: the symmetric change of rank one that agrees with it. Readings that the model explains badly
/// make that matter. What was learnt far away is forgotten where it would make the sum of squares a saddle.
fn learnt<Kept>(
    moved: &DVector<f64>,
    before: &FitPlace<Kept>,
    now: &FitPlace<Kept>,
    known: Option<DMatrix<f64>>,
) -> Option<DMatrix<f64>> {
    let size = moved.len();
    let changed = &before.gradient - &now.gradient - &now.information * moved;
    let corrected = |mut known: DMatrix<f64>| {
        let unknown = &changed - &known * moved;
        let along = unknown.dot(moved);
        if along.abs() > UNTAUGHT * unknown.norm() * moved.norm() {
            known.ger(along.recip(), &unknown, &unknown, 1.0);
        }
        let is_sound = Cholesky::new(&now.information + &known).is_some();
        is_sound.then_some(known)
    };
    (known.and_then(corrected)).or_else(|| corrected(DMatrix::zeros(size, size)))
}
