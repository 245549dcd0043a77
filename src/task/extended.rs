//! The extended vector: the identified compliances, and the parameters of all error sources that the whole plan shares.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::PriorCampaign;
use crate::numeric::posterior::Posterior;
use crate::observation::{DeflectionPrecision, PlannedReadings};
use crate::parameter::{
    ElasticArm, ErrorDistribution, JointFunction, ParameterError, ParameterKind, ParameterSet,
    Prior, ReadingSource, Source, Uncertainty, Unloaded,
};
use crate::robot::Load;

/// What is known of the robot from an earlier campaign and the scenario does not list.
const OTHERS: &str = "the robot's other unknowns";

/// Which of the arm's tools is measured.
const CALIBRATION: usize = 0;

/// What a belief knows to be uncertain, besides the instrument's noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Extended {
    /// The nominal arm, the calibration tool first, then the machining tool where it is another one.
    arm: ElasticArm,
    /// The identified compliances, then the parameters of the uncertainties, with their priors.
    set: ParameterSet,
    /// How many are the identified compliances.
    identified: usize,
    /// What else is to be found, right after these.
    further: Vec<ParameterKind>,
    /// The uncertainties that the whole plan shares, by name, and which parameters they are.
    shared: Vec<(String, Vec<usize>)>,
    /// What an earlier campaign knows of some of them, too: their values are the same in both. By the name of the uncertainty.
    kept: Vec<(String, Vec<usize>)>,
    /// The precision that an earlier campaign gives all parameters together (p x p, 1 over their units).
    earlier: DMatrix<f64>,
    /// The precision of each parameter that its uncertainty alone gives it (1 over its unit squared).
    own_precision: DVector<f64>,
    /// The prior as whitened equations, r x p.
    prior_rows: DMatrix<f64>,
    /// The names of those that are new in each reading.
    source_names: Vec<String>,
    sources: Vec<ReadingSource>,
    /// From which each uncertainty was evaluated, by name.
    distributions: BTreeMap<String, ErrorDistribution>,
    /// Which reading without the load deflections rest on.
    unloaded: Unloaded,
    /// The step (m) of displacements whose repeats share errors of rounding; nothing where none do.
    along_step_m: f64,
}

/// Unknowns as the uncertainties list them.
struct ListedUnknowns {
    /// How many are to be found, whatever uncertainties say of them; they come first.
    wanted: usize,
    /// All, with the deviation of what is known of each by itself.
    unknowns: Vec<(ParameterKind, Option<f64>)>,
    shared: Vec<(String, Vec<usize>)>,
    kept: Vec<(String, Vec<usize>)>,
    /// The places of those that an earlier campaign found, here and there.
    both: Vec<(usize, usize)>,
    /// What uncertainties say of those that are to be found: places and deviations.
    own_priors: Vec<(usize, f64)>,
    /// What was replaced since the earlier campaign.
    replaced: Vec<ParameterKind>,
}

impl ListedUnknowns {
    fn new(wanted: impl Iterator<Item = ParameterKind>) -> Self {
        let unknowns: Vec<_> = wanted.map(|kind| (kind, None)).collect();
        Self {
            wanted: unknowns.len(),
            unknowns,
            shared: Vec::new(),
            kept: Vec::new(),
            both: Vec::new(),
            own_priors: Vec::new(),
            replaced: Vec::new(),
        }
    }

    /// Adds what an uncertainty lists that the whole plan shares. What an earlier campaign knows of a compliance that it estimated is in its
    /// estimate.
    fn add(
        &mut self,
        arm: &ElasticArm,
        uncertainty: &Uncertainty,
        campaign: Option<&PriorCampaign>,
        is_estimated: &dyn Fn(usize) -> bool,
    ) -> Result<(), ParameterError> {
        let Source::Plan(parameters) = &uncertainty.source else {
            return Ok(());
        };
        if uncertainty.is_replaced {
            self.replaced.extend(parameters.iter().map(|each| each.0));
        }
        let (mut places, mut kept) = (Vec::new(), Vec::new());
        let campaign = campaign.filter(|_| !uncertainty.is_replaced);
        let is_common = campaign.is_some_and(|each| each.sources.contains(&uncertainty.name));
        for &(kind, deviation) in parameters {
            let wanted = &self.unknowns[..self.wanted];
            let Some(place) = wanted.iter().position(|each| each.0 == kind) else {
                let name = kind.name(arm);
                let found = campaign.filter(|_| kind.is_kept_between_campaigns());
                let found = found.and_then(|each| each.names.iter().position(|own| *own == name));
                let place = self.unknowns.len();
                self.both.extend(found.map(|found| (place, found)));
                if found.is_some() {
                    kept.push(place);
                } else {
                    places.push(place);
                }
                self.unknowns.push((kind, Some(deviation)));
                continue;
            };
            let mut known = self.kept.iter().flat_map(|(_, places)| places).chain(&kept);
            if known.any(|own| *own == place)
                || self.own_priors.iter().any(|(own, _)| *own == place)
            {
                return Err(ParameterError::Twice(kind.name(arm)));
            }
            if is_common && is_estimated(place) {
                kept.push(place);
                continue;
            }
            // A compliance stays linear, as in the paper.
            self.own_priors.push((place, deviation * kind.whole(arm)));
            places.push(place);
        }
        let name = &uncertainty.name;
        if !places.is_empty() || parameters.is_empty() {
            self.shared.push((name.clone(), places));
        }
        if !kept.is_empty() {
            self.kept.push((name.clone(), kept));
        }
        Ok(())
    }

