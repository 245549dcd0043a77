//! Inconsistency between two series of readings, or between the halves of joint space of one: parameters that differ by more than
//! their covariance explains.
//!
//! Each parameter of the robot that both tell has a value on either side. How far these may lie apart is asked of two yardsticks:
//!
//! - how much each value changes when blocks of joint space are left out one by one. That needs no model of what is unexplained, but takes
//!   blocks as independent;
//! - one mixed model of both series together, whose joints err in both alike. A gear that is not round errs in all blocks
//!   where its joint has the same angle, and, where it is so once or twice a turn, one way in the one half and the other way in the
//!   other.
//!
//! Student's t of the difference, over all parameters that are compared (Bonferroni), says whether both can be right; by that yardstick
//! which makes it more probable.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::super::estimate::two_sided_student;
use super::super::gauss_newton::{ParameterFit, fit_from};
use super::blocks::FEWEST_BLOCKS;
use super::mixed::{MixedModel, SumVariances};
use super::without::{Blocks, Fitted};
use super::{AbsoluteCase, AbsoluteError, AbsoluteFit};
use crate::observation::SharedErrors;
use crate::parameter::{ElasticArm, Parameter, ParameterKind, ParameterSet};

/// Series of one robot are said to contradict each other in one of a hundred comparisons.
pub const CONTRADICTION: f64 = 0.01;
/// At most so many blocks of each series are left out.
const BLOCKS: usize = 16;

/// What a series says of a parameter.
#[derive(Debug, Clone)]
struct SeriesEstimate {
    parameter: Parameter,
    /// Its place among all that were fitted.
    place: usize,
    value: f64,
    /// By leaving out blocks, in the unit of the value.
    error: f64,
}

/// What a series says of the robot's own parameters.
#[derive(Debug, Clone)]
pub struct SeriesEstimates {
    /// Those that it determines.
    parameters: Vec<SeriesEstimate>,
    /// How many parameters were fitted, those of frames among them.
    fitted: usize,
    /// The number of blocks that were left out.
    blocks: usize,
    /// Its readings with what their errors have in common, where there are enough to tell.
    mixed: Option<MixedModel>,
    /// The arm from which values count.
    reference: ElasticArm,
}

/// A parameter of which two series say different things.
#[derive(Debug, Clone, PartialEq)]
pub struct Inconsistency {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ParameterKind,
    /// What each says, in its own unit.
    pub values: [f64; 2],
    /// Their intervals of 95 %.
    pub intervals95: [[f64; 2]; 2],
    /// The probability of a difference as large, of any of those that were compared.
    pub probability: f64,
}

/// A parameter of two series.
struct Compared<'a>([&'a SeriesEstimate; 2]);

/// A standard error, known from so many degrees of freedom.
struct Yardstick {
    error: f64,
    degrees: f64,
}

/// Two series beside each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Inconsistencies {
    /// How many parameters both tell.
    pub compared: usize,
    /// Those that contradict each other, the surest first.
    pub found: Vec<Inconsistency>,
}

impl AbsoluteCase<'_> {
    /// What a fit of this case says of the robot's own parameters; `None` with too few configurations to leave some out.
    pub fn estimates(
        &mut self,
        fit: &AbsoluteFit,
    ) -> Result<Option<SeriesEstimates>, AbsoluteError> {
        let shared = fit
            .discrepancy
            .and_then(|discrepancy| self.weigh(discrepancy));
        let values = fit.values();
        let again = fit_from(
            &self.arm,
            &fit.set,
            &self.observations,
            shared.as_ref(),
            &values,
        )?;
        self.by_blocks(&fit.set, &again, (shared.as_ref(), fit.discrepancy))
    }

    /// The halves of joint space, across the joint that moves furthest: which half each reading is in, and what each half says.
    /// `None` where a half has too few configurations, or cannot be fitted.
    pub fn halves(&mut self, fit: &AbsoluteFit) -> Option<(Vec<usize>, [SeriesEstimates; 2])> {
        let shared = fit
            .discrepancy
            .and_then(|discrepancy| self.weigh(discrepancy));
        let halves = self.blocks(2);
        let half = |number: usize| {
            let (case, shared) = self.restricted(shared.as_ref(), |index| halves[index] == number);
            let observations = &case.observations;
            let fitted = fit_from(
                &case.arm,
                &fit.set,
                observations,
                shared.as_ref(),
                &fit.values(),
            );
            case.by_blocks(&fit.set, &fitted.ok()?, (shared.as_ref(), fit.discrepancy))
                .ok()?
        };
        let both = [half(0)?, half(1)?];
        Some((halves, both))
    }

    /// The same with some of the readings.
    fn restricted(
        &self,
        shared: Option<&SharedErrors>,
        is_in: impl Fn(usize) -> bool,
    ) -> (Self, Option<SharedErrors>) {
        let part = self.part(shared, &is_in);
        let places: Vec<usize> = (0..self.observations.len())
            .filter(|&index| is_in(index))
            .collect();
        let of_visit = |visit: &Vec<usize>| -> Vec<usize> {
            let found = visit
                .iter()
                .filter_map(|index| places.binary_search(index).ok());
            found.collect()
        };
        let mut visits: Vec<Vec<usize>> = self.visits.iter().map(of_visit).collect();
        visits.retain(|visit| !visit.is_empty());
        let case = Self {
            observations: part.observations,
            covariances: places
                .iter()
                .map(|&index| self.covariances[index])
                .collect(),
            visits,
            shared: self.shared.as_ref().map(|shared| shared.among(&places)),
            ..self.clone()
        };
        (case, part.shared)
    }

    fn by_blocks(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        (shared, discrepancy): (Option<&SharedErrors>, Option<[f64; 2]>),
    ) -> Result<Option<SeriesEstimates>, AbsoluteError> {
        let count = BLOCKS.min(self.different() / 2);
        if count < FEWEST_BLOCKS {
            return Ok(None);
        }
        let of_readings = self.blocks(count);
        let blocks = Blocks::new(self, shared, &of_readings, count);
        let fitted = Fitted { set, fit };
        let without = blocks.without(fitted)?;
        let mixed = discrepancy.and_then(|discrepancy| {
            let (_, mixed) = self.mixed(set, fit, discrepancy)?;
            Some(mixed.with_waves(&self.commanded_turns()))
        });
        let own = set.parameters().iter().enumerate();
        let own = own.filter(|(_, parameter)| !parameter.kind.is_mounted());
        Ok(Some(SeriesEstimates {
            parameters: own
                .filter_map(|(place, parameter)| {
                    Some(SeriesEstimate {
                        parameter: parameter.clone(),
                        place,
                        value: fit.posterior.mean[place],
                        error: fitted.standard_error(place, &without)?,
                    })
                })
                .collect(),
            fitted: set.len(),
            blocks: count,
            mixed,
            reference: self.arm.clone(),
        }))
    }
}

