//! A run of the paper's linear model: the noise of a run, multiplied by two matrices.
//!
//! With A the observation matrices of all measurements stacked (3M x p), sigma eps the noise and
//! A_0 those of the test poses, eqs. 9 and 15 leave, for measurements with such noise (eq. 10), the errors
//! of eq. 11, whose means are zero (eq. 16)
//!
//! ```text
//! dk = (A^T A)^-1 A^T sigma eps,      d = A_0 dk = B eps
//! ```
//!
//! The information matrix is factored, A^T A = L L^T, so that
//!
//! ```text
//! z = L^-1 A^T eps  (p standard normals),   d / sigma = (A_0 L^-T) z,   NEES = z^T z
//! ```
//!
//! and with S = B B^T / sigma^2 = (A_0 L^-T)(A_0 L^-T)^T, the squared distance has the mean
//! `rho_0^2` = sigma^2 trace(S) (eqs. 17 to 20) and the variance 2 sigma^4 trace(S^2). Several test poses
//! are stacked, each times the root of its weight.
//!
//! Where a plan does not determine all compliances, A and A_0 are those of what it does determine, in
//! r < p coordinates; a plan that leaves undetermined what a test pose needs makes no runs.
//!
//! A joint that is not identified is taken to have its nominal compliance. Where the virtual robot's
//! is another by u, with the observation matrices A' and `A_0`' of these joints, A' u adds to sigma
//! eps, and -`A_0`' u to d: the mean square then has the square of the bias c = (B A' / sigma - `A_0`') u
//! in addition, and the variance 4 sigma^2 c^T S c.

use multiversion::multiversion;
use nalgebra::{DMatrix, DMatrixViewMut, DVector};

use super::deviations::Deviations;
use super::tally::{Batch, Failure};
use crate::compensation::{test_pose_rows, weighted_rows};
use crate::numeric::estimable::Estimable;
use crate::numeric::random::normal::LANES;
use crate::plan::{Experiment, ExperimentModel, Plan, as_repeats, sharing_groups};
use crate::task::Task;
use crate::testbed::Truth;

/// The most unknowns that a run can have.
const MOST: usize = 480;
/// Up to so many, less memory is cleared in each run.
const FEW: usize = 12;
/// The same for more.
const SOME: usize = 96;

/// Three rows of a matrix, column by column.
type ThreeRows = Vec<[f64; 3]>;

/// What all plans of a study have in common.
#[derive(Debug, Clone)]
pub struct LinearModel<'a> {
    experiments: ExperimentModel<'a>,
    /// A_0 of all test poses, each times the root of its weight, stacked.
    test_poses: DMatrix<f64>,
    /// The typical sizes of the unknowns.
    typical: Vec<f64>,
    /// The precision of what is known of the unknowns before, times sigma^2.
    prior: Option<DMatrix<f64>>,
    /// What the virtual robot may differ in.
    deviations: Deviations<'a>,
    /// The rows `A_0`' of what of that the belief's vector does not have.
    test_poses_foreign: DMatrix<f64>,
}

impl<'a> LinearModel<'a> {
    /// The linear model of a task and a virtual robot.
    pub fn new(task: &'a Task, truth: &Truth) -> Self {
        let belief = &task.belief;
        let deviations = Deviations::new(belief, truth);
        let sizes = belief.sizes();
        let sigma_m = belief.instrument.sigma_m;
        Self {
            experiments: ExperimentModel::new(belief),
            test_poses: weighted_rows(&task.test_poses, sizes.len(), &|pose| {
                test_pose_rows(belief, pose)
            }),
            prior: Some(belief.precision() * sigma_m.powi(2)).filter(|each| each.amax() > 0.0),
            typical: sizes,
            test_poses_foreign: deviations.test_poses(task),
            deviations,
        }
    }

