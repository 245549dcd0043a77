//! Outliers (gross errors): fits without them, repeated until the same readings are outliers.
//!
//! The yardstick is the median of the squares that are left, which half of the readings being wrong does not spoil, so that a
//! few readings that are wrong by much, all to one side too, hide neither themselves nor others. Readings within five
//! standard deviations count fully, those beyond not at all.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, SymmetricEigen, Vector3};
use serde::Serialize;
use serde_json::{Value, json};
use statrs::distribution::FisherSnedecor;

use super::discrepancy::ReadingResidual;
use super::spread::ErrorSpread;
use crate::numeric::quantile::exceeded_with;
use crate::numeric::tolerance::{ends, median};
use crate::text::wording::counted;

/// Residuals that are as large, or as small, with less than this probability are no chance: with a
/// thousand calibrations of a correct set-up a year, each side warns wrongly once in ten years. It holds
/// for any number of degrees of freedom, since the probabilities are those of the chi-square
/// distribution itself.
pub const IMPLAUSIBLE: f64 = 1e-4;

/// Beyond so many standard deviations no correct reading lies: the probability is 5.7e-7, one in 1.7 million.
const FAR_OUT: f64 = 5.0;
/// That probability.
const BY_CHANCE: f64 = 5.733_031e-7;
/// What a robot errs by has longer tails: all readings of a command pose lie out for certain beyond so many standard deviations.
pub(super) const FAR_FOR_POSES: f64 = 3.0 * FAR_OUT;
/// Squares that are exceeded with this probability or more say nothing against the readings' own covariances.
const CLEARLY_PLAUSIBLE: f64 = 0.05;
/// A median tells as much of a variance as about so many of the residuals do by their squares.
const OF_A_MEDIAN: f64 = 0.5;
/// Fewer vectors do not tell which directions they prefer.
const LEAST_OF_A_SHAPE: usize = 40;
/// Each brings a shape nearer to that which the vectors have by more than a half.
const SHAPINGS: usize = 30;
/// Fewer poses do not tell where a few squares that are large are wrong, and where errors are large.
const LEAST_POSES: usize = 100;
/// So often readings are looked at to find out where it is.
const LOOKS: usize = 4;
/// A residual whose variance is a smaller share of its reading's says nothing: the fit goes through that reading (leverage one), and
/// rounding is what is left.
pub(super) const NO_VARIANCE: f64 = 1e-8;
/// Of two readings the one without which the squares are smaller by less is not a thousand times likelier to be the wrong one: 2 ln 1000.
const AS_LIKELY: f64 = 13.8;
/// Fits that are made; the first few leave out nearly all.
const ROUNDS: usize = 12;
/// A larger share of readings is not wrong: the model is.
const MOST: f64 = 0.25;

/// Half of the squares of normal errors lie below, over their variance: of a distance or a displacement along a direction, or of three
/// coordinates.
const fn middle_square(coordinates: usize) -> f64 {
    if coordinates == 1 {
        0.454_936_423_119_572_8
    } else {
        2.365_973_884_375_34
    }
}

/// The square over a variance from so many degrees of freedom that is exceeded as seldom as five standard deviations of one coordinate.
pub(super) fn far_square(coordinates: usize, freedom: f64) -> f64 {
    let far = [FAR_OUT * FAR_OUT, 31.812_3][usize::from(coordinates > 1)];
    if freedom.is_infinite() {
        return far;
    }
    let count = coordinates as f64;
    let law = FisherSnedecor::new(count, OF_A_MEDIAN * freedom);
    law.map_or(f64::INFINITY, |law| {
        (count * exceeded_with(&law, BY_CHANCE)).max(far)
    })
}

/// A reading that was left out; in records with its number from 1, and in words why.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(into = "Value")]
pub struct RejectedReading {
    /// Its index, from 0.
    pub reading: usize,
    /// How far out it lies: standard deviations of one coordinate with that probability.
    pub deviations: f64,
}

impl From<RejectedReading> for Value {
    fn from(
        RejectedReading {
            reading,
            deviations,
        }: RejectedReading,
    ) -> Self {
        json!({
            "reading": reading + 1,
            "deviations": deviations,
            "reason": format!("outlier: {deviations:.1} standard deviations given the other readings, limit {FAR_OUT}"),
        })
    }
}

impl RejectedReading {
    /// The outliers among so many readings, each with how far out it lies; none where there are none.
    pub fn words(rejected: &[Self], count: usize, noun: &str) -> Option<String> {
        let rows: Vec<String> = (rejected.iter())
            .map(|each| format!("{} ({:.1})", each.reading + 1, each.deviations))
            .collect();
        let number = counted(rows.len() as u64, "outlier");
        (!rows.is_empty()).then(|| {
            format!(
                "{number} of {count} {noun}s beyond {FAR_OUT} standard deviations, not fitted: {}",
                rows.join(", ")
            )
        })
    }
}

