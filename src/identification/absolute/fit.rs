//! The fit of absolute readings, its residuals and its conditions.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::conditions::{Told, impossible_compliance, left_out, too_large};
use super::super::estimate::two_sided_student;
use super::super::frames::reach;
use super::super::gauss_newton::{
    FitError, ParameterFit, fit_for_residuals, fit_from, fit_if_plausible,
};
use super::super::nominal::{UNKNOWN, UNKNOWN_TOGETHER, with_nominal};
use super::super::outliers;
use super::super::outliers::IMPLAUSIBLE;
use super::mixed::{MixedModel, VarianceComponents};
use super::rows::LinearReading;
use super::unknowns::{LeftOut, ToldApart};
use super::{
    AbsoluteCase, AbsoluteError, CopiedReadings, Discrepancy, DiscrepancyModel, ParameterGroup,
    ReadingResidual, RejectedReading,
};
use crate::codes::{Condition, ConditionCode};
use crate::numeric::factorisation::symmetric;
use crate::numeric::posterior::Posterior;
use crate::parameter::{ElasticArm, Parameter, ParameterKind, ParameterSet, relative_precision};

/// Fewer visits tell nothing of what the parameters leave but its size.
const LEAST_VISITS: usize = 20;

/// Robots leave less than this share of how far positions reach in each coordinate: 2 mm of a metre.
const ROBOTS_LEAVE: f64 = 2e-3;
/// No joint's zero or link's direction is off by more (rad) ...
const MOST_TURNED_RAD: f64 = 0.05;
/// ... and no link by more (m), in what a maker delivers.
const MOST_SHIFTED_M: f64 = 0.02;
/// Further from what is believed, in standard deviations of that, is told.
const FAR: f64 = 2.0;

/// The unit of a thousandth of what a correction of geometry is told in.
const fn thousandth(kind: ParameterKind) -> &'static str {
    match kind {
        ParameterKind::LinkPosition { .. } => "mm",
        _ => "mrad",
    }
}

/// How much each reading counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingWeights {
    /// By its own covariance alone.
    Own,
    /// The same; where the residuals say that this cannot be, by what the model leaves unexplained, too.
    AsNeeded,
    /// By what the model leaves unexplained, too.
    WithDiscrepancy,
}