    /// What the virtual robot may differ in.
    pub const fn deviations(&self) -> &Deviations<'a> {
        &self.deviations
    }

    /// Prepares a plan.
    ///
    /// # Errors
    /// The plan does not determine what the test poses need.
    pub fn plan(&self, plan: &Plan) -> Result<PlanModel, Failure> {
        let plan = &*as_repeats(plan, &self.experiments.belief.uncertain);
        let groups = sharing_groups(plan, self.deviations.is_shared_by_configuration());
        let observed = self.observed(&groups);
        let counted = self.counted(&observed, &groups);
        let mut all = &counted * counted.transpose();
        if let Some(prior) = &self.prior {
            all += prior;
        }
        let part = self.determined_part(&all);
        let (information, test_poses) = match &part {
            None => (all, self.test_poses.clone()),
            Some((_, basis)) => (basis.tr_mul(&all) * basis, &self.test_poses * basis),
        };
        let size = information.nrows();
        let factor = information
            .cholesky()
            .filter(|_| (1..=MOST).contains(&size))
            .ok_or(Failure::Undetermined)?
            .unpack();
        let whitened = |mut columns: DMatrix<f64>| {
            let is_regular = factor.solve_lower_triangular_mut(&mut columns);
            is_regular.then_some(columns).ok_or(Failure::Undetermined)
        };
        let mut columns = whitened(within(part.as_ref(), &observed))?;
        let foreign = self.deviations.foreign();
        let mut biases = DMatrix::zeros(size, self.deviations.count());
        let is_coloured = self.disturb(&groups, &mut columns, &mut biases.columns_mut(0, foreign));
        // What is known before draws towards the nominal values: a column for each that it knows of.
        if let Some(prior) = &self.prior {
            let drawn = -prior.select_columns(&self.deviations.tied());
            let drawn = whitened(within(part.as_ref(), &drawn))?;
            (biases.columns_mut(foreign, drawn.ncols())).copy_from(&drawn);
        }
        let errors = whitened(test_poses.transpose())?;
        if let Some((estimable, _)) = &part
            && !self.determines_test_poses(estimable, &errors)
        {
            return Err(Failure::Undetermined);
        }
        let mut test_poses_unknown = -&self.test_poses_foreign;
        test_poses_unknown = test_poses_unknown.resize_horizontally(biases.ncols(), 0.0);
        // Rows beyond p are zero: they fill up threes.
        let padded = size.next_multiple_of(3);
        let whitener = self.whitener(&groups, &columns, &biases, padded);
        let compensation = compensation_rows(&errors, &test_poses_unknown, padded);
        let bias = errors.tr_mul(&biases) + test_poses_unknown;
        // Of the whitened noise, whose covariance is none of ones where something is known before, or where the noise is another than
        // is believed.
        let errors = if is_coloured || self.prior.is_some() {
            (self.counted(&columns, &groups)).tr_mul(&errors)
        } else {
            errors
        };
        // E^T E or E E^T, whichever is smaller: their traces and norms are the same.
        let covariance = if errors.ncols() > errors.nrows() {
            &errors * errors.transpose()
        } else {
            errors.tr_mul(&errors)
        };
        Ok(PlanModel {
            whitener,
            compensation,
            freedom: size,
            expected: covariance.trace(),
            variance: 2.0 * covariance.norm_squared(),
            bias,
            errors,
        })
    }

    /// A^T (p x n), the experiments of one configuration beside each other.
    fn observed(&self, groups: &[Vec<&Experiment>]) -> DMatrix<f64> {
        let rows = self.experiments.rows();
        let mut readings = self.experiments.readings();
        let count: usize = groups.iter().map(Vec::len).sum();
        let mut observed = DMatrix::zeros(readings.parameters(), rows * count);
        let each = (groups.iter())
            .flat_map(|group| (self.experiments).observation_matrices_of(&mut readings, group));
        for (place, each) in each.enumerate() {
            (observed.columns_mut(rows * place, rows)).copy_from(&each.transpose());
        }
        observed
    }

    /// Columns of experiments as often as these are repeated: times the roots of their repeats.
    fn counted(&self, columns: &DMatrix<f64>, groups: &[Vec<&Experiment>]) -> DMatrix<f64> {
        let rows = self.experiments.rows();
        let mut counted = columns.clone();
        for (place, experiment) in groups.iter().flatten().enumerate() {
            let mut own = counted.columns_mut(rows * place, rows);
            own *= f64::from(experiment.repeats).sqrt();
        }
        counted
    }

    /// Makes whitened columns L^-1 A^T those of the noise as it is in truth, and adds what foreign parameters do to the biases; whether the
    /// noise is another than is believed.
    fn disturb(
        &self,
        groups: &[Vec<&Experiment>],
        columns: &mut DMatrix<f64>,
        biases: &mut DMatrixViewMut<'_, f64>,
    ) -> bool {
        let (rows, deviations) = (self.experiments.rows(), &self.deviations);
        let mut is_coloured = false;
        let mut first = 0;
        for group in groups {
            let mut all = columns.columns_mut(first, rows * group.len());
            first += rows * group.len();
            if biases.ncols() > 0 {
                let foreign = deviations.observation_matrices(&self.experiments, group);
                for (place, (experiment, own)) in group.iter().zip(foreign).enumerate() {
                    let seen = all.columns(rows * place, rows) * own;
                    *biases += seen * f64::from(experiment.repeats);
                }
            }
            if let Some(half) = deviations.coloured(group) {
                let coloured = &all * half;
                all.copy_from(&coloured);
                is_coloured = true;
            }
        }
        is_coloured
    }

    /// L^-1 A^T, as often as experiments are repeated, beside the biases, three rows at a time: the noise of all deflections comes before
    /// that of all rotations.
    fn whitener(
        &self,
        groups: &[Vec<&Experiment>],
        columns: &DMatrix<f64>,
        biases: &DMatrix<f64>,
        padded: usize,
    ) -> Vec<ThreeRows> {
        let rows = self.experiments.rows();
        let [columns, biases] = [columns, biases].map(|all| {
            let all = all.clone();
            all.resize_vertically(padded, 0.0)
        });
        let of_threes = |first: usize| {
            let all: ThreeRows = threes(&columns, first).collect();
            let each = || {
                let numbered = groups.iter().flatten().zip(all.chunks_exact(rows));
                let repeated = numbered
                    .flat_map(|(experiment, own)| (0..experiment.repeats).map(move |_| own));
                repeated.map(|own| own.split_at(3))
            };
            let (deflections, rotations) = (each().map(|own| own.0), each().map(|own| own.1));
            let noise = deflections.chain(rotations).flatten().copied();
            noise.chain(threes(&biases, first)).collect()
        };
        (0..padded).step_by(3).map(of_threes).collect()
    }

    /// What a plan determines, and its basis in rad/(N m), where that is not everything.
    fn determined_part(&self, information: &DMatrix<f64>) -> Option<(Estimable, DMatrix<f64>)> {
        let sigma_m = self.experiments.belief.instrument.sigma_m;
        let typical = &self.typical;
        let relative = DMatrix::from_fn(typical.len(), typical.len(), |row, column| {
            information[(row, column)] * (typical[row] / sigma_m) * (typical[column] / sigma_m)
        });
        if Estimable::surely_all(&relative) {
            return None;
        }
        let estimable = Estimable::new(&relative, typical);
        if estimable.is_complete() {
            return None;
        }
        let basis = estimable.basis_in_units();
        Some((estimable, basis))
    }

    /// Whether that is what each test pose needs; `errors` are L^-1 `A_0^T` of all of them.
    fn determines_test_poses(&self, estimable: &Estimable, errors: &DMatrix<f64>) -> bool {
        (0..errors.ncols()).step_by(3).all(|first| {
            let variance = errors.columns(first, 3).norm_squared();
            let error_m = variance.sqrt() * self.experiments.belief.instrument.sigma_m;
            let rows = self.test_poses.rows(first, 3).into_owned();
            estimable.missing(&rows, error_m).is_empty()
        })
    }
}

