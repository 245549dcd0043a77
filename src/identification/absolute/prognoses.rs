//! Readings that were not fitted beside what a fit predicts for them.

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::IdentificationError;
use super::{AbsoluteCase, DiscrepancyModel, ReadingPrognosis};
use crate::parameter::{Axis, ElasticArm, ParameterKind, ParameterSet};

/// Stations that stand as far off with a smaller probability were moved.
const MOVED: f64 = 1e-6;

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
    ) -> Result<Vec<ReadingPrognosis>, IdentificationError> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let readings = rows.iter().zip(&self.observations);
        let mut found: Vec<(DVector<f64>, DMatrix<f64>)> = readings
            .map(|(rows, each)| {
                discrepancy.prognosis(rows, places, each.setup.commanded_rad.as_slice())
            })
            .collect();
        if !anew.is_empty() {
            let frames = self.rows_at(arm, anew, anew.prior().mean.as_slice(), &[])?;
            let mut information = DMatrix::zeros(anew.len(), anew.len());
            let mut gradient = DVector::zeros(anew.len());
            for (rows, (left, covariance)) in frames.iter().zip(&found) {
                let Some(factor) = Cholesky::new(covariance.clone()) else {
                    continue;
                };
                let weighed = factor.solve(&rows.columns);
                information += weighed.tr_mul(&rows.columns);
                gradient += weighed.tr_mul(left);
            }
            if let Some(factor) = Cholesky::new(information) {
                let change = factor.solve(&gradient);
                for (rows, (left, _)) in frames.iter().zip(&mut found) {
                    *left -= &rows.columns * &change;
                }
            }
        }
        let readings = found.iter().zip(&self.observations);
        Ok(readings
            .map(|((left, covariance), each)| {
                discrepancy.judged(left, covariance, each.setup.commanded_rad.as_slice())
            })
            .collect())
    }

    /// How far the base of a station stands from where it was identified, as these readings have it: position (m) and rotation
    /// (rad) along and about its own axes, and the probability of that if nobody moved it. `set`, `places` and `discrepancy` as in
    /// [`prognoses`](Self::prognoses).
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
    ) -> Result<Option<MovedStation>, IdentificationError> {
        let joints: Vec<usize> = discrepancy.joints.iter().map(|each| each.joint).collect();
        let rows = self.rows_at(arm, set, set.prior().mean.as_slice(), &joints)?;
        let position = Axis::ALL.map(|axis| (ParameterKind::BasePosition { station, axis }, None));
        let rotation = Axis::ALL.map(|axis| (ParameterKind::BaseRotation { station, axis }, None));
        let Ok(base) = ParameterSet::new(arm, position.into_iter().chain(rotation)) else {
            return Ok(None);
        };
        let frames = self.rows_at(arm, &base, base.prior().mean.as_slice(), &[])?;
        let size = discrepancy.covariance.nrows();
        // Sums over readings, weighed by what is new in each: of the frame's six parameters, then of all that is known.
        let mut information = DMatrix::zeros(6 + size, 6 + size);
        let mut gradient = DVector::zeros(6 + size);
        let (mut read, mut average) = (Vec::new(), 0.0);
        let all = rows.iter().zip(&frames).zip(&self.observations);
        for ((rows, frame), each) in all.filter(|(_, each)| each.setup.station == station) {
            let q = each.setup.commanded_rad.as_slice();
            let local = discrepancy.local(rows, places, q);
            let new = local.new.diagonal().rows(0, 3).sum();
            let Some(factor) = Cholesky::new(local.new) else {
                continue;
            };
            read.push(frame);
            average += new;
            let index = (0..6).chain(local.index.iter().map(|place| 6 + place));
            let mut matrix = local.matrix.insert_columns(0, 6, 0.0);
            matrix.columns_mut(0, 6).copy_from(&frame.columns);
            let weighed = factor.solve(&matrix);
            let (among, pull) = (weighed.tr_mul(&matrix), weighed.tr_mul(&local.left));
            for (row, to) in index.clone().enumerate() {
                gradient[to] += pull[row];
                for (column, from) in index.clone().enumerate() {
                    information[(to, from)] += among[(row, column)];
                }
            }
        }
        // (R + A C A^T)^-1 = R^-1 - R^-1 A C (1 + A^T R^-1 A C)^-1 A^T R^-1, where C may be singular.
        let of_known = information.view((6, 6), (size, size));
        let mixed = DMatrix::identity(size, size) + of_known * &discrepancy.covariance;
        let of_both = information.view((6, 0), (size, 6)).into_owned();
        let mut right = of_both.clone().insert_column(6, 0.0);
        right.column_mut(6).copy_from(&gradient.rows(6, size));
        let Some(solved) = mixed.lu().solve(&right) else {
            return Ok(None);
        };
        let through = of_both.tr_mul(&(&discrepancy.covariance * solved));
        let of_frame = information.view((0, 0), (6, 6)) - through.columns(0, 6);
        let pull = gradient.rows(0, 6) - through.column(6);
        let size = of_frame.diagonal().map(|each| each.max(0.0).sqrt().recip());
        let relative = DMatrix::from_fn(6, 6, |row, column| {
            of_frame[(row, column)] * size[row] * size[column]
        });
        let (Some(factor), Ok(distribution)) = (Cholesky::new(relative), ChiSquared::new(6.0))
        else {
            return Ok(None);
        };
        let change = factor
            .solve(&pull.component_mul(&size))
            .component_mul(&size);
        let of_station = read.len().max(1) as f64;
        let displaced = read
            .iter()
            .map(|frame| (frame.columns.rows(0, 3) * &change).norm_squared());
        let displaced: f64 = displaced.sum();
        let square = change.dot(&pull) / f64::max(discrepancy.scale[0], 1.0);
        Ok(Some(MovedStation {
            position_m: change.fixed_rows::<3>(0).into_owned(),
            rotation_rad: change.fixed_rows::<3>(3).into_owned(),
            probability: distribution.sf(square),
            readings_m: (displaced / of_station).sqrt(),
            discrepancy_m: (average / (3.0 * of_station)).sqrt(),
        }))
    }
}
