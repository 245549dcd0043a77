//! The fit of absolute readings, its residuals and its conditions.

use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::conditions::{Told, impossible_compliance, inconsistent, left_out};
use super::super::estimate::{told_degrees, two_sided_student};
use super::super::fit::{Haste, ParameterFit};
use super::super::frames::reach;
use super::super::nominal::{UNKNOWN, UNKNOWN_TOGETHER, with_nominal};
use super::super::outliers::{self, IMPLAUSIBLE};
use super::super::prior_consistency::far_from_priors;
use super::choices::ReadingWeights;
use super::{
    AbsoluteCase, CopiedReadings, FitResult, IdentificationError, JointError, LeftOut,
    ParameterGroup, ReadingResidual, RejectedReading, Unexplained,
};
use crate::codes::{Condition, ConditionCode};
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, Freedom, Parameter, ParameterKind, ParameterSet};
use crate::task::Belief;

/// Robots leave less than this share of how far positions reach in each coordinate, 2 mm of a metre, and as much of a rotation (rad): a
/// joint that is off by an angle moves what it carries by that share of how far it reaches.
const ROBOTS_LEAVE: f64 = 2e-3;
/// No joint's zero or link's direction is off by more (rad) ...
const MOST_TURNED_RAD: f64 = 0.05;
/// ... and no link by more (m), in what a maker delivers.
const MOST_SHIFTED_M: f64 = 0.02;
/// Instruments err by no smaller a share of the standard deviations that are given for them, unless these are in another unit.
const OVERSTATED: f64 = 1e-2;
/// Corrections of fewer standard errors are no matter of tolerances.
const FAR: f64 = 2.0;

/// The probability of residuals at least as large; none where nothing is left over.
fn consistency_of(fit: &ParameterFit) -> Option<f64> {
    let chi_square = ChiSquared::new(fit.degrees_of_freedom()).ok()?;
    Some(chi_square.sf(fit.square))
}

/// What absolute readings tell of a robot.
#[derive(Debug, Clone)]
pub struct AbsoluteFit {
    /// The arm with the fitted frames, nominal in all else: the parameters' values count from there.
    pub reference: ElasticArm,
    /// The arm with all that was fitted.
    pub arm: ElasticArm,
    /// What was fitted.
    pub set: ParameterSet,
    /// Values, covariance, and what is determined; in the parameters' units.
    pub posterior: Posterior,
    /// What was left out as redundant.
    pub left_out: Vec<LeftOut>,
    /// What these readings do not determine, in sentences.
    pub undetermined: Vec<String>,
    /// The compliances that stay nominal since these readings tell less of them.
    pub stays_nominal: Vec<LeftOut>,
    /// What is left of each reading, those that were rejected among them.
    pub left: Vec<ReadingResidual>,
    /// The readings that were left out since they lie far out.
    pub rejected: Vec<RejectedReading>,
    /// Those that are copies.
    pub copies: CopiedReadings,
    /// How far most positions lie from their middle (m).
    pub reach_m: f64,
    /// The standard deviations of what no parameter explains, of positions (m) and rotations (rad), where they were taken
    /// from the residuals.
    pub discrepancy: Option<[f64; 2]>,
    /// The degrees of freedom of a coordinate's variance then; infinite where it was known before.
    pub degrees: f64,
    /// What that consists of, where there are readings enough to tell: the covariance counts it then.
    pub discrepancy_model: Option<Unexplained>,
    /// Whether readings were weighed by what the planner's model says of their errors besides the instrument's.
    pub counts_sources: bool,
    /// The number of scalar readings.
    pub rows: usize,
    /// The sum of squares of the weighted residuals.
    pub square: f64,
    /// The probability of residuals at least as large, if the readings' own covariances are right; none where they were not
    /// asked alone.
    pub consistency: Option<f64>,
    /// The number of steps.
    pub iterations: usize,
}

/// A fit to those readings of a case that were kept, with its weights.
pub(super) struct KeptFit<'a> {
    pub case: AbsoluteCase<'a>,
    pub rejected: Vec<RejectedReading>,
    pub fit: ParameterFit,
    /// As in [`AbsoluteFit`].
    pub discrepancy: Option<[f64; 2]>,
    pub discrepancy_model: Option<Unexplained>,
    pub consistency: Option<f64>,
}

/// A fit by what is known of the readings' errors.
pub(super) struct FitByKnownErrors<'a> {
    case: AbsoluteCase<'a>,
    /// By the instrument's errors alone; none where that was not asked, or went anywhere.
    own: Option<ParameterFit>,
    /// The probability of residuals at least as large then.
    consistency: Option<f64>,
    /// By those of the planner's model, as [`AbsoluteCase::counted`].
    counted: Option<(AbsoluteCase<'a>, ParameterFit)>,
}

