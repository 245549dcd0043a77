//! The key `robot.prior`: an earlier identification as prior information.

use nalgebra::{DMatrix, DVector};

use super::super::file::File;
use super::Checker;
use crate::codes::{Condition, ConditionCode};
use crate::files::FileError;
use crate::identification::{IdentificationBasis, IdentifiedFile, StoredIdentification};
use crate::parameter::{ElasticArm, ParameterKind, Prior, Source, Uncertainty};
use crate::robot::Robot;
use crate::task::{Belief, PriorCampaign, robot_sha256};
use crate::testbed::EarlierValues;

/// What a scenario knows from an earlier identification.
#[derive(Debug, Default)]
pub(super) struct Before {
    /// What is known of the parameters.
    pub prior: Option<Prior>,
    /// The error sources of its campaign.
    pub campaign: Option<PriorCampaign>,
    /// How many of the parameters something is known of.
    pub known: usize,
    /// What speaks against trusting it.
    pub doubts: Vec<Condition>,
}

impl Checker<'_> {
    /// Reads the earlier identification: its joints are unknown in this scenario, too, and their nominal
    /// compliances are its estimates, but for those of joints that were replaced since.
    pub(super) fn prior(
        &self,
        File {
            robot, uncertainty, ..
        }: &File,
        nominal: &mut Robot,
        parameters: &mut Vec<usize>,
    ) -> Result<Before, FileError> {
        let key = "robot.prior";
        let Some(file) = &robot.prior else {
            return Ok(Before::default());
        };
        let path = self.resolve(file);
        let wrong = |error: FileError| self.named_file(key, error);
        let identified = IdentifiedFile::read(&path).map_err(wrong)?;
        let stored = identified.known(nominal).map_err(wrong)?;
        self.inputs.borrow_mut().add(&path)?;
        let file = format!("the identification in {}", path.display());
        let mut doubts: Vec<Condition> = (stored.conditions.iter())
            .map(|condition| condition.within(&file))
            .collect();
        identified
            .check_robot(&robot_sha256(&nominal.chain))
            .map_err(wrong)?;
        let basis = identified.basis;
        if basis.identified_with.is_none() || basis.error_sources.is_none() {
            doubts.push(ConditionCode::NoFingerprint.with(format!(
                "{} does not say with which robot and error sources it was identified: sources that are in its estimates count again",
                path.display()
            )));
        }
        let is_replaced = |name: &String| {
            let mut tables = uncertainty.iter().filter(|each| each.replaced);
            tables.any(|each| each.knows_compliance_of(name))
        };
        let posterior = &stored.posterior;
        for (&joint, &mean) in stored.joints.iter().zip(&posterior.mean) {
            if mean <= 0.0 {
                let name = &nominal.chain.joints[joint].name;
                let problem =
                    format!("the compliance of {name} is {mean:e}; a positive one is needed");
                let none = FileError::new(&path, problem).at("compliance_rad_per_nm");
                return Err(wrong(none));
            }
            if !is_replaced(&nominal.chain.joints[joint].name) {
                nominal.compliance_rad_per_nm[joint] = mean;
            }
            if !parameters.contains(&joint) {
                parameters.push(joint);
            }
        }
        parameters.sort_unstable();
        let place = |joint: &usize| parameters.iter().position(|each| each == joint);
        let places: Vec<usize> = stored.joints.iter().filter_map(place).collect();
        let means: Vec<f64> = (parameters.iter())
            .map(|&joint| nominal.compliance_rad_per_nm[joint])
            .collect();
        let mut prior = Prior::of_posterior(posterior, &places, &means).ok_or_else(|| {
            let problem = "the covariance is singular: it says that something is known exactly";
            wrong(FileError::new(&path, problem).at("covariance_rad2_per_n2m2"))
        })?;
        for (place, &joint) in parameters.iter().enumerate() {
            if is_replaced(&nominal.chain.joints[joint].name) {
                prior = prior.without(place, means[place]);
            }
        }
        let spread = prior.spread(&nominal.typical_rad_per_nm(parameters));
        let campaign = campaign_of(stored, basis, &places, means.len(), nominal);
        if spread.ncols() == 0 && campaign.names.is_empty() {
            return Err(self.wrong(key, format!("{} determined nothing", path.display())));
        }
        Ok(Before {
            known: spread.ncols(),
            campaign: Some(campaign),
            prior: Some(prior),
            doubts,
        })
    }
}

