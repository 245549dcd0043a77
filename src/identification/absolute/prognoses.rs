//! Readings that were not fitted beside what a fit predicts for them.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6xX, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::discrepancy::three_rows;
use super::joint_errors::LocalRows;
use super::residuals::LinearReading;
use super::{AbsoluteCase, DiscrepancyModel, FitResult, ReadingPrognosis};
use crate::observation::SharingReadings;
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};

/// Stations that stand as far off with a smaller probability were moved.
const MOVED: f64 = 1e-6;
/// What is known of a new frame before its readings: the variance of each parameter, in typical sizes.
const ANEW: f64 = 1e4;

/// What frames take up whole keeps so small a share of its variance, for rounding.
const TAKEN_UP: f64 = 1e-9;

/// How far the base of a station stands from where it was identified.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedStation {
    /// Along its own axes (m).
    pub position_m: Vector3<f64>,
    /// About them (rad).
    pub rotation_rad: Vector3<f64>,
    /// The probability of so much if nobody moved it.
    pub probability: f64,
    /// How far that moves what was read, rms (m).
    pub readings_m: f64,
    /// The standard deviation of what the model leaves new in each coordinate of a reading (m): less is no sign of anything.
    pub discrepancy_m: f64,
}

impl MovedStation {
    /// Whether somebody moved it: by more than chance and what the model leaves do.
    pub fn is_moved(&self) -> bool {
        self.probability < MOVED && self.readings_m > self.discrepancy_m
    }
}