/// `A_0` L^-T from L^-1 `A_0^T`, filled up with zeros, beside the rows of what is unknown: three rows for each test pose.
fn compensation_rows(
    errors: &DMatrix<f64>,
    unknown: &DMatrix<f64>,
    padded: usize,
) -> Vec<ThreeRows> {
    let transposed = errors.transpose().resize_horizontally(padded, 0.0);
    let rows = |pose: usize| {
        let known = threes(&transposed, 3 * pose);
        known.chain(threes(unknown, 3 * pose)).collect()
    };
    (0..errors.ncols() / 3).map(rows).collect()
}

/// Columns of parameters in coordinates of what is determined.
fn within(part: Option<&(Estimable, DMatrix<f64>)>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    match part {
        None => columns.clone(),
        Some((_, basis)) => basis.tr_mul(columns),
    }
}

/// Three rows of a matrix from `first`, column by column.
fn threes(matrix: &DMatrix<f64>, first: usize) -> impl Iterator<Item = [f64; 3]> {
    (matrix.column_iter()).map(move |column| std::array::from_fn(|row| column[first + row]))
}

/// A plan made ready for runs; distances are in sigma.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanModel {
    /// L^-1 A^T beside L^-1 A^T A', three rows at a time.
    whitener: Vec<ThreeRows>,
    /// `A_0` L^-T beside -`A_0`', three rows for each test pose.
    compensation: Vec<ThreeRows>,
    /// The number r of combinations of compliances that the plan determines.
    freedom: usize,
    /// trace(S), the predicted mean square.
    pub expected: f64,
    /// 2 trace(S^2), its variance from run to run.
    pub variance: f64,
    /// B A' / sigma - `A_0`'.
    bias: DMatrix<f64>,
    /// What the noise alone leaves, E: its covariance is E^T E.
    errors: DMatrix<f64>,
}

