//! The predicted accuracy of a plan of absolute readings.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3};

use crate::numeric::estimable::Estimable;
use crate::numeric::posterior::Posterior;
use crate::numeric::tolerance::length_quantile;
use crate::parameter::ParameterSet;

/// The predicted accuracy of a plan of absolute readings.
#[derive(Debug, Clone)]
pub struct PredictedAccuracy {
    /// The number of readings.
    pub readings: u32,
    /// The station in whose frame the tool's place counts, by its number: that which leaves least.
    pub station: usize,
    /// The rms distance (m) over the test poses; or the unknowns that they need and that are not determined.
    pub left: Result<f64, Vec<String>>,
    /// What 95 % stay below (m).
    pub quantile95_m: Option<f64>,
    /// The variance of the squared distance (m^4), weighted over the test poses, of normal errors.
    pub square_variance_m4: Option<f64>,
    /// The rms distance (m) at each test pose.
    pub poses_m: Vec<Option<f64>>,
    /// The covariance (m^2) of what counts of the place at each test pose, in the world frame.
    pub places_m2: Vec<Option<Matrix3<f64>>>,
    /// Of that distance, what the task's uncertain force makes by itself (m): no reading shows it.
    pub task_force_m: f64,
    /// What is known after it.
    pub posterior: Posterior,
}

/// How the tool's place at a test pose follows what nobody knows, what counts of it.
#[derive(Debug, Clone)]
pub(super) struct PlaceRows {
    /// The weight of the test pose.
    pub weight: f64,
    /// C (3 x p, m in typical sizes), in the frame of each station that may count, by its number.
    pub by_station: BTreeMap<usize, DMatrix<f64>>,
    /// By the task's force (3 x t, m in standard deviations), which is off whatever is read.
    pub by_task: DMatrix<f64>,
}

/// Rows of all test poses (3 m x p), each times the root of its weight: C in the frame of a station, or by the task's force.
fn joined<'p>(
    poses: &'p [PlaceRows],
    rows: impl Fn(&'p PlaceRows) -> &'p DMatrix<f64>,
) -> DMatrix<f64> {
    let columns = poses.first().map_or(0, |pose| rows(pose).ncols());
    let mut all = DMatrix::zeros(3 * poses.len(), columns);
    for (index, pose) in poses.iter().enumerate() {
        let block = rows(pose) * pose.weight.sqrt();
        all.rows_mut(3 * index, 3).copy_from(&block);
    }
    all
}

/// C of all test poses (3 m x p), each times the root of its weight, in the frame of a station.
pub(super) fn stacked(poses: &[PlaceRows], station: usize) -> DMatrix<f64> {
    joined(poses, |pose| &pose.by_station[&station])
}

/// The same by the task's force (3 m x t).
pub(super) fn stacked_task(poses: &[PlaceRows]) -> DMatrix<f64> {
    joined(poses, |pose| &pose.by_task)
}

/// Rows in typical sizes by the parameters' own units.
pub(super) fn in_units(mut rows: DMatrix<f64>, scales: &DVector<f64>) -> DMatrix<f64> {
    for (mut column, scale) in rows.column_iter_mut().zip(scales) {
        column /= *scale;
    }
    rows
}

/// What is known after readings that tell so much, with what was known before (p x p, in typical sizes).
pub(super) fn known_after(set: &ParameterSet, information: &DMatrix<f64>) -> Posterior {
    let estimable = Estimable::new(information, set.scales().as_slice());
    let within = estimable.basis().tr_mul(information) * estimable.basis();
    let size = within.nrows();
    let inverse =
        (within.cholesky()).map_or_else(|| DMatrix::zeros(size, size), |factor| factor.inverse());
    let units = estimable.basis_in_units();
    Posterior {
        names: (set.parameters().iter())
            .map(|each| each.name.clone())
            .collect(),
        mean: set.prior().mean.as_slice().to_vec(),
        covariance: &units * inverse * units.transpose(),
        estimable,
    }
}

impl PredictedAccuracy {
    /// In the frame of the station where least is left.
    pub(super) fn new(
        posterior: Posterior,
        poses: &[PlaceRows],
        scales: &DVector<f64>,
        readings: u32,
    ) -> Self {
        let stations = poses
            .first()
            .into_iter()
            .flat_map(|pose| pose.by_station.keys());
        let left_in = |station: usize| {
            let rows = in_units(stacked(poses, station), scales);
            posterior.variance_of(&rows).map(|square| (square, rows))
        };
        let mut best = Err(Vec::new());
        for (station, left) in stations.map(|&station| (station, left_in(station))) {
            match (&mut best, left) {
                (Ok((_, least, _)), Ok((square, _))) if square >= *least => {}
                (best, Ok((square, rows))) => *best = Ok((station, square, rows)),
                (Err(names), Err(lacking)) if names.is_empty() => *names = lacking.parameters,
                _ => {}
            }
        }
        let task = stacked_task(poses);
        let first = poses.first().and_then(|pose| pose.by_station.keys().next());
        let station = best
            .as_ref()
            .map_or(first.copied().unwrap_or(0), |(station, ..)| *station);
        // The rms distance, and the covariance in the world frame.
        let of_pose = |pose: &PlaceRows| {
            let rows = in_units(pose.by_station[&station].clone(), scales);
            let square = posterior.variance_of(&rows).ok()?;
            let known = &rows * &posterior.covariance * rows.transpose();
            let task = &pose.by_task * pose.by_task.transpose();
            let place: Matrix3<f64> = (known + task).fixed_view::<3, 3>(0, 0).into();
            Some(((square + pose.by_task.norm_squared()).sqrt(), place))
        };
        let (poses_m, places_m2) = poses.iter().map(|pose| of_pose(pose).unzip()).unzip();
        let covariance = best.as_ref().ok().map(|(_, _, rows)| {
            rows * &posterior.covariance * rows.transpose() + &task * task.transpose()
        });
        Self {
            readings,
            station,
            quantile95_m: covariance
                .as_ref()
                .and_then(|each| length_quantile(each, 0.95)),
            square_variance_m4: covariance.map(|covariance| 2.0 * covariance.norm_squared()),
            left: best.map(|(_, square, _)| (square + task.norm_squared()).sqrt()),
            poses_m,
            places_m2,
            task_force_m: task.norm(),
            posterior,
        }
    }

    /// The rms distance (m) over the test poses; none where they need what is not determined.
    pub fn rho0_m(&self) -> Option<f64> {
        self.left.as_ref().ok().copied()
    }
}