/// What a fit to all readings but those that were rejected says of all.
pub(super) struct LookedOver<'a> {
    /// What it leaves of them.
    pub left: Vec<ReadingResidual>,
    /// Their own covariances.
    pub own: Vec<Matrix6<f64>>,
    /// The same as they were weighed.
    pub weighed: Vec<Matrix6<f64>>,
    /// The covariances of what is predicted for them; nothing where that is little.
    pub known: Vec<Matrix6<f64>>,
    /// Which were rejected.
    pub rejected: Vec<RejectedReading>,
    /// The commanded angles of each.
    pub angles: Vec<&'a [f64]>,
    /// As in [`discrepancy_of`](super::discrepancy::discrepancy_of).
    pub spare: f64,
    /// Degrees of freedom.
    pub freedom: f64,
    /// Whether a single reading may have drawn the fit to itself.
    pub is_drawn: bool,
    /// By how much variances are larger than the readings' own, where those that were fitted are plausible by their own; else what is
    /// unexplained of most is the yardstick.
    pub plausible: Option<f64>,
}

/// As [`LookedOver::plausible`], of readings whose weighted squares over their degrees of freedom are `ratio`, with the `probability` of
/// larger ones.
pub(super) fn plausible(probability: Option<f64>, ratio: f64) -> Option<f64> {
    match probability? {
        clear if clear >= CLEARLY_PLAUSIBLE => Some(1.0),
        doubtful if doubtful >= IMPLAUSIBLE => Some(ratio.max(1.0)),
        _ => None,
    }
}

