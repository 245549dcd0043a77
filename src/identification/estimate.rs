//! From measurements to compliances with their uncertainty.

use nalgebra::{DMatrix, Vector3};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use super::case::{Case, Sigma};
use super::discrepancy::three_rows;
use super::equations::rows_of;
use super::error::{FitResult, IdentificationError};
use super::fit::{FitStart, fit_linear, fit_nonlinear};
use super::prior_consistency::far_from_priors;
use crate::codes::Condition;
use crate::measurement::Measurement;
use crate::numeric::posterior::Posterior;
use crate::numeric::quantile::exceeded_with;
use crate::parameter::ParameterSet;
use crate::task::Method;

/// One joint's estimated compliance.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterEstimate {
    /// The joint's index.
    pub joint: usize,
    /// The joint's name.
    pub name: String,
    /// The unit of its compliance.
    pub unit: &'static str,
    /// The estimate with its standard error and 95 % interval (rad/(N m)); `None` where the
    /// measurements do not determine it.
    pub estimate: Option<Estimate>,
}

/// An estimate with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// The 95 % interval.
    pub interval95: [f64; 2],
}

/// What measurements say of something that is uncertain besides the identified compliances.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct UncertainEstimate {
    /// Its name, such as "load.scale" or "joint_1.compliance".
    pub name: String,
    /// What it is, in words.
    #[serde(skip)]
    pub words: String,
    /// The unit of the values: "1" for the logarithm of a ratio to what is nominal.
    pub unit: String,
    /// Of a logarithm, what it is the logarithm of a ratio to, in SI units: another scenario may have another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal: Option<f64>,
    /// The standard deviation that it had before.
    #[serde(rename = "prior_std")]
    pub prior_deviation: Option<f64>,
    /// The value, whose nominal one is mostly zero; null where nothing determines it.
    pub value: Option<f64>,
    /// Its standard error.
    #[serde(rename = "std")]
    pub standard_error: Option<f64>,
}

/// What was identified, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The method.
    pub method: Method,
    /// The identified joints.
    pub parameters: Vec<ParameterEstimate>,
    /// What else the belief holds to be uncertain, and the whole plan shares.
    pub uncertain: Vec<UncertainEstimate>,
    /// The compliance of every joint (rad/(N m)): estimates where there are. Where only combinations are
    /// determined, values that give these and are nominal in all other directions; else nominal values.
    pub compliance_rad_per_nm: Vec<f64>,
    /// What is known of all unknowns, the identified compliances first: their covariance (eq. 13), and which combinations
    /// are determined.
    pub posterior: Posterior,
    /// The standard deviation of a deflection's coordinate that the uncertainties rest on (m); the rms
    /// of them where measurements bring their own.
    pub sigma_m: f64,
    /// The standard deviation that the residuals show (m), where there are any to spare.
    pub residual_sigma_m: Option<f64>,
    /// The probability of residuals at least this large if sigma is as known; a small value says
    /// that the model or sigma is wrong.
    pub consistency: Option<f64>,
    /// The probability of residuals at least this small if sigma is as known; a small value says that
    /// the measurements, or sigma, are not what they are held to be.
    pub consistency_lower: Option<f64>,
    /// What the model leaves unexplained besides, where errors count it: standard deviations of positions (m) and rotations (rad).
    pub discrepancy: Option<[f64; 2]>,
    /// The rms of the coordinates of the deflections (m), and of their rotations (rad).
    pub deflections: [f64; 2],
    /// The condition that estimates are far from their priors.
    pub far_from_priors: Option<Condition>,
    /// Compliances that were to be identified and stay nominal, since measurements tell less of them; what they would be.
    pub stays_nominal: Vec<ParameterEstimate>,
    /// Whether all of them should: no compliance is determined better than its nominal value is right.
    pub is_all_weak: bool,
    /// Measured minus modelled deflections (m), three for each measurement, rotations left out.
    pub residuals_m: Vec<f64>,
    /// The condition number of the observation matrix with columns scaled to length one, in coordinates of
    /// what is determined.
    pub condition: f64,
    /// The number of Gauss-Newton steps; 1 for the linear method.
    pub iterations: usize,
}

impl Identification {
    /// The names of the joints whose compliances the measurements do not determine.
    pub fn unidentifiable(&self) -> Vec<&str> {
        let unknown = (self.parameters.iter()).filter(|each| each.estimate.is_none());
        unknown.map(|each| each.name.as_str()).collect()
    }
}

