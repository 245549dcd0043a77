//! The fit itself: linear by eq. 9 (or 6), non-linear by Gauss-Newton through the static equilibrium.

use nalgebra::DVector;

use super::equations::{EquationSource, Equations};
use super::error::IdentificationError;
use crate::numeric::estimable::Estimable;
use crate::numeric::least_squares::LeastSquares;

/// The non-linear estimate is found when no compliance would change by more than this share of
/// its typical size.
const CONVERGED: f64 = 1e-10;
/// Where more is uncertain, it is found when the next step is shorter than this in standard errors.
const CONVERGED_ERRORS: f64 = 1e-4;
/// Gauss-Newton needs three or four steps here, where the problem is nearly linear; with many unknowns of which one is
/// hardly determined, some tens.
const MAXIMUM_ITERATIONS: usize = 100;
/// Steps that change a compliance by more than this share of its typical size must lower the residuals;
/// shorter ones may end in their rounding.
const LONG: f64 = 1e-2;
/// A step is halved so often at most.
const HALVINGS: u32 = 20;

/// A fit before its uncertainty is judged: whitened residuals and the last least-squares problem.
pub(super) struct Fit {
    /// The values of the unknowns; in directions that are not determined, the nominal ones.
    pub values: Vec<f64>,
    pub estimable: Estimable,
    pub least_squares: LeastSquares,
    pub whitened_residuals: DVector<f64>,
    pub iterations: usize,
}

/// What the measurements determine follows from their linear equations at the commanded angles, as it
/// does for the planner: it does not depend on what was read, and does not change on the way of a fit.
pub(super) fn fit_linear(source: &EquationSource<'_>) -> Fit {
    let Equations {
        matrix,
        right_hand_side,
    } = source.linear();
    let estimable = source.estimable(&matrix);
    let mut values = source.nominal_values();
    let is_plain = source.uncertain.is_none();
    let (least_squares, whitened_residuals) = if estimable.is_complete() && is_plain {
        let least_squares = LeastSquares::solve(&matrix, &right_hand_side, &estimable);
        values.copy_from_slice(least_squares.solution.as_slice());
        let residuals = right_hand_side - matrix * &least_squares.solution;
        (least_squares, residuals)
    } else {
        // What is not determined stays nominal: the change from there is solved for.
        let change = if is_plain {
            right_hand_side - &matrix * DVector::from_column_slice(&values)
        } else {
            right_hand_side
        };
        let change = Equations {
            matrix: matrix.clone(),
            right_hand_side: change,
        };
        let least_squares = solve(source, &change, &estimable);
        let change = change.right_hand_side;
        add(&mut values, &least_squares.solution, 1.0);
        let residuals = change - matrix * &least_squares.solution;
        (least_squares, residuals)
    };
    Fit {
        values,
        estimable,
        least_squares,
        whitened_residuals,
        iterations: 1,
    }
}

/// Gauss-Newton from values that are near, from the linear estimate, or from the nominal values where there is no equilibrium
/// with that. Directions that the measurements do not determine keep the nominal value. A step that
/// leads where there is no equilibrium, or a long one that raises the residuals, is halved.
pub(super) fn fit_nonlinear(
    source: &EquationSource<'_>,
    near: Option<&[f64]>,
) -> Result<Fit, IdentificationError> {
    let (mut values, estimable) = start(source, near);
    let mut equations = source.nonlinear(&values).or_else(|error| {
        values = source.nominal_values();
        source.nonlinear(&values).map_err(|_| error)
    })?;
    let mut change = f64::INFINITY;
    for iterations in 1..=MAXIMUM_ITERATIONS {
        let (step, known) = next_step(source, &equations, &estimable);
        let steps = step.iter().zip(estimable.typical());
        change = (steps.map(|(step, typical)| step.abs() / typical)).fold(0.0, f64::max);
        let is_short =
            source.uncertain.is_some() && (&equations.matrix * &step).norm() <= CONVERGED_ERRORS;
        if change <= CONVERGED || is_short {
            return Ok(Fit {
                least_squares: known.unwrap_or_else(|| solve(source, &equations, &estimable)),
                whitened_residuals: equations.right_hand_side,
                values,
                estimable,
                iterations,
            });
        }
        let before = equations.right_hand_side.norm_squared();
        let mut share = 1.0;
        let mut halvings = 0;
        equations = loop {
            let mut next = values.clone();
            add(&mut next, &step, share);
            let found = source.nonlinear(&next);
            let rises = |found: &Equations| found.right_hand_side.norm_squared() > before;
            let is_worse = found.as_ref().map_or(true, rises);
            if halvings == HALVINGS || !is_worse || (found.is_ok() && share * change < LONG) {
                let found = found?;
                values = next;
                break found;
            }
            share *= 0.5;
            halvings += 1;
        };
    }
    Err(IdentificationError::NotConverged {
        step: change,
        unit: "typical sizes of the parameters",
    })
}

/// The values that are near as far as they are determined, else the linear estimate; and what is determined.
fn start(source: &EquationSource<'_>, near: Option<&[f64]>) -> (Vec<f64>, Estimable) {
    if let Some(near) = near {
        let estimable = source.estimable(&source.linear().matrix);
        let mut values = source.nominal_values();
        let typical = DVector::from_column_slice(estimable.typical());
        let off = DVector::from_iterator(
            near.len(),
            near.iter().zip(&values).map(|(near, value)| near - value),
        )
        .component_div(&typical);
        let within = estimable.basis() * estimable.basis().tr_mul(&off);
        add(&mut values, &within.component_mul(&typical), 1.0);
        return (values, estimable);
    }
    if source.uncertain.is_none() {
        let Fit {
            values, estimable, ..
        } = fit_linear(source);
        return (values, estimable);
    }
    let equations = source.linear();
    let estimable = source.estimable(&equations.matrix);
    let mut values = source.nominal_values();
    add(
        &mut values,
        &next_step(source, &equations, &estimable).0,
        1.0,
    );
    (values, estimable)
}

/// The next step, and what is known there; where more is uncertain the step alone, which is quicker.
fn next_step(
    source: &EquationSource<'_>,
    equations: &Equations,
    estimable: &Estimable,
) -> (DVector<f64>, Option<LeastSquares>) {
    let Equations {
        matrix,
        right_hand_side,
    } = equations;
    let step = (source.uncertain)
        .and_then(|_| LeastSquares::step_normal(matrix, right_hand_side, estimable));
    if let Some(step) = step {
        return (step, None);
    }
    let known = LeastSquares::solve(matrix, right_hand_side, estimable);
    (known.solution.clone(), Some(known))
}

/// What is known at the end. Where more is uncertain there are many unknowns, all of them with priors or
/// well determined: the normal equations do, in units of typical sizes.
fn solve(
    source: &EquationSource<'_>,
    equations: &Equations,
    estimable: &Estimable,
) -> LeastSquares {
    let Equations {
        matrix,
        right_hand_side,
    } = equations;
    let normal = (source.uncertain)
        .and_then(|_| LeastSquares::solve_normal(matrix, right_hand_side, estimable));
    normal.unwrap_or_else(|| LeastSquares::solve(matrix, right_hand_side, estimable))
}

/// Adds so many times a change to values.
fn add(values: &mut [f64], change: &DVector<f64>, times: f64) {
    for (value, change) in values.iter_mut().zip(change) {
        *value += times * change;
    }
}
