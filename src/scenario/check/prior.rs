//! The key `robot.prior`: an earlier identification as prior information.

use std::path::PathBuf;

use nalgebra::{DMatrix, DVector};

use super::Checker;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::identification::StoredIdentification;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ParameterKind, Prior, Source, Uncertainty};
use crate::robot::Robot;
use crate::task::{Belief, PriorCampaign, robot_sha256};
use crate::testbed::DrawnCompliances;

/// What a scenario knows from an earlier identification.
#[derive(Debug, Default)]
pub(super) struct Before {
    /// What is known of the parameters.
    pub prior: Option<Prior>,
    /// The error sources of its campaign.
    pub campaign: Option<PriorCampaign>,
    /// What a study draws the virtual robot's compliances from.
    pub drawn: Option<DrawnCompliances>,
    /// How many of the parameters something is known of.
    pub known: usize,
    /// What speaks against trusting it.
    pub doubts: Vec<String>,
}

impl Checker<'_> {
    /// Reads the earlier identification: its joints are unknown in this scenario, too, and their nominal
    /// compliances are its estimates.
    pub(super) fn prior(
        &self,
        file: Option<&PathBuf>,
        nominal: &mut Robot,
        parameters: &mut Vec<usize>,
    ) -> Result<Before, FileError> {
        let key = "robot.prior";
        let Some(file) = file else {
            return Ok(Before::default());
        };
        let path = self.resolve(file);
        let wrong = |error: FileError| self.named_file(key, error);
        let stored = StoredIdentification::read(&path, nominal).map_err(wrong)?;
        self.inputs.borrow_mut().add(&path)?;
        let file = format!("the identification in {}", path.display());
        let mut doubts: Vec<String> = (stored.conditions.iter())
            .map(|condition| condition.within(&file).text)
            .collect();
        match &stored.identified_with {
            Some(with) if with.robot_sha256 != robot_sha256(&nominal.chain) => {
                let problem = "was identified with another robot: its joints' names, axes or places are not \
                               those of the scenario's model";
                let other = FileError::new(&path, problem).at("identified_with.robot_sha256");
                return Err(wrong(other.code(ErrorCode::OtherRobot)));
            }
            Some(_) => {}
            None => doubts.push(format!(
                "{} does not say what it was identified with, as files of earlier versions do not",
                path.display()
            )),
        }
        let degrees_of_freedom = stored.degrees_of_freedom;
        let (joints, posterior, all) = (stored.joints, stored.posterior, stored.all);
        for (&joint, &mean) in joints.iter().zip(&posterior.mean) {
            if mean <= 0.0 {
                let name = &nominal.chain.joints[joint].name;
                let problem =
                    format!("the compliance of {name} is {mean:e}; a positive one is needed");
                let none = FileError::new(&path, problem).at("compliance_rad_per_nm");
                return Err(wrong(none));
            }
            nominal.compliance_rad_per_nm[joint] = mean;
            if !parameters.contains(&joint) {
                parameters.push(joint);
            }
        }
        parameters.sort_unstable();
        let place = |joint: &usize| parameters.iter().position(|each| each == joint);
        let places: Vec<usize> = joints.iter().filter_map(place).collect();
        let means: Vec<f64> = (parameters.iter())
            .map(|&joint| nominal.compliance_rad_per_nm[joint])
            .collect();
        let prior = Prior::of_posterior(&posterior, &places, &means).ok_or_else(|| {
            let problem = "the covariance is singular: it says that something is known exactly";
            wrong(FileError::new(&path, problem).at("covariance_rad2_per_n2m2"))
        })?;
        let spread = prior.spread(&nominal.typical_rad_per_nm(parameters));
        if spread.ncols() == 0 {
            return Err(self.wrong(key, format!("{} determined nothing", path.display())));
        }
        let count = means.len();
        Ok(Before {
            drawn: Some(DrawnCompliances {
                joints: parameters.clone(),
                mean_rad_per_nm: means,
                spread: spread.clone(),
            }),
            known: spread.ncols(),
            campaign: Some(PriorCampaign {
                degrees_of_freedom,
                ..campaign_of(&posterior, all.as_ref(), &places, count)
            }),
            prior: Some(prior),
            doubts,
        })
    }
}

/// The same where uncertainties tell of these compliances, too: both together are what a belief knows of them, so that runs sample
/// them once, from both, and no further part by the uncertainty. What is hidden stays as it is: no belief knows of it.
pub(super) fn drawn_from_both(
    drawn: DrawnCompliances,
    belief: &Belief,
    uncertainties: &mut [Uncertainty],
) -> DrawnCompliances {
    for each in uncertainties.iter_mut().filter(|each| !each.is_hidden) {
        if let Source::Plan(parameters) = &mut each.source {
            parameters.retain(|(kind, _)| {
                let of = |&joint: &usize| *kind == ParameterKind::JointCompliance { joint };
                !drawn.joints.iter().any(of)
            });
        }
    }
    let count = drawn.joints.len();
    let both = Prior {
        mean: DVector::from_column_slice(&drawn.mean_rad_per_nm),
        precision: belief.precision().view((0, 0), (count, count)).into_owned(),
    };
    DrawnCompliances {
        spread: both.spread(&belief.nominal.typical_rad_per_nm(&drawn.joints)),
        ..drawn
    }
}

/// The errors of an identification whose compliances are those at `places` among `count`.
fn campaign_of(
    posterior: &Posterior,
    all: Option<&Posterior>,
    places: &[usize],
    count: usize,
) -> PriorCampaign {
    let mut covariance = DMatrix::zeros(count, count);
    for (row, &place) in places.iter().enumerate() {
        for (column, &other) in places.iter().enumerate() {
            covariance[(place, other)] = posterior.covariance[(row, column)];
        }
    }
    let of_others = |all: &Posterior| {
        let others = all.names.iter().enumerate().skip(places.len());
        let with_compliances = others.map(|(column, name)| {
            let mut own = DVector::zeros(count);
            for (row, &place) in places.iter().enumerate() {
                own[place] = all.covariance[(row, column)];
            }
            (name.clone(), own)
        });
        with_compliances.collect()
    };
    PriorCampaign {
        covariance,
        others: all.map(of_others).unwrap_or_default(),
        degrees_of_freedom: None,
    }
}