impl AbsoluteCase<'_> {
    /// These readings beside what an arm with a discrepancy's model predicts for them. `set` are those of the model's
    /// parameters that the readings depend on, at their `places` among the model's, and counted from the arm itself. Frames of
    /// which `anew` has the parameters take the values that suit these readings best.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn prognoses(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        discrepancy: &DiscrepancyModel,
        anew: &ParameterSet,
    ) -> FitResult<Vec<ReadingPrognosis>> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let readings = rows.iter().zip(&self.observations);
        let local: Vec<LocalRows> = readings
            .map(|(rows, each)| {
                discrepancy.local(rows, places, each.setup.commanded_rad.as_slice())
            })
            .collect();
        let each = local.iter();
        let mut found: Vec<(DVector<f64>, DMatrix<f64>)> = each
            .map(|local| {
                let known = discrepancy.by_what_is_known(local);
                (local.left.clone(), &local.new + known)
            })
            .collect();
        if !anew.is_empty() {
            let frames = self.rows_at(arm, anew, anew.prior().mean.as_slice(), &[])?;
            take_out(&frames, &local, &discrepancy.covariance, &mut found);
        }
        let readings = found.iter().zip(&self.observations);
        Ok(readings
            .map(|((left, covariance), each)| {
                discrepancy.judged(left, covariance, each.setup.commanded_rad.as_slice())
            })
            .collect())
    }

    /// The probability of differences from the prediction that are as large, with the covariance of identification and readings: where the
    /// planner's model says what readings share, as it does of distances, or noise alone explains the identification, and no joint has an
    /// error of its own. All as in [`prognoses`](Self::prognoses).
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn probability(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        discrepancy: &DiscrepancyModel,
        anew: &ParameterSet,
    ) -> FitResult<Option<f64>> {
        let is_noise_alone = self.belief.uncertain.sources().next().is_none()
            && discrepancy.rest.iter().all(|rest| *rest <= 0.0);
        let is_known = self.is_sharing_known || is_noise_alone;
        if !is_known || !discrepancy.joints.is_empty() {
            return Ok(None);
        }
        let more = anew.parameters().iter().map(|each| each.kind);
        let Ok((all, _)) = set.with_more(arm, more) else {
            return Ok(None);
        };
        let mut case = self.clone();
        case.arm = arm.clone();
        case.weigh(discrepancy.rest);
        let readings = case.fitted_readings(&all);
        let equations = readings.equations(&all.prior().mean)?;
        let sizes = all.scales();
        let known = DMatrix::from_fn(all.len(), all.len(), |row, column| {
            match (places.get(row), places.get(column)) {
                (Some(&one), Some(&other)) => {
                    discrepancy.covariance[(one, other)] / (sizes[row] * sizes[column])
                }
                _ if row == column => ANEW,
                _ => 0.0,
            }
        });
        // y^T (R + A C A^T)^-1 y = y^T R^-1 y - g^T C (1 + A^T R^-1 A C)^-1 g with g = A^T R^-1 y.
        let mixed = DMatrix::identity(all.len(), all.len()) + &equations.information * &known;
        let solved = mixed.lu().solve(&equations.gradient);
        let freedom = readings.rows().saturating_sub(anew.len());
        Ok(
            (solved.zip(ChiSquared::new(freedom as f64).ok())).map(|(solved, law)| {
                law.sf(equations.square - equations.gradient.dot(&(known * solved)))
            }),
        )
    }

    /// How far the base of a station stands from where it was identified, as these readings have it: position (m) and rotation
    /// (rad) along and about its own axes, and the probability of that if nobody moved it. `set`, `places` and `discrepancy` as in
    /// [`prognoses`](Self::prognoses). Readings beyond the angles at which joints' errors were found say nothing of it: these may be any
    /// there, and are alike in all of them.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn moved_station(
        &self,
        arm: &ElasticArm,
        set: &ParameterSet,
        places: &[usize],
        discrepancy: &DiscrepancyModel,
        station: usize,
    ) -> FitResult<Option<MovedStation>> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let kinds = self.base_kinds(station).into_iter();
        let Ok(base) = ParameterSet::new(arm, kinds.map(|kind| (kind, None))) else {
            return Ok(None);
        };
        let own = base.len();
        let frames = self.rows_at(arm, &base, base.prior().mean.as_slice(), &[])?;
        let size = discrepancy.covariance.nrows();
        // Sums over readings, weighed by what is new in each: of the frame's own parameters, then of all that is known.
        let mut information = DMatrix::zeros(own + size, own + size);
        let mut gradient = DVector::zeros(own + size);
        let (mut read, mut average) = (Vec::new(), 0.0);
        for mut group in self.errors_together(discrepancy, &rows) {
            let commanded = |place: usize| &self.observations[place].setup;
            let counts = |&(place, _): &(usize, _)| {
                let setup = commanded(place);
                setup.station == station && discrepancy.reaches(setup.commanded_rad.as_slice())
            };
            group.retain(counts);
            let local = group.iter().map(|&(place, _)| {
                let q = commanded(place).commanded_rad.as_slice();
                discrepancy.local(&rows[place], places, q)
            });
            let local: Vec<LocalRows> = local.collect();
            let Some(factor) = Cholesky::new(new_together(&local, &group)) else {
                continue;
            };
            // The frame's own parameters, then those known ones that move any.
            let mut index: Vec<usize> =
                (local.iter().flat_map(|each| each.index.clone())).collect();
            index.sort_unstable();
            index.dedup();
            let mut matrix = DMatrix::zeros(factor.l_dirty().nrows(), own + index.len());
            let mut left = DVector::zeros(matrix.nrows());
            let mut row = 0;
            for (local, &(place, _)) in local.iter().zip(&group) {
                let (frame, count) = (&frames[place], local.left.len());
                read.push(frame);
                average += three_rows(&local.new.diagonal(), 0).sum() / count.min(3) as f64;
                left.rows_mut(row, count).copy_from(&local.left);
                let mut here = matrix.rows_mut(row, count);
                here.columns_mut(0, own).copy_from(&frame.columns);
                for (column, known) in local.matrix.column_iter().zip(&local.index) {
                    let at = index.binary_search(known).unwrap_or_default();
                    let mut sum = here.column_mut(own + at);
                    sum += column;
                }
                row += count;
            }
            let weighed = factor.solve(&matrix);
            let (among, pull) = (weighed.tr_mul(&matrix), weighed.tr_mul(&left));
            let index = (0..own).chain(index.into_iter().map(|place| own + place));
            for (row, to) in index.clone().enumerate() {
                gradient[to] += pull[row];
                for (column, from) in index.clone().enumerate() {
                    information[(to, from)] += among[(row, column)];
                }
            }
        }
        // (R + A C A^T)^-1 = R^-1 - R^-1 A C (1 + A^T R^-1 A C)^-1 A^T R^-1, where C may be singular.
        let of_known = information.view((own, own), (size, size));
        let mixed = DMatrix::identity(size, size) + of_known * &discrepancy.covariance;
        let of_both = information.view((own, 0), (size, own)).into_owned();
        let mut right = of_both.clone().insert_column(own, 0.0);
        right.column_mut(own).copy_from(&gradient.rows(own, size));
        let Some(solved) = mixed.lu().solve(&right) else {
            return Ok(None);
        };
        let through = of_both.tr_mul(&(&discrepancy.covariance * solved));
        let of_frame = information.view((0, 0), (own, own)) - through.columns(0, own);
        let pull = gradient.rows(0, own) - through.column(own);
        let (Some(factor), Ok(law)) = (Cholesky::new(of_frame), ChiSquared::new(own as f64)) else {
            return Ok(None);
        };
        let change = factor.solve(&pull);
        let of_station = read.len().max(1) as f64;
        let moves = |frame: &LinearReading| three_rows(&(&frame.columns * &change), 0);
        let displaced: f64 = (read.iter().map(|frame| moves(frame).norm_squared())).sum();
        let square = change.dot(&pull) / f64::max(discrepancy.scale[0], 1.0);
        let moved = |kind| base.index_of(kind).map_or(0.0, |place| change[place]);
        let [position_m, rotation_rad] =
            ParameterKind::of_base(station).map(|kinds| Vector3::from(kinds.map(moved)));
        Ok(Some(MovedStation {
            position_m,
            rotation_rad,
            probability: law.sf(square),
            readings_m: (displaced / of_station).sqrt(),
            discrepancy_m: (average / of_station).sqrt(),
        }))
    }

    /// Which readings share errors, each with how one standard deviation of each effect moves it: as the planner's model says, or those of a
    /// visit all that is new there.
    fn errors_together(
        &self,
        discrepancy: &DiscrepancyModel,
        rows: &[LinearReading],
    ) -> Vec<Vec<(usize, DMatrix<f64>)>> {
        if let Some(shared) = self.shared.as_ref().filter(|_| self.is_sharing_known) {
            let group = |group: &SharingReadings| {
                let each = group.readings.iter().zip(&group.effects);
                let effects = |(&place, effects): (&usize, &Matrix6xX<f64>)| {
                    let count = rows[place].residual.len();
                    (place, effects.rows(0, count).into_owned())
                };
                each.map(effects).collect()
            };
            return shared.groups.iter().map(group).collect();
        }
        let of_reading = |&place: &usize| {
            let (joints, count) = (&rows[place].joints, rows[place].residual.len());
            let mut effects = DMatrix::zeros(count, 6 + joints.ncols());
            for row in 0..count {
                effects[(row, row)] = discrepancy.rest[row / 3];
            }
            for (number, joint) in discrepancy.joints.iter().enumerate() {
                let moved = joints.column(number) * joint.repeatability;
                effects.set_column(6 + number, &moved);
            }
            (place, effects)
        };
        let visits = self.visits.iter();
        visits
            .map(|visit| visit.iter().map(of_reading).collect())
            .collect()
    }
}

