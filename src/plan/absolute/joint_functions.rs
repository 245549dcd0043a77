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

use nalgebra::{Cholesky, DMatrix, DVector, Isometry3, Matrix6xX, SymmetricEigen};

use super::predicted_accuracy::{PlaceRows, PredictedAccuracy, known_after, stacked, stacked_task};
use super::together::turned_columns;
use super::{AbsolutePlanning, RepeatedReading};
use crate::identification::AbsoluteCase;
use crate::observation::{BareArm, ReadingErrors, SharingReadings, planned_rows};
use crate::parameter::{JointFunction, ReadingSource, relative_precision};
use crate::robot::Load;
use crate::task::Task;

/// How a place follows the joints' error functions.
#[derive(Debug, Clone)]
pub(super) struct FunctionPoint {
    /// The commanded angle of each function's joint (rad).
    pub angles_rad: Vec<f64>,
    /// By one standard deviation of each (rows x f; m, rad).
    pub columns: DMatrix<f64>,
}

/// Joint error functions, and how candidates and test poses follow them.
#[derive(Debug, Clone)]
pub(super) struct RobotFunctions {
    /// The functions.
    pub each: Vec<JointFunction>,
    /// Where each candidate is read (6 x f), or each of some readings.
    pub candidates: Vec<FunctionPoint>,
    /// The machining tool at each test pose, what counts of it (3 x f).
    pub poses: Vec<FunctionPoint>,
}

