//! Orientations of stations and targets from those of poses.
//!
//! ```text
//! sum |F X - B^T Y|^2 -> min      over matrices B, X of length sqrt(3)
//! ```
//!
//! is an eigenproblem: with x = vec(X) and b = vec(B^T) of each target and station, the matrix has the number of readings on
//! its diagonal blocks and -sum Y^T (x) F^T between target and station. Its smallest eigenvector is the answer, made
//! rotations again. Targets and stations that no reading ties together are problems of their own.

use nalgebra::{DMatrix, Isometry3, Matrix3, SymmetricEigen};

use super::{MountedFrames, Sight, isometry, nearest, positions};

/// Frames from orientations, with translations that fit them; none where there are none.
pub(super) fn solved(
    sights: &[Sight],
    stations: usize,
    tools: &[Isometry3<f64>],
) -> Option<MountedFrames> {
    let mut frames = MountedFrames {
        instrument_from_base: vec![Isometry3::identity(); stations],
        link_from_tool: tools.to_vec(),
    };
    for part in tied(sights, stations, tools.len()) {
        orient(&mut frames, sights, stations, &part)?;
    }
    positions::translate(&mut frames, sights, tools);
    Some(frames)
}

/// Stations, then targets, by the parts that readings tie together.
fn tied(sights: &[Sight], stations: usize, targets: usize) -> Vec<Vec<usize>> {
    let mut part: Vec<usize> = (0..stations + targets).collect();
    loop {
        let mut is_done = true;
        for sight in sights {
            let (one, other) = (sight.station, stations + sight.target);
            let least = part[one].min(part[other]);
            is_done &= part[one] == least && part[other] == least;
            part[one] = least;
            part[other] = least;
        }
        if is_done {
            break;
        }
    }
    (0..stations + targets)
        .map(|root| (0..part.len()).filter(|&node| part[node] == root).collect())
        .filter(|members: &Vec<usize>| members.len() > 1)
        .collect()
}

/// Sets the orientations of a part.
fn orient(
    frames: &mut MountedFrames,
    sights: &[Sight],
    stations: usize,
    part: &[usize],
) -> Option<()> {
    let place = |node: usize| part.iter().position(|&member| member == node);
    let mut matrix = DMatrix::<f64>::zeros(9 * part.len(), 9 * part.len());
    for sight in sights {
        let (Some(station), Some(target)) = (place(sight.station), place(stations + sight.target))
        else {
            continue;
        };
        let link = sight.base_from_link.rotation.to_rotation_matrix();
        let product = sight
            .rotation?
            .transpose()
            .kronecker(&link.matrix().transpose())
            * sight.weight;
        let (station, target) = (9 * station, 9 * target);
        for row in 0..9 {
            matrix[(station + row, station + row)] += sight.weight;
            matrix[(target + row, target + row)] += sight.weight;
        }
        let mut beside = matrix.fixed_view_mut::<9, 9>(target, station);
        beside -= product;
        let mut beside = matrix.fixed_view_mut::<9, 9>(station, target);
        beside -= product.transpose();
    }
    if !matrix.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(matrix);
    let vector = eigen
        .eigenvectors
        .column(eigen.eigenvalues.imin())
        .into_owned();
    let blocks: Vec<Matrix3<f64>> = (0..part.len())
        .map(|index| Matrix3::from_iterator(vector.rows(9 * index, 9).iter().copied()))
        .collect();
    let determinants = blocks.iter().map(Matrix3::determinant);
    let sign = determinants.sum::<f64>().signum();
    for (&node, block) in part.iter().zip(&blocks) {
        let rotation = nearest(&(block * sign));
        if let Some(target) = node.checked_sub(stations) {
            let tool = &mut frames.link_from_tool[target];
            *tool = isometry(&rotation, tool.translation.vector);
        } else {
            let base = &mut frames.instrument_from_base[node];
            *base = isometry(&rotation.inverse(), base.translation.vector);
        }
    }
    Some(())
}
