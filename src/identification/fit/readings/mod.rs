//! The fit of any parameters to any readings, through the static equilibrium.
//!
//! Whatever readings and prior do not determine together stays at its nominal value. That is decided beforehand with the planner's model,
//! and depends on no reading.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::error::{FitResult, IdentificationError, OFF_PRIOR};
use super::gauss_newton::{CONVERGED, FitPlace, FitProblem, NEARLY_LINEAR, gauss_newton};
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::observation::{
    LinearObservations, NormalEquations, Observation, SharedErrors, normal_equations,
    planned_information,
};
use crate::parameter::{ElasticArm, Freedoms, ParameterSet, PriorAt};

/// After so many steps of fits that begin near the curvature is learnt.
const NEAR: usize = 2;
/// Weights follow from a fit that is so near in standard errors: its sum of squares is known to the square of that.
const FOR_WEIGHTS: f64 = 1e-2;
/// What a linear model says of the smallest sum of squares is believed when it says it twice to this share.
const SAID_AGAIN: f64 = 1e-2;
/// A sum of squares is hopeless if so small a share of it would be impossible.
const HOPELESS: f64 = 0.25;

/// Parameters that fit readings best, and what is known of them then.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterFit {
    /// What was fitted.
    pub set: ParameterSet,
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
) -> FitResult<ParameterFit> {
    let readings = FittedReadings {
        nominal,
        set,
        observations,
        shared: None,
        linear: None,
    };
    readings.fit_from_frames(Haste::None)
}

/// Observations to which parameters are fitted; some may share an error.
#[derive(Clone, Copy)]
pub struct FittedReadings<'a> {
    pub nominal: &'a ElasticArm,
    pub set: &'a ParameterSet,
    pub observations: &'a [Observation],
    pub shared: Option<&'a SharedErrors>,
    /// To first order, where they are near enough.
    pub linear: Option<&'a LinearReadings>,
}

/// Observations to first order about values of the parameters, and what they do not determine.
pub struct LinearReadings {
    pub observations: LinearObservations,
    freedoms: Freedoms,
}

/// What a fit may take for granted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Haste {
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
    pub fn fit_from_frames(&self, haste: Haste) -> FitResult<ParameterFit> {
        self.fit_from(&self.frames(), haste)
    }

    /// A fit that begins at values (p).
    pub fn fit_from(&self, start: &DVector<f64>, haste: Haste) -> FitResult<ParameterFit> {
        if self.observations.is_empty() {
            return Err(IdentificationError::NoMeasurements);
        }
        let nominal_values = &self.set.prior().mean;
        let freedoms = match self.linear {
            Some(known) => known.freedoms.clone(),
            None => self.freedoms(),
        };
        let estimable = freedoms.estimable(self.set);
        if estimable.rank() == 0 {
            return Err(IdentificationError::NothingObserved);
        }
        let mut problem = ReadingProblem {
            readings: *self,
            basis: estimable.basis(),
            haste,
        };
        // As far as the start does not leave what is determined.
        let scales = self.set.scales();
        let within = estimable.basis() * problem.coordinates(&(start - nominal_values));
        let start = nominal_values + within.component_mul(&scales);
        let start = problem.at(start)?;
        let (found, iterations) = gauss_newton(&mut problem, start)?;
        let units = estimable.basis_in_units();
        let (values, (equations, factor)) = (found.values, found.kept);
        let inverse = factor.inverse();
        let prior = problem.prior_at(&values)?.precision;
        let known_before = estimable.basis().tr_mul(&prior) * estimable.basis();
        let determined = estimable.rank() as f64 - known_before.dot(&inverse);
        let covariance = symmetric(&(&units * inverse * units.transpose()));
        let names = self.set.parameters().iter().map(|each| each.name.clone());
        Ok(ParameterFit {
            set: self.set.clone(),
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
            square: equations.square,
            iterations,
        })
    }

    /// What neither the observations nor the set's prior determine.
    fn freedoms(&self) -> Freedoms {
        let planned: Vec<_> = self.observations.iter().map(Observation::planned).collect();
        let nominal_values = &self.set.prior().mean;
        let information = planned_information(self.set, self.nominal, nominal_values, &planned);
        Freedoms::new(self.nominal, self.set, &information)
    }

    /// The same observations to first order about values (p), for fits that differ in weights alone.
    pub fn linear_at(&self, values: &DVector<f64>) -> FitResult<LinearReadings> {
        let observations =
            LinearObservations::new(self.set, self.nominal, values, self.observations)?;
        let freedoms = self.freedoms();
        Ok(LinearReadings {
            observations,
            freedoms,
        })
    }

    /// What the readings say at values (p), as they are weighed.
    pub fn equations(&self, values: &DVector<f64>) -> FitResult<NormalEquations> {
        let linear = self.linear.map(|known| &known.observations);
        let (set, nominal, observations) = (self.set, self.nominal, self.observations);
        Ok(normal_equations(
            set,
            nominal,
            values,
            observations,
            self.shared,
            linear,
        )?)
    }

    /// The number of scalar readings.
    pub fn rows(&self) -> usize {
        let readings = self.observations.iter();
        readings.map(|each| each.reading.kind().rows()).sum()
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
            linear: None,
        };
        // Where they cannot be found alone, all parameters may still be.
        if let Ok(fit) = readings.fit_from(&frames.prior().mean, Haste::Residuals) {
            for (&index, value) in is_frame.iter().zip(&fit.posterior.mean) {
                start[index] = *value;
            }
        }
        start
    }
}