impl SeriesEstimates {
    /// Where this series and another contradict each other. Geometry is compared where both were fitted with the same
    /// parameters of it: what one of them leaves out as redundant is in the others'.
    pub fn beside(&self, other: &Self) -> Inconsistencies {
        let is_same = geometry(self) == geometry(other);
        let twins = self.parameters.iter().filter_map(|one| {
            let kind = one.parameter.kind;
            let twin = (other.parameters.iter()).find(|each| each.parameter.kind == kind)?;
            (is_same || !is_geometry(kind)).then_some(Compared([one, twin]))
        });
        let compared: Vec<Compared<'_>> = twins.collect();
        let together = self.together(other, &compared);
        let degrees = self.blocks.min(other.blocks) as f64 - 1.0;
        let mut found = Vec::new();
        for (at, Compared(both)) in compared.iter().enumerate() {
            let yardsticks = |error: f64, which: usize| {
                let by_blocks = Yardstick { error, degrees };
                let together = together.as_ref().map(|found| {
                    let place = which * compared.len() + at;
                    Yardstick {
                        error: found.variances[place].sqrt(),
                        degrees: found.degrees[place],
                    }
                });
                [Some(by_blocks), together].into_iter().flatten()
            };
            let [one, second] = both.map(|each| each.value);
            let alone = yardsticks(both[0].error.hypot(both[1].error), 0)
                .map(|each| each.probability(one - second))
                .fold(0.0, f64::max);
            let probability = (alone * compared.len() as f64).min(1.0);
            if probability < CONTRADICTION {
                let parameter = &both[0].parameter;
                let quantity = |value: f64| parameter.quantity(&self.reference, value);
                let interval = |side: usize| {
                    let SeriesEstimate { value, error, .. } = *both[side];
                    let half = yardsticks(error, 1 + side)
                        .map(|each| each.half_width())
                        .fold(0.0, f64::max);
                    [value - half, value + half].map(quantity)
                };
                found.push(Inconsistency {
                    name: parameter.name.clone(),
                    kind: parameter.kind,
                    values: [one, second].map(quantity),
                    intervals95: [interval(0), interval(1)],
                    probability,
                });
            }
        }
        found.sort_by(|one, other| one.probability.total_cmp(&other.probability));
        Inconsistencies {
            compared: compared.len(),
            found,
        }
    }

    /// What one mixed model of both says: of the differences of what is compared, then of what the one says, then of the other.
    fn together(&self, other: &Self, compared: &[Compared<'_>]) -> Option<SumVariances> {
        let count = compared.len();
        let mut sums = DMatrix::zeros(self.fitted + other.fitted, 3 * count);
        for (at, Compared([one, second])) in compared.iter().enumerate() {
            let (one, second) = (one.place, self.fitted + second.place);
            sums[(one, at)] = 1.0;
            sums[(second, at)] = -1.0;
            sums[(one, count + at)] = 1.0;
            sums[(second, 2 * count + at)] = 1.0;
        }
        let (one, second) = (self.mixed.as_ref()?, other.mixed.as_ref()?);
        one.beside(second).of_sums(&sums)
    }
}

impl Yardstick {
    /// The probability of a value at least as far from nothing.
    fn probability(&self, value: f64) -> f64 {
        let distance = value.abs() / self.error;
        StudentsT::new(0.0, 1.0, self.degrees).map_or(1.0, |student| 2.0 * student.sf(distance))
    }

    /// How far an interval of 95 % reaches to either side.
    fn half_width(&self) -> f64 {
        self.error * two_sided_student(self.degrees)
    }
}

const fn is_geometry(kind: ParameterKind) -> bool {
    matches!(
        kind,
        ParameterKind::JointZero { .. }
            | ParameterKind::LinkPosition { .. }
            | ParameterKind::LinkRotation { .. }
    )
}

fn geometry(series: &SeriesEstimates) -> Vec<ParameterKind> {
    let kinds = series.parameters.iter().map(|each| each.parameter.kind);
    kinds.filter(|kind| is_geometry(*kind)).collect()
}