impl PlanModel {
    /// Several runs at once, from their standard normals (3M numbers of each, 6M where rotations are
    /// measured; more are left alone) and what [`Deviations::values`] gives.
    pub fn run(&self, normals: &[[f64; LANES]], unknown: &[[f64; LANES]]) -> Batch {
        let mut batch = Batch::default();
        self.run_into(&mut batch, normals, unknown);
        batch
    }

    /// The same in the place of what a batch had.
    pub fn run_into(&self, batch: &mut Batch, normals: &[[f64; LANES]], unknown: &[[f64; LANES]]) {
        (batch.square, batch.nees) = run(&self.whitener, &self.compensation, normals, unknown);
        batch.expected = [self.expected; LANES];
        batch.variance = [self.variance; LANES];
        batch.freedom = [self.freedom; LANES];
        batch.intervals = [[0; 2]; LANES];
        batch.failed = [None; LANES];
        if !unknown.is_empty() {
            for lane in 0..LANES {
                let unknown = DVector::from_fn(unknown.len(), |row, _| unknown[row][lane]);
                let bias = &self.bias * unknown;
                batch.expected[lane] += bias.norm_squared();
                batch.variance[lane] += 4.0 * (&self.errors * bias).norm_squared();
            }
        }
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512dq+avx512vl+fma",
    "x86_64+avx2+fma",
    "aarch64+neon"
))]
fn run(
    whitener: &[ThreeRows],
    compensation: &[ThreeRows],
    normals: &[[f64; LANES]],
    unknown: &[[f64; LANES]],
) -> ([f64; LANES], [f64; LANES]) {
    if 3 * whitener.len() <= FEW {
        run_up_to::<FEW>(whitener, compensation, normals, unknown)
    } else if 3 * whitener.len() <= SOME {
        run_up_to::<SOME>(whitener, compensation, normals, unknown)
    } else {
        run_up_to::<MOST>(whitener, compensation, normals, unknown)
    }
}

#[inline(always)]
fn run_up_to<const SIZE: usize>(
    whitener: &[ThreeRows],
    compensation: &[ThreeRows],
    normals: &[[f64; LANES]],
    unknown: &[[f64; LANES]],
) -> ([f64; LANES], [f64; LANES]) {
    let mut whitened = [[0.0; LANES]; SIZE];
    let mut nees = [0.0; LANES];
    for (rows, three) in whitener.iter().zip(whitened.chunks_exact_mut(3)) {
        let (known, others) = rows.split_at(rows.len() - unknown.len());
        let mut product = [[0.0; LANES]; 3];
        add_product(known, normals, &mut product);
        add_product(others, unknown, &mut product);
        add_squares(&product, &mut nees);
        three.copy_from_slice(&product);
    }
    let mut square = [0.0; LANES];
    for rows in compensation {
        let (known, others) = rows.split_at(rows.len() - unknown.len());
        let mut product = [[0.0; LANES]; 3];
        add_product(known, &whitened, &mut product);
        add_product(others, unknown, &mut product);
        add_squares(&product, &mut square);
    }
    (square, nees)
}

/// Adds three rows times as many columns as there are.
#[inline(always)]
fn add_product(rows: &[[f64; 3]], columns: &[[f64; LANES]], sum: &mut [[f64; LANES]; 3]) {
    let [mut x, mut y, mut z] = *sum;
    for ([a, b, c], column) in rows.iter().zip(columns) {
        for lane in 0..LANES {
            x[lane] = a.mul_add(column[lane], x[lane]);
            y[lane] = b.mul_add(column[lane], y[lane]);
            z[lane] = c.mul_add(column[lane], z[lane]);
        }
    }
    *sum = [x, y, z];
}

#[inline(always)]
fn add_squares(vectors: &[[f64; LANES]; 3], sum: &mut [f64; LANES]) {
    for vector in vectors {
        for lane in 0..LANES {
            sum[lane] = vector[lane].mul_add(vector[lane], sum[lane]);
        }
    }
}
