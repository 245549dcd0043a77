//! What is searched: the scenario's planning problem in relative units.

use nalgebra::{DMatrix, Matrix3xX};
use thiserror::Error;

use super::joints::{indifferent_joints, unexcited_parameters};
use super::observation::Observer;
use super::point::{LoadChoice, add_information};
use crate::compensation::test_pose_matrix;
use crate::plan::{
    Criterion, CriterionFunction, ExperimentModel, Plan, SmoothBound, bounds_of, widened,
};
use crate::scenario::{Region, Scenario};

/// Why there is no plan.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SearchError {
    /// No sampled experiment is feasible.
    #[error("no experiment is feasible: of {samples} random ones, {}", rejections.join(", "))]
    EmptyRegion {
        /// How many were tried.
        samples: usize,
        /// How many each constraint rejected.
        rejections: Vec<String>,
    },
    /// The test pose depends on a compliance that no feasible experiment shows.
    #[error(
        "no feasible experiment shows the compliance of {}: the loads leave it without torque",
        joints.join(", ")
    )]
    NotExcited {
        /// The joints.
        joints: Vec<String>,
    },
    /// So few experiments cannot determine the compliances.
    #[error("{experiments} experiments cannot determine {parameters} compliances in this region")]
    Singular {
        /// The number of different configurations.
        experiments: u32,
        /// The number of unknown compliances.
        parameters: usize,
    },
}

/// How much work a search does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Random experiments that are looked through for promising ones.
    pub pool: usize,
    /// How many of these a search over one experiment starts from, for the approximate design.
    pub probes: usize,
    /// Random starts of the search on which the certificate rests, at most.
    pub certificate_probes: usize,
    /// Searches over whole plans, at most.
    pub searches: usize,
}

impl Default for Effort {
    fn default() -> Self {
        Self {
            pool: 1000,
            probes: 16,
            certificate_probes: 1024,
            searches: 240,
        }
    }
}

/// A planning problem: the region, the loads, the criterion and the model, in relative units.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// What makes a plan good.
    pub criterion: Criterion,
    /// How much work the search does.
    pub effort: Effort,
    pub(super) bounds: Vec<SmoothBound>,
    pub(super) ranges: Vec<(f64, f64)>,
    pub(super) loads: LoadChoice,
    /// Joints whose angle changes neither what any experiment tells nor the smooth bounds: axis 1
    /// under a vertical load.
    pub(super) indifferent: Vec<usize>,
    /// The joints whose compliances the plan is to determine.
    parameters: Vec<usize>,
    /// Those of them that no experiment shows.
    unexcited: Vec<usize>,
    typical_rad_per_nm: Vec<f64>,
    test_poses: DMatrix<f64>,
}

impl<'a> Problem<'a> {
    /// The planning problem of a scenario for a criterion. For the test pose, a compliance that no
    /// load shows and that does not matter there is left out; every other criterion is about all
    /// compliances.
    #[must_use]
    pub fn new(scenario: &'a Scenario, criterion: Criterion) -> Self {
        let mut problem = Self::of_parameters(scenario, criterion, &scenario.parameters);
        let unexcited = unexcited_parameters(problem.observer(), &problem.ranges, &problem.loads);
        problem.unexcited = (unexcited.into_iter())
            .map(|index| scenario.parameters[index])
            .collect();
        if criterion == Criterion::TestPose {
            let matters = |&index: &usize| {
                problem.test_poses.row(index).amax() > 1e-9 * problem.test_poses.amax()
            };
            let kept: Vec<usize> = (0..scenario.parameters.len())
                .filter(|index| {
                    !problem.unexcited.contains(&scenario.parameters[*index]) || matters(index)
                })
                .map(|index| scenario.parameters[index])
                .collect();
            if !kept.is_empty() && kept.len() < scenario.parameters.len() {
                let unexcited = problem.unexcited;
                problem = Self::of_parameters(scenario, criterion, &kept);
                problem.unexcited = unexcited
                    .into_iter()
                    .filter(|joint| kept.contains(joint))
                    .collect();
            }
        }
        problem.indifferent = indifferent_joints(
            problem.observer(),
            &problem.ranges,
            &problem.loads,
            &problem.bounds,
        );
        problem
    }

    fn of_parameters(scenario: &'a Scenario, criterion: Criterion, parameters: &[usize]) -> Self {
        let typical_rad_per_nm = typical(scenario, parameters);
        Self {
            indifferent: Vec::new(),
            bounds: bounds_of(&scenario.region),
            ranges: ranges_of(&scenario.region),
            loads: LoadChoice::new(&scenario.loads),
            test_poses: scaled_test_poses(scenario, parameters, &typical_rad_per_nm),
            parameters: parameters.to_vec(),
            unexcited: Vec::new(),
            typical_rad_per_nm,
            criterion,
            effort: Effort::default(),
            scenario,
        }
    }

