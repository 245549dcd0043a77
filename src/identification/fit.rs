//! The fit itself: linear by eq. 9 (or 6), non-linear by Gauss-Newton through the static equilibrium.

use nalgebra::DVector;

use super::equations::{EquationSource, Equations};
use super::error::IdentificationError;
use crate::estimable::Estimable;
use crate::least_squares::LeastSquares;
use crate::robot::Robot;

/// The non-linear estimate is found when no compliance would change by more than this share of
/// its typical size.
const CONVERGED: f64 = 1e-10;
/// Gauss-Newton needs three or four steps here, where the problem is nearly linear.
const MAXIMUM_ITERATIONS: usize = 30;
/// Steps that change a compliance by more than this share of its typical size must lower the residuals;
/// shorter ones may end in their rounding.
const LONG: f64 = 1e-2;
/// A step is halved so often at most.
const HALVINGS: u32 = 20;

/// A fit before its uncertainty is judged: whitened residuals and the last least-squares problem.
pub(super) struct Fit {
    /// The compliance of every joint; in directions that are not determined, the nominal ones.
    pub compliance: Vec<f64>,
    pub estimable: Estimable,
    pub least_squares: LeastSquares,
    pub whitened_residuals: DVector<f64>,
    pub iterations: usize,
}

/// What the measurements determine follows from their linear equations at the commanded angles, as it
/// does for the planner: it does not depend on what was read, and does not change on the way of a fit.
pub(super) fn fit_linear(source: &EquationSource<'_>, nominal: &Robot) -> Fit {
    let Equations {
        matrix,
        right_hand_side,
    } = source.linear(&nominal.compliance_rad_per_nm);
    let parameters = source.parameters;
    let estimable = Estimable::of_equations(&matrix, &nominal.typical_rad_per_nm(parameters));
    let mut compliance = nominal.compliance_rad_per_nm.clone();
    let (least_squares, whitened_residuals) = if estimable.is_complete() {
        let least_squares = LeastSquares::solve(&matrix, &right_hand_side, &estimable);
        for (&joint, value) in parameters.iter().zip(&least_squares.solution) {
            compliance[joint] = *value;
        }
        let residuals = right_hand_side - matrix * &least_squares.solution;
        (least_squares, residuals)
    } else {
        // What is not determined stays nominal: the change from there is solved for.
        let start = parameters.iter().map(|&joint| compliance[joint]);
        let change = right_hand_side - &matrix * DVector::from_iterator(parameters.len(), start);
        let least_squares = LeastSquares::solve(&matrix, &change, &estimable);
        add(&mut compliance, parameters, &least_squares.solution, 1.0);
        let residuals = change - matrix * &least_squares.solution;
        (least_squares, residuals)
    };
    Fit {
        compliance,
        estimable,
        least_squares,
        whitened_residuals,
        iterations: 1,
    }
}

/// Gauss-Newton from the linear estimate, or from the nominal compliances where there is no equilibrium
/// with that. Directions that the measurements do not determine keep the nominal value. A step that
/// leads where there is no equilibrium, or a long one that raises the residuals, is halved.
pub(super) fn fit_nonlinear(
    source: &EquationSource<'_>,
    nominal: &Robot,
) -> Result<Fit, IdentificationError> {
    let Fit {
        mut compliance,
        estimable,
        ..
    } = fit_linear(source, nominal);
    let mut equations = source.nonlinear(&compliance).or_else(|error| {
        compliance.clone_from(&nominal.compliance_rad_per_nm);
        source.nonlinear(&compliance).map_err(|_| error)
    })?;
    let parameters = source.parameters;
    let mut change = f64::INFINITY;
    for iterations in 1..=MAXIMUM_ITERATIONS {
        let least_squares =
            LeastSquares::solve(&equations.matrix, &equations.right_hand_side, &estimable);
        let steps = least_squares.solution.iter().zip(estimable.typical());
        change = (steps.map(|(step, typical)| step.abs() / typical)).fold(0.0, f64::max);
        if change <= CONVERGED {
            return Ok(Fit {
                whitened_residuals: equations.right_hand_side,
                compliance,
                estimable,
                least_squares,
                iterations,
            });
        }
        let before = equations.right_hand_side.norm_squared();
        let mut share = 1.0;
        let mut halvings = 0;
        equations = loop {
            let mut next = compliance.clone();
            add(&mut next, parameters, &least_squares.solution, share);
            let found = source.nonlinear(&next);
            let rises = |found: &Equations| found.right_hand_side.norm_squared() > before;
            let is_worse = found.as_ref().map_or(true, rises);
            if halvings == HALVINGS || !is_worse || (found.is_ok() && share * change < LONG) {
                let found = found?;
                compliance = next;
                break found;
            }
            share *= 0.5;
            halvings += 1;
        };
    }
    Err(IdentificationError::NotConverged { change })
}

/// Adds so many times a change of the parameters to the compliances of all joints.
fn add(compliance: &mut [f64], parameters: &[usize], change: &DVector<f64>, times: f64) {
    for (&joint, change) in parameters.iter().zip(change) {
        compliance[joint] += times * change;
    }
}
