//! Model discrepancy: residuals beyond the noise of the readings.

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};

use crate::measurement::{Measurement, by_experiment};
use crate::numeric::tolerance::ends;

/// So often readings are weighed anew by what a fit leaves before the last time; the third time changes next to nothing.
pub(super) const WEIGHINGS: usize = 3;

/// A reading less its prediction, in the instrument's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadingResidual {
    /// Of the position (m); of a distance, or of what is along a direction, the first coordinate.
    pub position_m: Vector3<f64>,
    /// How many coordinates of the position were read: three, or that one.
    pub coordinates: usize,
    /// Of the orientation, a rotation vector (rad), where poses are read.
    pub rotation_rad: Option<Vector3<f64>>,
}

impl ReadingResidual {
    /// Of the rows of a reading: one, three or six.
    pub(super) fn of_rows(rows: &DVector<f64>) -> Self {
        Self {
            position_m: three_rows(rows, 0),
            coordinates: rows.len().min(3),
            rotation_rad: (rows.len() > 3).then(|| three_rows(rows, 3)),
        }
    }

    /// Of the position (0) or of the rotation (1), with how many coordinates of it were read; none of what was not read.
    pub(super) fn part(&self, part: usize) -> Option<(Vector3<f64>, usize)> {
        match part {
            0 => Some((self.position_m, self.coordinates)),
            _ => Some((self.rotation_rad?, 3)),
        }
    }
}

/// Three rows of a reading from one of them on; zeros where it has fewer.
pub(super) fn three_rows(rows: &DVector<f64>, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| rows.get(first + axis).copied().unwrap_or(0.0))
}

/// The covariance of the rows that a reading has, as one of six; zeros where it has fewer.
pub(super) fn six_rows(covariance: &DMatrix<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|row, column| covariance.get((row, column)).copied().unwrap_or(0.0))
}

/// The standard deviations of what no parameter explains, of each coordinate of a position (m) and of a rotation vector (rad): by how much
/// residuals are larger than the readings' own covariances (m^2, m rad, rad^2) make them. `spare` is the share of the numbers that was not
/// used up by the fit: degrees of freedom over numbers.
pub(super) fn discrepancy_of(
    left: &[ReadingResidual],
    covariances: &[Matrix6<f64>],
    spare: f64,
) -> [f64; 2] {
    [0, 1].map(|part| {
        let (mut all, mut own, mut count) = (0.0, 0.0, 0.0);
        for (left, covariance) in left.iter().zip(covariances) {
            if let Some((left, coordinates)) = left.part(part) {
                let first = 3 * part;
                all += left.norm_squared();
                own += (first..first + coordinates)
                    .map(|row| covariance[(row, row)])
                    .sum::<f64>();
                count += coordinates as f64;
            }
        }
        ((all / spare - own) / f64::max(count, 1.0)).max(0.0).sqrt()
    })
}

/// Measured deflections with standard deviations that count a discrepancy; `sigma_m` is that of deflections which bring none of their own.
/// Repeats of one experiment share a discrepancy s: each of r counts r s^2 besides its own variance, so that their mean has s^2.
pub fn with_discrepancy(
    [position_m, rotation_rad]: [f64; 2],
    measurements: &[Measurement],
    sigma_m: f64,
) -> Vec<Measurement> {
    let mut all = measurements.to_vec();
    for (each, [deflections, rotations]) in all.iter_mut().zip(repeats(measurements)) {
        let own = each.sigma_m.unwrap_or_else(|| Vector3::repeat(sigma_m));
        let more = position_m * deflections.sqrt();
        each.sigma_m = Some(own.map(|own| own.hypot(more)));
        if let Some(rotation) = &mut each.rotation {
            let more = rotation_rad * rotations.sqrt();
            rotation.sigma_rad = rotation.sigma_rad.map(|own| own.hypot(more));
        }
    }
    all
}

/// The covariance of a discrepancy in a reading: position above rotation (m^2, rad^2).
pub(super) fn discrepancy_covariance(discrepancy: [f64; 2]) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::from_fn(|row, _| discrepancy[row / 3].powi(2)))
}

/// For each measurement how many are of its experiment, itself among them: deflections and rotations.
pub(super) fn repeats(measurements: &[Measurement]) -> Vec<[f64; 2]> {
    let mut repeats = vec![[0.0; 2]; measurements.len()];
    for members in by_experiment(measurements) {
        let rotations = (members.iter()).filter(|&&each| measurements[each].rotation.is_some());
        let counts = [members.len() as f64, rotations.count() as f64];
        for each in members {
            repeats[each] = counts;
        }
    }
    repeats
}