/// The readings of a plan and those that are known, as one.
pub(super) struct TiedReadings {
    /// By configuration.
    pub groups: Vec<Vec<RepeatedReading>>,
    /// V^-1 (6 n x 6 n), nothing of what is not read.
    precision: DMatrix<f64>,
    /// X (6 n x p, in typical sizes).
    rows: DMatrix<f64>,
    /// B of each test pose (6 n x 3).
    with_poses: Vec<DMatrix<f64>>,
    /// The covariance of d at all test poses (3 m x 3 m, m^2).
    left: DMatrix<f64>,
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
        let angles =
            |q: &DVector<f64>| -> Vec<f64> { each.iter().map(|each| q[each.joint]).collect() };
        let candidate = |(place, load): &(usize, Load)| FunctionPoint {
            angles_rad: angles(&case.observations[*place].setup.commanded_rad),
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
                FunctionPoint {
                    angles_rad: angles(q),
                    columns: pose.counted_rows(columns(&errors.configuration, 3)),
                }
            }));
        }
        Self {
            each,
            candidates,
            poses,
        }
    }

    /// The covariance between two places.
    fn between(&self, one: &FunctionPoint, other: &FunctionPoint) -> DMatrix<f64> {
        let mut covariance = DMatrix::zeros(one.columns.nrows(), other.columns.nrows());
        for (function, each) in self.each.iter().enumerate() {
            let apart = (one.angles_rad[function] - other.angles_rad[function]).abs();
            let shared = (-apart / each.correlation_rad).exp();
            let [mine, theirs] = [one, other].map(|point| point.columns.column(function));
            covariance.ger(shared, &mine, &theirs, 1.0);
        }
        covariance
    }

    /// How standard normal numbers make the functions' values at some places (n x k each, of one function): the process from each angle
    /// to the next.
    fn roots(&self, points: &[&FunctionPoint]) -> Vec<DMatrix<f64>> {
        let root = |(function, each): (usize, &JointFunction)| {
            let angle = |place: usize| points[place].angles_rad[function];
            let mut order: Vec<usize> = (0..points.len()).collect();
            order.sort_by(|&one, &other| angle(one).total_cmp(&angle(other)));
            let mut root = DMatrix::zeros(points.len(), points.len());
            for (number, &place) in order.iter().enumerate() {
                let Some(before) = number.checked_sub(1).map(|number| order[number]) else {
                    root[(place, number)] = 1.0;
                    continue;
                };
                let kept = (-(angle(place) - angle(before)) / each.correlation_rad).exp();
                let own = root.row(before) * kept;
                root.set_row(place, &own);
                root[(place, number)] = (1.0 - kept * kept).max(0.0).sqrt();
            }
            root
        };
        self.each.iter().enumerate().map(root).collect()
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

    /// C', and d beside what the task's force does, in place of C.
    fn place_rows(&self, poses: &[PlaceRows]) -> Vec<PlaceRows> {
        let eigen = SymmetricEigen::new(self.left.clone());
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
                by_station: pose.by_station.iter().map(|rows| rows - &shown).collect(),
                by_task,
            }
        };
        (poses.iter().zip(self.gains().enumerate()))
            .map(of_pose)
            .collect()
    }

    /// C' of all test poses, each times the root of its weight, in the frame of a station.
    pub fn stacked(&self, poses: &[PlaceRows], station: usize) -> DMatrix<f64> {
        stacked(&self.place_rows(poses), station)
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

    /// What is known before any reading (p x p, in typical sizes), or before those that a plan chooses where these are by themselves.
    pub(super) fn known_before(&self) -> DMatrix<f64> {
        if self.functions.each.is_empty() {
            self.before.clone()
        } else {
            relative_precision(&self.set)
        }
    }

    /// A plan's readings with those that are known; none where no functions tie them.
    pub(super) fn tied(&self, plan: &[(usize, u32)]) -> Option<TiedReadings> {
        let functions = &self.functions;
        if functions.each.is_empty() {
            return None;
        }
        let all: Vec<(usize, u32)> = self.measured.iter().chain(plan).copied().collect();
        let groups = self.by_configuration(&all);
        let readings: Vec<&RepeatedReading> = groups.iter().flatten().collect();
        let points = readings
            .iter()
            .map(|each| &functions.candidates[each.place]);
        let points: Vec<&FunctionPoint> = points.collect();
        let mut covariance = DMatrix::zeros(6 * points.len(), 6 * points.len());
        let mut first = 0;
        for group in &groups {
            let own = self.covariance_of(group);
            covariance
                .view_mut((first, first), own.shape())
                .copy_from(&own);
            first += own.nrows();
        }
        for (row, one) in points.iter().enumerate() {
            for (column, other) in points.iter().enumerate() {
                let mut block = covariance.view_mut((6 * row, 6 * column), (6, 6));
                block += functions.between(one, other);
            }
        }
        let setups: Vec<_> = readings.iter().map(|each| self.setup(each.place)).collect();
        let mean = &self.set.prior().mean;
        let mut rows = DMatrix::zeros(6 * points.len(), self.set.len());
        let derivatives = planned_rows(&self.set, &self.case.arm, mean, &setups);
        for (place, each) in derivatives.iter().enumerate() {
            rows.rows_mut(6 * place, 6).copy_from(each);
        }
        let with_pose = |pose: &FunctionPoint| {
            let mut with = DMatrix::zeros(6 * points.len(), 3);
            for (place, point) in points.iter().enumerate() {
                with.rows_mut(6 * place, 6)
                    .copy_from(&functions.between(point, pose));
            }
            with
        };
        let with_poses: Vec<DMatrix<f64>> = functions.poses.iter().map(with_pose).collect();
        let precision = inverse_among(&covariance, &self.rows_of(readings));
        let count = functions.poses.len();
        let mut left = DMatrix::zeros(3 * count, 3 * count);
        for (row, one) in functions.poses.iter().enumerate() {
            let gain = with_poses[row].tr_mul(&precision);
            for (column, other) in functions.poses.iter().enumerate() {
                let own = functions.between(one, other) - &gain * &with_poses[column];
                left.view_mut((3 * row, 3 * column), (3, 3)).copy_from(&own);
            }
        }
        Some(TiedReadings {
            groups,
            precision,
            rows,
            with_poses,
            left,
        })
    }

    /// The predicted accuracy of a plan of so many readings whose readings are tied.
    pub(super) fn prediction_of(&self, tied: &TiedReadings, count: u32) -> PredictedAccuracy {
        let information = relative_precision(&self.set) + tied.weighed() * &tied.rows;
        let posterior = known_after(&self.set, &information);
        let poses = tied.place_rows(&self.poses);
        PredictedAccuracy {
            task_force_m: stacked_task(&self.poses).norm(),
            ..PredictedAccuracy::new(posterior, &poses, &self.set.scales(), count)
        }
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
        let points: Vec<&FunctionPoint> = points.collect();
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

    /// The errors that all readings of a plan share, each seen in its instrument's frame: those of configurations and visits, and the
    /// joints' functions.
    pub(super) fn tied_sharing(
        &self,
        groups: &[Vec<RepeatedReading>],
        frames: &[Isometry3<f64>],
    ) -> SharingReadings {
        let all: Vec<&RepeatedReading> = groups.iter().flatten().collect();
        let points = all
            .iter()
            .map(|each| &self.functions.candidates[each.place]);
        let points: Vec<&FunctionPoint> = points.collect();
        let roots = self.functions.roots(&points);
        let own = groups
            .iter()
            .map(|group| self.sharing(group, frames).effects);
        let own: Vec<Vec<Matrix6xX<f64>>> = own.collect();
        let width = |effects: &Vec<Matrix6xX<f64>>| effects.first().map_or(0, Matrix6xX::ncols);
        let before: usize = own.iter().map(width).sum();
        let mut effects = Vec::new();
        let mut first = 0;
        for of_group in &own {
            for each in of_group {
                let place = effects.len();
                let mut shared = Matrix6xX::zeros(before + roots.len() * all.len());
                shared.columns_mut(first, each.ncols()).copy_from(each);
                for (function, root) in roots.iter().enumerate() {
                    let own = points[place].columns.column(function);
                    let moved = Matrix6xX::from_fn(all.len(), |row, column| {
                        own[row] * root[(place, column)]
                    });
                    let frame = &frames[self.station_of(all[place].place)];
                    let moved = turned_columns(&moved, frame);
                    (shared.columns_mut(before + function * all.len(), all.len()))
                        .copy_from(&moved);
                }
                effects.push(shared);
            }
            first += width(of_group);
        }
        SharingReadings {
            readings: (0..all.len()).collect(),
            effects,
        }
    }

    /// How the joints' functions move the tool at each test pose (m, what counts, world frame) by the residuals of a plan's readings (3 x 6 n; m,
    /// rad, world frame), in the order of its configurations; none without functions.
    pub fn function_gains(&self, plan: &[(usize, u32)]) -> Vec<DMatrix<f64>> {
        let tied = self.tied(plan);
        tied.map_or_else(Vec::new, |tied| tied.gains().collect())
    }
}

/// The inverse of some rows and columns of a covariance, and nothing of all others.
pub(super) fn inverse_among(covariance: &DMatrix<f64>, kept: &[usize]) -> DMatrix<f64> {
    let among = DMatrix::from_fn(kept.len(), kept.len(), |row, column| {
        covariance[(kept[row], kept[column])]
    });
    let mut precision = DMatrix::zeros(covariance.nrows(), covariance.ncols());
    if let Some(factor) = Cholesky::new(among) {
        let inverse = factor.inverse();
        for (row, &to_row) in kept.iter().enumerate() {
            for (column, &to_column) in kept.iter().enumerate() {
                precision[(to_row, to_column)] = inverse[(row, column)];
            }
        }
    }
    precision
}
