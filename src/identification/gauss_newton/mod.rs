//! The fit of any parameters to any readings: Gauss-Newton with Levenberg-Marquardt's damping.
//!
//! ```text
//! sum (y - h(x))^T R^-1 (y - h(x)) + (x - m)^T P (x - m) -> min      over x = m + B z
//! ```
//!
//! with readings y, their prediction h through the static equilibrium, their covariances R, the prior's
//! mean m and precision P. B spans what readings and prior determine together; whatever they do not
//! stays at its nominal value. That is decided beforehand with the planner's model, and depends on no
//! reading.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use thiserror::Error;

use crate::numeric::estimable::Estimable;
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::observation::{
    NormalEquations, Observation, PlannedReading, SharedErrors, normal_equations,
    planned_information, shared_equations,
};
use crate::parameter::{ElasticArm, Freedoms, ParameterSet, relative_precision};
use crate::robot::EquilibriumError;

/// The fit is found when the next step is shorter than this in standard errors.
const CONVERGED: f64 = 1e-6;
/// A step this short in standard errors may end in the rounding of the sum of squares.
const SHORT: f64 = 1e-3;
/// After so many steps a short one is enough: readings that the model explains badly make the steps small and many.
const PATIENCE: usize = 20;
/// Nearly linear fits take three to six steps; far starts take some more.
const MAXIMUM_ITERATIONS: usize = 60;
/// After so many steps the curvature of what those that hardly become shorter leave is learnt.
const NEARLY_LINEAR: usize = 6;
/// The same of fits that begin near.
const NEAR: usize = 2;
/// Steps that become no shorter than this share of those before are slow.
const SLOW: f64 = 0.1;
/// Weights follow from a fit that is so near in standard errors: its sum of squares is known to the square of that.
const FOR_WEIGHTS: f64 = 1e-2;
/// What a linear model says of the smallest sum of squares is believed when it says it twice to this share.
const SAID_AGAIN: f64 = 1e-2;
/// A sum of squares is hopeless if so small a share of it would be impossible.
const HOPELESS: f64 = 0.25;
/// Directions in which a change of the gradient tells less than this share of itself teach nothing.
const UNTAUGHT: f64 = 1e-8;
/// Sums of squares that differ by this share may be the same.
const ROUNDING: f64 = 1e-12;
/// The first damping after a step that made the fit worse, relative to the information.
const FIRST_DAMPING: f64 = 1e-4;
/// With so much damping a step is none.
const LARGEST_DAMPING: f64 = 1e12;

/// Why there is no fit.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum FitError {
    /// There are no observations.
    #[error("there are no observations")]
    NoObservations,
    /// The observations determine nothing.
    #[error("the observations determine none of the parameters")]
    NothingObserved,
    /// The model has no equilibrium at the start.
    #[error("observation {observation}: {source}")]
    Equilibrium {
        /// The observation's number, from 1.
        observation: usize,
        /// What is wrong.
        source: EquilibriumError,
    },
    /// It did not converge.
    #[error("the fit did not converge: the last step was {steps:.1e} standard errors")]
    NotConverged {
        /// The length of the last step in standard errors.
        steps: f64,
    },
}

/// Parameters that fit readings best, and what is known of them then.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterFit {
    /// The belief with the fitted values.
    pub belief: ElasticArm,
    /// Values, covariance, and what is determined; in the parameters' units.
    pub posterior: Posterior,
    /// What is not.
    pub freedoms: Freedoms,
    /// The number of scalar readings.
    pub rows: usize,
    /// How many parameters the readings determine, less what a prior knows of them: the trace of the gain by the design.
    pub determined: f64,
    /// The sum of squares of the whitened residuals, without the prior's.
    pub square: f64,
    /// The number of steps.
    pub iterations: usize,
}

impl ParameterFit {
    /// Scalar readings, less what they determine: the mean of the sum of squares.
    pub fn degrees_of_freedom(&self) -> f64 {
        (self.rows as f64 - self.determined).max(0.0)
    }

    /// The share of the numbers that the fit did not use up.
    pub fn spare(&self) -> f64 {
        self.degrees_of_freedom().max(1.0) / self.rows as f64
    }
}

/// Fits parameters of a belief to observations.
pub fn fit_parameters(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
) -> Result<ParameterFit, FitError> {
    fit_from_frames(nominal, set, (observations, None), Haste::None)
}

/// The same, found as soon as a step is short in standard errors as the residuals have them: whether the observations' own
/// covariances explain these is known by then.
pub(super) fn fit_for_residuals(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
) -> Result<ParameterFit, FitError> {
    fit_from_frames(nominal, set, (observations, shared), Haste::Residuals)
}

