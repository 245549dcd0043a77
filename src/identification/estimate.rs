//! From measurements to compliances with their uncertainty.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

use super::error::IdentificationError;
use super::observations::{Equations, Observations};
use crate::least_squares::LeastSquares;
use crate::measurement::Measurement;
use crate::robot::Tool;
use crate::scenario::{Method, Robot};

/// The non-linear estimate is found when no compliance would change by more than this share of
/// itself.
const CONVERGED: f64 = 1e-10;
/// Gauss-Newton needs three or four steps here, where the problem is nearly linear.
const MAXIMUM_ITERATIONS: usize = 30;

/// Which standard deviation of deflections the uncertainties rest on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sigma {
    /// A known one (m).
    Known(f64),
    /// The one that the residuals show; intervals follow Student's t.
    FromResiduals,
}

impl Sigma {
    /// The standard deviation that weights deflections which bring none of their own (m). Where the
    /// residuals scale it, any value serves.
    pub(super) const fn weight_m(self) -> f64 {
        match self {
            Self::Known(sigma) => sigma,
            Self::FromResiduals => 1e-3,
        }
    }
}

/// One joint's estimated compliance.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterEstimate {
    /// The joint's index.
    pub joint: usize,
    /// The joint's name.
    pub name: String,
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

/// What was identified, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// The method.
    pub method: Method,
    /// The identified joints.
    pub parameters: Vec<ParameterEstimate>,
    /// The compliance of every joint (rad/(N m)): estimates where there are, else nominal values.
    pub compliance_rad_per_nm: Vec<f64>,
    /// The covariance of the parameters (eq. 13), p x p; zero for those not determined.
    pub covariance: DMatrix<f64>,
    /// The standard deviation of a deflection's coordinate that the uncertainties rest on (m); the rms
    /// of them where measurements bring their own.
    pub sigma_m: f64,
    /// The standard deviation that the residuals show (m), where there are any to spare.
    pub residual_sigma_m: Option<f64>,
    /// The probability of residuals at least this large if sigma is as known; a small value says
    /// that the model or sigma is wrong.
    pub consistency: Option<f64>,
    /// Measured minus modelled deflections (m), three for each measurement, rotations left out.
    pub residuals_m: Vec<f64>,
    /// The number of independent combinations of compliances that the measurements determine.
    pub rank: usize,
    /// The condition number of the observation matrix with columns scaled to length one.
    pub condition: f64,
    /// The number of Gauss-Newton steps; 1 for the linear method.
    pub iterations: usize,
}

impl Identification {
    /// The names of the joints whose compliances the measurements do not determine.
    #[must_use]
    pub fn unidentifiable(&self) -> Vec<&str> {
        self.parameters
            .iter()
            .filter(|parameter| parameter.estimate.is_none())
            .map(|parameter| parameter.name.as_str())
            .collect()
    }
}

/// Identifies the compliances of the joints in `parameters` of the nominal robot from measurements
/// at `tool`: by eq. 9 (eq. 6 where rotations are measured too) with weights, or through the static
/// equilibrium of the nominal model.
///
/// # Errors
/// Nothing can be identified; a single compliance that cannot is not an error but has no estimate.
pub fn identify(
    nominal: &Robot,
    tool: &Tool,
    parameters: &[usize],
    measurements: &[Measurement],
    sigma: Sigma,
    method: Method,
) -> Result<Identification, IdentificationError> {
    if measurements.is_empty() {
        return Err(IdentificationError::NoMeasurements);
    }
    let observations = Observations {
        chain: &nominal.chain,
        tool,
        parameters,
        measurements,
        sigma_m: sigma.weight_m(),
    };
    let fit = match method {
        Method::Linear => fit_linear(&observations, nominal),
        Method::Nonlinear => fit_nonlinear(&observations, nominal)?,
    };
    report(&observations, &fit, sigma, method, nominal)
}

/// A fit before its uncertainty is judged: whitened residuals and the last least-squares problem.
struct Fit {
    compliance: Vec<f64>,
    least_squares: LeastSquares,
    whitened_residuals: DVector<f64>,
    iterations: usize,
}

/// Typical sizes of the compliances: the nominal ones (rad/(N m)).
pub(super) fn typical(nominal: &Robot, parameters: &[usize]) -> Vec<f64> {
    let values = parameters
        .iter()
        .map(|&joint| nominal.compliance_rad_per_nm[joint]);
    let largest = values.clone().fold(0.0, f64::max);
    values
        .map(|value| if value > 0.0 { value } else { largest })
        .collect()
}

fn fit_linear(observations: &Observations<'_>, nominal: &Robot) -> Fit {
    let equations = observations.linear(&nominal.compliance_rad_per_nm);
    let Equations {
        matrix,
        right_hand_side,
    } = &equations;
    let typical = typical(nominal, observations.parameters);
    let least_squares = LeastSquares::solve(matrix, right_hand_side, &typical);
    let mut compliance = nominal.compliance_rad_per_nm.clone();
    for (index, &joint) in observations.parameters.iter().enumerate() {
        if least_squares.determined[index] {
            compliance[joint] = least_squares.solution[index];
        }
    }
    Fit {
        whitened_residuals: right_hand_side - matrix * &least_squares.solution,
        compliance,
        least_squares,
        iterations: 1,
    }
}