/// The covariance of what is new at readings that share errors, one below the other: each has its own part of these in its own.
fn new_together(local: &[LocalRows], group: &[(usize, DMatrix<f64>)]) -> DMatrix<f64> {
    let size = local.iter().map(|local| local.left.len()).sum();
    let mut all = DMatrix::zeros(size, size);
    let mut row = 0;
    for (one, (local_one, (_, effects))) in local.iter().zip(group).enumerate() {
        let mut column = 0;
        for (other, (local_other, (_, others))) in local.iter().zip(group).enumerate() {
            let counts = (local_one.left.len(), local_other.left.len());
            let block = if one == other {
                local_one.new.clone()
            } else {
                effects * others.transpose()
            };
            all.view_mut((row, column), counts).copy_from(&block);
            column += counts.1;
        }
        row += local_one.left.len();
    }
    all
}

/// Takes the frames that suit them best out of what readings leave, r, and out of its covariance V = B C B^T + N, with what is known C, and
/// N new in each:
///
/// ```text
/// x = M^-1 sum F^T V^-1 r,   M = sum F^T V^-1 F,   G = M^-1 sum F^T V^-1 B
/// r - F x = (B - F G) d + n - F M^-1 sum F^T V^-1 n
/// ```
fn take_out(
    frames: &[LinearReading],
    local: &[LocalRows],
    known: &DMatrix<f64>,
    found: &mut [(DVector<f64>, DMatrix<f64>)],
) {
    let own = frames.first().map_or(0, |rows| rows.columns.ncols());
    let [mut information, mut of_new] = [(); 2].map(|()| DMatrix::<f64>::zeros(own, own));
    let mut gradient = DVector::zeros(own);
    let mut of_known = DMatrix::zeros(own, known.nrows());
    let mut weighed = Vec::new();
    for ((frame, local), (left, covariance)) in frames.iter().zip(local).zip(&*found) {
        let factor = Cholesky::new(covariance.clone());
        let each = factor.map_or_else(
            || DMatrix::zeros(left.len(), own),
            |factor| factor.solve(&frame.columns),
        );
        information += each.tr_mul(&frame.columns);
        gradient += each.tr_mul(left);
        of_new += each.tr_mul(&local.new) * &each;
        let pulled = each.tr_mul(&local.matrix);
        for (column, &place) in pulled.column_iter().zip(&local.index) {
            let mut sum = of_known.column_mut(place);
            sum += column;
        }
        weighed.push(each);
    }
    let Some(factor) = Cholesky::new(information) else {
        return;
    };
    let inverse = factor.inverse();
    let change = &inverse * gradient;
    let gain = &inverse * of_known;
    let moved = &gain * known;
    let spread = &moved * gain.transpose() + &inverse * of_new * &inverse;
    let each = frames.iter().zip(local).zip(&weighed).zip(found);
    for (((frame, local), weighed), (left, covariance)) in each {
        let columns = &frame.columns;
        *left -= columns * &change;
        let with_known = moved.select_columns(&local.index) * local.matrix.transpose();
        let with_new = &inverse * weighed.tr_mul(&local.new);
        let common = columns * (with_known + with_new);
        let rounding = DMatrix::from_diagonal(&(covariance.diagonal() * TAKEN_UP));
        *covariance +=
            rounding + columns * &spread * columns.transpose() - &common - common.transpose();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SymmetricEigen;
    use rand::RngExt;

    use super::*;
    use crate::numeric::random::generator;

    /// Residuals and covariances without the frames that suit them best are those of the projection of all readings at once.
    #[test]
    fn covariances_are_those_of_the_projection() {
        const READINGS: usize = 5;
        const KNOWN: usize = 4;
        const FRAME: usize = 6;
        let mut random = generator(3, 0);
        let mut matrix =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0));
        let square = |root: DMatrix<f64>| &root * root.transpose();
        let known = square(matrix(KNOWN, KNOWN));
        let (mut frames, mut local) = (Vec::new(), Vec::new());
        for _ in 0..READINGS {
            frames.push(LinearReading {
                residual: DVector::zeros(3),
                columns: matrix(3, FRAME),
                joints: DMatrix::zeros(3, 0),
                own: DMatrix::zeros(3, 3),
            });
            local.push(LocalRows {
                index: (0..KNOWN).collect(),
                matrix: matrix(3, KNOWN),
                left: matrix(3, 1).column(0).into_owned(),
                new: square(matrix(3, 3)) + DMatrix::identity(3, 3) * 0.1,
            });
        }
        let size = 3 * READINGS;
        let (mut all, mut weights) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        let (mut of_known, mut of_frame) =
            (DMatrix::zeros(size, KNOWN), DMatrix::zeros(size, FRAME));
        let mut left = DVector::zeros(size);
        for (place, (frame, local)) in frames.iter().zip(&local).enumerate() {
            of_known.rows_mut(3 * place, 3).copy_from(&local.matrix);
            of_frame.rows_mut(3 * place, 3).copy_from(&frame.columns);
            left.rows_mut(3 * place, 3).copy_from(&local.left);
            all.view_mut((3 * place, 3 * place), (3, 3))
                .copy_from(&local.new);
        }
        all += &of_known * &known * of_known.transpose();
        let mut found = Vec::new();
        for (place, local) in local.iter().enumerate() {
            let own = all.view((3 * place, 3 * place), (3, 3)).into_owned();
            let inverse = own.clone().try_inverse().expect("regular");
            weights
                .view_mut((3 * place, 3 * place), (3, 3))
                .copy_from(&inverse);
            found.push((local.left.clone(), own));
        }
        take_out(&frames, &local, &known, &mut found);
        let information = of_frame.tr_mul(&weights) * &of_frame;
        let solved = information.try_inverse().expect("regular") * of_frame.tr_mul(&weights);
        let projection = DMatrix::identity(size, size) - &of_frame * solved;
        let (left, all) = (
            &projection * left,
            &projection * all * projection.transpose(),
        );
        assert!(SymmetricEigen::new(all.clone()).eigenvalues.min() > -1e-9);
        for (place, (own, covariance)) in found.iter().enumerate() {
            let expected = all.view((3 * place, 3 * place), (3, 3));
            assert!(
                (covariance - expected).amax() < 1e-7,
                "{covariance} {expected}"
            );
            assert!((own - left.rows(3 * place, 3)).amax() < 1e-9);
        }
    }
}
