//! The Fisher information of a plan, and the accuracy that follows from it.

use std::borrow::Cow;

use nalgebra::{DMatrix, Matrix3xX};

use super::{Experiment, Plan};
use crate::observation::PlannedReadings;
use crate::task::{Belief, Extended};

/// The planner's model of an experiment: the nominal robot with the calibration tool.
#[derive(Debug, Clone, Copy)]
pub struct ExperimentModel<'a> {
    /// What the planner believes in.
    pub belief: &'a Belief,
}

impl<'a> ExperimentModel<'a> {
    /// The model that a planner believes in.
    pub const fn new(belief: &'a Belief) -> Self {
        Self { belief }
    }

    /// The number of rows of an experiment's observation matrix: 3, or 6 where rotations are measured.
    pub fn rows(&self) -> usize {
        self.belief.instrument.precision().rows()
    }

    /// The observation matrix A^(p) of an experiment (eqs. 4, 7), 3 x p, at the commanded angles, with the
    /// springs beside the joints' own at work. Where rotations are measured A^(phi) stands below it, in the units of A^(p): times `sigma_m` over the
    /// standard deviation of rotations. Where more is uncertain there are columns for that, and rows are
    /// weighted: `sigma_m` L^-1 J with the reading's covariance L L^T.
    pub fn observation_matrix(&self, experiment: &Experiment) -> DMatrix<f64> {
        rows_of(&mut self.readings(), self.belief, experiment)
    }

    /// The readings that are planned, with derivatives by all unknowns in their units.
    pub fn readings(&self) -> PlannedReadings<'a> {
        let (belief, precision) = (self.belief, self.belief.instrument.precision());
        if !belief.uncertain.has_closed_forms() {
            return belief.uncertain.readings_of_all(precision);
        }
        let arm = belief.arm_with(&belief.calibration_tool);
        let sizes = vec![1.0; belief.parameters.len()];
        PlannedReadings::of_compliances(arm, &belief.parameters, &sizes, precision)
    }

    /// The observation matrices of all experiments of a plan, in its order: as [`Self::observation_matrix`], those of one
    /// configuration whitened together where they share something, so that the sum of r A^T A is what they tell.
    pub fn observation_matrices(&self, plan: &Plan) -> Vec<DMatrix<f64>> {
        let mut matrices = vec![DMatrix::zeros(0, 0); plan.experiments.len()];
        let mut readings = self.readings();
        for group in plan.by_configuration() {
            let here: Vec<&Experiment> = group.iter().map(|&at| &plan.experiments[at]).collect();
            for (place, own) in group
                .into_iter()
                .zip(self.observation_matrices_of(&mut readings, &here))
            {
                matrices[place] = own;
            }
        }
        matrices
    }

    /// The same of experiments of one configuration, by [`Self::readings`].
    pub fn observation_matrices_of(
        &self,
        model: &mut PlannedReadings<'_>,
        experiments: &[&Experiment],
    ) -> Vec<DMatrix<f64>> {
        if self.belief.is_shared_by_configuration() {
            return self.rows_together(model, experiments);
        }
        let experiments = experiments.iter();
        experiments
            .map(|experiment| rows_of(model, self.belief, experiment))
            .collect()
    }

    /// The rows of the experiments of one configuration, whitened together.
    pub fn rows_together(
        &self,
        model: &mut PlannedReadings<'_>,
        experiments: &[&Experiment],
    ) -> Vec<DMatrix<f64>> {
        if let [only] = experiments {
            return vec![rows_of(model, self.belief, only)];
        }
        model.stand_at(experiments[0]);
        let rows = model.observe_together(experiments);
        rows.into_iter()
            .map(|rows| rows * self.belief.instrument.sigma_m)
            .collect()
    }
}

/// `sigma_m` of a belief times the whitened rows of an experiment, those of rotations below those of positions.
pub(super) fn rows_of(
    model: &mut PlannedReadings<'_>,
    belief: &Belief,
    experiment: &Experiment,
) -> DMatrix<f64> {
    let (size, blocks) = (model.parameters(), model.rows() / 3);
    let mut matrix = Matrix3xX::zeros(blocks * size);
    model.set_repeats(experiment.repeats);
    model.stand_at(experiment);
    model.observe(&experiment.load, &mut matrix);
    matrix *= belief.instrument.sigma_m;
    let mut rows = DMatrix::zeros(3 * blocks, size);
    for block in 0..blocks {
        rows.rows_mut(3 * block, 3)
            .copy_from(&matrix.columns(block * size, size));
    }
    rows
}

/// A plan whose experiments that are alike are one, with repeats, where these share errors of rounding.
pub fn as_repeats<'p>(plan: &'p Plan, uncertain: &Extended) -> Cow<'p, Plan> {
    if uncertain.along_step_m() <= 0.0 {
        return Cow::Borrowed(plan);
    }
    let mut plan = plan.clone();
    plan.put_repeats_together();
    Cow::Owned(plan)
}

/// The experiments of a plan by configuration, where deflections of one configuration share something; else each by itself. Those that
/// are alone come first.
pub fn sharing_groups(plan: &Plan, is_shared: bool) -> Vec<Vec<&Experiment>> {
    if !is_shared {
        return plan.experiments.iter().map(|only| vec![only]).collect();
    }
    let groups = plan.by_configuration().into_iter().map(|group| {
        let here = group.into_iter().map(|place| &plan.experiments[place]);
        here.collect()
    });
    let mut groups: Vec<Vec<&Experiment>> = groups.collect();
    groups.sort_by_key(|group| group.len() > 1);
    groups
}