impl LookedOver<'_> {
    /// The readings that lie far out of what the fit leaves of all. Where a discrepancy comes from residuals of few degrees of
    /// freedom, larger squares are as improbable; where what is left is larger at some angles than at others, the yardstick there is.
    /// None where so many lie far out that nothing can be said of single ones.
    pub fn far_out(&self) -> Option<Vec<RejectedReading>> {
        let discrepancy = match self.plausible {
            Some(_) => [Matrix3::zeros(); 2],
            None => [0, 1].map(|part| self.robust_discrepancy(part)),
        };
        let counts = discrepancy.map(|part| part != Matrix3::zeros());
        let scale = self.plausible.unwrap_or(1.0);
        let freedom = if scale <= 1.0 && counts == [false; 2] {
            f64::INFINITY
        } else {
            self.freedom
        };
        let [one, three] = [1, 3].map(|count| far_square(count, freedom));
        let mut farthest = vec![0.0_f64; self.left.len()];
        for (part, discrepancy) in discrepancy.iter().enumerate() {
            // Over their medians, so that readings of one coordinate and of three compare.
            let (mut squares, mut far) = (Vec::new(), Vec::new());
            for (reading, left) in self.left.iter().enumerate() {
                let own = self.own[reading].fixed_view::<3, 3>(3 * part, 3 * part);
                let square = self.square(reading, part, &(own + discrepancy));
                let coordinates = left.part(part).map_or(3, |(_, coordinates)| coordinates);
                let median = middle_square(coordinates);
                squares.push(square.unwrap_or(0.0) / scale / median);
                far.push(if coordinates == 1 { one } else { three } / median);
            }
            let mut factors = vec![1.0; squares.len()];
            if counts[part] {
                factors = local_factors(&squares, &self.angles, &far);
            }
            for (reading, most) in farthest.iter_mut().enumerate() {
                *most = most.max(squares[reading] / factors[reading] / far[reading]);
            }
        }
        let far_out = (farthest.iter().enumerate()).filter(|(_, ratio)| **ratio > 1.0);
        let found: Vec<RejectedReading> = far_out
            .map(|(reading, ratio)| RejectedReading {
                reading,
                deviations: FAR_OUT * ratio.sqrt(),
            })
            .collect();
        (found.len() as f64 <= MOST * self.own.len() as f64).then_some(found)
    }

    /// The readings that a search begins without: those that lie far out, else the farthest where one among few draws the fit to
    /// itself, and hides in what that leaves of the others.
    pub fn suspects(&self) -> Option<Vec<RejectedReading>> {
        let far_out = self.far_out();
        if !self.is_drawn || far_out.as_ref().is_some_and(|found| !found.is_empty()) {
            return far_out;
        }
        Some(self.farthest().into_iter().collect())
    }

    /// The reading without which the weighted squares are smallest; none where they are as small without another one.
    fn farthest(&self) -> Option<RejectedReading> {
        let squares = self.weighed.iter().enumerate().map(|(reading, own)| {
            let parts = [0, 1].map(|part| {
                let own = own.fixed_view::<3, 3>(3 * part, 3 * part).into_owned();
                self.square(reading, part, &own).unwrap_or(0.0)
            });
            (reading, parts[0].max(parts[1]))
        });
        let mut squares: Vec<(usize, f64)> = squares.collect();
        squares.sort_by(|one, other| other.1.total_cmp(&one.1));
        let &(reading, square) = squares.first()?;
        let second = squares.get(1).map_or(0.0, |each| each.1);
        let deviations = square.sqrt();
        (square - second > AS_LIKELY).then_some(RejectedReading {
            reading,
            deviations,
        })
    }

    /// What is left of a reading's position (0) or rotation (1) over the covariance of that: R - A cov A^T with the covariance of what is
    /// predicted; of one that was rejected R + A cov A^T. `whole` is what R is to be: where it counts what is unexplained, a fit takes up as
    /// large a share of it as of what the reading was weighed by. None of what was not read.
    fn square(&self, reading: usize, part: usize, whole: &Matrix3<f64>) -> Option<f64> {
        let (left, coordinates) = self.left[reading].part(part)?;
        let is_rejected = self.rejected.iter().any(|each| each.reading == reading);
        let (first, size) = (3 * part, (coordinates, coordinates));
        let [own, known] = [&self.weighed[reading], &self.known[reading]]
            .map(|all| all.view((first, first), size).into_owned());
        let known = known * if is_rejected { -1.0 } else { 1.0 };
        let whole = whole.view((0, 0), size).into_owned();
        let (whole, own) = (whole.cholesky()?.l(), own.cholesky()?.l());
        let half = own.solve_lower_triangular(&known)?;
        let share = own.solve_lower_triangular(&half.transpose())?;
        let variance = DMatrix::identity(coordinates, coordinates) - share;
        let left = left.rows(0, coordinates).into_owned();
        let squares = squares_of(&whole.solve_lower_triangular(&left)?, variance);
        Some(squares.iter().sum())
    }

    /// What is unexplained of the position (0) or rotation (1) of most readings: a covariance.
    fn robust_discrepancy(&self, part: usize) -> Matrix3<f64> {
        let parts = self.left.iter().map(|left| left.part(part));
        let is_whole = (parts.clone().flatten()).all(|(_, coordinates)| coordinates == 3);
        let own = parts.clone().zip(&self.own).map(|(left, covariance)| {
            let coordinates = left.map_or(3, |(_, coordinates)| coordinates);
            let rows = 3 * part..3 * part + coordinates;
            let sum: f64 = rows.map(|row| covariance[(row, row)]).sum();
            sum / coordinates as f64
        });
        let own = median(own.collect()).unwrap_or(0.0);
        let size = |square: &dyn Fn(&Vector3<f64>) -> f64| {
            let squares = parts.clone().flatten();
            let squares =
                squares.map(|(left, coordinates)| square(&left) / middle_square(coordinates));
            median(squares.collect()).unwrap_or(0.0) / self.spare
        };
        let least = size(&Vector3::norm_squared);
        if least <= own {
            return Matrix3::zeros();
        }
        let vectors: Vec<Vector3<f64>> = parts.clone().flatten().map(|(left, _)| left).collect();
        // One coordinate says nothing of the others.
        let shape = if is_whole {
            shape_of(&vectors)
        } else {
            Matrix3::identity()
        };
        let inverse = shape.try_inverse().unwrap_or_else(Matrix3::identity);
        let all = shape * size(&|vector| vector.dot(&(inverse * vector)));
        let mut eigen = SymmetricEigen::new(all);
        // Errors are larger in some directions where they are elsewhere, perhaps: nowhere are they taken for smaller than on the whole.
        (eigen.eigenvalues).apply(|value| *value = value.max(least) - own);
        eigen.recompose()
    }
}

/// By how much larger squares, over their medians, are where each reading is than on the whole, at least one: as those say that do not
/// lie far out there. Readings of one pose err alike, and say it once.
fn local_factors(squares: &[f64], angles: &[&[f64]], far: &[f64]) -> Vec<f64> {
    let mut factors = vec![1.0; squares.len()];
    let commands = angles.first().map_or(0, |each| each.len());
    let ranges: Vec<[f64; 2]> = (0..commands)
        .map(|joint| ends(angles.iter().map(|each| each[joint])))
        .collect();
    for _ in 0..LOOKS {
        let kept = (0..squares.len()).filter(|&each| squares[each] <= far[each] * factors[each]);
        let kept: Vec<usize> = kept.collect();
        let mut poses: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
        for &each in &kept {
            let pose = angles[each].iter().map(|angle| angle.to_bits()).collect();
            poses.entry(pose).or_default().push(each);
        }
        let mean = |own: &Vec<usize>| {
            own.iter().map(|&each| squares[each]).sum::<f64>() / own.len() as f64
        };
        let means: Vec<f64> = poses.values().map(mean).collect();
        let places: Vec<&[f64]> = poses.values().map(|own| angles[own[0]]).collect();
        let spread = (poses.len() >= LEAST_POSES)
            .then(|| ErrorSpread::of_logarithms(&means, &places, &ranges));
        let Some(spread) = spread.flatten() else {
            break;
        };
        let relative = (angles.iter()).map(|angles| spread.logarithm_at(angles, &ranges).exp());
        let relative: Vec<f64> = relative.collect();
        let over = kept.iter().map(|&each| squares[each] / relative[each]);
        let Some(middle) = median(over.collect()) else {
            break;
        };
        let found = relative.iter().map(|relative| (relative * middle).max(1.0));
        factors = found.collect();
    }
    factors
}