impl FitByKnownErrors<'_> {
    /// Whether these errors explain the residuals.
    pub(super) fn is_explained(&self) -> bool {
        let is_plausible = (self.consistency).is_none_or(|probability| probability >= IMPLAUSIBLE);
        self.counted.is_some() || self.own.is_some() && is_plausible
    }
}

impl<'a> AbsoluteCase<'a> {
    /// Fits what the belief leaves open, or what `groups` name, together with all frames.
    pub fn fit(
        &mut self,
        groups: &[ParameterGroup],
        weights: ReadingWeights,
    ) -> FitResult<AbsoluteFit> {
        self.choices.weights = weights;
        self.check_frames()?;
        let (set, left_out) = self.told_apart(groups, &[])?;
        let start = self.far_from_frames();
        let mut found = self.settled(&set, &start, self.choices.keeps_all)?;
        let nominal = found.fit.set.nominal().len();
        if nominal > set.nominal().len() && found.rejected.len() > start.len() {
            // Compliances that stay nominal beside gross errors may be determined without.
            let without = self.settled(&set, &found.rejected, true).ok();
            if let Some(without) = without.filter(|each| each.fit.set.nominal().len() < nominal) {
                found = without;
            }
        }
        self.told(found, left_out)
    }

    /// A fit without the readings that lie far out, or without given ones alone, in which compliances stay nominal that it does not tell.
    fn settled(
        &self,
        free: &ParameterSet,
        start: &[RejectedReading],
        are_given: bool,
    ) -> FitResult<KeptFit<'a>> {
        let mut set = free.clone();
        let mut near: Option<KeptFit<'a>> = None;
        loop {
            let begun = near.and_then(|near| self.fit_without(start, &set, Some(&near)).ok());
            let begun = begun.map_or_else(|| self.fit_without(start, &set, None), Ok);
            let mut found = match begun {
                Err(IdentificationError::NotConverged { step }) if !are_given => {
                    let rejected = self.far_out_of_fewer(&set, start);
                    let rejected = rejected.ok_or(IdentificationError::NotConverged { step })?;
                    self.fit_without(&rejected, &set, None)?
                }
                found => found?,
            };
            if !are_given && let Some(others) = self.without_far_out(&found) {
                found = others;
            }
            let fit = &found.fit;
            let mut other = with_nominal(fit, &fit.posterior.covariance, UNKNOWN);
            if other.is_none() {
                found.discrepancy_model = self.unexplained(&mut found);
                if !are_given && let Some(rejected) = self.far_out_of_model(&found) {
                    found = self.fit_without(&rejected, &set, Some(&found))?;
                    found.discrepancy_model = self.unexplained(&mut found);
                }
                other = (found.discrepancy_model.as_ref()).and_then(|model| {
                    with_nominal(&found.fit, &model.covariance, UNKNOWN_TOGETHER)
                });
            }
            match other {
                Some(other) => (set, near) = (other, Some(found)),
                None => return Ok(found),
            }
        }
    }

    /// What a fit leaves: as the planner's model says, or as the readings tell; none where neither does.
    fn unexplained(&self, found: &mut KeptFit<'a>) -> Option<Unexplained> {
        let (case, fit) = (&found.case, &mut found.fit);
        if let Some(known) = self.known_components([0.0; 2])
            && let Some(beside) = case.with_known(fit, &known)
        {
            // What is left beside the functions may be more than readings were weighed by.
            if let Some(discrepancy) = &mut found.discrepancy {
                *discrepancy = [0, 1].map(|part| discrepancy[part].max(beside.model.rest[part]));
            }
            return Some(beside);
        }
        let is_rejected = outliers::rejected_of(self.observations.len(), &found.rejected);
        let far_out = self.part_of(|index| is_rejected[index]);
        case.discrepancy_model(fit, found.discrepancy?, &far_out)
    }

    /// The readings that no fit begins with.
    pub(super) fn far_from_frames(&self) -> Vec<RejectedReading> {
        if self.choices.keeps_all {
            return Vec::new();
        }
        self.far_from_frames.clone()
    }

    /// All that is told of a fit to those readings that were kept.
    fn told(&mut self, found: KeptFit<'a>, left_out: Vec<LeftOut>) -> FitResult<AbsoluteFit> {
        let (case, mut fit, discrepancy) = (found.case, found.fit, found.discrepancy);
        let stays_nominal = case.stays_nominal(&fit)?;
        if let Some(model) = &found.discrepancy_model {
            fit.posterior.covariance.clone_from(&model.covariance);
        }
        let degrees = discrepancy.map(|_| case.degrees_of(&fit));
        let counts_sources = case.is_sharing_known;
        (self.arm, self.within) = (case.arm, case.within);
        let left = self.left(&fit.belief)?;
        let undetermined = fit.freedoms.named.into_iter();
        let undetermined = undetermined.filter(|each| !each.stays_nominal);
        Ok(AbsoluteFit {
            reference: self.arm.clone(),
            arm: fit.belief,
            posterior: fit.posterior,
            left_out,
            undetermined: undetermined.map(|each| each.sentence).collect(),
            stays_nominal,
            left,
            rejected: found.rejected,
            copies: self.copies.clone(),
            reach_m: reach(&self.sights()),
            degrees: degrees.unwrap_or(f64::INFINITY),
            discrepancy,
            discrepancy_model: found.discrepancy_model,
            counts_sources,
            rows: fit.rows,
            square: fit.square,
            consistency: found.consistency,
            iterations: fit.iterations,
            set: fit.set,
        })
    }

    /// The compliances that stay nominal in a fit, with what would be found besides if they were others.
    fn stays_nominal(&self, fit: &ParameterFit) -> FitResult<Vec<LeftOut>> {
        let nominal = fit.freedoms.named.iter().filter(|each| each.stays_nominal);
        let nominal: Vec<_> = nominal.collect();
        if nominal.is_empty() {
            return Ok(Vec::new());
        }
        let (set, scales) = (&fit.set, fit.set.scales());
        let values = DVector::from_column_slice(&fit.posterior.mean);
        let told = self.fitted_readings(set).equations(&values)?.information;
        let left_out = |each: &Freedom| {
            let told = told.column(each.redundant).component_div(&scales);
            let shift = &fit.posterior.covariance * told / -scales[each.redundant];
            LeftOut {
                name: set.parameters()[each.redundant].name.clone(),
                sentence: each.sentence.clone(),
                shift: shift.as_slice().to_vec(),
            }
        };
        Ok(nominal.into_iter().map(left_out).collect())
    }

    /// One fit without some readings, from near another one.
    pub(super) fn fit_without(
        &self,
        rejected: &[RejectedReading],
        set: &ParameterSet,
        near: Option<&KeptFit<'a>>,
    ) -> FitResult<KeptFit<'a>> {
        let by_known = self.by_known_errors(rejected, set, near)?;
        self.completed(by_known, rejected, set)
    }

    /// The fit of which this is the beginning: with a discrepancy, where what is known of errors does not explain the residuals.
    pub(super) fn completed(
        &self,
        by_known: FitByKnownErrors<'a>,
        rejected: &[RejectedReading],
        set: &ParameterSet,
    ) -> FitResult<KeptFit<'a>> {
        let is_explained = by_known.is_explained();
        let (mut case, mut consistency) = (by_known.case, by_known.consistency);
        let (fit, discrepancy) = match (by_known.counted, by_known.own) {
            (Some((counted, fit)), _) => {
                consistency = consistency_of(&fit);
                case = counted;
                (fit, None)
            }
            (None, Some(fit)) if is_explained || self.choices.weights == ReadingWeights::Own => {
                let values = case.rebased(&fit);
                (case.fit_near(set, values.as_slice(), Haste::Near)?, None)
            }
            (None, other) => case.with_discrepancy(set, other.as_ref())?,
        };
        Ok(KeptFit {
            case,
            rejected: rejected.to_vec(),
            fit,
            discrepancy,
            discrepancy_model: None,
            consistency,
        })
    }

    /// The same by what is known of the readings' errors, as far as it is asked.
    pub(super) fn by_known_errors(
        &self,
        rejected: &[RejectedReading],
        set: &ParameterSet,
        near: Option<&KeptFit<'a>>,
    ) -> FitResult<FitByKnownErrors<'a>> {
        let weights = self.choices.weights;
        let mut case = self.without(rejected);
        let start = near.map(|near| case.rebased(&near.fit));
        let readings = case.fitted_readings(set);
        let fit = |haste| match &start {
            Some(values) => readings.fit_from(values, haste),
            None => readings.fit_from_frames(haste),
        };
        let own = match weights {
            ReadingWeights::WithDiscrepancy => None,
            ReadingWeights::Own => Some(fit(Haste::Residuals)?),
            ReadingWeights::AsNeeded => {
                match fit(Haste::Plausibility) {
                    Ok(fit) => Some(fit),
                    // Readings that the model cannot explain may drive its parameters anywhere.
                    Err(IdentificationError::NotConverged { .. }) => None,
                    Err(error) => return Err(error),
                }
            }
        };
        let mut found = FitByKnownErrors {
            consistency: own.as_ref().and_then(consistency_of),
            case,
            own,
            counted: None,
        };
        if let Some(fit) = &found.own
            && weights == ReadingWeights::AsNeeded
        {
            found.counted = (found.case).counted(set, fit, found.is_explained())?;
        }
        Ok(found)
    }

    /// The case weighed by what the planner's model says of the readings' errors, with the fit from near one that counts the instrument's
    /// alone. None where the model says nothing, or where readings that are not plausible by the instrument are not by the model either: of
    /// plausible ones it may say more than they show.
    fn counted(
        &self,
        set: &ParameterSet,
        own: &ParameterFit,
        is_plausible: bool,
    ) -> FitResult<Option<(Self, ParameterFit)>> {
        let mut counted = self.clone();
        let values = counted.rebased(own);
        counted = counted.counting_sources();
        if !counted.is_sharing_known {
            return Ok(None);
        }
        let fit = counted.fit_near(set, values.as_slice(), Haste::Near)?;
        let plausible = IMPLAUSIBLE..=1.0 - IMPLAUSIBLE;
        let is_counted = is_plausible
            || consistency_of(&fit).is_some_and(|probability| plausible.contains(&probability));
        Ok(is_counted.then_some((counted, fit)))
    }

    /// The fitted frames become those from which their parameters count, but for what is known of some before: the values of a fit (p)
    /// there.
    pub(super) fn rebased(&mut self, fit: &ParameterFit) -> DVector<f64> {
        let bases =
            (self.arm.instrument_from_base.iter_mut()).zip(&fit.belief.instrument_from_base);
        for (station, (base, fitted)) in bases.enumerate() {
            if !fit
                .set
                .knows_frame_of(ParameterKind::of_base(station)[0][0])
            {
                *base = *fitted;
            }
        }
        self.arm.tools.clone_from(&fit.belief.tools);
        from_its_frames(fit)
    }
}

