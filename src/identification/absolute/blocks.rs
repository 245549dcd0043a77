//! Parts of the readings, those that were kept and blocks of joint space, and cross-validation: fits without one block each.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::super::error::OFF_PRIOR;
use super::super::fit::{FitProblem, Haste, ParameterFit, ReadingProblem};
use super::{
    AbsoluteCase, AbsoluteFit, CopiedReadings, DiscrepancyModel, FitResult, JointError,
    ReadingResidual, RejectedReading, joint_space_blocks,
};
use crate::experiment::together;
use crate::numeric::estimable::Estimable;
use crate::observation::{NormalEquations, ObservationModel, of_each_prediction};
use crate::parameter::ParameterSet;

/// With fewer blocks there is nothing to compare.
pub const FEWEST_BLOCKS: usize = 4;
/// Steps of fits that start at the fit to all readings.
const MAXIMUM_STEPS: usize = 6;
/// A first step that predicts the block's sum of squares as well as this is the fit.
const AS_PREDICTED: f64 = 1e-4;
/// A fit is found when the next step is shorter than this in standard errors.
const SHORT: f64 = 1e-2;
/// A direction that the other blocks do not determine matters to a reading that a typical size moves by so many of its
/// standard deviations.
const MATTERS: f64 = 0.1;

impl AbsoluteCase<'_> {
    /// The same case with the readings that were fitted alone, weighed by the errors that the fit counted.
    pub fn kept(&self, fit: &AbsoluteFit) -> Self {
        let kept = self.without(&fit.rejected);
        if fit.counts_sources {
            kept.counting_sources()
        } else {
            kept
        }
    }

    /// The same case without some of its readings, and without copies of others.
    pub(super) fn without(&self, rejected: &[RejectedReading]) -> Self {
        let kept = self.copies.kept(self.observations.len(), rejected);
        self.part_of(|index| kept.binary_search(&index).is_ok())
    }

    /// The same case with some of its readings alone, weighed as they are.
    pub(in crate::identification) fn part_of(&self, is_in: impl Fn(usize) -> bool) -> Self {
        let places: Vec<usize> = (0..self.observations.len())
            .filter(|&index| is_in(index))
            .collect();
        let new = |index: &usize| places.binary_search(index).ok();
        let visits = self.visits.iter();
        let visits = visits.map(|visit| visit.iter().filter_map(new).collect());
        Self {
            belief: self.belief,
            arm: self.arm.clone(),
            stations: self.stations.clone(),
            targets: self.targets.clone(),
            observations: (places.iter().map(|&index| self.observations[index].clone())).collect(),
            covariances: (places.iter().map(|&index| self.covariances[index])).collect(),
            loads: (places.iter().map(|&index| self.loads[index])).collect(),
            visits: (visits.filter(|visit: &Vec<usize>| !visit.is_empty())).collect(),
            within: self.within,
            shared: self.shared.as_ref().map(|shared| shared.among(&places)),
            is_sharing_known: self.is_sharing_known,
            choices: self.choices,
            far_from_frames: Vec::new(),
            copies: CopiedReadings::default(),
        }
    }

    /// The same case as if joints had been commanded where they stand by these errors.
    pub(super) fn displaced(mut self, errors: &[JointError]) -> Self {
        for each in &mut self.observations {
            let commanded = each.setup.commanded_rad.clone();
            for error in errors {
                each.setup.commanded_rad[error.joint] += error.at(commanded.as_slice());
            }
        }
        self
    }

    /// Each reading's block of joint space, among so many. Readings of one visit are of one configuration.
    pub fn blocks(&self, count: usize) -> Vec<usize> {
        joint_space_blocks(&self.configurations(), count)
    }

    pub(super) fn configurations(&self) -> Vec<&DVector<f64>> {
        // A visit's first reading stands for all of it, whatever angles the others say.
        let mut configurations: Vec<&DVector<f64>> = (self.observations.iter())
            .map(|each| &each.setup.commanded_rad)
            .collect();
        for visit in &self.visits {
            for &index in &visit[1..] {
                configurations[index] = configurations[visit[0]];
            }
        }
        configurations
    }

    /// How many different configurations were read.
    pub fn different(&self) -> usize {
        self.command_poses().len()
    }

    /// The readings of each configuration.
    pub(super) fn command_poses(&self) -> Vec<Vec<usize>> {
        let q = |reading: usize| &self.observations[reading].setup.commanded_rad;
        let (pose, is_alike) = (
            |reading| (q(reading), None),
            |one, other| q(one) == q(other),
        );
        together(self.observations.len(), pose, is_alike)
    }

    /// Which of the readings do not hang on directions (p x f, in typical sizes) that others leave open.
    fn determined_by_others(
        &self,
        set: &ParameterSet,
        values: &DVector<f64>,
        hidden: &DMatrix<f64>,
    ) -> FitResult<Vec<bool>> {
        if hidden.ncols() == 0 {
            return Ok(vec![true; self.observations.len()]);
        }
        let hidden = DMatrix::from_diagonal(&set.scales()) * hidden;
        let model = ObservationModel::new(set, &self.arm, values.as_slice());
        let told = of_each_prediction(&model, &self.observations, |place, predicted, rows| {
            self.observations[place].whiten(predicted, rows);
            let moved = &*rows * &hidden;
            moved.column_iter().all(|moved| moved.norm() < MATTERS)
        });
        Ok(told?)
    }
}

/// One block of readings beside a fit to all others.
pub(super) struct Without {
    /// The fit's values (p), in the parameters' units.
    pub values: DVector<f64>,
    /// Which readings of the block the others tell, in the block's order.
    pub is_told: Vec<bool>,
    /// What is left of the block's readings.
    pub left: Vec<ReadingResidual>,
    /// What joints are off by as the other blocks tell it; nothing where that is not asked.
    pub joint_errors: Vec<JointError>,
}

