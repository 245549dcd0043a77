//! The rows of B, a factor of what an approximate design's directional derivative is: d(x) = |A(x) B^T|^2 in relative
//! units, trace(A G A^T) with G = B^T B; and what a bound of d bounds by them.

use nalgebra::DMatrix;

use super::approximate::ApproximateDesign;
use super::problem::Problem;
use crate::numeric::factorisation::finite_eigen;
use crate::plan::Criterion;
use crate::plan::proof::Aim;
use crate::task::{Task, TestPose};

/// Eigenvalues of G, and weights of variances, below this share of the largest are left out: any G gives a bound.
const NOTHING: f64 = 1e-9;

/// The rows of B for the joints' `tau_n` `J_n` as they are (per N m^2), and what they are made for.
pub(super) struct BoundRows {
    pub rows: Vec<Vec<f64>>,
    pub aim: Aim,
}

impl BoundRows {
    /// For an approximate design of a problem's criterion; `None` where its information is singular.
    pub fn new(problem: &Problem<'_>, approximate: &ApproximateDesign) -> Option<Self> {
        let information = approximate.information(problem);
        // Columns are the rows of B.
        let (columns, aim) = match problem.criterion.bounded_as()? {
            Criterion::TestPose => {
                let solved = information.cholesky()?.solve(problem.test_poses());
                // From coordinates of the basis to compliances: B is then that of the combinations that show.
                let solved = match problem.basis() {
                    Some(basis) => basis * solved,
                    None => solved,
                };
                (solved, Aim::TestPoses)
            }
            // The others are about all compliances.
            _ if problem.basis().is_some() => return None,
            criterion => of_all(criterion, &information, approximate)?,
        };
        let sigma_m = problem.task.belief.instrument.sigma_m;
        let row = |column: nalgebra::DVectorView<'_, f64>| {
            let values = column.iter().zip(problem.typical_rad_per_nm());
            values
                .map(|(value, typical)| value * typical / sigma_m)
                .collect()
        };
        let rows: Vec<Vec<f64>> = columns.column_iter().map(row).collect();
        let is_finite = (rows.iter().flatten()).all(|value| value.is_finite());
        let rows = match aim {
            Aim::TestPoses => directed(problem.task, &rows),
            _ => rows,
        };
        is_finite.then_some(Self { rows, aim })
    }
}

/// The rows of B, of which test poses with a direction n need one: n^T times theirs.
fn directed(task: &Task, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let poses = task.test_poses.iter().zip(rows.chunks(3));
    let of_pose = |(pose, three): (&TestPose, &[Vec<f64>])| match pose.direction {
        None => three.to_vec(),
        Some(direction) => {
            let along = |parameter: usize| {
                let parts = three.iter().zip(&direction);
                parts.map(|(row, n)| n * row[parameter]).sum()
            };
            vec![(0..three[0].len()).map(along).collect()]
        }
    };
    poses.flat_map(of_pose).collect()
}

fn of_all(
    criterion: Criterion,
    information: &DMatrix<f64>,
    approximate: &ApproximateDesign,
) -> Option<(DMatrix<f64>, Aim)> {
    let size = information.nrows();
    let factor = information.clone().cholesky()?;
    let directions = &approximate.directions;
    Some(match criterion {
        // G = M^-2
        Criterion::A => (factor.inverse(), Aim::TotalVariance),
        // G = cost M^-1 / p = B^T B with B = root L^-1 for M = L L^T, which is lower triangular.
        Criterion::D => {
            let root = (approximate.certificate.cost / size as f64).sqrt();
            let lower = factor.l();
            let inverse = lower.solve_lower_triangular(&DMatrix::identity(size, size))?;
            (
                inverse.lower_triangle().transpose() * root,
                Aim::Determinant,
            )
        }
        // G = sum of c_j^2 of the columns of M^-1 times themselves, with weights c_j^2 of sum 1.
        Criterion::G => {
            let inverse = factor.inverse();
            let weights = (information * directions * information).diagonal();
            let least = NOTHING * weights.max();
            let kept: Vec<(usize, f64)> = (weights.iter().enumerate())
                .filter(|(_, weight)| **weight > least)
                .map(|(index, weight)| (index, weight.sqrt()))
                .collect();
            let columns: Vec<_> = (kept.iter())
                .map(|&(index, root)| inverse.column(index) * root)
                .collect();
            (DMatrix::from_columns(&columns), Aim::LargestVariance(kept))
        }
        Criterion::E => {
            let eigen = finite_eigen(directions)?;
            let least = NOTHING * eigen.eigenvalues.max();
            let pairs = (eigen.eigenvalues.iter()).zip(eigen.eigenvectors.column_iter());
            let columns: Vec<_> = pairs
                .filter(|(value, _)| **value > least)
                .map(|(value, vector)| vector * value.sqrt())
                .collect();
            (DMatrix::from_columns(&columns), Aim::SmallestEigenvalue)
        }
        // G = trace(M^-1/2) M^-3/2
        Criterion::O5 => {
            let eigen = finite_eigen(information)?;
            let root = eigen.eigenvalues.map(|value| value.powf(-0.5)).sum().sqrt();
            let powers = eigen.eigenvalues.map(|value| root * value.powf(-0.75));
            let vectors = &eigen.eigenvectors;
            let columns = vectors * DMatrix::from_diagonal(&powers) * vectors.transpose();
            (columns, Aim::InverseRoots)
        }
        _ => return None,
    })
}
