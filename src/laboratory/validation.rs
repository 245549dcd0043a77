//! Whether a robot keeps what its identification promises: other measurements, made where the promise is
//! weakest.

use nalgebra::{DMatrix, DVector, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use thiserror::Error;

use crate::experiment::{Experiment, Plan};
use crate::measurement::Measurement;
use crate::plan::ExperimentModel;
use crate::plan::search::{SearchError, random_plan};
use crate::posterior::Posterior;
use crate::robot::{EquilibriumError, EquilibriumSolver, Load};
use crate::task::{Belief, Method, Task};

/// Random experiments among which the weakest promises are looked for.
const CANDIDATES: u32 = 400;

/// The experiments of a validation: of many random ones those whose deflection is known least by what is
/// identified, each after those before it are measured.
///
/// # Errors
/// No experiment is possible.
pub fn validation_plan(
    task: &Task,
    posterior: &Posterior,
    experiments: u32,
    seed: u64,
) -> Result<Plan, SearchError> {
    let candidates = random_plan(task, CANDIDATES, seed, 0)?;
    let model = ExperimentModel::new(&task.belief);
    let sigma_m = task.belief.instrument.sigma_m;
    let mut covariance = posterior.covariance.clone();
    let mut chosen: Vec<Experiment> = Vec::new();
    for _ in 0..experiments {
        let unknown = |experiment: &Experiment| {
            let rows = model.observation_matrix(experiment);
            (&rows * &covariance * rows.transpose()).trace()
        };
        let weakest = (candidates.experiments.iter())
            .max_by(|one, other| unknown(one).total_cmp(&unknown(other)));
        let Some(weakest) = weakest else { break };
        let rows = model.observation_matrix(weakest);
        let noise = DMatrix::identity(rows.nrows(), rows.nrows()) * sigma_m.powi(2);
        let gain = &covariance * rows.transpose();
        if let Some(inverse) = (&rows * &gain + noise).try_inverse() {
            covariance -= &gain * inverse * gain.transpose();
        }
        chosen.push(weakest.clone());
    }
    Ok(Plan {
        experiments: chosen,
    })
}

/// A measurement beside what was promised for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Validated {
    /// The measured deflection less the predicted one (m).
    pub difference_m: Vector3<f64>,
    /// The standard deviation of its length that is promised (m), the instrument's noise included.
    pub promised_m: f64,
    /// The same without the noise: what compensation would leave here.
    pub left_m: f64,
}

/// What a validation says.
#[derive(Debug, Clone, PartialEq)]
pub struct Validation {
    /// Each measurement.
    pub each: Vec<Validated>,
    /// The probability of differences as large as these, if the promise is kept.
    pub probability: f64,
}

/// Why nothing can be said.
#[derive(Debug, Error)]
pub enum ValidationError {
    /// The identified robot gives way under a load.
    #[error("measurement {measurement}: {source}")]
    Equilibrium {
        /// The measurement, from 1.
        measurement: usize,
        /// What is wrong.
        source: EquilibriumError,
    },
    /// There is no covariance to judge by.
    #[error("the covariance of what was identified is none")]
    Singular,
}

/// Compares measurements with what the identified compliances of all joints (rad/(N m)) predict.
///
/// # Errors
/// The identified robot has no equilibrium, or its covariance is none.
pub fn validate(
    belief: &Belief,
    compliance_rad_per_nm: &[f64],
    posterior: &Posterior,
    measurements: &[Measurement],
) -> Result<Validation, ValidationError> {
    let model = ExperimentModel::new(belief);
    let size = 3 * measurements.len();
    let mut differences = DVector::zeros(size);
    let mut rows = DMatrix::zeros(size, belief.parameters.len());
    let mut noise = DVector::zeros(size);
    for (index, each) in measurements.iter().enumerate() {
        let experiment = Experiment {
            configuration_rad: each.configuration_rad.clone(),
            load: each.load,
            repeats: 1,
        };
        let predicted =
            predicted(belief, compliance_rad_per_nm, &experiment).map_err(|source| {
                ValidationError::Equilibrium {
                    measurement: index + 1,
                    source,
                }
            })?;
        let block = model.observation_matrix(&experiment);
        (rows.rows_mut(3 * index, 3)).copy_from(&block.rows(0, 3));
        (differences.rows_mut(3 * index, 3)).copy_from(&(each.deflection_m - predicted));
        let sigma = each
            .sigma_m
            .unwrap_or(Vector3::repeat(belief.instrument.sigma_m));
        (noise.rows_mut(3 * index, 3)).copy_from(&sigma.map(|sigma| sigma.powi(2)));
    }
    let known = &rows * &posterior.covariance * rows.transpose();
    let spread = &known + DMatrix::from_diagonal(&noise);
    let factor = spread.clone().cholesky().ok_or(ValidationError::Singular)?;
    let square = differences.dot(&factor.solve(&differences));
    let distribution = ChiSquared::new(size as f64).map_err(|_| ValidationError::Singular)?;
    let trace = |of: &DMatrix<f64>, index: usize| {
        (0..3)
            .map(|row| of[(3 * index + row, 3 * index + row)])
            .sum::<f64>()
            .sqrt()
    };
    let each = (0..measurements.len()).map(|index| Validated {
        difference_m: differences.fixed_rows::<3>(3 * index).into_owned(),
        promised_m: trace(&spread, index),
        left_m: trace(&known, index),
    });
    Ok(Validation {
        each: each.collect(),
        probability: distribution.sf(square),
    })
}

/// The deflection that compliances predict (m).
fn predicted(
    belief: &Belief,
    compliance_rad_per_nm: &[f64],
    experiment: &Experiment,
) -> Result<Vector3<f64>, EquilibriumError> {
    if belief.method == Method::Linear {
        let all: Vec<usize> = (0..belief.joints()).collect();
        let state = (belief.nominal.chain.at(&belief.calibration_tool))
            .state(experiment.configuration_rad.as_slice());
        let matrix = crate::robot::ObservationMatrix::new(&state, &experiment.load, &all).position;
        return Ok(matrix * DVector::from_column_slice(compliance_rad_per_nm));
    }
    let mut solver = EquilibriumSolver::new(belief.joints());
    let mut at = |load: &Load| {
        let mut arm = belief.nominal.chain.at(&belief.calibration_tool);
        let q = experiment.configuration_rad.as_slice();
        solver.solve(&mut arm, compliance_rad_per_nm, q, load)?;
        Ok(solver.state().tool_position)
    };
    Ok(at(&experiment.load)? - at(&Load::NONE)?)
}