/// What runs sample about an earlier identification: compliances, unless the scenario tells the robot's, and the parameters of sources
/// that both campaigns have in common. Where uncertainties tell of these compliances, too, both together are what a belief knows of
/// them, so that runs sample them once, from both, and no further part by the uncertainty. What is hidden stays as it is: no belief
/// knows of it.
pub(super) fn sampled_about_earlier(
    belief: &Belief,
    tells_compliances: bool,
    uncertainties: &mut Vec<Uncertainty>,
) -> Option<EarlierValues> {
    let prior = belief.prior.as_ref()?;
    let extended = &belief.uncertain;
    let others = extended.kept_others();
    let parameters = extended.set().parameters();
    let kept: Vec<ParameterKind> = others.iter().map(|&place| parameters[place].kind).collect();
    let joints = if tells_compliances {
        Vec::new()
    } else {
        belief.parameters.clone()
    };
    if joints.is_empty() && kept.is_empty() {
        return None;
    }
    let is_sampled = |kind: &ParameterKind| {
        let of = |&joint: &usize| *kind == ParameterKind::JointCompliance { joint };
        kept.contains(kind) || joints.iter().any(of)
    };
    uncertainties.retain_mut(|each| match &mut each.source {
        Source::Plan(parameters) if !each.is_hidden => {
            let count = parameters.len();
            parameters.retain(|(kind, _)| !is_sampled(kind));
            let mut shared = extended.shared().iter();
            parameters.len() == count || shared.any(|(name, _)| *name == each.name)
        }
        _ => true,
    });
    let count = belief.parameters.len();
    let all: Vec<usize> = (0..count).chain(others.iter().copied()).collect();
    let earlier_others = (others.iter())
        .map(|&place| extended.set().prior().mean[place] - parameters[place].nominal);
    let mean = prior.mean.iter().copied().chain(earlier_others);
    let both = Prior::new(
        DVector::from_iterator(all.len(), mean),
        (belief.precision().select_rows(&all)).select_columns(&all),
    );
    let sizes = belief.sizes();
    let sizes: Vec<f64> = all.iter().map(|&place| sizes[place]).collect();
    let first = if tells_compliances { count } else { 0 };
    Some(EarlierValues {
        joints,
        kept,
        mean: both.mean.as_slice()[first..].to_vec(),
        spread: (both.spread(&sizes).rows(first, all.len() - first)).into_owned(),
    })
}

/// What an identification found besides compliances, springs in the logarithm; its own compliances are those at `places` among `count`.
fn campaign_of(
    stored: StoredIdentification,
    basis: IdentificationBasis,
    places: &[usize],
    count: usize,
    nominal: &Robot,
) -> PriorCampaign {
    let own = places.len();
    let compliance = nominal.compliance_rad_per_nm.clone();
    let arm = ElasticArm::new(nominal.chain.clone(), compliance, Vec::new());
    let kinds = ParameterKind::all_of(&arm);
    let (mut names, mut values, mut listed) = (Vec::new(), Vec::new(), Vec::new());
    let (mut from, mut factors) = ((0..own).collect::<Vec<_>>(), vec![1.0; own]);
    let found = &stored.all;
    let listed_others = stored.listed.iter().enumerate();
    for (index, &deviation) in listed_others.filter(|each| stored.determined[each.0]) {
        let (name, value) = (&found.names[own + index], found.mean[own + index]);
        let kind = ParameterKind::named(name, &kinds, &arm);
        // Of which nothing was known before, they were found in their unit.
        let whole = kind
            .filter(|kind| deviation.is_none() && kind.is_logarithmic(true))
            .filter(|kind| !kind.is_logarithmic(false))
            .map(|kind| kind.whole(&arm));
        from.push(own + index);
        names.push(name.clone());
        values.push(whole.map_or(value, |whole| (value / whole).ln()));
        factors.push(whole.map_or(1.0, |_| value.recip()));
        listed.push(deviation);
    }
    let all = DMatrix::from_fn(from.len(), from.len(), |row, column| {
        found.covariance[(from[row], from[column])] * factors[row] * factors[column]
    });
    let others = names.len();
    let mut cross = DMatrix::zeros(count, others);
    for (row, &place) in places.iter().enumerate() {
        (cross.row_mut(place)).copy_from(&all.view((row, own), (1, others)));
    }
    PriorCampaign {
        sources: basis.error_sources.unwrap_or_default(),
        reading_digests: basis.reading_digests.unwrap_or_default(),
        cross,
        covariance: all.view((own, own), (others, others)).into_owned(),
        listed,
        names,
        values: DVector::from_vec(values),
        left_out: stored.left_out,
        degrees_of_freedom: stored.degrees_of_freedom,
    }
}
