//! Readings that were not fitted beside what a fit predicts for them.

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::discrepancy::three_rows;
use super::joint_errors::LocalRows;
use super::residuals::LinearReading;
use super::sharing::StackedRows;
use super::{AbsoluteCase, DiscrepancyModel, FitResult, ReadingPrognosis};
use crate::parameter::{ParameterKind, ParameterSet};

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

/// Readings that were not fitted beside an identified arm, which their case has, with the discrepancy that it leaves.
pub struct OtherReadings<'a> {
    case: &'a AbsoluteCase<'a>,
    set: &'a ParameterSet,
    places: &'a [usize],
    discrepancy: &'a DiscrepancyModel,
    rows: Vec<LinearReading>,
    local: Vec<LocalRows>,
}

impl<'a> AbsoluteCase<'a> {
    /// These readings beside what its arm with a discrepancy's model predicts for them. `set` are those of the model's parameters that the
    /// readings depend on, at their `places` among the model's, and counted from the arm itself.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn beside(
        &'a self,
        set: &'a ParameterSet,
        places: &'a [usize],
        discrepancy: &'a DiscrepancyModel,
    ) -> FitResult<OtherReadings<'a>> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(&self.arm, set, set.prior().mean.as_slice(), &joints)?;
        let readings = rows.iter().zip(&self.observations);
        let local = readings.map(|(rows, each)| {
            discrepancy.local(rows, places, each.setup.commanded_rad.as_slice())
        });
        Ok(OtherReadings {
            local: local.collect(),
            case: self,
            set,
            places,
            discrepancy,
            rows,
        })
    }
}

