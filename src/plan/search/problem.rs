//! What is searched: the scenario's planning problem in relative units.

use nalgebra::{DMatrix, Matrix3xX, Vector3};
use rand::RngExt;
use thiserror::Error;

use super::observation::Observer;
use crate::compensation::test_pose_matrix;
use crate::plan::{
    Bound, Criterion, CriterionFunction, Experiment, ExperimentModel, Plan, bounds_of,
};
use crate::random::generator;
use crate::robot::Load;
use crate::scenario::{Loads, Scenario};

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

/// The kinds of load that the local search tells apart.
#[derive(Debug, Clone, PartialEq)]
pub enum LoadChoice {
    /// One of these.
    OneOf(Vec<Load>),
    /// A force of any direction and of this size (N).
    AnyDirection(f64),
}

/// A configuration and a load with the observation matrix that they give.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// The joint angles (rad).
    pub q: Vec<f64>,
    /// The load.
    pub load: Load,
    /// The scaled observation matrix, 3 x p.
    pub matrix: Matrix3xX<f64>,
}

impl Point {
    /// The scaled information A^T A, p x p.
    #[must_use]
    pub fn information(&self) -> DMatrix<f64> {
        let matrix = self.matrix.tr_mul(&self.matrix);
        DMatrix::from_column_slice(matrix.nrows(), matrix.ncols(), matrix.as_slice())
    }