/// The probability of residuals at least as large; none where nothing is left over.
fn consistency(fit: &ParameterFit) -> Option<f64> {
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
    /// The compliances that stay nominal since these readings tell less of them, in sentences.
    pub stays_nominal: Vec<String>,
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
    /// What that consists of, where there are readings enough to tell: the covariance counts it then.
    pub discrepancy_model: Option<Unexplained>,
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

/// What parameters leave of readings, told apart.
#[derive(Debug, Clone, PartialEq)]
pub struct Unexplained {
    /// Errors of joints and what is new at each visit, to predict with.
    pub model: DiscrepancyModel,
    /// The covariance of the parameters (p x p), if that is what they leave.
    pub covariance: DMatrix<f64>,
    /// The degrees of freedom of each parameter's variance.
    pub degrees: Vec<f64>,
    /// What is left of each reading that was not rejected beside the parameters and the joints' errors.
    pub left: Vec<ReadingResidual>,
    /// Visits.
    pub visits: usize,
    /// As many with errors of their own would tell as much of the parameters.
    pub effective_sample_size: f64,
    /// The shares of positions and of rotations that lie in their regions of 95 % as computed, each predicted by a fit to other
    /// stands.
    pub predicted_by_others: [Option<f64>; 2],
}

/// A fit with its weights.
pub(super) struct WeighedFit {
    fit: ParameterFit,
    discrepancy: Option<[f64; 2]>,
    consistency: Option<f64>,
}

impl AbsoluteCase<'_> {
    /// Fits what the belief leaves open, or what `groups` name, together with all frames.
    pub fn fit(
        &mut self,
        groups: &[ParameterGroup],
        weights: ReadingWeights,
    ) -> Result<AbsoluteFit, AbsoluteError> {
        self.check_frames()?;
        let ToldApart { mut set, left_out } = self.unknowns(groups)?;
        let start = self.far_from_frames();
        loop {
            let (mut kept, mut rejected) = (self.without(&start), start.clone());
            let mut weighed = kept.weighed_fit(&set, weights, None)?;
            if !self.keeps_all
                && let Some(others) =
                    self.without_far_out(&set, weights, (&weighed.fit, weighed.discrepancy), &start)
            {
                (kept, rejected, weighed) = others;
            }
            let posterior = &weighed.fit.posterior;
            if let Some(other) = with_nominal(&set, &posterior.mean, &posterior.covariance, UNKNOWN)
            {
                set = other;
                continue;
            }
            let far_out = self.only(&rejected);
            let discrepancy_model = (weighed.discrepancy).and_then(|discrepancy| {
                kept.discrepancy_model(&set, &weighed.fit, discrepancy, &far_out)
            });
            if let Some(discrepancy_model) = &discrepancy_model
                && let Some(other) = with_nominal(
                    &set,
                    &posterior.mean,
                    &discrepancy_model.covariance,
                    UNKNOWN_TOGETHER,
                )
            {
                set = other;
                continue;
            }
            return self.told(
                &kept,
                (set, left_out),
                (weighed, discrepancy_model),
                rejected,
            );
        }
    }

    /// The readings that no fit begins with.
    pub(super) fn far_from_frames(&self) -> Vec<RejectedReading> {
        if self.keeps_all {
            return Vec::new();
        }
        self.far_from_frames.clone()
    }

    /// All that is told of a fit to those readings that were kept.
    fn told(
        &mut self,
        kept: &Self,
        (set, left_out): (ParameterSet, Vec<LeftOut>),
        (weighed, discrepancy_model): (WeighedFit, Option<Unexplained>),
        rejected: Vec<RejectedReading>,
    ) -> Result<AbsoluteFit, AbsoluteError> {
        let WeighedFit {
            mut fit,
            discrepancy,
            consistency,
        } = weighed;
        if let Some(discrepancy_model) = &discrepancy_model {
            fit.posterior
                .covariance
                .clone_from(&discrepancy_model.covariance);
        }
        self.arm.clone_from(&kept.arm);
        self.within = kept.within;
        let left = self.left_by(&fit)?;
        let (nominal, undetermined): (Vec<_>, Vec<_>) =
            (fit.freedoms.named.into_iter()).partition(|each| each.stays_nominal);
        Ok(AbsoluteFit {
            reference: self.arm.clone(),
            arm: fit.belief,
            posterior: fit.posterior,
            left_out,
            undetermined: undetermined.into_iter().map(|each| each.sentence).collect(),
            stays_nominal: nominal.into_iter().map(|each| each.sentence).collect(),
            left,
            rejected,
            copies: self.copies.clone(),
            reach_m: reach(&self.sights()),
            discrepancy,
            discrepancy_model,
            rows: fit.rows,
            square: fit.square,
            consistency,
            iterations: fit.iterations,
            set,
        })
    }

    /// One fit to all readings of the case, perhaps near one to nearly the same readings.
    fn weighed_fit(
        &mut self,
        set: &ParameterSet,
        weights: ReadingWeights,
        near: Option<&ParameterFit>,
    ) -> Result<WeighedFit, AbsoluteError> {
        let known = self.shared.clone();
        let shared = known.as_ref();
        let own = match weights {
            ReadingWeights::WithDiscrepancy => None,
            ReadingWeights::Own => Some(fit_for_residuals(
                &self.arm,
                set,
                &self.observations,
                shared,
            )?),
            ReadingWeights::AsNeeded => {
                match fit_if_plausible(&self.arm, set, &self.observations, shared) {
                    Ok(fit) => Some(fit),
                    // Readings that the model cannot explain may drive its parameters anywhere.
                    Err(FitError::NotConverged { .. }) => None,
                    Err(error) => return Err(error.into()),
                }
            }
        };
        let consistency = own.as_ref().and_then(consistency);
        let is_plausible = consistency.is_none_or(|probability| probability >= IMPLAUSIBLE);
        let (fit, discrepancy) = match own {
            Some(fit) if is_plausible || weights == ReadingWeights::Own => {
                let values = self.rebased(set, &fit);
                (
                    fit_from(&self.arm, set, &self.observations, shared, &values)?,
                    None,
                )
            }
            other => self.with_discrepancy(set, near.cloned().or(other))?,
        };
        Ok(WeighedFit {
            fit,
            discrepancy,
            consistency,
        })
    }

    /// Fits without the readings that lie far out of a first fit with its discrepancy, which was without those of `start`. None where none
    /// does and none was, where too many do, or where the others determine less than all.
    pub(super) fn without_far_out(
        &self,
        set: &ParameterSet,
        weights: ReadingWeights,
        first: (&ParameterFit, Option<[f64; 2]>),
        start: &[RejectedReading],
    ) -> Option<(Self, Vec<RejectedReading>, WeighedFit)> {
        let rank = first.0.posterior.estimable.rank();
        let mut rejected = self.far_out(set, first, start)?;
        if rejected.is_empty() && !start.is_empty() {
            // Geometry and elasticity explain what frames alone do not.
            let mut all = self.without(&[]);
            let weighed = all.weighed_fit(set, weights, Some(first.0)).ok()?;
            let fit_of_all = (&weighed.fit, weighed.discrepancy);
            let others = self.without_far_out(set, weights, fit_of_all, &[]);
            return Some(others.unwrap_or((all, Vec::new(), weighed)));
        }
        if rejected.is_empty() && first.1.is_some() {
            // One among few draws the fit to itself, and hides in what that leaves of the others.
            rejected.extend(self.farthest(set, first));
        }
        let mut robust = None;
        if rejected.is_empty() && first.1.is_some() {
            // Many that err alike draw the fit to themselves, too.
            robust = self.robust_fit(set, first.0);
            if let Some(robust) = &robust {
                rejected = self.far_out(set, (robust, first.1), start)?;
            }
        }
        let (rejected, found) = outliers::until_the_same(
            rejected,
            |(_, rejected, weighed): &(Self, Vec<RejectedReading>, WeighedFit)| {
                self.far_out(set, (&weighed.fit, weighed.discrepancy), rejected)
            },
            |rejected| {
                let mut kept = self.without(rejected);
                let near = kept.weighed_fit(set, weights, Some(robust.as_ref().unwrap_or(first.0)));
                let weighed = near.or_else(|_| {
                    // Gross errors may have led the first fit to where none converges.
                    kept = self.without(rejected);
                    kept.weighed_fit(set, weights, None)
                });
                let weighed = weighed.ok()?;
                let is_as_good = weighed.fit.posterior.estimable.rank() >= rank;
                is_as_good.then(|| (kept, rejected.to_vec(), weighed))
            },
        )?;
        let (kept, _, weighed) = found;
        Some((kept, rejected, weighed))
    }

    /// A mixed model of what the parameters leave, with the readings; none where there is too little to tell.
    pub(super) fn mixed(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        [position_m, rotation_rad]: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        let joints = self.commanded_joints();
        let variances = joints.len() + 1;
        if self.visits.len() < LEAST_VISITS || fit.degrees_of_freedom() < 4.0 * variances as f64 {
            return None;
        }
        self.mixed_of(set, &fit.posterior, joints, [position_m, rotation_rad])
    }

    /// The variance components of what a fit leaves of the readings that it kept; none where there is too little to tell, or where nothing
    /// is left beyond the readings' own covariances.
    pub fn variance_components(&self, fit: &AbsoluteFit) -> Option<VarianceComponents> {
        fit.discrepancy_model.as_ref()?;
        let (joints, turns) = (self.commanded_joints(), self.commanded_turns());
        let kept = self.kept(fit);
        let (_, mixed) = kept.mixed_of(&fit.set, &fit.posterior, joints, fit.discrepancy?)?;
        mixed.components(&turns)
    }

    /// The same with errors of these joints, however many readings there are.
    pub(super) fn mixed_of(
        &self,
        set: &ParameterSet,
        posterior: &Posterior,
        joints: Vec<usize>,
        [position_m, rotation_rad]: [f64; 2],
    ) -> Option<(Vec<LinearReading>, MixedModel)> {
        let values = &posterior.mean;
        let rows = self.rows_at(&self.arm, set, values, &joints).ok()?;
        let estimable = &posterior.estimable;
        let off = DVector::from_column_slice(values) - &set.prior().mean;
        let pull = relative_precision(set) * off.component_div(&set.scales());
        let basis = estimable.basis();
        let prior = basis.tr_mul(&relative_precision(set)) * basis;
        let pull = DMatrix::from_columns(&[-basis.tr_mul(&pull)]);
        let units = estimable.basis_in_units();
        let discrepancy = Discrepancy {
            position_m,
            rotation_rad,
        };
        let mixed = MixedModel::new(self, &rows, joints, units, [prior, pull], &discrepancy);
        Some((rows, mixed))
    }

    /// What a mixed model tells of what the parameters leave; none where there is too little to tell. `left_out` are readings that were not
    /// fitted.
    fn discrepancy_model(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        discrepancy: [f64; 2],
        left_out: &Self,
    ) -> Option<Unexplained> {
        let (rows, mixed) = self.mixed(set, fit, discrepancy)?;
        let values = &fit.posterior.mean;
        let others = left_out.rows_at(&self.arm, set, values, &self.commanded_joints());
        let found = mixed.fit(&mixed.visits_of(left_out, &others.ok()?))?;
        let turns = self.commanded_turns();
        let (covariance, degrees) = mixed.with_waves(&turns).of_parameters()?;
        let places: Vec<usize> = (0..set.len()).collect();
        let prognoses = (rows.iter().zip(&self.observations)).map(|(rows, each)| {
            let q = each.setup.commanded_rad.as_slice();
            let (left, covariance) = found.model.prognosis(rows, &places, q);
            found.model.judged(&left, &covariance, q).left
        });
        let independent = &fit.posterior;
        let logarithms: Vec<f64> = (0..set.len())
            .filter(|&index| independent.standard_error(index).is_some())
            .map(|index| {
                let [one, other] = [&independent.covariance, &covariance]
                    .map(|covariance| covariance[(index, index)]);
                (one / other).ln()
            })
            .filter(|logarithm| logarithm.is_finite())
            .collect();
        let ratio = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
        Some(Unexplained {
            left: prognoses.collect(),
            visits: self.visits.len(),
            effective_sample_size: self.visits.len() as f64 * ratio.exp().min(1.0),
            predicted_by_others: found.predicted_by_others,
            covariance: symmetric(&covariance),
            degrees,
            model: found.model,
        })
    }

    /// The fitted frames become those from which their parameters count: the values of a fit (p) there.
    pub(super) fn rebased(&mut self, set: &ParameterSet, fit: &ParameterFit) -> DVector<f64> {
        self.arm
            .instrument_from_base
            .clone_from(&fit.belief.instrument_from_base);
        self.arm.tools.clone_from(&fit.belief.tools);
        let values = set.parameters().iter().zip(&fit.posterior.mean);
        let rebased = values.map(|(each, &value)| if each.kind.is_mounted() { 0.0 } else { value });
        DVector::from_iterator(set.len(), rebased)
    }

    pub(super) fn left_by(&self, fit: &ParameterFit) -> Result<Vec<ReadingResidual>, FitError> {
        self.left(&fit.belief)
            .map_err(|(index, source)| FitError::Equilibrium {
                observation: index + 1,
                source,
            })
    }
}

