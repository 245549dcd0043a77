//! Joint error functions of the planner's model: the robot keeps them, so that they tie all readings of a plan together, and the tool at
//! the test poses to them.
//!
//! With readings y = X x + U e + n, the tool's place C x + G e, and the covariance K of the functions' values e at the commanded angles,
//! let V be the covariance of U e + n and B = U K G^T. The best linear prediction of the place (universal kriging) errs by
//!
//! ```text
//! C' (x - x^) + d,   C' = C - B^T V^-1 X,   cov(d) = G K G^T - B^T V^-1 B,
//! ```
//!
//! with x^ from generalised least squares by V. Without such functions a plan's configurations are independent, and nothing of this is
//! needed.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX, SymmetricEigen};

use super::predicted_accuracy::PlaceRows;
use super::{AbsolutePlanning, RepeatedReading};
use crate::identification::AbsoluteCase;
use crate::numeric::factorisation::inverse_of;
use crate::numeric::markov::{Kernel, ProcessPoint, root};
use crate::observation::{BareArm, ReadingErrors, planned_rows};
use crate::parameter::{JointFunction, ReadingSource, relative_precision};
use crate::robot::Load;
use crate::task::Task;

/// Joint error functions, and how candidates and test poses follow them (m, rad) at the commanded angles of their joints (rad).
#[derive(Debug, Clone)]
pub(super) struct RobotFunctions {
    /// How each is correlated (over angles in rad).
    pub kernels: Vec<Kernel>,
    /// Each candidate (6 x f), or each of some readings.
    pub candidates: Vec<ProcessPoint>,
    /// The machining tool at each test pose, what counts of it (3 x f).
    pub poses: Vec<ProcessPoint>,
}

/// Readings whose errors are tied, as one.
pub(super) struct TiedReadings {
    /// By configuration.
    pub groups: Vec<Vec<RepeatedReading>>,
    /// V^-1 (6 n x 6 n), nothing of what is not read.
    precision: DMatrix<f64>,
    /// X (6 n x p, in typical sizes).
    rows: DMatrix<f64>,
    /// B of each test pose (6 n x 3); none without functions.
    with_poses: Vec<DMatrix<f64>>,
}

impl RobotFunctions {
    /// Of sources that are such, where some candidates are read under loads.
    pub fn new(
        task: &Task,
        (case, target): (&AbsoluteCase<'_>, usize),
        read: &[(usize, Load)],
        sources: &[&ReadingSource],
    ) -> Self {
        let each: Vec<JointFunction> = sources.iter().flat_map(|each| each.functions()).collect();
        let sources = || sources.iter().copied();
        let joints = &case.belief.nominal.chain.joints;
        let angles = |q: &DVector<f64>| -> Vec<f64> {
            let each = each.iter().map(|each| each.joint);
            each.map(|joint| joints[joint].in_turn(q[joint])).collect()
        };
        let candidate = |(place, load): &(usize, Load)| ProcessPoint {
            places: angles(&case.observations[*place].setup.commanded_rad),
            columns: columns(&case.disturbed(*place, load, sources()).configuration, 6),
        };
        let nominal = &case.belief.nominal;
        let arm = BareArm {
            chain: &nominal.chain,
            compliance_rad_per_nm: &nominal.compliance_rad_per_nm,
            tool: &case.arm.tools[target],
        };
        let mut poses = Vec::new();
        let mut candidates = Vec::new();
        if !each.is_empty() {
            candidates.extend(read.iter().map(candidate));
            poses.extend(task.test_poses.iter().map(|pose| {
                let q = &pose.configuration_rad;
                let carried = (arm.tool, &pose.load);
                let errors = ReadingErrors::new(arm, q.as_slice(), carried, None, sources());
                ProcessPoint {
                    places: angles(q),
                    columns: pose.counted_rows(columns(&errors.configuration, 3)),
                }
            }));
        }
        Self {
            kernels: (each.iter())
                .map(|each| each.kernel_on(&nominal.chain))
                .collect(),
            candidates,
            poses,
        }
    }

    /// How standard normal numbers make the functions' values at some points (a row for each, of one function).
    pub fn roots(&self, points: &[&ProcessPoint]) -> Vec<DMatrix<f64>> {
        let places = |function: usize| points.iter().map(move |point| point.places[function]);
        let kernels = self.kernels.iter().enumerate();
        kernels
            .map(|(function, &kernel)| root(&places(function).collect::<Vec<_>>(), kernel))
            .collect()
    }
}

/// The first rows of some columns.
fn columns(all: &Matrix6xX<f64>, rows: usize) -> DMatrix<f64> {
    all.rows(0, rows).into_owned()
}

impl TiedReadings {
    /// X^T V^-1 (p x 6 n).
    fn weighed(&self) -> DMatrix<f64> {
        self.rows.tr_mul(&self.precision)
    }