    /// The point as an experiment of a plan.
    #[must_use]
    pub fn experiment(&self, repeats: u32) -> Experiment {
        Experiment {
            configuration_rad: nalgebra::DVector::from_column_slice(&self.q),
            load: self.load,
            repeats,
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
    pub(super) bounds: Vec<Bound>,
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
        problem.unexcited = problem.unexcited_joints();
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
        problem.indifferent = indifferent_joints(&problem);
        problem
    }

    fn of_parameters(scenario: &'a Scenario, criterion: Criterion, parameters: &[usize]) -> Self {
        let typical_rad_per_nm = typical(scenario, parameters);
        Self {
            indifferent: Vec::new(),
            bounds: bounds_of(&scenario.region),
            ranges: scenario
                .region
                .joint_range_rad
                .iter()
                .map(|&[low, high]| (low, high))
                .collect(),
            loads: match &scenario.loads {
                Loads::Fixed(load) => LoadChoice::OneOf(vec![*load]),
                // The information is quadratic in the force's size: the largest is best.
                Loads::Direction { direction, force_n } => {
                    let [x, y, z] = (direction * force_n[1]).into();
                    LoadChoice::OneOf(vec![Load::force(x, y, z)])
                }
                Loads::Any { force_max_n } => LoadChoice::AnyDirection(*force_max_n),
                Loads::List(loads) => LoadChoice::OneOf(loads.clone()),
            },
            test_poses: scaled_test_poses(scenario, parameters, &typical_rad_per_nm),
            parameters: parameters.to_vec(),
            unexcited: Vec::new(),
            typical_rad_per_nm,
            criterion,
            effort: Effort::default(),
            scenario,
        }
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

    /// The joints whose compliances do not show at random configurations under any load.
    fn unexcited_joints(&self) -> Vec<usize> {
        const CONFIGURATIONS: u64 = 40;
        let forces = [Vector3::x(), Vector3::y(), Vector3::z()].map(|force| Load {
            force_n: force,
            torque_nm: Vector3::zeros(),
        });
        let loads: &[Load] = match &self.loads {
            LoadChoice::OneOf(loads) => loads,
            LoadChoice::AnyDirection(_) => &forces,
        };
        let mut observer = self.observer();
        let mut matrix = Matrix3xX::zeros(self.parameters());
        let mut shown = vec![0.0_f64; self.parameters()];
        let mut random = generator(0, 2);
        for _ in 0..CONFIGURATIONS {
            let draw = |&(low, high): &(f64, f64)| low + (high - low) * random.random::<f64>();
            let q: Vec<f64> = self.ranges.iter().map(draw).collect();
            observer.move_to(&q);
            for load in loads {
                observer.observe(load, &mut matrix);
                for (shown, column) in shown.iter_mut().zip(matrix.column_iter()) {
                    *shown = shown.max(column.norm());
                }
            }
        }
        let largest = shown.iter().copied().fold(0.0, f64::max);
        let joints = self.parameters.iter().zip(shown);
        joints
            .filter(|(_, shown)| *shown <= 1e-9 * largest)
            .map(|(joint, _)| *joint)
            .collect()
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

/// Adds `weight` A^T A to an information matrix.
pub(super) fn add_information(
    information: &mut DMatrix<f64>,
    matrix: &Matrix3xX<f64>,
    weight: f64,
) {
    let columns = matrix.as_slice();
    let size = matrix.ncols();
    let sums = information.as_mut_slice().chunks_exact_mut(size);
    for (sums, one) in sums.zip(columns.chunks_exact(3)) {
        let [x, y, z] = [one[0] * weight, one[1] * weight, one[2] * weight];
        for (sum, other) in sums.iter_mut().zip(columns.chunks_exact(3)) {
            *sum += x * other[0] + y * other[1] + z * other[2];
        }
    }
}

/// trace(A G A^T): the information of an experiment in the directions G.
pub(super) fn information_in(matrix: &Matrix3xX<f64>, directions: &DMatrix<f64>) -> f64 {
    let columns = matrix.as_slice();
    let mut sum = 0.0;
    let rows = directions.as_slice().chunks_exact(matrix.ncols());
    for (row, one) in rows.zip(columns.chunks_exact(3)) {
        for (weight, other) in row.iter().zip(columns.chunks_exact(3)) {
            sum += weight * (one[0] * other[0] + one[1] * other[1] + one[2] * other[2]);
        }
    }
    sum
}

/// A G for an observation matrix A, times a factor.
pub(super) fn in_directions(
    product: &mut Matrix3xX<f64>,
    factor: f64,
    matrix: &Matrix3xX<f64>,
    directions: &DMatrix<f64>,
) {
    let columns = matrix.as_slice();
    let rows = directions.as_slice().chunks_exact(matrix.ncols());
    for (sum, row) in product.as_mut_slice().chunks_exact_mut(3).zip(rows) {
        sum.fill(0.0);
        for (weight, column) in row.iter().zip(columns.chunks_exact(3)) {
            let weight = factor * weight;
            sum[0] += weight * column[0];
            sum[1] += weight * column[1];
            sum[2] += weight * column[2];
        }
    }
}

/// Finds the joints that do not matter by turning each at random configurations.
fn indifferent_joints(problem: &Problem<'_>) -> Vec<usize> {
    const CONFIGURATIONS: u64 = 8;
    let LoadChoice::OneOf(loads) = &problem.loads else {
        return Vec::new();
    };
    let mut observer = problem.observer();
    let gravity = observer.gravity();
    let mut matrix = Matrix3xX::zeros(problem.parameters());
    let mut told = |q: &[f64], load: &Load| {
        observer.move_to(q);
        observer.observe(load, &mut matrix);
        let margin = |bound: &Bound| bound.margin(&observer.state, load, &gravity);
        let mut told: Vec<f64> = problem.bounds.iter().map(margin).collect();
        told.extend(matrix.tr_mul(&matrix).iter());
        told
    };
    let mut random = generator(0, 1);
    let mut draw = |joint: usize| {
        let (low, high) = problem.ranges[joint];
        low + (high - low) * random.random::<f64>()
    };
    let joints = problem.ranges.len();
    let mut matters = vec![false; joints];
    for _ in 0..CONFIGURATIONS {
        let q: Vec<f64> = (0..joints).map(&mut draw).collect();
        for (joint, matters) in matters.iter_mut().enumerate() {
            let mut turned = q.clone();
            turned[joint] = draw(joint);
            for load in loads {
                let (before, after) = (told(&q, load), told(&turned, load));
                let size = before
                    .iter()
                    .fold(1.0_f64, |size, value| size.max(value.abs()));
                *matters |= before
                    .iter()
                    .zip(&after)
                    .any(|(one, other)| (one - other).abs() > 1e-9 * size);
            }
        }
    }
    (0..joints).filter(|&joint| !matters[joint]).collect()
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