impl AbsoluteFit {
    /// Whether it explains all readings within their own standard deviations.
    pub fn explains_all(&self) -> bool {
        let is_plausible = self.consistency.is_some_and(|each| each >= IMPLAUSIBLE);
        is_plausible && self.discrepancy.is_none() && self.rejected.is_empty()
    }

    /// The quantity of a parameter in its own unit: ratios of logarithms become quantities.
    pub fn quantity(&self, index: usize) -> f64 {
        let parameter = &self.set.parameters()[index];
        parameter.quantity(&self.reference, self.posterior.mean[index])
    }

    /// The standard error of that quantity; `None` where it is not determined.
    pub fn standard_error(&self, index: usize) -> Option<f64> {
        let error = self.posterior.standard_error(index)?;
        let is_logarithmic = self.set.parameters()[index].is_logarithmic;
        Some(if is_logarithmic {
            error * self.quantity(index)
        } else {
            error
        })
    }

    /// By how many standard errors the interval of 95 % of a parameter reaches to either side.
    pub fn reach95(&self, index: usize) -> f64 {
        let discrepancy_model = self.discrepancy_model.as_ref();
        two_sided_student(discrepancy_model.map_or(f64::INFINITY, |each| each.degrees[index]))
    }

    /// The standard errors of three parameters together, where all are in the fit and determined.
    pub fn standard_errors(&self, kinds: [ParameterKind; 3]) -> Option<[f64; 3]> {
        let mut errors = [0.0; 3];
        for (error, kind) in errors.iter_mut().zip(kinds) {
            *error = self.standard_error(self.set.index_of(kind)?)?;
        }
        Some(errors)
    }

