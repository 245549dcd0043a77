//! The fit of deflections: linear by eq. 9 (or 6), non-linear by Gauss-Newton through the static equilibrium.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, stack};

use super::super::case::Case;
use super::super::equations::PredictedRows;
use super::super::error::FitResult;
use super::super::whitening::Whitening;
use super::gauss_newton::{FitPlace, FitProblem, gauss_newton};
use crate::numeric::estimable::Estimable;
use crate::numeric::factorisation::{gram, inverse_of};
use crate::numeric::least_squares::{LeastSquares, condition_of, sound_factor};
use crate::observation::RestTorques;
use crate::task::Method;

/// Where more is uncertain, the last step is taken. After steps of l0 and l1 standard errors the next is l1 (l1 / l0) long at most, and
/// shorter by far where residuals are small: a fit is found when that is less than this ...
const LEFT: f64 = 1e-4;
/// ... and l1 no longer than this, so that the covariance is that of the estimate to some thousandths.
const LAST_STEP: f64 = 0.03;

/// A fit before its uncertainty is judged.
pub struct DeflectionFit {
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
#[derive(Debug)]
pub struct FitStart {
    equations: Arc<StartEquations>,
    /// What the measurements determine follows from their linear equations at the commanded angles, as it
    /// does for the planner: it does not depend on what was read, and does not change on the way of a fit.
    pub estimable: Estimable,
    /// The prior's information in coordinates of what is determined, r x r.
    before: DMatrix<f64>,
    /// The information's factor where a fit begins, where a step is found by it and it is not singular to rounding.
    factor: Option<Cholesky<f64, Dyn>>,
}

/// The equations that fits begin with, whichever compliances they hold.
#[derive(Debug)]
struct StartEquations {
    whitening: Whitening,
    /// What is known before, as whitened equations (q x p) of the change from nominal values,
    prior: DMatrix<f64>,
    /// and whether these are others elsewhere.
    has_ratios: bool,
    nominal: DVector<f64>,
    /// The equations to first order in compliance.
    linear: DeflectionRows,
    /// Those through the static equilibrium at nominal values, as far as there is one, where a fit begins there.
    at_rest: Option<DeflectionRows>,
    torques: Vec<RestTorques>,
}

/// Whitened equations of the change from values of the unknowns: of the readings, and of what was known before below them.
#[derive(Debug, Clone)]
struct DeflectionRows {
    /// (N + q) x p.
    matrix: DMatrix<f64>,
    /// What is left of each (N + q).
    left: DVector<f64>,
}

impl DeflectionRows {
    /// Of readings of nothing. `off` is what the values leave of what was known before, whose rows are `prior`.
    fn new(
        mut predicted: PredictedRows,
        whitening: &Whitening,
        prior: &DMatrix<f64>,
        off: &DVector<f64>,
    ) -> Self {
        whitening.whiten(&mut predicted.derivatives);
        whitening.whiten(&mut predicted.values);
        Self {
            matrix: stack![predicted.derivatives; *prior],
            left: stack![-predicted.values; *off],
        }
    }

    /// The same with what was read, whitened.
    fn reading(mut self, read: &DVector<f64>) -> Self {
        let mut left = self.left.rows_mut(0, read.len());
        left += read;
        self
    }
}

impl StartEquations {
    fn new(source: &Case<'_>, is_near: bool) -> Self {
        let whitening = source.whitening();
        let nominal = DVector::from_vec(source.belief.values());
        let known = &source.belief.uncertain;
        let prior = known.prior_rows().clone();
        let off = DVector::zeros(prior.nrows());
        let rows = |predicted| DeflectionRows::new(predicted, &whitening, &prior, &off);
        let linear = rows(source.predicted_linearly());
        let mut torques = Vec::new();
        let at_rest = (source.method == Method::Nonlinear && !is_near)
            .then(|| source.predicted(nominal.as_slice(), &mut torques).ok());
        Self {
            linear,
            at_rest: at_rest.flatten().map(rows),
            whitening,
            prior,
            has_ratios: !known.set().prior().ratios.is_empty(),
            nominal,
            torques,
        }
    }

    /// Where a fit begins that does not begin near, but for what was read.
    fn at_nominal(&self) -> &DeflectionRows {
        self.at_rest.as_ref().unwrap_or(&self.linear)
    }
}

impl FitStart {
    /// Fits that begin at nominal values: by the linear method, or through the static equilibrium.
    pub fn new(source: &Case<'_>, is_near: bool) -> Self {
        Self::of(Arc::new(StartEquations::new(source, is_near)), source)
    }

    /// The same of fits to the same measurements that hold what a case holds.
    pub fn holding(&self, source: &Case<'_>) -> Self {
        Self::of(Arc::clone(&self.equations), source)
    }