/// The values of a fit (p), counted from the frames that it found, but for what is known of some before.
pub(super) fn from_its_frames(fit: &ParameterFit) -> DVector<f64> {
    let counts = |kind: ParameterKind| !kind.is_mounted() || fit.set.knows_frame_of(kind);
    let values = fit.set.parameters().iter().zip(&fit.posterior.mean);
    let counted = values.map(|(each, &value)| if counts(each.kind) { value } else { 0.0 });
    DVector::from_iterator(fit.set.len(), counted)
}

impl AbsoluteFit {
    /// Whether it explains all readings within their own standard deviations.
    pub fn explains_all(&self) -> bool {
        let is_plausible = self.consistency.is_some_and(|each| each >= IMPLAUSIBLE);
        is_plausible && self.discrepancy.is_none() && self.rejected.is_empty()
    }

    /// What joints are off by, where the planner's model has joint error functions.
    pub fn known_joint_errors(&self, belief: &Belief) -> &[JointError] {
        let are_known = !belief.uncertain.joint_functions().is_empty();
        let model = self.discrepancy_model.as_ref().filter(|_| are_known);
        model.map_or(&[], |each| &each.model.joints)
    }

    /// The quantity of a parameter in its own unit: ratios of logarithms become quantities.
    pub fn quantity(&self, index: usize) -> f64 {
        let parameter = &self.set.parameters()[index];
        parameter.quantity(&self.reference, self.posterior.mean[index])
    }

