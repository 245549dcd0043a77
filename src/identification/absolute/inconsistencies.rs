//! Inconsistency between two series of readings, or between the halves of joint space of one: parameters that differ by more than
//! their covariance explains.
//!
//! Each parameter of the robot that both determine has a value on either side. Whether these may lie so far apart is asked of two
//! variances of their difference, in which errors that both series share cancel:
//!
//! - how much the difference changes when blocks of joint space are left out one by one, of both series the same one. That needs no
//!   model of the discrepancy, but takes blocks as independent;
//! - one mixed model of both series together, whose joints err in both alike, as does a configuration that both visit; a prior that
//!   both have counts once. A gear that is not round errs in all blocks where its joint has the same angle, and, where it is so once
//!   or twice a turn, one way in the one half and the other way in the other.
//!
//! Student's t of the difference, over all parameters that are compared (Bonferroni), says whether both can be right; by that variance
//! which makes it more probable.

use nalgebra::DVector;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::super::estimate::two_sided_student;
use super::super::fit::{Haste, ParameterFit};
use super::blocks::{Blocks, FEWEST_BLOCKS};
use super::mixed::{MixedModel, known_alone};
use super::unknowns::is_geometry;
use super::{AbsoluteCase, AbsoluteFit, FitResult, IdentificationError, joint_space_blocks};
use crate::codes::{Condition, ConditionCode};
use crate::parameter::{ElasticArm, ParameterKind};
use crate::quantities::units::shown_unit;
use crate::text::wording::p_value;

/// Series of one robot are said to contradict each other in one of a hundred comparisons.
pub const CONTRADICTION: f64 = 0.01;
/// At most so many blocks of each series are left out.
const BLOCKS: usize = 16;
/// A standard error of a difference below this share of those of what differs is rounding: of sums that cancel, and of where fits end.
const RESOLVED: f64 = 1e-4;

/// What a series says of a robot.
struct SeriesEstimates {
    /// What it says of the parameters, as readings were weighed,
    fit: ParameterFit,
    /// and the values without each block of them,
    without: Vec<DVector<f64>>,
    /// Its readings with what their errors have in common, where there are enough to tell.
    mixed: Option<MixedModel>,
    /// The arm from which values count.
    reference: ElasticArm,
}

/// A parameter of which two series say different things.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Inconsistency {
    /// Its name.
    pub name: String,
    /// What it is.
    #[serde(skip)]
    pub kind: ParameterKind,
    /// The unit of its values.
    pub unit: &'static str,
    /// What each says.
    pub values: [f64; 2],
    /// Their intervals of 95 %.
    pub intervals95: [[f64; 2]; 2],
    /// The probability of a difference as large, of any of those that were compared.
    pub probability: f64,
}

/// Two series beside each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Inconsistencies {
    /// Which series, in words.
    pub between: [String; 2],
    /// How many parameters of the robot both determine whose difference is resolved.
    pub compared: usize,
    /// How far each of these lies apart, in standard errors of the difference.
    #[serde(skip)]
    pub deviations: Vec<f64>,
    /// The names of those whose difference is all rounding: both series have them from the same prior.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_comparable: Vec<String>,
    /// Those that contradict each other, the surest first.
    pub found: Vec<Inconsistency>,
}

impl Inconsistencies {
    /// What must be looked at: each inconsistency.
    pub fn conditions(&self) -> impl Iterator<Item = Condition> {
        self.found.iter().map(|each| {
            let (factor, unit) = shown_unit(each.unit);
            let [one, other] = [0, 1].map(|side| {
                let [low, high] = each.intervals95[side].map(|end| end * factor);
                let (value, series) = (each.values[side] * factor, &self.between[side]);
                format!("{value:.4} ({low:.4} to {high:.4}) {unit} {series}")
            });
            ConditionCode::Inconsistency.with(format!(
                "inconsistency between series: {} is {one} and {other}, {}",
                each.name,
                p_value(each.probability)
            ))
        })
    }
}