impl Case<'_> {
    /// Identifies what is unknown: by eq. 9 (eq. 6 where rotations are measured too) with weights, or through the static equilibrium of the
    /// nominal model.
    ///
    /// # Errors
    /// Nothing can be identified; a single compliance that cannot is not an error but has no estimate.
    pub fn identify(&self) -> FitResult<Identification> {
        self.identify_near(None)
    }

    /// The same from values of the unknowns (p) that are near.
    pub(super) fn identify_near(&self, near: Option<&[f64]>) -> FitResult<Identification> {
        let start = FitStart::new(self, near.is_some());
        let mut found = self.identify_from(&start, near)?;
        found.uncertain = self.others(&found.posterior);
        found.far_from_priors = far_from_priors(self.belief.uncertain.set(), &found.posterior);
        Ok(found)
    }

    /// The same with what it begins with; what else is uncertain is not told.
    pub(super) fn identify_from(
        &self,
        start: &FitStart,
        near: Option<&[f64]>,
    ) -> FitResult<Identification> {
        if self.measurements.is_empty() {
            return Err(IdentificationError::NoMeasurements);
        }
        let fit = match self.method {
            Method::Linear => fit_linear(start, self),
            Method::Nonlinear => fit_nonlinear(start, self, near)?,
        };
        let rank = start.estimable.rank();
        if rank == 0 {
            return Err(IdentificationError::NothingObserved);
        }
        let equations = fit.whitened_residuals.len();
        let spare = equations.saturating_sub(rank);
        let freedom = spare as f64;
        let sigma_m = self.typical_sigma_m();
        let sum_of_squares = fit.whitened_residuals.norm_squared();
        let ratio = (spare > 0).then(|| (sum_of_squares / freedom).sqrt());
        let is_known = matches!(self.sigma, Sigma::Known(_));
        let factor = if is_known {
            1.0
        } else {
            ratio.ok_or(IdentificationError::NoResiduals { equations, rank })?
        };
        let quantile = two_sided_student(if is_known { f64::INFINITY } else { freedom });
        let joints = &self.belief.parameters;
        let posterior = Posterior {
            names: self.belief.unknown_names(),
            mean: fit.values,
            covariance: fit.covariance * (factor * factor),
            estimable: start.estimable.clone(),
        };
        // Files hold what is known of the compliances alone: what is told of them is decided there.
        let has_more = !self.belief.uncertain.is_plain();
        let compliances = has_more.then(|| posterior.of_first(joints.len()));
        let compliances = compliances.as_ref().unwrap_or(&posterior);
        let chain = &self.belief.nominal.chain;
        let parameters = (joints.iter().enumerate())
            .map(|(index, &joint)| ParameterEstimate {
                joint,
                name: posterior.names[index].clone(),
                unit: chain.joints[joint].drive.compliance_unit(),
                estimate: Estimate::of(compliances, index, quantile),
            })
            .collect();
        let mut left = fit.whitened_residuals.rows(0, self.rows()).into_owned();
        start.take_off(&mut left);
        let residuals_m = (self.rows_of_each().zip(self.measurements)).flat_map(|(rows, of)| {
            let left = three_rows(&left.rows_range(rows).into_owned(), 0);
            <[f64; 3]>::from(in_room(of, &left))
        });
        let chi_square = ChiSquared::new(freedom).ok().filter(|_| is_known);
        let deflections = self.measurements.iter();
        let coordinates: usize = (deflections.clone()).map(|each| rows_of(each).min(3)).sum();
        let squares: f64 = (deflections.clone())
            .map(|each| each.deflection_m.norm_squared())
            .sum();
        let mut rotations = [0.0; 2];
        for each in deflections.filter_map(|each| each.rotation.as_ref()) {
            rotations[0] += each.vector_rad.norm_squared();
            rotations[1] += 3.0;
        }
        let turned = rotations[0] / rotations[1].max(1.0);
        let is_coarse = self.belief.uncertain.along_step_m() > 0.0
            && self
                .measurements
                .iter()
                .any(|each| each.direction.is_some());
        Ok(Identification {
            method: self.method,
            parameters,
            uncertain: Vec::new(),
            compliance_rad_per_nm: self.belief.compliance_at(&posterior.mean),
            posterior,
            sigma_m: sigma_m * factor,
            residual_sigma_m: ratio.map(|ratio| ratio * sigma_m),
            consistency: chi_square.map(|chi| chi.sf(sum_of_squares)),
            // Repeats that a coarse gauge shows alike are nearer to each other than normal errors are.
            consistency_lower: (chi_square.filter(|_| !is_coarse))
                .map(|chi| chi.cdf(sum_of_squares)),
            discrepancy: None,
            deflections: [squares / coordinates as f64, turned].map(f64::sqrt),
            far_from_priors: None,
            stays_nominal: Vec::new(),
            is_all_weak: false,
            residuals_m: residuals_m.collect(),
            condition: fit.condition,
            iterations: fit.iterations,
        })
    }

    /// What was identified of what else is uncertain than compliances.
    fn others(&self, posterior: &Posterior) -> Vec<UncertainEstimate> {
        let extended = &self.belief.uncertain;
        let parameters = extended.set().parameters().iter().enumerate();
        let others = parameters.skip(self.belief.parameters.len());
        let told = others.map(|(place, parameter)| {
            let standard_error = posterior.standard_error(place);
            UncertainEstimate {
                name: parameter.name.clone(),
                words: parameter.kind.words(extended.arm()),
                unit: parameter.unit().to_owned(),
                nominal: (parameter.is_logarithmic)
                    .then(|| parameter.quantity(extended.arm(), 0.0)),
                prior_deviation: extended.prior_deviation(place),
                value: standard_error.map(|_| posterior.mean[place]),
                standard_error,
            }
        });
        told.collect()
    }
}

