//! The rows of B, a factor of what an approximate design's directional derivative is: d(x) = |A(x) B^T|^2 in relative
//! units, trace(A G A^T) with G = B^T B.

use super::approximate::ApproximateDesign;
use super::problem::Problem;
use crate::task::{Task, TestPose};

/// The rows of B for the joints' `tau_n` `J_n` as they are (per N m^2), for an approximate design of a problem's test poses;
/// `None` where its information is singular.
pub(super) fn bound_rows(
    problem: &Problem<'_>,
    approximate: &ApproximateDesign,
) -> Option<Vec<Vec<f64>>> {
    let information = approximate.information(problem);
    let solved = information.cholesky()?.solve(&problem.test_poses);
    // Columns are the rows of B; from coordinates of the basis to compliances: B is then that of the combinations that show.
    let columns = match &problem.basis {
        Some(basis) => basis * solved,
        None => solved,
    };
    let sigma_m = problem.task.belief.instrument.sigma_m;
    let row = |column: nalgebra::DVectorView<'_, f64>| {
        let values = column.iter().zip(&problem.sizes);
        values
            .map(|(value, typical)| value * typical / sigma_m)
            .collect()
    };
    let rows: Vec<Vec<f64>> = columns.column_iter().map(row).collect();
    let is_finite = (rows.iter().flatten()).all(|value| value.is_finite());
    is_finite.then(|| directed(problem.task, &rows))
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
