//! Frames from positions.
//!
//! With y = B (f + F x), turned round, G y + g = f + F x is linear in G = B^T, g and x, as G Y = F X is where orientations are read, too. Left
//! to be any matrices, G and X come from least squares; made a rotation again, G starts turns of two steps that each are solved exactly: the
//! stations where the targets are known (two clouds of points), and all translations where the stations' orientations are. Where all
//! axes are parallel, no reading tells how far along them a target is: it is where it is believed to be, whichever start
//! was the best.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, SymmetricEigen, Translation3, Vector3};

use super::{LENGTH_M, MountedFrames, Sight, nearest};

/// Turns end when the sum of squares falls by less than this share.
const SETTLED: f64 = 1e-9;
/// Nothing is gained by more.
const MOST_TURNS: usize = 200;
/// Eigenvalues below this share of the largest are directions that are not seen: they stay as they are.
const UNSEEN: f64 = 1e-10;
/// What is believed of a target counts as much as this share of the readings.
const BELIEVED: f64 = 1e-8;

/// Frames from several starts.
pub(super) fn solved(
    sights: &[Sight],
    stations: usize,
    tools: &[Isometry3<f64>],
) -> Vec<MountedFrames> {
    let alone = sights.iter().map(|sight| Sight {
        rotation: None,
        ..sight.clone()
    });
    let sights = &*alone.collect::<Vec<_>>();
    let start = |link_from_tool| MountedFrames {
        instrument_from_base: vec![Isometry3::identity(); stations],
        link_from_tool,
    };
    let on_the_link =
        |tool: &Isometry3<f64>| Isometry3::from_parts(Translation3::identity(), tool.rotation);
    let mut starts = vec![
        start(tools.to_vec()),
        start(tools.iter().map(on_the_link).collect()),
    ];
    for each in &mut starts {
        place_stations(each, sights);
    }
    starts.push(relaxed(sights, stations, tools));
    for frames in &mut starts {
        let mut cost = f64::INFINITY;
        for _ in 0..MOST_TURNS {
            translate(frames, sights, tools);
            place_stations(frames, sights);
            let now = frames.cost(sights);
            if now >= cost * (1.0 - SETTLED) {
                break;
            }
            cost = now;
        }
    }
    starts
}

/// Where a target is in the robot's base and where it was read (m), and how much that counts.
type WeighedPair = (Vector3<f64>, Vector3<f64>, f64);

fn place_stations(frames: &mut MountedFrames, sights: &[Sight]) {
    for (station, base) in frames.instrument_from_base.iter_mut().enumerate() {
        let pairs: Vec<WeighedPair> = (sights.iter())
            .filter(|sight| sight.station == station)
            .map(|sight| {
                let tool = frames.link_from_tool[sight.target].translation.vector;
                let there = sight.base_from_link.transform_point(&tool.into());
                (there.coords, sight.position_m, sight.weight)
            })
            .collect();
        let weights: f64 = pairs.iter().map(|pair| pair.2).sum();
        let weights = if weights > 0.0 { weights } else { 1.0 };
        let mean = |of: fn(&WeighedPair) -> Vector3<f64>| {
            let sum: Vector3<f64> = pairs.iter().map(|pair| of(pair) * pair.2).sum();
            sum / weights
        };
        let (here, seen) = (mean(|pair| pair.0), mean(|pair| pair.1));
        let products =
            (pairs.iter()).map(|pair| (pair.1 - seen) * (pair.0 - here).transpose() * pair.2);
        let rotation = nearest(&products.sum::<Matrix3<f64>>());
        *base = Isometry3::from_parts((seen - rotation * here).into(), rotation.into());
    }
}

/// The translations of stations and targets that fit best where the stations are turned as they are; the targets are believed to be
/// where `tools` are.
pub(super) fn translate(frames: &mut MountedFrames, sights: &[Sight], tools: &[Isometry3<f64>]) {
    let stations = frames.instrument_from_base.len();
    let size = 3 * (stations + frames.link_from_tool.len());
    let mut sums = LinearSums::zeros(size);
    for sight in sights {
        let base = (frames.instrument_from_base[sight.station].rotation).to_rotation_matrix();
        let link = base * sight.base_from_link.rotation.to_rotation_matrix();
        let right = sight.position_m - base * sight.base_from_link.translation.vector;
        let mut row = DMatrix::zeros(3, size);
        (row.fixed_view_mut::<3, 3>(0, 3 * sight.station)).fill_with_identity();
        (row.fixed_view_mut::<3, 3>(0, 3 * (stations + sight.target))).copy_from(link.matrix());
        sums.add(&row, &right, sight.weight);
    }
    let weight = BELIEVED * sums.information.amax();
    for (target, tool) in tools.iter().enumerate() {
        for axis in 0..3 {
            let place = 3 * (stations + target) + axis;
            sums.information[(place, place)] += weight;
            sums.right[place] += weight * tool.translation.vector[axis];
        }
    }
    let all = frames.instrument_from_base.iter_mut();
    let mut all: Vec<&mut Isometry3<f64>> = all.chain(&mut frames.link_from_tool).collect();
    let places = all.iter().map(|each| each.translation.vector);
    let known = places.flat_map(<[f64; 3]>::from);
    let solved = sums.solved(&DVector::from_iterator(size, known));
    for (index, each) in all.iter_mut().enumerate() {
        each.translation.vector = solved.fixed_rows::<3>(3 * index).into_owned();
    }
}