    /// Adds what an earlier campaign found of the robot, or left nominal, and no uncertainty lists: it is unknown still.
    fn add_found(&mut self, arm: &ElasticArm, campaign: &PriorCampaign) {
        let is_compliance = |kind| matches!(kind, ParameterKind::JointCompliance { .. });
        let all = ParameterKind::of_robot(arm);
        let mut places = Vec::new();
        for (found, name) in campaign.names.iter().enumerate() {
            let kind = ParameterKind::named(name, &all, arm);
            let is_same = |kind: &ParameterKind| {
                kind.is_kept_between_campaigns() && !self.replaced.contains(kind)
            };
            let Some(kind) = kind.filter(is_same) else {
                continue;
            };
            let known = self.unknowns.iter().position(|each| each.0 == kind);
            // Typical sizes stay what they are without that: what is redundant is the same. A prior makes springs logarithms.
            let is_ratio = kind.is_logarithmic(true) && !kind.is_logarithmic(false);
            let deviation = is_ratio.then(|| campaign.covariance[(found, found)].sqrt());
            let place = known.unwrap_or(self.unknowns.len());
            match known {
                Some(place) if place < self.wanted && !is_compliance(kind) => {
                    self.unknowns[place].1 = deviation;
                }
                None if kind.is_of_any_robot() => self.unknowns.push((kind, deviation)),
                _ => continue,
            }
            self.both.push((place, found));
            places.push(place);
        }
        for (name, _) in &campaign.left_out {
            let kind = ParameterKind::named(name, &all, arm);
            let is_it =
                |(own, _): &(ParameterKind, _)| Some(*own) == kind && !self.replaced.contains(own);
            places.extend(self.unknowns.iter().position(is_it));
        }
        let is_kept = |place: &usize| self.kept.iter().any(|each| each.1.contains(place));
        places.retain(|place| !is_kept(place));
        if !places.is_empty() {
            self.kept.push((OTHERS.to_owned(), places));
        }
    }
}