type ReadingPlace = FitPlace<(NormalEquations, Cholesky<f64, Dyn>)>;

/// Readings whose parameters change along some directions alone.
pub struct ReadingProblem<'a> {
    pub readings: FittedReadings<'a>,
    /// The directions (p x r), in typical sizes.
    pub basis: &'a DMatrix<f64>,
    pub haste: Haste,
}

impl ReadingProblem<'_> {
    /// What is known before, at values (p).
    fn prior_at(&self, values: &DVector<f64>) -> FitResult<PriorAt> {
        let set = self.readings.set;
        let known = set.prior().at(values, set.scales().as_slice());
        known.ok_or(OFF_PRIOR)
    }

    /// The problem at values (p) by what the readings say there.
    pub fn solved(
        &self,
        values: DVector<f64>,
        equations: NormalEquations,
    ) -> FitResult<ReadingPlace> {
        let known = self.prior_at(&values)?;
        let within = |information: &DMatrix<f64>| self.basis.tr_mul(information) * self.basis;
        let mut all = &equations.information + &known.precision;
        let mut information = within(&all);
        let gradient = self.basis.tr_mul(&(&equations.gradient - &known.pull));
        let step = f64::INFINITY;
        let factor =
            Cholesky::new(information.clone()).ok_or(IdentificationError::NotConverged { step })?;
        let mut step = factor.solve(&gradient);
        let (set, mut is_bent) = (self.readings.set, false);
        let (prior, scales) = (set.prior(), set.scales());
        let right = &equations.gradient;
        for (place, more) in prior.beside_gauss_newton(&values, scales.as_slice(), right) {
            all[(place, place)] += more;
            is_bent = true;
        }
        if is_bent {
            information = within(&all);
            if let Some(bent) = Cholesky::new(information.clone()) {
                step = bent.solve(&gradient);
            }
        }
        Ok(FitPlace {
            values,
            square: equations.square + known.square,
            step,
            information,
            gradient,
            kept: (equations, factor),
        })
    }
}

impl FitProblem for ReadingProblem<'_> {
    /// What the readings say, and the information's factor.
    type Kept = (NormalEquations, Cholesky<f64, Dyn>);

    fn at(&mut self, values: DVector<f64>) -> FitResult<ReadingPlace> {
        let equations = self.readings.equations(&values)?;
        self.solved(values, equations)
    }

    fn change(&self, values: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        let (set, prior) = (self.readings.set, self.readings.set.prior());
        let mut change = (self.basis * step).component_mul(&set.scales());
        let parameters = set.parameters().iter().zip(&change).enumerate();
        let share = parameters
            .filter(|(place, _)| prior.ratio_of(*place).is_none())
            .map(|(_, (parameter, change))| change.abs() / parameter.longest_step())
            .fold(1.0, f64::max);
        change /= share;
        prior.step_from(values, change)
    }

    fn coordinates(&self, change: &DVector<f64>) -> DVector<f64> {
        (self.basis).tr_mul(&change.component_div(&self.readings.set.scales()))
    }

    /// Where the residuals alone count, standard errors are larger than the observations' own covariances make them.
    fn tolerance(&self, now: &ReadingPlace, _: Option<f64>) -> f64 {
        match self.haste {
            Haste::None | Haste::Near => CONVERGED,
            Haste::Weights => FOR_WEIGHTS,
            Haste::Residuals | Haste::Plausibility => {
                let rows = self.readings.rows().max(1) as f64;
                CONVERGED * (now.kept.0.square / rows).sqrt().max(1.0)
            }
        }
    }

    fn nearly_linear(&self) -> usize {
        match self.haste {
            Haste::None => NEARLY_LINEAR,
            _ => NEAR,
        }
    }

    /// Whether the smallest sum of squares that the linear model predicts is one that no noise makes, by far, and was the same
    /// a step before.
    fn is_hopeless(&self, before: &ReadingPlace, now: &ReadingPlace) -> bool {
        if self.haste != Haste::Plausibility {
            return false;
        }
        let [told, predicted] = [before, now].map(|each| each.square - each.length().powi(2));
        let is_said_again = (predicted - told).abs() <= SAID_AGAIN * predicted;
        let spare = self.readings.rows().saturating_sub(self.basis.ncols());
        let chance = ChiSquared::new(spare as f64).map(|chi| chi.sf(HOPELESS * predicted));
        is_said_again && chance == Ok(0.0)
    }
}

#[cfg(test)]
mod tests;
