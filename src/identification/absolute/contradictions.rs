//! Two series of readings, or the halves of joint space of one, whose parameters contradict each other.
//!
//! Each parameter of the robot that both tell has a value and a standard error on either side; these count what the model leaves,
//! and how much the value changes when blocks of joint space are left out one by one. Student's t of the difference, over
//! all parameters that are compared (Bonferroni), says whether both can be right.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::super::gauss_newton::{ParameterFit, fit_from};
use super::blocks::FEWEST_BLOCKS;
use super::without::{Blocks, Fitted};
use super::{AbsoluteCase, AbsoluteError, AbsoluteFit};
use crate::observation::SharedErrors;
use crate::parameter::{ElasticArm, Parameter, ParameterKind, ParameterSet};

/// Series of one robot are said to contradict each other in one of a hundred comparisons.
pub const CONTRADICTION: f64 = 0.01;
/// At most so many blocks of each series are left out.
const BLOCKS: usize = 16;
/// Of intervals of 95 %.
const UPPER: f64 = 0.975;

/// What a series says of the robot's own parameters.
#[derive(Debug, Clone)]
pub struct SeriesEstimates {
    /// Each with its value and its standard error, in the unit of its value; none where it is not determined.
    pub parameters: Vec<(Parameter, f64, Option<f64>)>,
    /// The number of blocks that were left out.
    pub blocks: usize,
    /// The arm from which values count.
    reference: ElasticArm,
}

/// A parameter of which two series say different things.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
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
pub struct Contradictions {
    /// How many parameters both tell.
    pub compared: usize,
    /// Those that contradict each other, the surest first.
    pub found: Vec<Contradiction>,
}

impl AbsoluteCase<'_> {
    /// What a fit of this case says of the robot's own parameters; `None` with too few configurations to leave some out.
    ///
    /// # Errors
    /// See [`AbsoluteError`].
    pub fn estimates(
        &mut self,
        fit: &AbsoluteFit,
    ) -> Result<Option<SeriesEstimates>, AbsoluteError> {
        let shared = fit.misfit.and_then(|misfit| self.weigh(misfit));
        let values = fit.values();
        let again = fit_from(
            &self.arm,
            &fit.set,
            &self.observations,
            shared.as_ref(),
            &values,
        )?;
        self.by_blocks(&fit.set, &again, shared.as_ref())
    }

    /// The halves of joint space, across the joint that moves furthest: which half each reading is in, and what each half says.
    /// `None` where a half has too few configurations, or cannot be fitted.
    #[must_use]
    pub fn halves(&mut self, fit: &AbsoluteFit) -> Option<(Vec<usize>, [SeriesEstimates; 2])> {
        let shared = fit.misfit.and_then(|misfit| self.weigh(misfit));
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
            case.by_blocks(&fit.set, &fitted.ok()?, shared.as_ref())
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
        let of_stand = |stand: &Vec<usize>| -> Vec<usize> {
            let found = stand
                .iter()
                .filter_map(|index| places.binary_search(index).ok());
            found.collect()
        };
        let mut stands: Vec<Vec<usize>> = self.stands.iter().map(of_stand).collect();
        stands.retain(|stand| !stand.is_empty());
        let case = Self {
            observations: part.observations,
            covariances: places
                .iter()
                .map(|&index| self.covariances[index])
                .collect(),
            stands,
            ..self.clone()
        };
        (case, part.shared)
    }

    fn by_blocks(
        &self,
        set: &ParameterSet,
        fit: &ParameterFit,
        shared: Option<&SharedErrors>,
    ) -> Result<Option<SeriesEstimates>, AbsoluteError> {
        let count = BLOCKS.min(self.different() / 2);
        if count < FEWEST_BLOCKS {
            return Ok(None);
        }
        let of_readings = self.blocks(count);
        let blocks = Blocks::new(self, shared, &of_readings, count);
        let fitted = Fitted { set, fit };
        let without = blocks.without(fitted)?;
        let own = set.parameters().iter().enumerate();
        let own = own.filter(|(_, parameter)| !parameter.kind.is_mounted());
        Ok(Some(SeriesEstimates {
            parameters: own
                .map(|(place, parameter)| {
                    let value = fit.posterior.mean[place];
                    let error = fitted.standard_error(place, &without);
                    (parameter.clone(), value, error)
                })
                .collect(),
            blocks: count,
            reference: self.arm.clone(),
        }))
    }
}

impl SeriesEstimates {
    /// Where this series and another contradict each other. Geometry is compared where both were fitted with the same
    /// parameters of it: what one of them leaves out as redundant is in the others'.
    #[must_use]
    pub fn beside(&self, other: &Self) -> Contradictions {
        let is_same = geometry(self) == geometry(other);
        let mut compared = Vec::new();
        for (parameter, value, error) in &self.parameters {
            let kind = parameter.kind;
            let twin = other.parameters.iter().find(|(each, ..)| each.kind == kind);
            if let Some(error) = error
                && let Some((_, second, Some(second_error))) = twin
                && (is_same || !is_geometry(kind))
            {
                compared.push((parameter, [*value, *second], [*error, *second_error]));
            }
        }
        let degrees = self.blocks.min(other.blocks) as f64 - 1.0;
        let mut found = Vec::new();
        if let Ok(distribution) = StudentsT::new(0.0, 1.0, degrees) {
            let half = distribution.inverse_cdf(UPPER);
            for (parameter, values, errors) in &compared {
                let distance = (values[0] - values[1]).abs() / errors[0].hypot(errors[1]);
                let alone = 2.0 * distribution.sf(distance);
                let probability = (alone * compared.len() as f64).min(1.0);
                if probability < CONTRADICTION {
                    let quantity = |value: f64| parameter.quantity(&self.reference, value);
                    let interval = |side: usize| {
                        let width = half * errors[side];
                        [values[side] - width, values[side] + width].map(quantity)
                    };
                    found.push(Contradiction {
                        name: parameter.name.clone(),
                        kind: parameter.kind,
                        values: values.map(quantity),
                        intervals95: [interval(0), interval(1)],
                        probability,
                    });
                }
            }
        }
        found.sort_by(|one, other| one.probability.total_cmp(&other.probability));
        Contradictions {
            compared: compared.len(),
            found,
        }
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
    let kinds = series
        .parameters
        .iter()
        .map(|(parameter, ..)| parameter.kind);
    kinds.filter(|kind| is_geometry(*kind)).collect()
}