/// The same, ended where it begins as soon as it is clear that the observations' own covariances explain them by no values.
pub(super) fn fit_if_plausible(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
) -> Result<ParameterFit, FitError> {
    fit_from_frames(nominal, set, (observations, shared), Haste::Plausibility)
}

/// A fit that begins where the frames follow from the readings.
fn fit_from_frames(
    nominal: &ElasticArm,
    set: &ParameterSet,
    (observations, shared): (&[Observation], Option<&SharedErrors>),
    haste: Haste,
) -> Result<ParameterFit, FitError> {
    if observations.is_empty() {
        return Err(FitError::NoObservations);
    }
    let start = frames(nominal, set, observations);
    fit(nominal, set, observations, shared, &start, haste)
}

/// The same from values (p) that are near; some observations may share an error.
pub(super) fn fit_from(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
    start: &DVector<f64>,
) -> Result<ParameterFit, FitError> {
    fit(nominal, set, observations, shared, start, Haste::Near)
}

/// The same, found as soon as weights follow from what it leaves.
pub(super) fn fit_for_weights(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
    start: &DVector<f64>,
) -> Result<ParameterFit, FitError> {
    fit(nominal, set, observations, shared, start, Haste::Weights)
}

/// What a fit may take for granted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Haste {
    /// Nothing.
    None,
    /// It begins near.
    Near,
    /// It begins anywhere, and need be no better than its residuals.
    Residuals,
    /// The same, and it may end where it begins if no values can explain the observations.
    Plausibility,
    /// It begins near, and weights follow from it alone.
    Weights,
}

fn fit(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
    shared: Option<&SharedErrors>,
    start: &DVector<f64>,
    haste: Haste,
) -> Result<ParameterFit, FitError> {
    if observations.is_empty() {
        return Err(FitError::NoObservations);
    }
    let nominal_values = &set.prior().mean;
    let (freedoms, estimable) = determined(nominal, set, observations);
    if estimable.rank() == 0 {
        return Err(FitError::NothingObserved);
    }
    let problem = FitProblem {
        nominal,
        set,
        observations,
        shared,
        prior: relative_precision(set),
        basis: estimable.basis(),
        haste,
    };
    // As far as the start does not leave what is determined.
    let scales = set.scales();
    let off = (start - nominal_values).component_div(&scales);
    let within = estimable.basis() * estimable.basis().tr_mul(&off);
    let start = nominal_values + within.component_mul(&scales);
    let (values, solved, iterations) = problem.solve(&start)?;
    let units = estimable.basis_in_units();
    let inverse = solved.factor.inverse();
    let known_before = estimable.basis().tr_mul(&problem.prior) * estimable.basis();
    let determined = estimable.rank() as f64 - known_before.dot(&inverse);
    let covariance = symmetric(&(&units * inverse * units.transpose()));
    let names = set.parameters().iter().map(|each| each.name.clone());
    Ok(ParameterFit {
        belief: set.apply(nominal, values.as_slice()),
        posterior: Posterior {
            names: names.collect(),
            mean: values.as_slice().to_vec(),
            covariance,
            estimable,
        },
        freedoms,
        rows: observations
            .iter()
            .map(|each| each.reading.kind().rows())
            .sum(),
        determined,
        square: solved.equations.square,
        iterations,
    })
}

/// What the observations and the set's prior determine.
fn determined(
    nominal: &ElasticArm,
    set: &ParameterSet,
    observations: &[Observation],
) -> (Freedoms, Estimable) {
    let planned: Vec<PlannedReading> = observations.iter().map(Observation::planned).collect();
    let information = planned_information(set, nominal, &set.prior().mean, &planned);
    let freedoms = Freedoms::new(nominal, set, &information);
    let estimable = freedoms.estimable(set);
    (freedoms, estimable)
}

/// The prior's mean (p) with frames of the base and of the tools, which may be anywhere, that fit best when all else is
/// as it is believed to be.
fn frames(nominal: &ElasticArm, set: &ParameterSet, observations: &[Observation]) -> DVector<f64> {
    let mut start = set.prior().mean.clone();
    let is_frame: Vec<usize> = (0..set.len())
        .filter(|&index| set.parameters()[index].kind.is_mounted())
        .collect();
    if is_frame.is_empty() || is_frame.len() == set.len() {
        return start;
    }
    let others_nominal = set.apply(nominal, start.as_slice());
    let frames = set.subset(&is_frame);
    // Their nominal values are applied already; the subset's values count from the nominal belief.
    let mut belief = others_nominal;
    belief.tools.clone_from(&nominal.tools);
    (belief.instrument_from_base).clone_from(&nominal.instrument_from_base);
    let (_, estimable) = determined(&belief, &frames, observations);
    if estimable.rank() > 0 {
        let problem = FitProblem {
            nominal: &belief,
            set: &frames,
            observations,
            shared: None,
            prior: relative_precision(&frames),
            basis: estimable.basis(),
            haste: Haste::None,
        };
        // Where they cannot be found alone, all parameters may still be.
        if let Ok((values, _, _)) = problem.solve(&frames.prior().mean) {
            for (&index, value) in is_frame.iter().zip(&values) {
                start[index] = *value;
            }
        }
    }
    start
}