    /// By how much that changes with the parameter's own value.
    pub fn factor(&self, index: usize) -> f64 {
        if self.set.parameters()[index].is_logarithmic {
            self.quantity(index)
        } else {
            1.0
        }
    }

    /// The standard error of that quantity; `None` where it is not determined.
    pub fn standard_error(&self, index: usize) -> Option<f64> {
        Some(self.posterior.standard_error(index)? * self.factor(index))
    }

    /// By how many standard errors the interval of 95 % of a parameter reaches to either side.
    pub fn reach95(&self, index: usize) -> f64 {
        let value = self.posterior.mean[index];
        let told = || {
            let covariance = &self.posterior.covariance;
            told_degrees(&self.set, covariance, (index, value), self.degrees)
        };
        let model = self.discrepancy_model.as_ref();
        let degrees = model.map_or_else(told, |model| model.degrees[index]);
        two_sided_student(degrees)
    }

    /// The standard errors of three parameters together, where all are in the fit and determined.
    pub fn standard_errors(&self, kinds: [ParameterKind; 3]) -> Option<[f64; 3]> {
        let mut errors = [0.0; 3];
        for (error, kind) in errors.iter_mut().zip(kinds) {
            *error = self.standard_error(self.set.index_of(kind)?)?;
        }
        Some(errors)
    }

