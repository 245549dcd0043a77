//! Whether a robot errs as its identification predicts: other measurements, made where the prediction is
//! weakest.

use nalgebra::DMatrix;

use crate::experiment::{Experiment, Plan};
use crate::identification::{Case, IdentificationError, Predictions};
use crate::measurement::Measurement;
use crate::numeric::posterior::Posterior;
use crate::plan::ExperimentModel;
use crate::plan::search::{SearchError, random_plan};
use crate::task::{Belief, Task};

/// Random experiments among which the weakest predictions are looked for.
const CANDIDATES: u32 = 400;

/// The experiments of a validation: of many random ones those whose deflection is known least by what is
/// identified, each after those before it are measured. What depends on compliances that were not determined is
/// left out: nothing is predicted there.
pub fn validation_plan(
    task: &Task,
    posterior: &Posterior,
    experiments: u32,
    seed: u64,
) -> Result<Plan, SearchError> {
    let candidates = random_plan(task, CANDIDATES, seed, 0)?;
    let model = ExperimentModel::new(&task.belief);
    let sigma_m = task.belief.instrument.sigma_m;
    let is_predicted = |experiment: &&Experiment| {
        let rows = model.observation_matrix(experiment);
        posterior.variance_of(&rows).is_ok()
    };
    let predicted: Vec<&Experiment> = (candidates.experiments.iter())
        .filter(is_predicted)
        .collect();
    let mut covariance = posterior.covariance.clone();
    let mut chosen: Vec<Experiment> = Vec::new();
    for _ in 0..experiments {
        let unknown = |experiment: &Experiment| {
            let rows = model.observation_matrix(experiment);
            (&rows * &covariance * rows.transpose()).trace()
        };
        let weakest = (predicted.iter().copied())
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

/// Compares measurements of another campaign with what is known of the identified robot.
///
/// # Errors
/// A measurement depends on what is not known, or the identified robot gives way under its load.
pub fn validate(
    belief: &Belief,
    posterior: &Posterior,
    measurements: &[Measurement],
) -> Result<Predictions, IdentificationError> {
    let case = Case::as_believed(belief, measurements);
    case.predictions(&belief.uncertain.in_another_campaign(posterior))
}