    /// Those of one thing for each reading that belong to the readings that were fitted.
    pub fn of_kept<T: Clone>(&self, all: &[T]) -> Vec<T> {
        let is_rejected = outliers::rejected_of(all.len(), &self.rejected);
        let is_copy = self.copies.is_copy(all.len());
        (all.iter().zip(is_rejected.into_iter().zip(is_copy)))
            .filter(|(_, (is_rejected, is_copy))| !is_rejected && !is_copy)
            .map(|(each, _)| each.clone())
            .collect()
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
                conditions.extend(impossible_compliance(joint, self.quantity(index)));
            }
        }
        conditions.extend(self.far_from_belief());
        conditions.extend(self.beyond_making());
        conditions.extend(self.copies.conditions("reading"));
        conditions.extend(self.handled().filter_map(Told::condition));
        conditions
    }

    /// What holds since the fit counts it, and nobody need act on.
    pub fn notes(&self) -> Vec<String> {
        let nominal = self.stays_nominal.iter().cloned();
        nominal
            .chain(self.handled().filter_map(Told::note))
            .collect()
    }

    /// The readings that were left out, and residuals that are too large.
    fn handled(&self) -> impl Iterator<Item = Told> {
        let rejected = left_out(&self.rejected, self.left.len(), "reading");
        let improbable = self.consistency.filter(|each| *each < IMPLAUSIBLE);
        let residuals = improbable.map(|probability| {
            let words = format!(
                "residuals too large for the readings' standard deviations, p = {probability:.1e}"
            );
            let left_m = self.discrepancy.map(|[position_m, _]| position_m);
            too_large(
                &words,
                left_m.map(|left_m| [left_m, ROBOTS_LEAVE * self.reach_m]),
            )
        });
        rejected.into_iter().chain(residuals)
    }

    /// Corrections of geometry that no maker's tolerances explain.
    fn beyond_making(&self) -> Option<Condition> {
        let far: Vec<String> = (self.of_the_robot())
            .filter_map(|(index, each)| {
                let most = match each.kind {
                    ParameterKind::JointZero { .. } | ParameterKind::LinkRotation { .. } => {
                        MOST_TURNED_RAD
                    }
                    ParameterKind::LinkPosition { .. } => MOST_SHIFTED_M,
                    _ => return None,
                };
                let off = self.posterior.mean[index] - self.set.prior().mean[index];
                let error = self.posterior.standard_error(index)?;
                (off.abs() > most.max(FAR * error)).then(|| {
                    format!(
                        "{} by {:.1} {}",
                        each.name,
                        off * 1e3,
                        thousandth(each.kind)
                    )
                })
            })
            .collect();
        (!far.is_empty()).then(|| {
            let words = format!("beyond manufacturing tolerances: {}", far.join(", "));
            ConditionCode::GeometryBeyondTolerance.with(words)
        })
    }

    /// Masses and centres that are further from what is believed than this is uncertain: in their weak directions the fit puts what
    /// no other parameter explains.
    fn far_from_belief(&self) -> Option<Condition> {
        let prior = &self.set.prior().mean;
        let far: Vec<String> = (self.of_the_robot())
            .filter(|(_, each)| each.kind.is_of_mass())
            .filter_map(|(index, each)| {
                let off = (self.posterior.mean[index] - prior[index]).abs();
                let share = off / each.prior_deviation?;
                (share > FAR).then(|| format!("{} by {share:.1}", each.name))
            })
            .collect();
        (!far.is_empty()).then(|| {
            let far = far.join(", ");
            let words =
                format!("masses far from their priors, in prior standard deviations: {far}");
            ConditionCode::MassFarFromPrior.with(words)
        })
    }
}