    /// B^T V^-1 (3 x 6 n) of each test pose: how its place follows residuals.
    fn gains(&self) -> impl Iterator<Item = DMatrix<f64>> {
        let poses = self.with_poses.iter();
        poses.map(|with| with.tr_mul(&self.precision))
    }

    /// The covariance of d at all test poses (3 m x 3 m, m^2).
    fn left(&self, functions: &RobotFunctions) -> DMatrix<f64> {
        let count = functions.poses.len();
        let mut left = DMatrix::zeros(3 * count, 3 * count);
        for (row, gain) in self.gains().enumerate() {
            for (column, with) in self.with_poses.iter().enumerate() {
                let [one, other] = [row, column].map(|pose| &functions.poses[pose]);
                let own = one.covariance(other, &functions.kernels) - &gain * with;
                left.view_mut((3 * row, 3 * column), (3, 3)).copy_from(&own);
            }
        }
        left
    }

    /// C', and d beside what the task's force does, in place of C.
    fn place_rows(&self, poses: &[PlaceRows], functions: &RobotFunctions) -> Vec<PlaceRows> {
        let eigen = SymmetricEigen::new(self.left(functions));
        let roots = eigen.eigenvalues.map(|each| each.max(0.0).sqrt());
        let left = &eigen.eigenvectors * DMatrix::from_diagonal(&roots);
        let of_pose = |(pose, (place, gain)): (&PlaceRows, (usize, DMatrix<f64>))| {
            let shown = gain * &self.rows;
            let own = left.rows(3 * place, 3);
            let known = pose.by_task.ncols();
            let mut by_task = pose
                .by_task
                .clone()
                .resize_horizontally(known + own.ncols(), 0.0);
            by_task.columns_mut(known, own.ncols()).copy_from(&own);
            PlaceRows {
                weight: pose.weight,
                by_station: (pose.by_station.iter())
                    .map(|(station, rows)| (*station, rows - &shown))
                    .collect(),
                by_task,
            }
        };
        (poses.iter().zip(self.gains().enumerate()))
            .map(of_pose)
            .collect()
    }

    /// Makes C of all test poses (3 m x p), each times the root of its weight, C'.
    pub fn take_shown(&self, rows: &mut DMatrix<f64>, poses: &[PlaceRows]) {
        for (place, (pose, gain)) in poses.iter().zip(self.gains()).enumerate() {
            let mut own = rows.rows_mut(3 * place, 3);
            own -= gain * &self.rows * pose.weight.sqrt();
        }
    }

    /// How the tool's place at the test poses, each times the root of its weight, follows readings: (C' M^-1 X^T + B^T) V^-1 (3 m x 6 n),
    /// where the first is by the gain C' M^-1 (3 m x p, by typical sizes).
    pub fn weights(&self, poses: &[PlaceRows], gain: &DMatrix<f64>) -> DMatrix<f64> {
        let mut weights = gain * self.weighed();
        for (place, (pose, own)) in poses.iter().zip(self.gains()).enumerate() {
            let mut rows = weights.rows_mut(3 * place, 3);
            rows += own * pose.weight.sqrt();
        }
        weights
    }
}

impl AbsolutePlanning<'_> {
    /// The load of a candidate.
    pub(super) fn load(&self, place: usize) -> Load {
        self.candidates[place].load.unwrap_or(Load::NONE)
    }

    /// Whether functions tie all readings.
    pub(super) const fn ties_all(&self) -> bool {
        !self.functions.kernels.is_empty()
    }

    /// What is known before any reading (p x p, in typical sizes), or before those that a plan chooses where these are by themselves.
    pub(super) fn known_before(&self) -> DMatrix<f64> {
        if self.ties_all() {
            relative_precision(&self.set)
        } else {
            self.before.clone()
        }
    }

    /// A plan's readings by what ties them: those of each configuration, or, where functions do, all with those that are known.
    pub(super) fn tied(&self, plan: &[(usize, u32)]) -> Vec<TiedReadings> {
        if self.ties_all() {
            let all: Vec<(usize, u32)> = self.measured.iter().chain(plan).copied().collect();
            return vec![self.as_one(self.by_configuration(&all))];
        }
        let groups = self.by_configuration(plan).into_iter();
        groups.map(|group| self.as_one(vec![group])).collect()
    }