/// Fits anew without what lies far out, until the same does; what was left out, with the last fit. `rejected` lies far out of a first
/// fit to all; `fit_without` gets the fit before, where there is one without what lay far out. None where nothing does, where too much
/// does, or where there is no other fit.
pub(super) fn until_the_same<Fit>(
    mut rejected: Vec<RejectedReading>,
    far_out: impl Fn(&Fit) -> Option<Vec<RejectedReading>>,
    fit_without: impl Fn(&[RejectedReading], Option<&Fit>) -> Option<Fit>,
) -> Option<(Vec<RejectedReading>, Fit)> {
    let mut found: Option<(_, Fit)> = None;
    for _ in 0..ROUNDS {
        if rejected.is_empty() {
            return None;
        }
        let fit = fit_without(&rejected, found.as_ref().map(|(_, before)| before))?;
        let next = far_out(&fit)?;
        let readings = |all: &[RejectedReading]| -> Vec<usize> {
            all.iter().map(|each| each.reading).collect()
        };
        if readings(&next) == readings(&rejected) {
            return Some((next, fit));
        }
        found = Some((rejected, fit));
        rejected = next;
    }
    found
}

/// For each of so many readings whether it was rejected.
pub(super) fn rejected_of(count: usize, rejected: &[RejectedReading]) -> Vec<bool> {
    let mut of_all = vec![false; count];
    for each in rejected {
        of_all[each.reading] = true;
    }
    of_all
}

/// Those of one thing for each reading that belong to readings that were not rejected.
pub(super) fn kept<T: Clone>(all: &[T], rejected: &[RejectedReading]) -> Vec<T> {
    let is_rejected = rejected_of(all.len(), rejected);
    let all = all.iter().zip(is_rejected);
    all.filter(|(_, is_rejected)| !is_rejected)
        .map(|(each, _)| each.clone())
        .collect()
}

/// The squares of whitened numbers over their variance, in the directions in which a fit leaves any.
pub(super) fn squares_of(left: &DVector<f64>, variance: DMatrix<f64>) -> Vec<f64> {
    let eigen = SymmetricEigen::new(variance);
    let coordinates = eigen.eigenvectors.tr_mul(left);
    (eigen.eigenvalues.iter().zip(&coordinates))
        .filter(|(variance, _)| **variance > NO_VARIANCE)
        .map(|(variance, coordinate)| coordinate * coordinate / variance)
        .collect()
}

/// The shape of the covariance of vectors, of determinant one, by their directions alone (Tyler 1987): far ones count no more than others.
/// Errors of parallel joints lie within a plane.
fn shape_of(vectors: &[Vector3<f64>]) -> Matrix3<f64> {
    let mut shape = Matrix3::identity();
    if vectors.len() < LEAST_OF_A_SHAPE {
        return shape;
    }
    for _ in 0..SHAPINGS {
        let Some(inverse) = shape.try_inverse() else {
            return Matrix3::identity();
        };
        let sum: Matrix3<f64> = (vectors.iter())
            .map(|vector| (vector, vector.dot(&(inverse * vector))))
            .filter(|(_, square)| *square > 0.0)
            .map(|(vector, square)| vector * vector.transpose() / square)
            .sum();
        let size = sum.determinant().cbrt();
        if size.is_nan() || size <= 0.0 {
            return Matrix3::identity();
        }
        shape = sum / size;
    }
    shape
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    use super::*;

    #[test]
    fn laws_are_those_of_chi_square() {
        for coordinates in [1, 3] {
            let [far, of_few, of_many] =
                [f64::INFINITY, 20.0, 1e9].map(|freedom| far_square(coordinates, freedom));
            let squares = ChiSquared::new(coordinates as f64).expect("a law");
            assert!((squares.cdf(middle_square(coordinates)) - 0.5).abs() < 1e-12);
            assert!((squares.sf(far) / BY_CHANCE - 1.0).abs() < 1e-4);
            // Of a variance that is hardly known larger squares are as improbable.
            assert!(of_few > 2.0 * far && of_many < 1.001 * far);
        }
    }
}