impl Extended {
    /// The vector of the compliances of an arm's `identified` joints, with what is known of these before, of what
    /// else is to be found (`further`), of which nothing is known but what the uncertainties say, of these, and of what the campaign behind
    /// the prior found of the robot. A source that it lists, too, has the same value in both, and what it found of it is known of it.
    ///
    /// # Errors
    /// An unknown is something that the arm does not have or cannot know.
    pub fn new(
        arm: ElasticArm,
        identified: &[usize],
        further: &[ParameterKind],
        prior: Option<&Prior>,
        campaign: Option<&PriorCampaign>,
        uncertainties: &[Uncertainty],
    ) -> Result<Self, ParameterError> {
        let compliance = |&joint: &usize| ParameterKind::JointCompliance { joint };
        let wanted = identified.iter().map(compliance);
        let mut listed = ListedUnknowns::new(wanted.chain(further.iter().copied()));
        let further_names: Vec<String> = further.iter().map(|kind| kind.name(&arm)).collect();
        let is_estimated = |place: usize| {
            let Some(further) = place.checked_sub(identified.len()) else {
                return prior.is_some_and(|prior| prior.precision[(place, place)] > 0.0);
            };
            let name = further_names.get(further);
            campaign.is_some_and(|each| name.is_some_and(|name| each.names.contains(name)))
        };
        for each in uncertainties {
            listed.add(&arm, each, campaign, &is_estimated)?;
        }
        if let Some(campaign) = campaign {
            listed.add_found(&arm, campaign);
        }
        let ListedUnknowns {
            unknowns,
            shared,
            kept,
            both,
            own_priors,
            ..
        } = listed;
        let readings = uncertainties.iter().filter_map(|each| match &each.source {
            Source::Reading(source) => Some((each.name.clone(), source.clone())),
            Source::Plan(_) => None,
        });
        let (source_names, sources) = readings.unzip();
        let mut set = ParameterSet::new(&arm, unknowns)?;
        let mut own_precision = set.prior().precision.diagonal();
        for &(place, _) in &both {
            own_precision[place] = 0.0;
        }
        let mut earlier = DMatrix::zeros(set.len(), set.len());
        if let Some(prior) = prior {
            let (known, others): (Vec<usize>, Vec<usize>) = both.iter().copied().unzip();
            let places: Vec<usize> = (0..identified.len()).chain(known).collect();
            let found = campaign.filter(|_| !others.is_empty());
            let (mut mean, mut precision) = (
                set.prior().mean.select_rows(&places),
                prior.precision.clone(),
            );
            if let Some(found) = found {
                let values = found.values.select_rows(&others);
                mean.rows_mut(identified.len(), others.len())
                    .copy_from(&values);
                precision =
                    (found.together(&precision, &others)).ok_or(ParameterError::Covariance)?;
            }
            set = set.with_earlier(&places, &mean, &precision);
            earlier = &set.prior().precision - DMatrix::from_diagonal(&own_precision);
            if let Some(found) = campaign.map(|each| each.as_found(&set, 0)) {
                let found = found.tr_mul(&earlier) * found;
                set = set.with_precision(&(&found - &earlier));
                earlier = found;
            }
        }
        for (place, deviation) in own_priors {
            own_precision[place] = deviation.powi(-2);
            set = set.with_deviation(place, deviation);
        }
        let joints = identified.iter();
        let mut sizes: Vec<f64> = joints
            .map(|&joint| compliance(&joint).typical_size(&arm, false))
            .collect();
        sizes.extend(
            set.parameters()[identified.len()..]
                .iter()
                .map(|each| each.scale),
        );
        Ok(Self {
            prior_rows: set.prior().rows(&sizes),
            arm,
            set,
            identified: identified.len(),
            further: further.to_vec(),
            shared,
            kept,
            earlier,
            own_precision,
            source_names,
            sources,
            distributions: (uncertainties.iter())
                .map(|each| (each.name.clone(), each.distribution))
                .collect(),
            unloaded: Unloaded::Own,
            along_step_m: 0.0,
        })
    }

    /// The same where deflections rest on such readings without the load.
    pub const fn resting_on(mut self, unloaded: Unloaded) -> Self {
        self.unloaded = unloaded;
        self
    }

    /// The same where displacements are shown in steps (m) so coarse that repeats share errors of rounding; nothing where they are not.
    pub const fn shown_in_steps(mut self, along_step_m: f64) -> Self {
        self.along_step_m = along_step_m;
        self
    }

    /// The step (m) of displacements whose repeats share errors of rounding; nothing where none do.
    pub const fn along_step_m(&self) -> f64 {
        self.along_step_m
    }

    /// Whether repeats of an experiment share something that they do not average.
    pub fn is_shared_by_repeats(&self) -> bool {
        self.along_step_m > 0.0 || self.is_shared_by_configuration()
    }

    /// Which reading without the load deflections rest on.
    pub const fn unloaded(&self) -> Unloaded {
        self.unloaded
    }

    /// Of what moves along a gauge's direction the share that is shown on average.
    pub fn share_along(&self) -> f64 {
        ReadingSource::share_along(&self.sources)
    }

    /// The same vector where only the instrument's noise is believed in, with what is known of the compliances before:
    /// what is to be found stays.
    ///
    /// # Errors
    /// None, as it is a part of the same.
    pub fn noise_only(
        &self,
        identified: &[usize],
        prior: Option<&Prior>,
    ) -> Result<Self, ParameterError> {
        let (arm, further) = (self.arm.clone(), &self.further);
        let noise_only = Self::new(arm, identified, further, prior, None, &[])?;
        Ok((noise_only.resting_on(self.unloaded)).shown_in_steps(self.along_step_m))
    }

    /// Whether closed forms hold: compliances alone are unknown, only the noise of each deflection is uncertain, and no spring moves where
    /// the unloaded arm rests with them.
    pub fn has_closed_forms(&self) -> bool {
        self.is_plain() && !self.arm.chain.elements.has_springs()
    }

