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

use super::error::IdentificationError;
use crate::numeric::estimable::Estimable;
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::observation::{
    NormalEquations, Observation, SharedErrors, normal_equations, planned_information,
    shared_equations,
};
use crate::parameter::{ElasticArm, Freedoms, ParameterSet, relative_precision};

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
const FIRST_DAMPING: f64 = 1e-8;
/// With so much damping a step is none.
const LARGEST_DAMPING: f64 = 1e12;

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
) -> Result<ParameterFit, IdentificationError> {
    let readings = FittedReadings {
        nominal,
        set,
        observations,
        shared: None,
    };
    readings.fit_from_frames(Haste::None)
}

/// Observations to which parameters are fitted; some may share an error.
#[derive(Clone, Copy)]
pub(super) struct FittedReadings<'a> {
    pub nominal: &'a ElasticArm,
    pub set: &'a ParameterSet,
    pub observations: &'a [Observation],
    pub shared: Option<&'a SharedErrors>,
}

/// What a fit may take for granted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Haste {
    /// Nothing.
    None,
    /// It begins near.
    Near,
    /// It begins anywhere, and is found as soon as a step is short in standard errors as the residuals have them: whether the
    /// observations' own covariances explain these is known by then.
    Residuals,
    /// The same, and it may end where it begins if no values can explain the observations.
    Plausibility,
    /// It begins near, and weights follow from it alone.
    Weights,
}

impl FittedReadings<'_> {
    /// A fit that begins where the frames follow from the readings.
    pub fn fit_from_frames(&self, haste: Haste) -> Result<ParameterFit, IdentificationError> {
        self.fit_from(&self.frames(), haste)
    }

    /// A fit that begins at values (p).
    pub fn fit_from(
        &self,
        start: &DVector<f64>,
        haste: Haste,
    ) -> Result<ParameterFit, IdentificationError> {
        if self.observations.is_empty() {
            return Err(IdentificationError::NoMeasurements);
        }
        let nominal_values = &self.set.prior().mean;
        let (freedoms, estimable) = self.determined();
        if estimable.rank() == 0 {
            return Err(IdentificationError::NothingObserved);
        }
        let problem = FitProblem {
            readings: *self,
            prior: relative_precision(self.set),
            basis: estimable.basis(),
            haste,
        };
        // As far as the start does not leave what is determined.
        let scales = self.set.scales();
        let off = (start - nominal_values).component_div(&scales);
        let within = estimable.basis() * estimable.basis().tr_mul(&off);
        let start = nominal_values + within.component_mul(&scales);
        let (values, solved, iterations) = problem.solve(&start)?;
        let units = estimable.basis_in_units();
        let inverse = solved.factor.inverse();
        let known_before = estimable.basis().tr_mul(&problem.prior) * estimable.basis();
        let determined = estimable.rank() as f64 - known_before.dot(&inverse);
        let covariance = symmetric(&(&units * inverse * units.transpose()));
        let names = self.set.parameters().iter().map(|each| each.name.clone());
        Ok(ParameterFit {
            belief: self.set.apply(self.nominal, values.as_slice()),
            posterior: Posterior {
                names: names.collect(),
                mean: values.as_slice().to_vec(),
                covariance,
                estimable,
            },
            freedoms,
            rows: self.rows(),
            determined,
            square: solved.equations.square,
            iterations,
        })
    }

    /// What the readings say at values (p), as they are weighed.
    pub fn equations(&self, values: &DVector<f64>) -> Result<NormalEquations, IdentificationError> {
        let (set, nominal, observations) = (self.set, self.nominal, self.observations);
        Ok(match self.shared {
            None => normal_equations(set, nominal, values, observations),
            Some(shared) => shared_equations(set, nominal, values, observations, shared),
        }?)
    }

    /// The number of scalar readings.
    pub fn rows(&self) -> usize {
        let readings = self.observations.iter();
        readings.map(|each| each.reading.kind().rows()).sum()
    }

    /// What the observations and the set's prior determine.
    fn determined(&self) -> (Freedoms, Estimable) {
        let (set, nominal) = (self.set, self.nominal);
        let planned: Vec<_> = self.observations.iter().map(Observation::planned).collect();
        let information = planned_information(set, nominal, &set.prior().mean, &planned);
        let freedoms = Freedoms::new(nominal, set, &information);
        let estimable = freedoms.estimable(self.set);
        (freedoms, estimable)
    }

    /// The prior's mean (p) with frames of the base and of the tools, which may be anywhere, that fit best when all else is
    /// as it is believed to be.
    fn frames(&self) -> DVector<f64> {
        let mut start = self.set.prior().mean.clone();
        let is_frame: Vec<usize> = (0..self.set.len())
            .filter(|&index| self.set.parameters()[index].kind.is_mounted())
            .collect();
        let is_none = is_frame.is_empty() || self.observations.is_empty();
        if is_none || is_frame.len() == self.set.len() {
            return start;
        }
        let frames = self.set.subset(&is_frame);
        // Their nominal values are applied already; the subset's values count from the nominal belief.
        let mut belief = self.set.apply(self.nominal, start.as_slice());
        belief.tools.clone_from(&self.nominal.tools);
        (belief.instrument_from_base).clone_from(&self.nominal.instrument_from_base);
        let readings = FittedReadings {
            nominal: &belief,
            set: &frames,
            observations: self.observations,
            shared: None,
        };
        // Where they cannot be found alone, all parameters may still be.
        if let Ok(fit) = readings.fit_from(&frames.prior().mean, Haste::None) {
            for (&index, value) in is_frame.iter().zip(&fit.posterior.mean) {
                start[index] = *value;
            }
        }
        start
    }
}

