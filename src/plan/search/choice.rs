//! The choice from some experiments as a finite problem.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::candidate_information::CandidateInformation;
use super::finite::{FiniteProblem, ToldTogether};
use super::problem::Problem;
use crate::experiment::{Experiment, numbered};

impl Problem<'_> {
    /// The choice from some experiments, each as often as its repeats say at most.
    pub(super) fn choice_among<'p>(&'p self, all: &'p [Experiment]) -> FiniteProblem<'p> {
        let each: Vec<DMatrix<f64>> = (all.par_iter())
            .map(|experiment| self.told(experiment, 1))
            .collect();
        let mandatory = &self.task.design.mandatory;
        let configurations = numbered(all.len(), |place| all[place].pose(), |_, _| true);
        let is_mandatory =
            |place: &usize| (mandatory.experiments.iter()).any(|each| each.stands_as(&all[*place]));
        let told = |measured: &[(usize, u32)]| {
            let here = mandatory.experiments.iter();
            let here = here
                .filter(|each| each.stands_as(&all[measured[0].0]))
                .cloned();
            let here: Vec<Experiment> = here.collect();
            match *measured {
                [(only, times)] if here.is_empty() => self.told(&all[only], times),
                _ => {
                    let before = self.told_by(here.clone());
                    self.told_by([here, measured_of(all, measured)].concat()) - before
                }
            }
        };
        FiniteProblem {
            criterion: self.criterion,
            test_poses: self.test_poses.clone(),
            beside: self.information(mandatory),
            told: CandidateInformation::of_all(self.parameters(), &each),
            most: all.iter().map(|each| each.repeats).collect(),
            mandatory: (0..all.len())
                .filter(is_mandatory)
                .map(|place| configurations[place])
                .collect(),
            configurations,
            told_together: (self.is_shared_by_repeats())
                .then(|| -> Box<ToldTogether<'p>> { Box::new(told) }),
            bounds: None,
        }
    }
}

/// Experiments of a list by their places, each measured so often.
pub(super) fn measured_of(all: &[Experiment], plan: &[(usize, u32)]) -> Vec<Experiment> {
    let measured = plan.iter().map(|&(place, repeats)| Experiment {
        repeats,
        ..all[place].clone()
    });
    measured.collect()
}