impl OtherReadings<'_> {
    /// Each beside its prediction. Frames of which `anew` has the parameters take the values that suit these readings best.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn prognoses(&self, anew: &ParameterSet) -> FitResult<Vec<ReadingPrognosis>> {
        let discrepancy = self.discrepancy;
        let local = self.local.iter();
        let local = local.map(|each| (each.left.clone(), discrepancy.covariance_of(each)));
        let mut found: Vec<_> = local.collect();
        if !anew.is_empty() {
            let frames = self.of_frames(anew)?;
            let groups = self.case.errors_together(discrepancy, &self.rows);
            let groups = groups.iter();
            let groups = groups.map(|group| StackedRows::of(group, &self.local, &frames));
            let groups: Vec<StackedRows> = groups.collect();
            take_out(anew.len(), &groups, &discrepancy.covariance, &mut found);
        }
        let readings = found.iter().zip(&self.case.observations);
        let judged = readings.map(|((left, covariance), each)| {
            discrepancy.judged(left, covariance, each.setup.commanded_rad.as_slice())
        });
        Ok(judged.collect())
    }

    /// How parameters of frames move the readings.
    fn of_frames(&self, frames: &ParameterSet) -> FitResult<Vec<LinearReading>> {
        let (case, values) = (self.case, &frames.prior().mean);
        case.rows_at(&case.arm, frames, values.as_slice(), &[])
    }

    /// The probability of differences from the prediction that are as large, with the covariance of identification and readings: where the
    /// planner's model says what readings share, as it does of distances, or noise alone explains the identification, and no joint has an
    /// error of its own. Frames as in [`prognoses`](Self::prognoses).
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn probability(&self, anew: &ParameterSet) -> FitResult<Option<f64>> {
        let (case, discrepancy) = (self.case, self.discrepancy);
        let is_noise_alone = case.belief.uncertain.sources().next().is_none()
            && discrepancy.rest.iter().all(|rest| *rest <= 0.0);
        let is_known = case.is_sharing_known || is_noise_alone;
        if !is_known || !discrepancy.joints.is_empty() {
            return Ok(None);
        }
        let more = anew.parameters().iter().map(|each| each.kind);
        let Ok((all, _)) = self.set.with_more(&case.arm, more) else {
            return Ok(None);
        };
        let mut case = case.clone();
        case.weigh(discrepancy.rest);
        let readings = case.fitted_readings(&all);
        let equations = readings.equations(&all.prior().mean)?;
        let sizes = all.scales();
        let known = DMatrix::from_fn(all.len(), all.len(), |row, column| {
            match (self.places.get(row), self.places.get(column)) {
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
        let law = ChiSquared::new(freedom as f64).ok();
        Ok(solved.zip(law).map(|(solved, law)| {
            law.sf(equations.square - equations.gradient.dot(&(known * solved)))
        }))
    }

    /// How far the base of a station stands from where it was identified, as these readings have it: position (m) and rotation
    /// (rad) along and about its own axes, and the probability of that if nobody moved it. Readings beyond the angles at which joints'
    /// errors were found say nothing of it: these may be any there, and are alike in all of them.
    ///
    /// # Errors
    /// The arm has no equilibrium for a reading.
    pub fn moved_station(&self, station: usize) -> FitResult<Option<MovedStation>> {
        let (case, discrepancy, local) = (self.case, self.discrepancy, &self.local);
        let kinds = case.base_kinds(station).into_iter();
        let Ok(base) = ParameterSet::new(&case.arm, kinds.map(|kind| (kind, None))) else {
            return Ok(None);
        };
        let own = base.len();
        let frames = self.of_frames(&base)?;
        let size = discrepancy.covariance.nrows();
        // Sums over readings, weighed by what is new in each: of the frame's own parameters, then of all that is known.
        let mut information = DMatrix::zeros(own + size, own + size);
        let mut gradient = DVector::zeros(own + size);
        let (mut read, mut average) = (Vec::new(), 0.0);
        for mut group in case.errors_together(discrepancy, &self.rows) {
            let counts = |&(place, _): &(usize, _)| {
                let setup = &case.observations[place].setup;
                setup.station == station && discrepancy.reaches(setup.commanded_rad.as_slice())
            };
            group.retain(counts);
            if group.is_empty() {
                continue;
            }
            let stacked = StackedRows::of(&group, local, &frames);
            let Some(factor) = Cholesky::new(stacked.new) else {
                continue;
            };
            for &place in &stacked.readings {
                let new = local[place].new.diagonal();
                read.push(&frames[place]);
                average += three_rows(&new, 0).sum() / new.len().min(3) as f64;
            }
            let weighed = factor.solve(&stacked.columns);
            let among = weighed.tr_mul(&stacked.columns);
            let pull = weighed.tr_mul(&stacked.left);
            // The frame's own parameters, then those known ones that move any.
            let known = stacked.index.into_iter().map(|place| own + place);
            let index = (0..own).chain(known);
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
}

/// Takes the frames (f parameters) that suit them best out of what readings leave, r, and out of its covariance, where those that share
/// errors have V = B C B^T + N together, with what is known C, and N new in them:
///
/// ```text
/// x = M^-1 sum F^T V^-1 r,   M = sum F^T V^-1 F,   G = M^-1 sum F^T V^-1 B
/// r - F x = (B - F G) d + n - F M^-1 sum F^T V^-1 n
/// ```
fn take_out(
    own: usize,
    groups: &[StackedRows],
    known: &DMatrix<f64>,
    found: &mut [(DVector<f64>, DMatrix<f64>)],
) {
    let [mut information, mut of_new] = [(); 2].map(|()| DMatrix::<f64>::zeros(own, own));
    let mut gradient = DVector::zeros(own);
    let mut of_known = DMatrix::zeros(own, known.nrows());
    let mut weighed = Vec::new();
    for group in groups {
        let (frames, matrix) = group.columns.columns_range_pair(..own, own..);
        let among = known.select_rows(&group.index).select_columns(&group.index);
        let covariance = &group.new + matrix * among * matrix.transpose();
        let each = Cholesky::new(covariance).map_or_else(
            || DMatrix::zeros(group.left.len(), own),
            |factor| factor.solve(&frames),
        );
        information += each.tr_mul(&frames);
        gradient += each.tr_mul(&group.left);
        of_new += each.tr_mul(&group.new) * &each;
        let pulled = each.tr_mul(&matrix);
        for (column, &place) in pulled.column_iter().zip(&group.index) {
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
    for (group, weighed) in groups.iter().zip(&weighed) {
        let (frames, matrix) = group.columns.columns_range_pair(..own, own..);
        let with_known = moved.select_columns(&group.index) * matrix.transpose();
        let with_new = &inverse * weighed.tr_mul(&group.new);
        let common = with_known + with_new;
        let mut row = 0;
        for &place in &group.readings {
            let (left, covariance) = &mut found[place];
            let columns = frames.rows(row, left.len());
            *left -= columns * &change;
            let common = columns * common.columns(row, left.len());
            let rounding = DMatrix::from_diagonal(&(covariance.diagonal() * TAKEN_UP));
            *covariance +=
                rounding + columns * &spread * columns.transpose() - &common - common.transpose();
            row += left.len();
        }
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
        const READINGS: usize = 6;
        const TOGETHER: usize = 2;
        const KNOWN: usize = 4;
        const FRAME: usize = 6;
        let mut random = generator(3, 0);
        let mut matrix =
            |rows, columns| DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0));
        let square = |root: DMatrix<f64>| &root * root.transpose();
        let known = square(matrix(KNOWN, KNOWN));
        let (mut frames, mut local, mut effects) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..READINGS {
            frames.push(LinearReading {
                residual: DVector::zeros(3),
                columns: matrix(3, FRAME),
                joints: DMatrix::zeros(3, 0),
                own: DMatrix::zeros(3, 3),
            });
            let shared = matrix(3, 2);
            local.push(LocalRows {
                index: (0..KNOWN).collect(),
                matrix: matrix(3, KNOWN),
                left: matrix(3, 1).column(0).into_owned(),
                new: square(shared.clone()) + DMatrix::identity(3, 3) * 0.1,
            });
            effects.push(shared);
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
            for (other, others) in effects.iter().enumerate() {
                let new = if other == place {
                    local.new.clone()
                } else if other / TOGETHER == place / TOGETHER {
                    &effects[place] * others.transpose()
                } else {
                    continue;
                };
                all.view_mut((3 * place, 3 * other), (3, 3)).copy_from(&new);
            }
        }
        all += &of_known * &known * of_known.transpose();
        let own = |place: usize| all.view((3 * place, 3 * place), (3, 3)).into_owned();
        let found = local.iter().enumerate();
        let mut found: Vec<_> = found
            .map(|(place, local)| (local.left.clone(), own(place)))
            .collect();
        let mut groups = Vec::new();
        for first in (0..READINGS).step_by(TOGETHER) {
            let (at, count) = (3 * first, 3 * TOGETHER);
            let together = all.view((at, at), (count, count)).into_owned();
            let inverse = together.try_inverse().expect("regular");
            weights
                .view_mut((at, at), (count, count))
                .copy_from(&inverse);
            let group = (first..first + TOGETHER).map(|place| (place, effects[place].clone()));
            groups.push(StackedRows::of(&group.collect(), &local, &frames));
        }
        take_out(FRAME, &groups, &known, &mut found);
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