struct FitProblem<'a> {
    nominal: &'a ElasticArm,
    set: &'a ParameterSet,
    observations: &'a [Observation],
    shared: Option<&'a SharedErrors>,
    prior: nalgebra::DMatrix<f64>,
    basis: &'a nalgebra::DMatrix<f64>,
    haste: Haste,
}

/// Where a step began.
struct StepBefore {
    values: DVector<f64>,
    gradient: DVector<f64>,
    /// The undamped step's length in standard errors.
    steps: f64,
    /// The smallest sum of squares there is, if the model is linear.
    predicted: f64,
}

/// The problem at one vector of values, with the next step in coordinates of the basis.
struct Solved {
    equations: NormalEquations,
    /// The sum of squares with the prior's.
    cost: f64,
    information: nalgebra::DMatrix<f64>,
    gradient: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// The undamped step's length in standard errors.
    steps: f64,
}

impl Solved {
    /// The smallest sum of squares there is, if the model is linear.
    fn predicted(&self) -> f64 {
        self.cost - self.steps * self.steps
    }
}

impl FitProblem<'_> {
    fn solve(&self, start: &DVector<f64>) -> Result<(DVector<f64>, Solved, usize), FitError> {
        let mut values = start.clone();
        let mut now = self.at(&values)?;
        let mut damping = 0.0;
        let mut curvature: Option<DMatrix<f64>> = None;
        let mut before: Option<StepBefore> = None;
        for iterations in 1..=MAXIMUM_ITERATIONS {
            let is_slow = iterations > PATIENCE && now.steps <= SHORT;
            if now.steps <= self.tolerance(&now) || is_slow {
                return Ok((values, now, iterations));
            }
            if let Some(before) = &before {
                if self.is_hopeless(before, &now) {
                    return Ok((start.clone(), self.at(start)?, iterations));
                }
                let is_slow = iterations > self.fast_steps() && now.steps > SLOW * before.steps;
                if is_slow || curvature.is_some() {
                    curvature = self.learnt(before, &values, &now, curvature);
                }
            }
            before = Some(StepBefore {
                values: values.clone(),
                gradient: now.gradient.clone(),
                steps: now.steps,
                predicted: now.predicted(),
            });
            let curved = curvature.as_ref();
            if let Some(found) = curved.and_then(|curved| self.curved_step(curved, &values, &now)) {
                (values, now) = found;
                continue;
            }
            curvature = None;
            loop {
                let next = self.step(&now, damping).map(|step| &values + step);
                let found = next.map(|next| (self.at(&next), next));
                if let Some((Ok(found), next)) = found
                    && (found.cost <= now.cost || now.steps <= SHORT)
                {
                    (values, now) = (next, found);
                    damping = if damping > FIRST_DAMPING {
                        damping / 10.0
                    } else {
                        0.0
                    };
                    break;
                }
                damping = FIRST_DAMPING.max(damping * 10.0);
                if damping > LARGEST_DAMPING {
                    return Err(FitError::NotConverged { steps: now.steps });
                }
            }
        }
        Err(FitError::NotConverged { steps: now.steps })
    }

    fn at(&self, values: &DVector<f64>) -> Result<Solved, FitError> {
        let (set, observations) = (self.set, self.observations);
        let equations = match self.shared {
            None => normal_equations(set, self.nominal, values, observations),
            Some(shared) => shared_equations(set, self.nominal, values, observations, shared),
        };
        let equations = equations.map_err(|(index, source)| FitError::Equilibrium {
            observation: index + 1,
            source,
        })?;
        let off = (values - &self.set.prior().mean).component_div(&self.set.scales());
        let pull = &self.prior * &off;
        let information = self.basis.tr_mul(&(&equations.information + &self.prior)) * self.basis;
        let gradient = self.basis.tr_mul(&(&equations.gradient - &pull));
        let factor = Cholesky::new(information.clone()).ok_or(FitError::NotConverged {
            steps: f64::INFINITY,
        })?;
        let steps = gradient.dot(&factor.solve(&gradient)).max(0.0).sqrt();
        Ok(Solved {
            cost: equations.square + off.dot(&pull),
            equations,
            information,
            gradient,
            factor,
            steps,
        })
    }

    /// How short a step has to be in standard errors. Where the residuals alone count, these are larger than the observations' own
    /// covariances make them.
    fn tolerance(&self, now: &Solved) -> f64 {
        match self.haste {
            Haste::None | Haste::Near => CONVERGED,
            Haste::Weights => FOR_WEIGHTS,
            Haste::Residuals | Haste::Plausibility => {
                CONVERGED
                    * (now.equations.square / self.rows().max(1) as f64)
                        .sqrt()
                        .max(1.0)
            }
        }
    }

    /// The number of scalar readings.
    fn rows(&self) -> usize {
        let readings = self.observations.iter();
        readings.map(|each| each.reading.kind().rows()).sum()
    }

    const fn fast_steps(&self) -> usize {
        match self.haste {
            Haste::None => NEARLY_LINEAR,
            _ => NEAR,
        }
    }

    /// Whether the smallest sum of squares that the linear model predictions is one that no noise makes, by far, and was the same
    /// a step before.
    fn is_hopeless(&self, before: &StepBefore, now: &Solved) -> bool {
        if self.haste != Haste::Plausibility {
            return false;
        }
        let predicted = now.predicted();
        let is_said_again = (predicted - before.predicted).abs() <= SAID_AGAIN * predicted;
        let spare = self.rows().saturating_sub(self.basis.ncols());
        let chance = ChiSquared::new(spare as f64).map(|chi| chi.sf(HOPELESS * predicted));
        is_said_again && chance == Ok(0.0)
    }

    /// How the residuals bend the sum of squares otherwise than the linear model, as far as known, corrected by how the gradient
    /// changed along a step: the symmetric change of rank one that agrees with it. Readings that the model explains badly
    /// make that matter. What was learnt far away is forgotten where it would make the sum of squares a saddle.
    fn learnt(
        &self,
        before: &StepBefore,
        values: &DVector<f64>,
        now: &Solved,
        known: Option<DMatrix<f64>>,
    ) -> Option<DMatrix<f64>> {
        let size = now.gradient.len();
        let moved = (values - &before.values).component_div(&self.set.scales());
        let moved = self.basis.tr_mul(&moved);
        let changed = &before.gradient - &now.gradient - &now.information * &moved;
        let corrected = |mut known: DMatrix<f64>| {
            let unknown = &changed - &known * &moved;
            let along = unknown.dot(&moved);
            if along.abs() > UNTAUGHT * unknown.norm() * moved.norm() {
                known.ger(along.recip(), &unknown, &unknown, 1.0);
            }
            let is_sound = Cholesky::new(&now.information + &known).is_some();
            is_sound.then_some(known)
        };
        (known.and_then(corrected)).or_else(|| corrected(DMatrix::zeros(size, size)))
    }

    /// A step by what is known of that, too. None where it is no better.
    fn curved_step(
        &self,
        curvature: &DMatrix<f64>,
        values: &DVector<f64>,
        now: &Solved,
    ) -> Option<(DVector<f64>, Solved)> {
        let within = Cholesky::new(&now.information + curvature)?.solve(&now.gradient);
        let next = values + self.limited(&within);
        let found = self.at(&next).ok()?;
        let is_nearer = found.steps < now.steps && found.cost <= now.cost * (1.0 + ROUNDING);
        (found.cost < now.cost || is_nearer).then_some((next, found))
    }

    /// The step in the parameters' units, no longer than what the model can follow.
    fn step(&self, now: &Solved, damping: f64) -> Option<DVector<f64>> {
        let within = if damping > 0.0 {
            let mut damped = now.information.clone();
            for index in 0..damped.nrows() {
                damped[(index, index)] *= 1.0 + damping;
            }
            Cholesky::new(damped)?.solve(&now.gradient)
        } else {
            now.factor.solve(&now.gradient)
        };
        Some(self.limited(&within))
    }

    /// A step that is told in coordinates of the basis, in the parameters' units and no longer than what the model can follow.
    fn limited(&self, within: &DVector<f64>) -> DVector<f64> {
        let mut step = (self.basis * within).component_mul(&self.set.scales());
        let parameters = self.set.parameters().iter();
        let share = (parameters.zip(&step))
            .map(|(parameter, step)| step.abs() / parameter.longest_step())
            .fold(1.0, f64::max);
        step /= share;
        step
    }
}

#[cfg(test)]
mod tests;