    fn of(equations: Arc<StartEquations>, source: &Case<'_>) -> Self {
        let mut free = Cow::Borrowed(&equations.linear.matrix);
        for &place in source.held {
            free.to_mut().column_mut(place).fill(0.0);
        }
        let estimable = Estimable::of_equations(&free, &source.belief.sizes());
        let mut start = Self {
            factor: None,
            before: gram(&(&equations.prior * estimable.basis_in_units())),
            estimable,
            equations,
        };
        if !source.belief.uncertain.is_plain() || source.method == Method::Nonlinear {
            start.factor = sound_factor(start.information(start.equations.at_nominal()));
        }
        start
    }

    /// Takes what readings of one configuration share off whitened rows.
    pub fn take_off(&self, rows: &mut DVector<f64>) {
        self.equations.whitening.take_off(rows);
    }

    /// What was read, whitened.
    fn read(&self, source: &Case<'_>) -> DVector<f64> {
        let mut read = source.read();
        self.equations.whitening.whiten(&mut read);
        read
    }

    /// What equations say of what is determined (r x r).
    fn information(&self, rows: &DeflectionRows) -> DMatrix<f64> {
        let before = self.equations.prior.nrows();
        let readings = rows.matrix.nrows() - before;
        let within = (self.estimable).coordinates(rows.matrix.rows(0, readings).transpose());
        let mut information = if self.equations.has_ratios {
            gram(&(rows.matrix.rows(readings, before) * self.estimable.basis_in_units()))
        } else {
            self.before.clone()
        };
        information.gemm(1.0, &within, &within.transpose(), 1.0);
        information
    }

    /// The right-hand side of the normal equations (r).
    fn gradient(&self, rows: &DeflectionRows) -> DVector<f64> {
        (self.estimable).coordinates(rows.matrix.tr_mul(&rows.left))
    }

    /// What solves the equations (r): by their factor where there is one, else by the singular values of all rows.
    fn step(
        &self,
        rows: &DeflectionRows,
        gradient: &DVector<f64>,
        factor: Option<&Cholesky<f64, Dyn>>,
    ) -> DVector<f64> {
        factor.map_or_else(
            || self.estimable.coordinates_of(&self.solve(rows).solution),
            |factor| factor.solve(gradient),
        )
    }

    fn solve(&self, rows: &DeflectionRows) -> LeastSquares {
        LeastSquares::solve(&rows.matrix, &rows.left, &self.estimable)
    }

    /// The end of a fit at values of the unknowns, with the last step, by a factor where there is one. Where only compliances are unknown,
    /// these are few, and may be determined badly: not by it.
    fn end(
        &self,
        source: &Case<'_>,
        rows: DeflectionRows,
        values: &DVector<f64>,
        factor: Option<&Cholesky<f64, Dyn>>,
        iterations: usize,
    ) -> DeflectionFit {
        let factor = factor.filter(|_| !source.belief.uncertain.is_plain());
        let last = factor.map_or_else(
            || self.solve(&rows),
            |factor| LeastSquares {
                solution: (self.estimable).in_units(factor.solve(&self.gradient(&rows))),
                covariance: self.estimable.covariance(inverse_of(factor)),
                condition: condition_of(factor),
            },
        );
        DeflectionFit {
            whitened_residuals: rows.left - rows.matrix * &last.solution,
            values: (values + last.solution).as_slice().to_vec(),
            covariance: last.covariance,
            condition: last.condition,
            iterations,
        }
    }
}

/// The rest of a nonlinear fit.
struct DeflectionProblem<'a> {
    start: &'a FitStart,
    source: &'a Case<'a>,
    /// What was read, whitened.
    read: DVector<f64>,
    torques: Vec<RestTorques>,
    /// The length in standard errors of the step to where the fit begins; zero if it is unknown.
    begun: f64,
}

impl DeflectionProblem<'_> {
    /// Adds what the curvature by logarithms has besides Gauss-Newton's at values (p); its factor where that is something.
    fn bend(
        &self,
        information: &mut DMatrix<f64>,
        rows: &DeflectionRows,
        values: &DVector<f64>,
    ) -> Option<Cholesky<f64, Dyn>> {
        let prior = self.source.belief.uncertain.set().prior();
        if prior.ratios.is_empty() {
            return None;
        }
        let readings = self.read.len();
        let right = (rows.matrix.rows(0, readings)).tr_mul(&rows.left.rows(0, readings));
        let (basis, one) = (
            self.start.estimable.basis_in_units(),
            vec![1.0; values.len()],
        );
        let mut is_bent = false;
        for (place, more) in prior.beside_gauss_newton(values, &one, &right) {
            let along = basis.row(place).transpose();
            information.ger(more, &along, &along, 1.0);
            is_bent = true;
        }
        is_bent.then(|| sound_factor(information.clone())).flatten()
    }
}