pub(super) struct Blocks<'a> {
    pub case: &'a AbsoluteCase<'a>,
    /// Each reading's block.
    pub of_readings: Vec<usize>,
    parts: Vec<AbsoluteCase<'a>>,
}

impl<'a> Blocks<'a> {
    /// So many blocks, or fewer.
    pub fn new(case: &'a AbsoluteCase<'a>, count: usize) -> Self {
        let of_readings = case.blocks(count);
        let count = of_readings.iter().max().map_or(0, |&last| last + 1);
        Self::of_readings(case, of_readings, count)
    }

    /// Those to which readings belong; some may be empty.
    pub fn of_readings(case: &'a AbsoluteCase<'a>, of_readings: Vec<usize>, count: usize) -> Self {
        let part = |block| case.part_of(|index| of_readings[index] == block);
        Self {
            parts: (0..count).map(part).collect(),
            case,
            of_readings,
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// The readings of a block, by their places.
    pub fn places(&self, block: usize) -> impl Iterator<Item = usize> {
        let places = 0..self.of_readings.len();
        places.filter(move |&index| self.of_readings[index] == block)
    }

    /// A fit without each of the blocks, from one to all.
    pub fn without(&self, fit: &ParameterFit) -> FitResult<Vec<Without>> {
        let set = &fit.set;
        let values = DVector::from_column_slice(&fit.posterior.mean);
        let equations = (self.parts.par_iter())
            .map(|part| part.fitted_readings(set).equations(&values))
            .collect::<FitResult<Vec<_>>>()?;
        let all: DMatrix<f64> = equations.iter().map(|each| &each.information).sum();
        let gradient: DVector<f64> = equations.iter().map(|each| &each.gradient).sum();
        (0..self.parts.len())
            .into_par_iter()
            .map(|block| {
                let own = &equations[block];
                let others = NormalEquations {
                    information: &all - &own.information,
                    gradient: &gradient - &own.gradient,
                    square: 0.0,
                };
                self.without_block(fit, block, own, others)
            })
            .collect()
    }

    fn without_block(
        &self,
        fit: &ParameterFit,
        block: usize,
        own: &NormalEquations,
        others: NormalEquations,
    ) -> FitResult<Without> {
        let (part, set) = (&self.parts[block], &fit.set);
        let values = DVector::from_column_slice(&fit.posterior.mean);
        let prior = set.prior().at(&values, set.scales().as_slice());
        let prior = prior.ok_or(OFF_PRIOR)?.precision;
        // What the other blocks determine of what all determine, in typical sizes, and what they do not.
        let all = fit.posterior.estimable.basis();
        let within = all.tr_mul(&(&others.information + prior)) * all;
        let estimable = Estimable::new(&within, &vec![1.0; all.ncols()]);
        let (basis, hidden) = (all * estimable.basis(), all * estimable.hidden());
        let problem = |readings| ReadingProblem {
            readings,
            basis: &basis,
            haste: Haste::Near,
        };
        let of_block = problem(part.fitted_readings(set));
        let change = of_block.change(&values, &of_block.solved(values.clone(), others)?.step);
        let mut values = values + &change;
        let found = part.square_at(&set.apply(&part.arm, values.as_slice()))?;
        let change = change.component_div(&set.scales());
        let predicted = own.square - 2.0 * change.dot(&own.gradient)
            + change.dot(&(&own.information * &change));
        if (found - predicted).abs() > AS_PREDICTED * found {
            let rest = (self.case).part_of(|index| self.of_readings[index] != block);
            let mut problem = problem(rest.fitted_readings(set));
            for _ in 0..MAXIMUM_STEPS {
                let now = problem.at(values.clone())?;
                if now.length() < SHORT {
                    break;
                }
                values += problem.change(&now.values, &now.step);
            }
        }
        Ok(Without {
            left: part.left(&set.apply(&part.arm, values.as_slice()))?,
            is_told: part.determined_by_others(set, &values, &hidden)?,
            values,
            joint_errors: Vec::new(),
        })
    }

    /// The same with joint error functions beside the parameters of a fit that leaves such a discrepancy, by the variances of all readings;
    /// and these functions of all. None where there is too little to tell.
    pub fn with_joint_errors(
        &self,
        (fit, discrepancy): (&ParameterFit, [f64; 2]),
        without: &[Without],
    ) -> Option<(DiscrepancyModel, Vec<Without>)> {
        let (_, mixed) = self.case.mixed(fit, discrepancy)?;
        let joints = self.case.commanded_joints();
        let parts = self.parts.iter().map(|part| {
            let found = part.mixed_of(&fit.set, &fit.posterior, joints.clone(), discrepancy);
            found.map(|(_, mixed)| mixed)
        });
        let (all, others) = mixed.without_each(&parts.collect::<Option<Vec<_>>>()?)?;
        let values = DVector::from_column_slice(&fit.posterior.mean);
        let of_block = |(block, (without, model)): (usize, (&Without, DiscrepancyModel))| {
            let values = &values + &model.shift;
            let part = self.parts[block].clone().displaced(&model.joints);
            let belief = fit.set.apply(&part.arm, values.as_slice());
            Some(Without {
                left: part.left(&belief).ok()?,
                is_told: without.is_told.clone(),
                values,
                joint_errors: model.joints,
            })
        };
        let blocks = without.iter().zip(others).enumerate();
        Some((all, blocks.map(of_block).collect::<Option<_>>()?))
    }
}