/// Gauss-Newton from the linear estimate; directions that the data do not determine stay as they
/// are. A compliance of which only a combination with others is determined moves with that, so that
/// the residuals are those of the best fit, but is then reported with its nominal value.
fn fit_nonlinear(
    observations: &Observations<'_>,
    nominal: &Robot,
) -> Result<Fit, IdentificationError> {
    let typical = typical(nominal, observations.parameters);
    let mut compliance = fit_linear(observations, nominal).compliance;
    let mut change = f64::INFINITY;
    for iterations in 1..=MAXIMUM_ITERATIONS {
        let equations = observations.nonlinear(&compliance)?;
        let least_squares =
            LeastSquares::solve(&equations.matrix, &equations.right_hand_side, &typical);
        let steps = least_squares.solution.iter().zip(&typical);
        let changes = steps.map(|(step, typical)| step.abs() / typical);
        if changes.clone().all(|change| change <= CONVERGED) {
            for (index, &joint) in observations.parameters.iter().enumerate() {
                if !least_squares.determined[index] {
                    compliance[joint] = nominal.compliance_rad_per_nm[joint];
                }
            }
            return Ok(Fit {
                whitened_residuals: equations.right_hand_side,
                compliance,
                least_squares,
                iterations,
            });
        }
        change = changes.fold(0.0, f64::max);
        for (step, &joint) in least_squares.solution.iter().zip(observations.parameters) {
            compliance[joint] += step;
        }
    }
    Err(IdentificationError::NotConverged { change })
}

fn report(
    observations: &Observations<'_>,
    fit: &Fit,
    sigma: Sigma,
    method: Method,
    nominal: &Robot,
) -> Result<Identification, IdentificationError> {
    let least_squares = &fit.least_squares;
    if least_squares.rank == 0 {
        return Err(IdentificationError::NothingObserved);
    }
    let equations = fit.whitened_residuals.len();
    let spare = equations - least_squares.rank;
    let freedom = spare as f64;
    let sigma_m = observations.typical_sigma_m();
    let sum_of_squares = fit.whitened_residuals.norm_squared();
    let ratio = (spare > 0).then(|| (sum_of_squares / freedom).sqrt());
    let (factor, quantile) = match sigma {
        Sigma::Known(_) => (1.0, two_sided_normal()),
        Sigma::FromResiduals => (
            ratio.ok_or(IdentificationError::NoResiduals {
                equations,
                rank: least_squares.rank,
            })?,
            two_sided_student(freedom),
        ),
    };
    let covariance = &least_squares.covariance * (factor * factor);
    let parameters = observations
        .parameters
        .iter()
        .enumerate()
        .map(|(index, &joint)| ParameterEstimate {
            joint,
            name: nominal.chain.joints[joint].name.clone(),
            estimate: least_squares.determined[index].then(|| {
                let value = fit.compliance[joint];
                let standard_error = covariance[(index, index)].sqrt();
                Estimate {
                    value,
                    standard_error,
                    interval95: [
                        value - quantile * standard_error,
                        value + quantile * standard_error,
                    ],
                }
            }),
        })
        .collect();
    Ok(Identification {
        method,
        parameters,
        compliance_rad_per_nm: fit.compliance.clone(),
        covariance,
        sigma_m: sigma_m * factor,
        residual_sigma_m: ratio.map(|ratio| ratio * sigma_m),
        consistency: (spare > 0 && matches!(sigma, Sigma::Known(_)))
            .then(|| ChiSquared::new(freedom).map_or(f64::NAN, |chi| chi.sf(sum_of_squares))),
        residuals_m: residuals_m(observations, &fit.whitened_residuals),
        rank: least_squares.rank,
        condition: least_squares.condition,
        iterations: fit.iterations,
    })
}

/// Takes the weights off the residuals of deflections.
fn residuals_m(observations: &Observations<'_>, whitened: &DVector<f64>) -> Vec<f64> {
    let mut rows = whitened.iter();
    let mut residuals = Vec::new();
    for each in observations.measurements {
        let sigma = each
            .sigma_m
            .unwrap_or(nalgebra::Vector3::repeat(observations.sigma_m));
        residuals.extend(rows.by_ref().take(3).zip(sigma.iter()).map(|(r, s)| r * s));
        if each.rotation.is_some() {
            rows.by_ref().take(3).for_each(drop);
        }
    }
    residuals
}

fn two_sided_normal() -> f64 {
    Normal::standard().inverse_cdf(0.975)
}

fn two_sided_student(freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |student| student.inverse_cdf(0.975))
}
