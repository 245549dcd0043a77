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
use super::blocks::{Blocks, FEWEST_BLOCKS};
use super::mixed::{MixedModel, SumVariances};
use super::unknowns::is_geometry;
use super::{AbsoluteCase, AbsoluteError, AbsoluteFit};
use crate::parameter::{ElasticArm, Parameter, ParameterKind};

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
        if let Some(discrepancy) = fit.discrepancy {
            self.weigh(discrepancy);
        }
        self.by_blocks(fit)
    }

    /// The halves of joint space, across the joint that moves furthest: which half each reading is in, and what each half says.
    /// `None` where a half has too few configurations, or cannot be fitted.
    pub fn halves(&mut self, fit: &AbsoluteFit) -> Option<(Vec<usize>, [SeriesEstimates; 2])> {
        if self.reads_distances() {
            return None;
        }
        if let Some(discrepancy) = fit.discrepancy {
            self.weigh(discrepancy);
        }
        let halves = self.blocks(2);
        let half = |number: usize| {
            let case = self.part_of(|index| halves[index] == number);
            case.by_blocks(fit).ok()?
        };
        let both = [half(0)?, half(1)?];
        Some((halves, both))
    }

    fn by_blocks(&self, of_all: &AbsoluteFit) -> Result<Option<SeriesEstimates>, AbsoluteError> {
        let set = &of_all.set;
        let fit = self.fit_near(set, &of_all.posterior.mean)?;
        let count = BLOCKS.min(self.different() / 2);
        if count < FEWEST_BLOCKS {
            return Ok(None);
        }
        let without = Blocks::new(self, count).without(set, &fit)?;
        let mixed = of_all.discrepancy.and_then(|discrepancy| {
            let (_, mixed) = self.mixed(set, &fit, discrepancy)?;
            Some(mixed.with_waves(&self.commanded_turns()))
        });
        // By leaving out blocks, and no less than what the weights say.
        let estimate = |(place, parameter): (usize, &Parameter)| {
            let own = fit.posterior.standard_error(place)?;
            let value = fit.posterior.mean[place];
            let squares = without
                .iter()
                .map(|each| (each.values[place] - value).powi(2));
            let by_blocks = (squares.sum::<f64>() * (count - 1) as f64 / count as f64).sqrt();
            Some(SeriesEstimate {
                parameter: parameter.clone(),
                place,
                value,
                error: own.max(by_blocks),
            })
        };
        Ok(Some(SeriesEstimates {
            parameters: of_all.of_the_robot().filter_map(estimate).collect(),
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
            (is_same || !is_geometry(kind)).then_some([one, twin])
        });
        let compared: Vec<[&SeriesEstimate; 2]> = twins.collect();
        let together = self.together(other, &compared);
        let degrees = self.blocks.min(other.blocks) as f64 - 1.0;
        let mut found = Vec::new();
        for (at, both) in compared.iter().enumerate() {
            // Standard errors with their degrees of freedom: by blocks, and by the model of both together.
            let yardsticks = |error: f64, which: usize| {
                let together = together.as_ref().map(|found| {
                    let place = which * compared.len() + at;
                    [found.variances[place].sqrt(), found.degrees[place]]
                });
                [Some([error, degrees]), together].into_iter().flatten()
            };
            let [one, second] = both.map(|each| each.value);
            let alone = yardsticks(both[0].error.hypot(both[1].error), 0)
                .map(|[error, degrees]| {
                    let distance = (one - second).abs() / error;
                    let student = StudentsT::new(0.0, 1.0, degrees);
                    student.map_or(1.0, |student| 2.0 * student.sf(distance))
                })
                .fold(0.0, f64::max);
            let probability = (alone * compared.len() as f64).min(1.0);
            if probability < CONTRADICTION {
                let parameter = &both[0].parameter;
                let quantity = |value: f64| parameter.quantity(&self.reference, value);
                let interval = |side: usize| {
                    let SeriesEstimate { value, error, .. } = *both[side];
                    let half = yardsticks(error, 1 + side)
                        .map(|[error, degrees]| error * two_sided_student(degrees))
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
    fn together(&self, other: &Self, compared: &[[&SeriesEstimate; 2]]) -> Option<SumVariances> {
        let count = compared.len();
        let mut sums = DMatrix::zeros(self.fitted + other.fitted, 3 * count);
        for (at, [one, second]) in compared.iter().enumerate() {
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

fn geometry(series: &SeriesEstimates) -> Vec<ParameterKind> {
    let kinds = series.parameters.iter().map(|each| each.parameter.kind);
    kinds.filter(|kind| is_geometry(*kind)).collect()
}