/// The last step was so many standard errors.
const fn not_converged(step: f64) -> IdentificationError {
    let unit = "standard errors";
    IdentificationError::NotConverged { step, unit }
}

/// Readings whose parameters change along some directions alone.
pub(super) struct FitProblem<'a> {
    pub readings: FittedReadings<'a>,
    /// The prior's precision (p x p), and the directions (p x r), in typical sizes.
    pub prior: DMatrix<f64>,
    pub basis: &'a DMatrix<f64>,
    pub haste: Haste,
}

/// The problem at one vector of values, with the next step in coordinates of the basis.
pub(super) struct Solved {
    equations: NormalEquations,
    /// The sum of squares with the prior's.
    cost: f64,
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    /// The undamped step's length in standard errors.
    pub steps: f64,
}

impl Solved {
    /// The smallest sum of squares there is, if the model is linear.
    fn predicted(&self) -> f64 {
        self.cost - self.steps * self.steps
    }
}

impl FitProblem<'_> {
    fn solve(
        &self,
        start: &DVector<f64>,
    ) -> Result<(DVector<f64>, Solved, usize), IdentificationError> {
        let mut place = (start.clone(), self.at(start)?);
        let mut damping = 0.0;
        let mut curvature: Option<DMatrix<f64>> = None;
        let mut before: Option<(DVector<f64>, Solved)> = None;
        for iterations in 1..=MAXIMUM_ITERATIONS {
            let (values, now) = &place;
            let is_slow = iterations > PATIENCE && now.steps <= SHORT;
            if now.steps <= self.tolerance(now) || is_slow {
                return Ok((place.0, place.1, iterations));
            }
            if let Some((last, before)) = &before {
                if self.is_hopeless(before, now) {
                    return Ok((start.clone(), self.at(start)?, iterations));
                }
                let is_slow = iterations > self.fast_steps() && now.steps > SLOW * before.steps;
                if is_slow || curvature.is_some() {
                    curvature = self.learnt(&(values - last), before, now, curvature);
                }
            }
            let curved = curvature.as_ref();
            let curved = curved.and_then(|curved| self.curved_step(curved, values, now));
            let next = if let Some(next) = curved {
                next
            } else {
                curvature = None;
                self.plain_step(values, now, &mut damping)?
            };
            before = Some(std::mem::replace(&mut place, next));
        }
        Err(not_converged(place.1.steps))
    }

    /// The next values by the linear model, damped as far as it has to be, with the problem there.
    fn plain_step(
        &self,
        values: &DVector<f64>,
        now: &Solved,
        damping: &mut f64,
    ) -> Result<(DVector<f64>, Solved), IdentificationError> {
        loop {
            let step = if *damping > 0.0 {
                self.damped_step(now, *damping)
            } else {
                Some(self.step(now))
            };
            if let Some(next) = step.map(|step| values + step)
                && let Ok(found) = self.at(&next)
                && (found.cost <= now.cost || now.steps <= SHORT)
            {
                let is_damped = *damping > FIRST_DAMPING;
                *damping = if is_damped { *damping / 10.0 } else { 0.0 };
                return Ok((next, found));
            }
            *damping = FIRST_DAMPING.max(*damping * 10.0);
            if *damping > LARGEST_DAMPING {
                return Err(not_converged(now.steps));
            }
        }
    }

    /// The problem at values (p).
    pub fn at(&self, values: &DVector<f64>) -> Result<Solved, IdentificationError> {
        self.solved(values, self.readings.equations(values)?)
    }

    /// The same by what the readings say there.
    pub fn solved(
        &self,
        values: &DVector<f64>,
        equations: NormalEquations,
    ) -> Result<Solved, IdentificationError> {
        let off =
            (values - &self.readings.set.prior().mean).component_div(&self.readings.set.scales());
        let pull = &self.prior * &off;
        let information = self.basis.tr_mul(&(&equations.information + &self.prior)) * self.basis;
        let gradient = self.basis.tr_mul(&(&equations.gradient - &pull));
        let factor = Cholesky::new(information.clone()).ok_or(not_converged(f64::INFINITY))?;
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
                let rows = self.readings.rows().max(1) as f64;
                CONVERGED * (now.equations.square / rows).sqrt().max(1.0)
            }
        }
    }

    const fn fast_steps(&self) -> usize {
        match self.haste {
            Haste::None => NEARLY_LINEAR,
            _ => NEAR,
        }
    }

    /// Whether the smallest sum of squares that the linear model predictions is one that no noise makes, by far, and was the same
    /// a step before.
    fn is_hopeless(&self, before: &Solved, now: &Solved) -> bool {
        if self.haste != Haste::Plausibility {
            return false;
        }
        let predicted = now.predicted();
        let is_said_again = (predicted - before.predicted()).abs() <= SAID_AGAIN * predicted;
        let spare = self.readings.rows().saturating_sub(self.basis.ncols());
        let chance = ChiSquared::new(spare as f64).map(|chi| chi.sf(HOPELESS * predicted));
        is_said_again && chance == Ok(0.0)
    }

    /// How the residuals bend the sum of squares otherwise than the linear model, as far as known, corrected by how the gradient
    /// changed along a step: the symmetric change of rank one that agrees with it. Readings that the model explains badly
    /// make that matter. What was learnt far away is forgotten where it would make the sum of squares a saddle.
    fn learnt(
        &self,
        moved: &DVector<f64>,
        before: &Solved,
        now: &Solved,
        known: Option<DMatrix<f64>>,
    ) -> Option<DMatrix<f64>> {
        let size = now.gradient.len();
        let moved = (self.basis).tr_mul(&moved.component_div(&self.readings.set.scales()));
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
    pub fn step(&self, now: &Solved) -> DVector<f64> {
        self.limited(&now.factor.solve(&now.gradient))
    }

    fn damped_step(&self, now: &Solved, damping: f64) -> Option<DVector<f64>> {
        let mut damped = now.information.clone();
        for index in 0..damped.nrows() {
            damped[(index, index)] *= 1.0 + damping;
        }
        Some(self.limited(&Cholesky::new(damped)?.solve(&now.gradient)))
    }

    /// A step that is told in coordinates of the basis, in the parameters' units and no longer than what the model can follow.
    fn limited(&self, within: &DVector<f64>) -> DVector<f64> {
        let mut step = (self.basis * within).component_mul(&self.readings.set.scales());
        let parameters = self.readings.set.parameters().iter();
        let share = (parameters.zip(&step))
            .map(|(parameter, step)| step.abs() / parameter.longest_step())
            .fold(1.0, f64::max);
        step /= share;
        step
    }
}

#[cfg(test)]
mod tests;