impl FitProblem for DeflectionProblem<'_> {
    /// The rows, and the information's factor where it is not singular to rounding.
    type Kept = (DeflectionRows, Option<Cholesky<f64, Dyn>>);

    /// Where rotations are off by far more than noise, fits end where no part of a step lowers it.
    const SMALL: f64 = 1e-2;

    fn at(&mut self, values: DVector<f64>) -> FitResult<FitPlace<Self::Kept>> {
        let start = self.start;
        let predicted = (self.source).predicted(values.as_slice(), &mut self.torques)?;
        let equations = &start.equations;
        let (prior, off) = self.source.prior_rows_at(&values)?;
        let rows = DeflectionRows::new(predicted, &equations.whitening, &prior, &off);
        let rows = rows.reading(&self.read);
        let mut information = start.information(&rows);
        let factor = sound_factor(information.clone());
        let gradient = start.gradient(&rows);
        let bent = self.bend(&mut information, &rows, &values);
        let step = start.step(&rows, &gradient, bent.as_ref().or(factor.as_ref()));
        Ok(FitPlace {
            values,
            square: rows.left.norm_squared(),
            information,
            gradient,
            step,
            kept: (rows, factor),
        })
    }

    fn change(&self, values: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        let prior = self.source.belief.uncertain.set().prior();
        prior.step_from(values, self.start.estimable.in_units(step.clone()))
    }

    fn coordinates(&self, change: &DVector<f64>) -> DVector<f64> {
        self.start.estimable.coordinates_of(change)
    }

    /// Compliances alone take few steps, and are told to the last digit.
    fn tolerance(&self, _: &FitPlace<Self::Kept>, before: Option<f64>) -> f64 {
        if self.source.belief.uncertain.is_plain() {
            0.0
        } else {
            let before = before.unwrap_or(self.begun);
            (LEFT * before).sqrt().min(LAST_STEP)
        }
    }
}

/// The linear estimate. What is not determined stays nominal: the change from there is solved for.
pub fn fit_linear(start: &FitStart, source: &Case<'_>) -> DeflectionFit {
    let rows = start
        .equations
        .at_nominal()
        .clone()
        .reading(&start.read(source));
    start.end(
        source,
        rows,
        &start.equations.nominal,
        start.factor.as_ref(),
        1,
    )
}

/// Gauss-Newton from values that are near, from one step from the nominal values, or from these where there is no equilibrium
/// with that. Directions that the measurements do not determine keep the nominal value. The last step is taken, too.
pub fn fit_nonlinear(
    start: &FitStart,
    source: &Case<'_>,
    near: Option<&[f64]>,
) -> FitResult<DeflectionFit> {
    let (read, nominal) = (start.read(source), &start.equations.nominal);
    let prior = source.belief.uncertain.set().prior();
    let (first, begun) = if let Some(near) = near {
        let off = DVector::from_column_slice(near) - nominal;
        let within = start.estimable.coordinates_of(&off);
        (start.estimable.in_units(within), 0.0)
    } else {
        let rows = start.equations.at_nominal().clone().reading(&read);
        let gradient = start.gradient(&rows);
        let step = start.step(&rows, &gradient, start.factor.as_ref());
        let length = gradient.dot(&step).max(0.0).sqrt();
        (
            prior.step_from(nominal, start.estimable.in_units(step)),
            length,
        )
    };
    let mut problem = DeflectionProblem {
        start,
        source,
        read,
        torques: start.equations.torques.clone(),
        begun,
    };
    let first = (problem.at(nominal + first))
        .or_else(|error| problem.at(nominal.clone()).map_err(|_| error))?;
    let (found, iterations) = gauss_newton(&mut problem, first)?;
    let (rows, factor) = found.kept;
    Ok(start.end(source, rows, &found.values, factor.as_ref(), iterations))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::read_plan;
    use crate::scenario::Scenario;
    use crate::testbed::measurements_of;

    /// A fit that begins near and one that does not end at the same place, as near as is said.
    #[test]
    fn the_last_step_is_taken() {
        let scenario = Scenario::load("scenarios/kr270.toml".as_ref()).expect("valid");
        let belief = &scenario.task.belief;
        let plan = read_plan("scenarios/plans/klimchik2012_m3.csv".as_ref(), 6).expect("a plan");
        let mut measured = measurements_of(&plan, &belief.instrument);
        let case = Case::as_believed(belief, &[]);
        let unread = case.with(&measured);
        let mut near = belief.values();
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
            assert!((one - value).abs() < LEFT * error, "{place}: {one} {value}");
        }
    }
}
