//! The fit itself: linear by eq. 9 (or 6), non-linear by Gauss-Newton through the static equilibrium.

use nalgebra::{DMatrix, DVector, stack};

use super::case::Case;
use super::equations::{PredictedRows, PriorRows};
use super::error::IdentificationError;
use super::whitening::Whitening;
use crate::numeric::estimable::Estimable;
use crate::numeric::factorisation::gram;
use crate::numeric::least_squares::{FactoredEquations, LeastSquares};
use crate::observation::RestTorques;
use crate::task::Method;

/// The non-linear estimate is found when no compliance would change by more than this share of
/// its typical size.
const CONVERGED: f64 = 1e-10;
/// Where more is uncertain, it is found when the last step is shorter than this in standard errors: the next would be shorter by far.
const CONVERGED_ERRORS: f64 = 1e-4;
/// Gauss-Newton needs three or four steps here, where the problem is nearly linear; with many unknowns of which one is
/// hardly determined, some tens.
const MAXIMUM_ITERATIONS: usize = 100;
/// Steps that change a compliance by more than this share of its typical size must lower the residuals;
/// shorter ones may end in their rounding.
const LONG: f64 = 1e-2;
/// A step is halved so often at most.
const HALVINGS: u32 = 20;

/// A fit before its uncertainty is judged.
pub(super) struct Fit {
    /// The values of the unknowns; in directions that are not determined, the nominal ones.
    pub values: Vec<f64>,
    /// The covariance of what is determined, p x p.
    pub covariance: DMatrix<f64>,
    /// See [`LeastSquares::condition`].
    pub condition: f64,
    pub whitened_residuals: DVector<f64>,
    pub iterations: usize,
}

/// What fits to the same plan begin with, whatever is read.
#[derive(Debug, Clone)]
pub(super) struct FitStart {
    pub whitening: Whitening,
    /// What the measurements determine follows from their linear equations at the commanded angles, as it
    /// does for the planner: it does not depend on what was read, and does not change on the way of a fit.
    pub estimable: Estimable,
    prior: PriorRows,
    /// The prior's information in coordinates of what is determined, r x r.
    before: DMatrix<f64>,
    nominal: Vec<f64>,
    /// Where a fit begins that does not begin near: at nominal values, through the static equilibrium as far as there is one.
    at_nominal: PredictedRows,
    /// Their normal equations, where a step is found by these and they are not singular to rounding.
    normal: Option<FactoredEquations>,
    torques: Vec<RestTorques>,
}

impl FitStart {
    /// Fits that begin at nominal values: by the linear method, or through the static equilibrium.
    pub fn new(source: &Case<'_>, is_near: bool) -> Self {
        let whitening = source.whitening();
        let nominal = source.nominal_values();
        let prior = source.prior();
        let mut at_nominal = source.predicted_linearly();
        whitening.whiten(&mut at_nominal.derivatives);
        let estimable = source.estimable(&stack![at_nominal.derivatives; prior.rows]);
        let mut torques = Vec::new();
        let at_rest = (source.method == Method::Nonlinear && !is_near)
            .then(|| source.predicted(&nominal, &mut torques).ok());
        if let Some(mut at_rest) = at_rest.flatten() {
            whitening.whiten(&mut at_rest.derivatives);
            at_nominal = at_rest;
        }
        whitening.whiten(&mut at_nominal.values);
        let within = &prior.rows * estimable.basis_in_units();
        let before = gram(&within);
        let is_factored = source.uncertain.is_some() || source.method == Method::Nonlinear;
        Self {
            normal: (is_factored
                .then(|| FactoredEquations::new(&at_nominal.derivatives, &before, &estimable)))
            .flatten(),
            before,
            whitening,
            estimable,
            prior,
            nominal,
            at_nominal,
            torques,
        }
    }

    /// The number of equations, what was known before among them.
    pub fn equations(&self) -> usize {
        self.at_nominal.values.len() + self.prior.rows.nrows()
    }