impl AbsoluteCase<'_> {
    /// Where a fit of this case and one of another series of the robot contradict each other, by common blocks of joint space.
    ///
    /// # Errors
    /// There are too few configurations to leave some out, or a fit does not converge.
    pub fn inconsistencies_with(
        &mut self,
        fit: &AbsoluteFit,
        other: &mut Self,
        other_fit: &AbsoluteFit,
    ) -> FitResult<Inconsistencies> {
        let different = self.different().min(other.different());
        let needed = 2 * FEWEST_BLOCKS;
        if different < needed {
            return Err(IdentificationError::TooFewConfigurations { different, needed });
        }
        let count = BLOCKS.min(different / 2);
        let both = [self.configurations(), other.configurations()].concat();
        let mut own = joint_space_blocks(&both, count);
        let others = own.split_off(self.observations.len());
        let series = [(self, fit, own), (other, other_fit, others)];
        let [own, others] = series.map(|(case, fit, of_readings)| {
            if let Some(discrepancy) = fit.discrepancy {
                case.weigh(discrepancy);
            }
            case.by_blocks(fit, &Blocks::of_readings(case, of_readings, count))
        });
        Ok(own?.beside(&others?, true))
    }

    /// The same of the halves of joint space, across the joint that moves furthest, with which half each reading is in. `None` where a half
    /// has too few configurations, or cannot be fitted.
    pub fn inconsistencies_of_halves(
        &mut self,
        fit: &AbsoluteFit,
    ) -> Option<(Vec<usize>, Inconsistencies)> {
        if let Some(discrepancy) = fit.discrepancy {
            self.weigh(discrepancy);
        }
        let halves = self.blocks(2);
        let half = |number: usize| {
            let case = self.part_of(|index| halves[index] == number);
            let count = BLOCKS.min(case.different() / 2);
            let blocks = (count >= FEWEST_BLOCKS).then(|| Blocks::new(&case, count))?;
            case.by_blocks(fit, &blocks).ok()
        };
        let found = half(0)?.beside(&half(1)?, false);
        Some((halves, found))
    }

    fn by_blocks(&self, of_all: &AbsoluteFit, blocks: &Blocks<'_>) -> FitResult<SeriesEstimates> {
        let fit = self.fit_near(&of_all.set, &of_all.posterior.mean, Haste::Near)?;
        let without = blocks.without(&fit)?;
        let mixed = of_all.discrepancy.and_then(|discrepancy| {
            let (_, mixed) = self.mixed(&fit, discrepancy)?;
            Some(mixed.with_waves(&self.commanded_turns()))
        });
        Ok(SeriesEstimates {
            fit,
            without: without.into_iter().map(|each| each.values).collect(),
            mixed,
            reference: self.arm.clone(),
        })
    }
}

/// A standard error by what leaving out each block changes.
fn jackknife(changes: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = changes.len() as f64;
    let squares: f64 = changes.map(|change| change * change).sum();
    (squares * (count - 1.0) / count).sqrt()
}