    /// Whether compliances alone are unknown, and only the noise of each deflection is uncertain.
    pub const fn is_plain(&self) -> bool {
        self.further.is_empty()
            && self.is_certain()
            && matches!(self.unloaded, Unloaded::Own)
            && self.along_step_m <= 0.0
    }

    /// The arm at values of the unknowns (p).
    pub fn arm_at(&self, values: &[f64]) -> ElasticArm {
        self.set.apply(&self.arm, values)
    }

    /// Whether nothing but the instrument's noise is uncertain.
    pub const fn is_certain(&self) -> bool {
        self.shared.is_empty() && self.kept.is_empty() && self.sources.is_empty()
    }

    /// Whether deflections of one configuration share something that repeats do not average.
    pub fn is_shared_by_configuration(&self) -> bool {
        self.unloaded == Unloaded::Shared
            || self.sources.iter().any(ReadingSource::is_of_configuration)
    }

    /// Whether deflections have discrepancies that are new in each configuration.
    pub fn has_discrepancies(&self) -> bool {
        let mut sources = self.sources.iter();
        sources.any(|each| each.is_of_configuration() && each.is_of_deflection(false))
    }

    /// Whether joints have gaps, so that the side of approach counts.
    pub fn has_backlash(&self) -> bool {
        let is_gap = |kind| matches!(kind, ParameterKind::JointBacklash { .. });
        self.set.parameters().iter().any(|each| is_gap(each.kind))
    }

    /// Whether the instrument drifts between the readings of a deflection.
    pub fn has_drift(&self) -> bool {
        let is_drift = |kind| matches!(kind, ParameterKind::Drift { .. });
        self.set.parameters().iter().any(|each| is_drift(each.kind))
    }

    /// From which distribution an uncertainty was evaluated.
    pub fn distribution(&self, name: &str) -> ErrorDistribution {
        self.distributions.get(name).copied().unwrap_or_default()
    }

    /// The names of what is to be found besides compliances.
    pub fn further(&self) -> impl Iterator<Item = &str> {
        let places = self.identified..self.identified + self.further.len();
        (self.set.parameters()[places].iter()).map(|each| each.name.as_str())
    }

    /// The same about other compliances of all joints (rad/(N m)), with what measurements tell besides: a precision of
    /// all unknowns (p x p, in one over their units). Where compliances alone are unknown, their mean becomes these.
    pub fn informed(&self, compliance_rad_per_nm: &[f64], precision: &DMatrix<f64>) -> Self {
        let mut informed = self.clone();
        (informed.arm.compliance_rad_per_nm).copy_from_slice(compliance_rad_per_nm);
        informed.set = informed.set.with_precision(precision);
        if self.is_plain() {
            let kinds = informed.set.parameters().iter().map(|each| each.kind);
            let mean = kinds.map(|kind| kind.whole(&informed.arm)).collect();
            let places: Vec<usize> = (0..self.identified).collect();
            let precision = informed.set.prior().precision.clone();
            let mean = DVector::from_vec(mean);
            informed.set = (informed.set).with_earlier(&places, &mean, &precision);
        }
        let identified = informed.set.parameters()[..self.identified].iter();
        let mut sizes: Vec<f64> = identified
            .map(|each| each.kind.typical_size(&informed.arm, false))
            .collect();
        sizes.extend(informed.other_sizes());
        informed.prior_rows = informed.set.prior().rows(&sizes);
        informed
    }

    /// The nominal arm, the calibration tool first.
    pub const fn arm(&self) -> &ElasticArm {
        &self.arm
    }

    /// Which of the arm's tools machines.
    pub const fn machining_tool(&self) -> usize {
        self.arm.tools.len() - 1
    }

    /// The extended vector: the identified compliances, then what is uncertain.
    pub const fn set(&self) -> &ParameterSet {
        &self.set
    }

    /// How many of its first parameters are the identified compliances.
    pub const fn identified(&self) -> usize {
        self.identified
    }

    /// The names of the parameters after the identified compliances.
    pub fn other_names(&self) -> Vec<String> {
        let others = self.set.parameters()[self.identified..].iter();
        others.map(|each| each.name.clone()).collect()
    }

    /// Their typical sizes: the standard deviations of their priors.
    pub fn other_sizes(&self) -> Vec<f64> {
        let others = self.set.parameters()[self.identified..].iter();
        others.map(|each| each.scale).collect()
    }

    /// The uncertainties that the whole plan shares, by name, and which parameters they are.
    pub fn shared(&self) -> &[(String, Vec<usize>)] {
        &self.shared
    }