    /// The readings that were fitted, by their places.
    pub fn kept(&self) -> Vec<usize> {
        self.copies.kept(self.left.len(), &self.rejected)
    }

    /// Those of one thing for each reading that belong to the readings that were fitted.
    pub fn of_kept<T: Clone>(&self, all: &[T]) -> Vec<T> {
        let kept = self.kept().into_iter();
        kept.map(|place| all[place].clone()).collect()
    }

    /// The parameters that are no frames of stations or targets, with their places in the set.
    pub fn of_the_robot(&self) -> impl Iterator<Item = (usize, &Parameter)> {
        let all = self.set.parameters().iter().enumerate();
        all.filter(|(_, parameter)| !parameter.kind.is_mounted())
    }

    /// The values, as the set takes them.
    pub fn values(&self) -> DVector<f64> {
        DVector::from_vec(self.posterior.mean.clone())
    }

    /// What must be looked at.
    pub fn conditions(&self) -> Vec<Condition> {
        let mut conditions: Vec<Condition> = (self.undetermined.iter())
            .map(|sentence| {
                ConditionCode::Unidentifiable.with(format!("not determined: {sentence}"))
            })
            .collect();
        for (index, parameter) in self.of_the_robot() {
            if matches!(parameter.kind, ParameterKind::JointCompliance { .. })
                && self.standard_error(index).is_some()
            {
                let joint = parameter.name.trim_end_matches(".compliance");
                conditions.extend(impossible_compliance(
                    joint,
                    (self.quantity(index), parameter.quantity_unit()),
                ));
            }
        }
        conditions.extend(self.beyond_tolerances());
        conditions.extend(far_from_priors(&self.set, &self.posterior));
        conditions.extend(self.copies.conditions("reading"));
        conditions.extend(self.handled().filter_map(Result::ok));
        conditions
    }

    /// What contradicts the planner's model: estimates far from their priors, and residuals that its error sources do not explain.
    pub fn contradictions(&self, belief: &Belief) -> Vec<Condition> {
        let has_functions = !belief.uncertain.joint_functions().is_empty();
        let unexplained = self.discrepancy.filter(|_| !has_functions).map(|[position_m, _]| {
            ConditionCode::ResidualsTooLarge.with(format!(
                "residuals show a model discrepancy of {:.4} mm that the scenario does not have: predicted accuracies do not count it",
                position_m * 1e3
            ))
        });
        let far = far_from_priors(&self.set, &self.posterior);
        unexplained.into_iter().chain(far).collect()
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        let nominal = self.stays_nominal.iter().map(|each| each.sentence.clone());
        (nominal.chain(self.handled().filter_map(Result::err))).collect()
    }

    /// The readings that were left out, and residuals that are too small or too large.
    fn handled(&self) -> impl Iterator<Item = Told> {
        let rejected = left_out(&self.rejected, self.left.len(), "reading");
        let usual = [ROBOTS_LEAVE * self.reach_m, ROBOTS_LEAVE];
        let left_and_usual =
            (self.discrepancy).map(|left| [0, 1].map(|part| [left[part], usual[part]]));
        let probabilities = [self.consistency, self.consistency.map(|each| 1.0 - each)];
        let deviations = "the readings' standard deviations";
        let share = (self.square / self.rows as f64).sqrt();
        let shares = [share, OVERSTATED];
        let residuals = inconsistent(probabilities, deviations, left_and_usual, shares);
        rejected.into_iter().chain(residuals)
    }

    /// Corrections of geometry that no maker's tolerances explain.
    fn beyond_tolerances(&self) -> Option<Condition> {
        let far = self.of_the_robot().filter_map(|(index, each)| {
            let off = self.posterior.mean[index] - self.set.prior().mean[index];
            let (most, unit) = match each.kind {
                ParameterKind::LinkPosition { .. } => (MOST_SHIFTED_M, "mm"),
                ParameterKind::JointZero { .. } | ParameterKind::LinkRotation { .. } => {
                    (MOST_TURNED_RAD, "mrad")
                }
                _ => return None,
            };
            let error = self.posterior.standard_error(index)?;
            (off.abs() > most.max(FAR * error))
                .then(|| format!("{} by {:.1} {unit}", each.name, off * 1e3))
        });
        let far: Vec<String> = far.collect();
        let code = ConditionCode::GeometryBeyondTolerance;
        let words = far.join(", ");
        (!far.is_empty()).then(|| code.with(format!("beyond manufacturing tolerances: {words}")))
    }
}