    fn as_one(&self, groups: Vec<Vec<RepeatedReading>>) -> TiedReadings {
        let functions = &self.functions;
        let readings: Vec<&RepeatedReading> = groups.iter().flatten().collect();
        let setups: Vec<_> = readings.iter().map(|each| self.setup(each.place)).collect();
        let mean = &self.set.prior().mean;
        let mut rows = DMatrix::zeros(6 * readings.len(), self.set.len());
        let derivatives = planned_rows(&self.set, &self.case.arm, mean, &setups);
        for (place, each) in derivatives.iter().enumerate() {
            rows.rows_mut(6 * place, 6).copy_from(each);
        }
        let with_pose = |pose: &ProcessPoint| {
            let mut with = DMatrix::zeros(6 * readings.len(), 3);
            for (place, each) in readings.iter().enumerate() {
                let point = &functions.candidates[each.place];
                let between = point.covariance(pose, &functions.kernels);
                with.rows_mut(6 * place, 6).copy_from(&between);
            }
            with
        };
        TiedReadings {
            with_poses: functions.poses.iter().map(with_pose).collect(),
            precision: inverse_among(&self.covariance_of(&groups), &self.rows_of(&readings)),
            rows,
            groups,
        }
    }

    /// What a plan tells with what is known before (p x p, in typical sizes) where functions tie all readings, and how the tool's place
    /// follows what nobody knows then.
    pub(super) fn tied_together(&self, plan: &[(usize, u32)]) -> (DMatrix<f64>, Vec<PlaceRows>) {
        let tied = self.tied(plan).swap_remove(0);
        let information = relative_precision(&self.set) + tied.weighed() * &tied.rows;
        (information, tied.place_rows(&self.poses, &self.functions))
    }

    /// What the functions of a source leave (m^2) where the tool's place follows readings by such weights (3 m x 6 n) of these readings:
    /// at the test poses they move the tool themselves.
    pub(super) fn left_by_functions(
        &self,
        readings: &[&RepeatedReading],
        weights: &DMatrix<f64>,
        source: &ReadingSource,
    ) -> f64 {
        let read = readings
            .iter()
            .map(|each| (each.place, self.load(each.place)));
        let read: Vec<(usize, Load)> = read.collect();
        let case = (&self.case, self.target);
        let functions = RobotFunctions::new(self.task, case, &read, &[source]);
        let points = functions.candidates.iter().chain(&functions.poses);
        let points: Vec<&ProcessPoint> = points.collect();
        let mut square = 0.0;
        for (function, root) in functions.roots(&points).iter().enumerate() {
            // How the tool's place follows the function at each point (3 m x n).
            let mut moved = DMatrix::zeros(weights.nrows(), points.len());
            for (place, point) in points.iter().take(readings.len()).enumerate() {
                let own = point.columns.column(function);
                moved.set_column(place, &-(weights.columns(6 * place, 6) * own));
            }
            for (pose, rows) in self.poses.iter().enumerate() {
                let place = readings.len() + pose;
                let own = points[place].columns.column(function) * rows.weight.sqrt();
                moved.view_mut((3 * pose, place), (3, 1)).copy_from(&own);
            }
            square += (moved * root).norm_squared();
        }
        square
    }

    /// How the joints' functions move the tool at each test pose (m, what counts, world frame) by the residuals of a plan's readings (3 x 6 n; m,
    /// rad, world frame), in the order of its configurations; none without functions.
    pub fn function_gains(&self, plan: &[(usize, u32)]) -> Vec<DMatrix<f64>> {
        let tied = self.tied(plan);
        tied.iter().flat_map(TiedReadings::gains).collect()
    }
}

/// The inverse of some rows and columns of a covariance, and nothing of all others.
fn inverse_among(covariance: &DMatrix<f64>, kept: &[usize]) -> DMatrix<f64> {
    let among = DMatrix::from_fn(kept.len(), kept.len(), |row, column| {
        covariance[(kept[row], kept[column])]
    });
    let mut precision = DMatrix::zeros(covariance.nrows(), covariance.ncols());
    if let Some(factor) = Cholesky::new(among) {
        let inverse = inverse_of(&factor);
        for (row, &to_row) in kept.iter().enumerate() {
            for (column, &to_column) in kept.iter().enumerate() {
                precision[(to_row, to_column)] = inverse[(row, column)];
            }
        }
    }
    precision
}