    /// The change from nominal values to others, as far as it is determined.
    fn determined(&self, values: &[f64]) -> DVector<f64> {
        let typical = DVector::from_column_slice(self.estimable.typical());
        let off = DVector::from_column_slice(values) - DVector::from_column_slice(&self.nominal);
        let basis = self.estimable.basis();
        (basis * basis.tr_mul(&off.component_div(&typical))).component_mul(&typical)
    }

    /// The equations at values of the unknowns, by whitened predictions there.
    fn place(&self, read: &DVector<f64>, predicted: PredictedRows, values: &[f64]) -> FitPlace {
        let off = &self.prior.mean - DVector::from_column_slice(values);
        FitPlace {
            matrix: predicted.derivatives,
            left: read - predicted.values,
            before: &self.prior.rows * off,
        }
    }

    /// The same through the static equilibrium there.
    fn at(
        &self,
        source: &Case<'_>,
        read: &DVector<f64>,
        values: &[f64],
        torques: &mut Vec<RestTorques>,
    ) -> Result<FitPlace, IdentificationError> {
        let mut predicted = source.predicted(values, torques)?;
        self.whitening.whiten(&mut predicted.derivatives);
        self.whitening.whiten(&mut predicted.values);
        Ok(self.place(read, predicted, values))
    }

    /// The step that the equations say: by normal equations where there are some, else by the singular values of all rows.
    fn step(&self, place: &FitPlace, normal: Option<&FactoredEquations>) -> DVector<f64> {
        let Some(normal) = normal else {
            return self.solve(place).solution;
        };
        let gradient = place.matrix.tr_mul(&place.left) + self.prior.rows.tr_mul(&place.before);
        normal.solution(gradient, &self.estimable)
    }

    fn solve(&self, place: &FitPlace) -> LeastSquares {
        let matrix = stack![place.matrix; self.prior.rows];
        LeastSquares::solve(&matrix, &place.residuals(), &self.estimable)
    }

    /// The end of a fit, with the last step.
    fn end(
        &self,
        place: &FitPlace,
        mut values: Vec<f64>,
        normal: Option<&FactoredEquations>,
        iterations: usize,
    ) -> Fit {
        let LeastSquares {
            solution: step,
            covariance,
            condition,
        } = match normal {
            None => self.solve(place),
            Some(equations) => LeastSquares {
                solution: self.step(place, normal),
                covariance: equations.covariance(&self.estimable),
                condition: equations.condition,
            },
        };
        add(&mut values, &step, 1.0);
        let moved = stack![&place.matrix * &step; &self.prior.rows * &step];
        Fit {
            whitened_residuals: place.residuals() - moved,
            values,
            covariance,
            condition,
            iterations,
        }
    }
}

/// Whitened equations of the change from values of the unknowns.
struct FitPlace {
    /// Of the readings, N x p.
    matrix: DMatrix<f64>,
    /// What is left of these.
    left: DVector<f64>,
    /// How far the values are from what was known before.
    before: DVector<f64>,
}

impl FitPlace {
    fn residuals(&self) -> DVector<f64> {
        stack![self.left; self.before]
    }

    fn square(&self) -> f64 {
        self.left.norm_squared() + self.before.norm_squared()
    }
}

/// The linear estimate. What is not determined stays nominal: the change from there is solved for.
pub(super) fn fit_linear(start: &FitStart, source: &Case<'_>) -> Fit {
    let mut read = source.read();
    start.whitening.whiten(&mut read);
    let place = start.place(&read, start.at_nominal.clone(), &start.nominal);
    // Where only compliances are unknown, these are few, and may be determined badly.
    let normal = start.normal.as_ref().filter(|_| source.uncertain.is_some());
    start.end(&place, start.nominal.clone(), normal, 1)
}