impl SeriesEstimates {
    /// Where this series and another contradict each other, by the same blocks of both or not. Geometry is compared where both were fitted
    /// with the same parameters of it: what one of them leaves out as redundant is in the others'.
    fn beside(&self, other: &Self, has_common_blocks: bool) -> Inconsistencies {
        let (own, others): (Vec<_>, Vec<_>) =
            (self.determined().collect(), other.determined().collect());
        let geometry = |all: &[(ParameterKind, usize)]| -> Vec<ParameterKind> {
            let kinds = all.iter().map(|each| each.0);
            kinds.filter(|kind| is_geometry(*kind)).collect()
        };
        let is_same = geometry(&own) == geometry(&others);
        let twins = own.iter().filter_map(|&(kind, place)| {
            let (_, twin) = others.iter().find(|each| each.0 == kind)?;
            (is_same || !is_geometry(kind)).then_some([place, *twin])
        });
        let mixed = self.mixed.as_ref().zip(other.mixed.as_ref());
        let together = mixed.and_then(|(one, second)| one.beside(second).covariance_parts());
        let (both, degrees) = ([self, other], self.without.len().min(other.without.len()));
        let degrees = degrees as f64 - 1.0;
        let mut beside = Inconsistencies::default();
        for places in twins {
            let parameter = &self.fit.set.parameters()[places[0]];
            // Standard errors of a sum of both with their degrees of freedom, by blocks and by the model of both together.
            let yardsticks = |error: f64, factors: [f64; 2]| {
                let sum = [
                    (places[0], factors[0]),
                    (self.fit.set.len() + places[1], factors[1]),
                ];
                let together = together.as_ref().map(|parts| parts.of_sum(&sum));
                [Some([error, degrees]), together].into_iter().flatten()
            };
            // By leaving out blocks, and no less than what the weights say; where what both share is counted, that is not needed.
            let [one, second] = [self.changes(places[0]), other.changes(places[1])];
            let mut apart = if has_common_blocks {
                jackknife(one.zip(second).map(|(one, second)| one - second))
            } else {
                jackknife(one).hypot(jackknife(second))
            };
            if !(has_common_blocks && together.is_some()) {
                apart = apart.max(self.weighed(other, places));
            }
            let own = [0, 1].map(|side| both[side].error(places[side]));
            let values = [0, 1].map(|side| both[side].fit.posterior.mean[places[side]]);
            let least = RESOLVED * own[0].hypot(own[1]);
            let difference = values[0] - values[1];
            let (mut largest, mut probability) = (0.0_f64, 0.0_f64);
            let differing = yardsticks(apart, [1.0, -1.0]);
            for [error, degrees] in differing.filter(|[error, _]| *error > least) {
                largest = largest.max(error);
                let student = StudentsT::new(0.0, 1.0, degrees);
                let as_large = |law: StudentsT| 2.0 * law.sf(difference.abs() / error);
                probability = probability.max(student.map_or(1.0, as_large));
            }
            if largest <= 0.0 {
                beside.not_comparable.push(parameter.name.clone());
                continue;
            }
            beside.deviations.push(difference / largest);
            let quantity = |value: f64| parameter.quantity(&self.reference, value);
            let interval = |side: usize| {
                let halves = yardsticks(own[side], [[1.0, 0.0], [0.0, 1.0]][side]);
                let halves = halves.map(|[error, degrees]| error * two_sided_student(degrees));
                let (value, half) = (values[side], halves.fold(0.0, f64::max));
                [value - half, value + half].map(quantity)
            };
            beside.found.push(Inconsistency {
                name: parameter.name.clone(),
                kind: parameter.kind,
                unit: parameter.quantity_unit(),
                values: values.map(quantity),
                intervals95: [interval(0), interval(1)],
                probability,
            });
        }
        beside.compared = beside.deviations.len();
        for each in &mut beside.found {
            each.probability = (each.probability * beside.compared as f64).min(1.0);
        }
        (beside.found).retain(|each| each.probability < CONTRADICTION);
        (beside.found).sort_by(|one, other| one.probability.total_cmp(&other.probability));
        beside
    }

    /// The robot's own parameters that it determines, with their places.
    fn determined(&self) -> impl Iterator<Item = (ParameterKind, usize)> {
        let all = self.fit.set.parameters().iter().enumerate();
        let own = all.filter(|(_, parameter)| !parameter.kind.is_mounted());
        own.filter(|(place, _)| self.fit.posterior.standard_error(*place).is_some())
            .map(|(place, parameter)| (parameter.kind, place))
    }

    /// What leaving out each block changes of a parameter.
    fn changes(&self, place: usize) -> impl ExactSizeIterator<Item = f64> {
        let value = self.fit.posterior.mean[place];
        self.without.iter().map(move |values| values[place] - value)
    }

    /// The standard error of an estimate by leaving out blocks, and no less than what the weights say.
    fn error(&self, place: usize) -> f64 {
        let own = self.fit.posterior.covariance[(place, place)].sqrt();
        own.max(jackknife(self.changes(place)))
    }

    /// The standard error of a difference as readings were weighed, C1 + C2 - 2 C1 M C2: what both know before with precision M they owe to
    /// one prior, which moves the difference by C1 - C2 alone. Summed as squares, so that it is never negative.
    fn weighed(&self, other: &Self, [one, second]: [usize; 2]) -> f64 {
        let [own, others] = [self, other].map(|series| &series.fit.posterior.covariance);
        let mut of_readings = [own[(one, one)], others[(second, second)]];
        let mut of_priors = 0.0;
        let alone = |fit: &ParameterFit| {
            let known = known_alone(&fit.set, &fit.posterior.mean);
            known.collect::<Vec<_>>()
        };
        let others_alone = alone(&other.fit);
        for (kind, place, precision) in alone(&self.fit) {
            let twin = others_alone.iter().find(|(each, ..)| *each == kind);
            if let Some(&(_, twin, _)) = twin {
                let pulled = [own[(one, place)], others[(second, twin)]];
                of_priors += precision * (pulled[0] - pulled[1]).powi(2);
                for (own, pulled) in of_readings.iter_mut().zip(pulled) {
                    *own -= precision * pulled * pulled;
                }
            }
        }
        let own: f64 = of_readings.iter().map(|own| own.max(0.0)).sum();
        (own + of_priors).sqrt()
    }
}