    /// The same problem over the smooth bounds of a class of plans: those of the region, widened.
    pub(super) fn widened(&self) -> Self {
        let region = widened(&self.scenario.region);
        Self {
            bounds: bounds_of(&region),
            ranges: ranges_of(&region),
            ..self.clone()
        }
    }

    /// Whether the size of a force is to be searched. Otherwise the largest is best: information grows
    /// with the square of the size, no bound of the region depends on it, and the criterion is the
    /// better for more of every information.
    pub(super) fn is_size_free(&self) -> bool {
        !self.criterion.is_monotone() || self.is_force_bounded()
    }

    /// Whether bounds of the region depend on the load.
    pub(super) fn is_force_bounded(&self) -> bool {
        (self.bounds.iter()).any(|bound| {
            matches!(
                bound,
                SmoothBound::TorqueMax(..) | SmoothBound::TorqueMin(..)
            )
        })
    }

    /// Every compliance must show in some experiment.
    ///
    /// # Errors
    /// Those that do not are named.
    pub(super) fn check_excited(&self) -> Result<(), SearchError> {
        if self.unexcited.is_empty() {
            return Ok(());
        }
        let names = self.scenario.parameter_names();
        let named = self.scenario.parameters.iter().zip(names);
        Err(SearchError::NotExcited {
            joints: named
                .filter(|(joint, _)| self.unexcited.contains(joint))
                .map(|(_, name)| name)
                .collect(),
        })
    }

    /// The number p of compliances.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.typical_rad_per_nm.len()
    }

    /// An observer of this problem's experiments.
    #[must_use]
    pub fn observer(&self) -> Observer<'a> {
        Observer::new(
            ExperimentModel::new(self.scenario),
            &self.parameters,
            &self.typical_rad_per_nm,
        )
    }

    /// The criterion as a cost.
    #[must_use]
    pub fn cost(&self) -> CriterionFunction {
        self.cost_of(self.criterion)
    }

    /// Any other criterion of the same problem.
    #[must_use]
    pub fn cost_of(&self, criterion: Criterion) -> CriterionFunction {
        CriterionFunction::new(criterion, self.test_poses.clone())
    }

    /// The scaled information matrix of a plan.
    #[must_use]
    pub fn information(&self, plan: &Plan) -> DMatrix<f64> {
        let mut observer = self.observer();
        let size = self.parameters();
        let mut matrix = Matrix3xX::zeros(size);
        let mut information = DMatrix::zeros(size, size);
        for experiment in &plan.experiments {
            observer.move_to(experiment.configuration_rad.as_slice());
            observer.observe(&experiment.load, &mut matrix);
            add_information(&mut information, &matrix, f64::from(experiment.repeats));
        }
        information
    }

    /// From a scaled covariance to standard errors (rad/(N m)).
    #[must_use]
    pub fn standard_errors(&self, covariance: &DMatrix<f64>) -> Vec<f64> {
        self.typical_rad_per_nm
            .iter()
            .enumerate()
            .map(|(index, typical)| covariance[(index, index)].max(0.0).sqrt() * typical)
            .collect()
    }
}

fn ranges_of(region: &Region) -> Vec<(f64, f64)> {
    let ranges = region.joint_range_rad.iter();
    ranges.map(|&[low, high]| (low, high)).collect()
}

/// Nominal compliances of the parameters; the largest one stands in for a joint held to be rigid.
fn typical(scenario: &Scenario, parameters: &[usize]) -> Vec<f64> {
    let nominal = &scenario.nominal.compliance_rad_per_nm;
    let largest = nominal.iter().copied().fold(0.0, f64::max);
    let fallback = if largest > 0.0 { largest } else { 1e-6 };
    parameters
        .iter()
        .map(|&joint| {
            if nominal[joint] > 0.0 {
                nominal[joint]
            } else {
                fallback
            }
        })
        .collect()
}

/// C^T (p x 3 poses): the test poses' matrices in relative units, times the roots of the weights.
fn scaled_test_poses(scenario: &Scenario, parameters: &[usize], typical: &[f64]) -> DMatrix<f64> {
    let mut stacked = DMatrix::zeros(typical.len(), 3 * scenario.test_poses.len());
    for (index, pose) in scenario.test_poses.iter().enumerate() {
        let matrix = test_pose_matrix(
            &scenario.nominal.chain,
            &scenario.machining_tool,
            pose,
            parameters,
        );
        for row in 0..3 {
            for (parameter, scale) in typical.iter().enumerate() {
                stacked[(parameter, 3 * index + row)] =
                    matrix[(row, parameter)] * scale * pose.weight.sqrt();
            }
        }
    }
    stacked
}