/// Parts of joint space: the number of the block of each configuration (rad; m where joints slide). The largest block is cut
/// in halves along the joint that moves furthest in it, until there are `count` or none has two different configurations.
/// Discrepancy is alike where configurations are; what is judged by other blocks than it was fitted to is judged elsewhere.
pub(super) fn joint_space_blocks(configurations: &[&DVector<f64>], count: usize) -> Vec<usize> {
    let mut blocks: Vec<Vec<usize>> = vec![(0..configurations.len()).collect()];
    while blocks.len() < count {
        let cut = (blocks.iter().enumerate())
            .filter_map(|(place, block)| widest(configurations, block).map(|joint| (place, joint)))
            .max_by_key(|(place, _)| (blocks[*place].len(), std::cmp::Reverse(*place)));
        let Some((place, joint)) = cut else {
            break;
        };
        let block = &mut blocks[place];
        let angle = |index: usize| configurations[index][joint];
        block.sort_by(|&one, &other| angle(one).total_cmp(&angle(other)).then(one.cmp(&other)));
        // Equal angles stay together: the change next to the middle.
        let middle = block.len() / 2;
        let is_change = |&at: &usize| angle(block[at - 1]) < angle(block[at]);
        let change = (1..block.len())
            .filter(is_change)
            .min_by_key(|at| at.abs_diff(middle));
        let other = block.split_off(change.unwrap_or(middle));
        blocks.push(other);
    }
    let mut block_of = vec![0; configurations.len()];
    for (number, block) in blocks.iter().enumerate() {
        for &index in block {
            block_of[index] = number;
        }
    }
    block_of
}

/// The joint that moves furthest in a block; none where none moves.
fn widest(configurations: &[&DVector<f64>], block: &[usize]) -> Option<usize> {
    let joints = configurations.get(*block.first()?)?.len();
    let reach = |joint: usize| {
        let angles = block.iter().map(|&index| configurations[index][joint]);
        let [low, high] = ends(angles);
        high - low
    };
    (0..joints)
        .map(|joint| (joint, reach(joint)))
        .filter(|(_, reach)| *reach > 0.0)
        .max_by(|one, other| one.1.total_cmp(&other.1).then(other.0.cmp(&one.0)))
        .map(|(joint, _)| joint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discrepancy_is_what_noise_does_not_explain() {
        let residual = |x: f64| ReadingResidual {
            position_m: Vector3::new(x, x, x),
            coordinates: 3,
            rotation_rad: None,
        };
        let left = [residual(5e-4), residual(-5e-4)];
        let own = Matrix6::from_diagonal_element(9e-8);
        let [position_m, rotation_rad] = discrepancy_of(&left, &[own, own], 1.0);
        assert!((position_m - 4e-4).abs() < 1e-12);
        assert!(rotation_rad.abs() < f64::MIN_POSITIVE);
        // Half of the numbers were used up.
        let discrepancy = discrepancy_of(&left, &[own, own], 0.5);
        assert!((discrepancy[0] - (2.0 * 25e-8 - 9e-8_f64).sqrt()).abs() < 1e-12);
        let covariance = discrepancy_covariance(discrepancy);
        assert!((covariance[(1, 1)] - discrepancy[0].powi(2)).abs() < 1e-20);
    }

    #[test]
    fn blocks_are_parts_of_joint_space() {
        let grid: Vec<DVector<f64>> = (0..64)
            .map(|index| DVector::from_vec(vec![f64::from(index % 8), 0.1 * f64::from(index / 8)]))
            .collect();
        let all: Vec<&DVector<f64>> = grid.iter().collect();
        let blocks = joint_space_blocks(&all, 8);
        for block in 0..8 {
            let angles: Vec<f64> = (0..64)
                .filter(|&index| blocks[index] == block)
                .map(|index| grid[index][0])
                .collect();
            // The first joint moves ten times as far: one block for each of its angles.
            assert_eq!(angles.len(), 8);
            assert!((angles.windows(2)).all(|pair| pair[0].to_bits() == pair[1].to_bits()));
        }
        // The same configuration twice stays in one block.
        let same = [&grid[3], &grid[3]];
        assert_eq!(joint_space_blocks(&same, 4), [0, 0]);
    }
}
