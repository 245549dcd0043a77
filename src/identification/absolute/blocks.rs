//! Readings by blocks of joint space.

use nalgebra::DVector;

use super::super::gauss_newton::FitError;
use super::{AbsoluteCase, joint_space_blocks};
use crate::observation::{
    NormalEquations, Observation, SharedErrors, normal_equations, shared_equations,
};
use crate::parameter::{ElasticArm, ParameterSet};

/// With fewer blocks there is nothing to compare.
pub const FEWEST_BLOCKS: usize = 4;

/// Some of the readings, weighed as all are.
#[derive(Debug, Clone)]
pub(super) struct ReadingPart {
    pub observations: Vec<Observation>,
    pub shared: Option<SharedErrors>,
}

impl ReadingPart {
    /// What these readings say.
    pub fn equations(
        &self,
        set: &ParameterSet,
        reference: &ElasticArm,
        values: &DVector<f64>,
    ) -> Result<NormalEquations, FitError> {
        let observations = &self.observations;
        let equations = match &self.shared {
            None => normal_equations(set, reference, values, observations),
            Some(shared) => shared_equations(set, reference, values, observations, shared),
        };
        equations.map_err(|(index, source)| FitError::Equilibrium {
            observation: index + 1,
            source,
        })
    }

    /// The number of scalar readings.
    pub fn rows(&self) -> usize {
        let readings = self.observations.iter();
        readings.map(|each| each.reading.kind().rows()).sum()
    }
}

impl AbsoluteCase<'_> {
    /// Each reading's block of joint space, among so many. Readings of one visit are of one configuration.
    pub fn blocks(&self, count: usize) -> Vec<usize> {
        // A visit's first reading stands for all of it, whatever angles the others say.
        let mut configurations: Vec<&DVector<f64>> = (self.observations.iter())
            .map(|each| &each.setup.commanded_rad)
            .collect();
        for visit in &self.visits {
            for &index in &visit[1..] {
                configurations[index] = configurations[visit[0]];
            }
        }
        joint_space_blocks(&configurations, count)
    }

    /// How many different configurations were read.
    pub fn different(&self) -> usize {
        let configurations = self.observations.iter();
        let mut all: Vec<Vec<u64>> = configurations
            .map(|each| {
                each.setup
                    .commanded_rad
                    .iter()
                    .map(|angle| angle.to_bits())
                    .collect()
            })
            .collect();
        all.sort_unstable();
        all.dedup();
        all.len()
    }

    /// The readings at some places, which are in order.
    pub(super) fn part(
        &self,
        shared: Option<&SharedErrors>,
        is_in: impl Fn(usize) -> bool,
    ) -> ReadingPart {
        let places: Vec<usize> = (0..self.observations.len())
            .filter(|&index| is_in(index))
            .collect();
        let shared = shared.map(|shared| shared.among(&places));
        let observations = places
            .iter()
            .map(|&index| self.observations[index].clone())
            .collect();
        ReadingPart {
            observations,
            shared,
        }
    }
}