/// Stations by least squares in which they, and where poses are read the targets' orientations, may be any matrices.
pub(super) fn relaxed(
    sights: &[Sight],
    stations: usize,
    tools: &[Isometry3<f64>],
) -> MountedFrames {
    let of_target = if sights.iter().any(|sight| sight.rotation.is_some()) {
        12
    } else {
        3
    };
    let size = 12 * stations + of_target * tools.len();
    let mut sums = LinearSums::zeros(size);
    let mut centre = vec![(Vector3::zeros(), 0.0); stations];
    for sight in sights {
        centre[sight.station].0 += sight.position_m * sight.weight;
        centre[sight.station].1 += sight.weight;
    }
    for sight in sights {
        let (sum, count) = centre[sight.station];
        let seen = sight.position_m - sum / count.max(f64::MIN_POSITIVE);
        let mut row = DMatrix::zeros(3, size);
        for axis in 0..3 {
            for column in 0..3 {
                row[(axis, 12 * sight.station + 3 * column + axis)] = seen[column];
            }
            row[(axis, 12 * sight.station + 9 + axis)] = 1.0;
        }
        let link = sight.base_from_link.rotation.to_rotation_matrix();
        let target = 12 * stations + of_target * sight.target;
        (row.fixed_view_mut::<3, 3>(0, target)).copy_from(&-link.matrix());
        sums.add(&row, &sight.base_from_link.translation.vector, sight.weight);
        let columns = sight.rotation.iter().flat_map(Matrix3::column_iter);
        for (read, column) in columns.zip(1..) {
            let mut row = DMatrix::zeros(3, size);
            for (by, read) in read.iter().enumerate() {
                let mut turned = row.fixed_view_mut::<3, 3>(0, 12 * sight.station + 3 * by);
                turned.fill_diagonal(*read);
            }
            (row.fixed_view_mut::<3, 3>(0, target + 3 * column)).copy_from(&-link.matrix());
            sums.add(&row, &Vector3::zeros(), sight.weight * LENGTH_M * LENGTH_M);
        }
    }
    let solved = sums.solved(&DVector::zeros(size));
    let instrument_from_base = (0..stations)
        .map(|station| {
            let turned = Matrix3::from_iterator(solved.rows(12 * station, 9).iter().copied());
            let rotation = nearest(&turned.transpose()).into();
            Isometry3::from_parts(Translation3::identity(), rotation)
        })
        .collect();
    MountedFrames {
        instrument_from_base,
        link_from_tool: tools.to_vec(),
    }
}

/// Least squares in normal equations.
struct LinearSums {
    information: DMatrix<f64>,
    right: DVector<f64>,
}

impl LinearSums {
    fn zeros(size: usize) -> Self {
        Self {
            information: DMatrix::zeros(size, size),
            right: DVector::zeros(size),
        }
    }

    fn add(&mut self, rows: &DMatrix<f64>, right: &Vector3<f64>, weight: f64) {
        self.information += rows.tr_mul(rows) * weight;
        self.right += rows.tr_mul(right) * weight;
    }

    /// The solution; what is not seen is as it is `known`.
    fn solved(&self, known: &DVector<f64>) -> DVector<f64> {
        let gap = &self.right - &self.information * known;
        if !gap.iter().all(|value| value.is_finite()) {
            return known.clone();
        }
        let eigen = SymmetricEigen::new(self.information.clone());
        let least = UNSEEN * eigen.eigenvalues.amax();
        let mut solved = known.clone();
        let vectors = eigen.eigenvectors.column_iter();
        for (&value, vector) in eigen.eigenvalues.iter().zip(vectors) {
            if value > least {
                solved.axpy(vector.dot(&gap) / value, &vector, 1.0);
            }
        }
        solved
    }
}