    /// The uncertainties whose value is that of an earlier campaign, by name, and which parameters they are.
    pub fn kept(&self) -> &[(String, Vec<usize>)] {
        &self.kept
    }

    /// The parameters of these that are no identified compliances, by their places.
    pub fn kept_others(&self) -> Vec<usize> {
        let all = self.kept.iter().flat_map(|(_, places)| places);
        (all.copied().filter(|place| *place >= self.identified)).collect()
    }

    /// The precision that an earlier campaign gives all parameters together (p x p, 1 over their units).
    pub const fn earlier(&self) -> &DMatrix<f64> {
        &self.earlier
    }

    /// The prior as whitened equations, r x p: rows of unit variance that the unknowns times them equal those of its
    /// mean.
    pub const fn prior_rows(&self) -> &DMatrix<f64> {
        &self.prior_rows
    }

    /// What is known in another campaign: frames, mounted tools and drift have new values there, as their uncertainties say.
    pub fn in_another_campaign(&self, posterior: &Posterior) -> Posterior {
        let mut posterior = posterior.clone();
        for (place, parameter) in self.set.parameters().iter().enumerate() {
            let own = self.own_precision[place];
            if own > 0.0 && !parameter.kind.is_kept_between_campaigns() {
                posterior.mean[place] = parameter.nominal;
                posterior.covariance.row_mut(place).fill(0.0);
                posterior.covariance.column_mut(place).fill(0.0);
                posterior.covariance[(place, place)] = own.recip();
            }
        }
        posterior
    }

    /// The precision that its uncertainty alone gives a parameter (1 over its unit squared).
    pub fn own_precision(&self, parameter: usize) -> f64 {
        self.own_precision[parameter]
    }

    /// The standard deviation that its uncertainty alone gives a parameter, in its unit; `None` where there is none.
    pub fn prior_deviation(&self, parameter: usize) -> Option<f64> {
        let own = self.own_precision[parameter];
        let deviation = self.set.parameters()[parameter].prior_deviation;
        deviation.or_else(|| (own > 0.0).then(|| own.sqrt().recip()))
    }

    /// The uncertainties that are new in each reading, by name.
    pub fn sources(&self) -> impl Iterator<Item = (&str, &ReadingSource)> {
        let names = self.source_names.iter().map(String::as_str);
        names.zip(&self.sources)
    }

    /// The joints' errors as functions of their own angles, in the joints' order, with how well they return.
    pub fn joint_functions(&self) -> Vec<JointFunction> {
        let each = self.sources.iter().flat_map(ReadingSource::functions);
        let mut functions: Vec<JointFunction> = each.collect();
        functions.sort_by_key(|each| each.joint);
        for function in &mut functions {
            let squares = self.sources.iter().filter_map(|source| match source {
                ReadingSource::JointRepeatability(deviations) => deviations.get(function.joint),
                _ => None,
            });
            // Of a difference of two visits.
            let square: f64 = squares.map(|each| 0.5 * each * each).sum();
            function.repeatability_rad = square.sqrt();
        }
        functions
    }

    /// The standard deviation (m) of each coordinate of what no parameter explains of a position under a load; none where nothing says so.
    pub fn discrepancy_m(&self, load: &Load) -> Option<f64> {
        let squares = self.sources.iter().filter_map(|source| match source {
            ReadingSource::Discrepancy(error) => Some(error.in_reading_m(load).powi(2)),
            _ => None,
        });
        squares.reduce(|sum, each| sum + each).map(f64::sqrt)
    }

    /// The readings that planning sees, with derivatives with respect to some of the unknowns in units of their `sizes`.
    pub fn readings(
        &self,
        unknowns: &[usize],
        sizes: &[f64],
        precision: DeflectionPrecision,
    ) -> PlannedReadings<'_> {
        let set = &self.set.subset(unknowns);
        PlannedReadings::new(&self.arm, CALIBRATION, set, sizes, precision, &self.sources)
    }

    /// The same for all unknowns, in their units.
    pub fn readings_of_all(&self, precision: DeflectionPrecision) -> PlannedReadings<'_> {
        let all: Vec<usize> = (0..self.set.len()).collect();
        self.readings(&all, &vec![1.0; all.len()], precision)
    }

    /// The same at the machining tool, where nothing is measured.
    pub fn at_test_pose(&self, sizes: &[f64]) -> PlannedReadings<'_> {
        PlannedReadings::at_test_pose(&self.arm, self.machining_tool(), &self.set, sizes)
    }
}