impl Estimate {
    /// Of one of the parameters, whose interval is so many standard errors to either side; `None` where it is not determined.
    fn of(posterior: &Posterior, index: usize, quantile: f64) -> Option<Self> {
        let estimate = Self {
            value: posterior.mean[index],
            standard_error: posterior.standard_error(index)?,
            interval95: [0.0; 2],
        };
        Some(estimate.within(quantile))
    }

    /// The same with an interval of so many standard errors to either side.
    pub(super) fn within(self, quantile: f64) -> Self {
        let half = quantile * self.standard_error;
        Self {
            interval95: [self.value - half, self.value + half],
            ..self
        }
    }
}

/// The identification of one plan's measurements over and over: what does not depend on what is read is made once.
#[derive(Debug)]
pub(crate) struct PreparedCase<'a> {
    case: Case<'a>,
    start: FitStart,
}

impl<'a> PreparedCase<'a> {
    /// For other measurements like these, whatever they read.
    pub fn new(case: Case<'a>, measurements: &[Measurement]) -> Self {
        Self {
            start: FitStart::new(&case.with(measurements), false),
            case,
        }
    }

    /// Identifies what is unknown; what else is uncertain than compliances is in the posterior alone.
    pub fn identify(&self, measurements: &[Measurement]) -> FitResult<Identification> {
        self.case.with(measurements).identify_holding(&self.start)
    }

    /// The same with what else is uncertain.
    pub fn identify_all(&self, measurements: &[Measurement]) -> FitResult<Identification> {
        let mut found = self.identify(measurements)?;
        found.uncertain = self.case.others(&found.posterior);
        Ok(found)
    }
}

/// What is left of a deflection (m); of a displacement along a direction, which is the first coordinate, in that direction.
pub(super) fn in_room(of: &Measurement, left_m: &Vector3<f64>) -> Vector3<f64> {
    // No minus zero.
    (of.direction).map_or(*left_m, |direction| direction * left_m.x + Vector3::zeros())
}

/// With so many degrees of freedom Student's t is normal.
const MANY: f64 = 1e6;

/// What 95 % of a variable of Student's t stay within, to either side.
pub(super) fn two_sided_student(freedom: f64) -> f64 {
    if freedom >= MANY {
        return Normal::standard().inverse_cdf(0.975);
    }
    StudentsT::new(0.0, 1.0, freedom)
        .map_or(f64::INFINITY, |student| exceeded_with(&student, 0.025))
}

/// The degrees of freedom of the variance of a parameter with a value, where those of the readings' are so many: what is known before is no
/// estimate.
pub(super) fn told_degrees(
    set: &ParameterSet,
    covariance: &DMatrix<f64>,
    (index, value): (usize, f64),
    degrees: f64,
) -> f64 {
    let known = set.prior().own_at(index, value);
    let told = 1.0 - covariance[(index, index)] * known;
    degrees / told.max(f64::EPSILON).powi(2)
}