/// Gauss-Newton from values that are near, from one step from the nominal values, or from these where there is no equilibrium
/// with that. Directions that the measurements do not determine keep the nominal value. A step that
/// leads where there is no equilibrium, or a long one that raises the residuals, is halved. The last step is taken, too.
pub(super) fn fit_nonlinear(
    start: &FitStart,
    source: &Case<'_>,
    near: Option<&[f64]>,
) -> Result<Fit, IdentificationError> {
    let mut read = source.read();
    start.whitening.whiten(&mut read);
    let mut torques = start.torques.clone();
    let mut values = start.nominal.clone();
    let first = if let Some(near) = near {
        start.determined(near)
    } else {
        let nominal = start.place(&read, start.at_nominal.clone(), &values);
        start.step(&nominal, start.normal.as_ref())
    };
    add(&mut values, &first, 1.0);
    let mut place = start
        .at(source, &read, &values, &mut torques)
        .or_else(|error| {
            values.clone_from(&start.nominal);
            let nominal = start.at(source, &read, &values, &mut torques);
            nominal.map_err(|_| error)
        })?;
    let mut change = f64::INFINITY;
    for iterations in 1..=MAXIMUM_ITERATIONS {
        let normal = FactoredEquations::new(&place.matrix, &start.before, &start.estimable);
        let step = start.step(&place, normal.as_ref());
        let steps = step.iter().zip(start.estimable.typical());
        change = (steps.map(|(step, typical)| step.abs() / typical)).fold(0.0, f64::max);
        let length = (&place.matrix * &step).norm_squared();
        let length = length + (&start.prior.rows * &step).norm_squared();
        let is_short = source.uncertain.is_some() && length.sqrt() <= CONVERGED_ERRORS;
        if change <= CONVERGED || is_short {
            let normal = normal.as_ref().filter(|_| source.uncertain.is_some());
            return Ok(start.end(&place, values, normal, iterations));
        }
        let before = place.square();
        let mut share = 1.0;
        let mut halvings = 0;
        place = loop {
            let mut next = values.clone();
            add(&mut next, &step, share);
            let found = start.at(source, &read, &next, &mut torques);
            let rises = |found: &FitPlace| found.square() > before;
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

fn add(values: &mut [f64], change: &DVector<f64>, times: f64) {
    for (value, change) in values.iter_mut().zip(change) {
        *value += times * change;
    }
}

#[cfg(test)]
mod tests {
    use super::super::Sigma;
    use super::*;
    use crate::plan::read_plan;
    use crate::scenario::Scenario;
    use crate::testbed::measurements_of;

    /// A fit that begins near and one that does not end at the same place, by far nearer than the last step may be long.
    #[test]
    fn the_last_step_is_taken() {
        let scenario = Scenario::load("scenarios/kr270.toml".as_ref()).expect("valid");
        let belief = &scenario.task.belief;
        let plan = read_plan("scenarios/plans/klimchik2012_m3.csv".as_ref(), 6).expect("a plan");
        let sigma = Sigma::Known(belief.instrument.sigma_m);
        let mut measured = measurements_of(&plan, &belief.instrument);
        let case = Case::of_belief(belief, &[], sigma, Method::Nonlinear);
        let unread = case.with(&measured);
        let mut near = unread.nominal_values();
        for (place, value) in near.iter_mut().take(5).enumerate() {
            *value *= 1.2 - 0.1 * place as f64;
        }
        let shown = unread.predicted(&near, &mut Vec::new()).expect("stable");
        for (index, each) in measured.iter_mut().enumerate() {
            each.deflection_m = shown.values.fixed_rows::<3>(3 * index).into_owned();
            each.deflection_m.x += 5e-5;
        }
        let source = case.with(&measured);
        let [one, other] = [None, Some(near.as_slice())].map(|near| {
            let start = FitStart::new(&source, near.is_some());
            fit_nonlinear(&start, &source, near).expect("a fit")
        });
        for (place, (one, value)) in other.values.iter().zip(&one.values).enumerate() {
            let error = other.covariance[(place, place)].sqrt();
            assert!((one - value).abs() < 1e-8 * error, "{place}: {one} {value}");
        }
    }
}
