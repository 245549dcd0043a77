//! Readings that were not fitted beside what a fit predicts for them.

use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::super::discrepancy::three_rows;
use super::residuals::LinearReading;
use super::{AbsoluteCase, DiscrepancyModel, FitResult, ReadingPrognosis};
use crate::parameter::{ElasticArm, ParameterKind, ParameterSet};

/// Stations that stand as far off with a smaller probability were moved.
const MOVED: f64 = 1e-6;
/// What is known of a new frame before its readings: the variance of each parameter, in typical sizes.
const ANEW: f64 = 1e4;

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

    /// The probability of differences from the prediction that are as large, with the covariance of identification and readings: where the
    /// planner's model says what readings share, as it does of distances, and no joint has an error of its own. All as in
    /// [`prognoses`](Self::prognoses).
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
        if !self.is_sharing_known || !discrepancy.joints.is_empty() {
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
    ) -> FitResult<Option<MovedStation>> {
        let setups = self.observations.iter().map(|each| &each.setup);
        let own = setups.filter(|each| each.station == station);
        let own: Vec<&[f64]> = own.map(|each| each.commanded_rad.as_slice()).collect();
        let discrepancy = discrepancy.clone().reaching(&own);
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
        let all = rows.iter().zip(&frames).zip(&self.observations);
        for ((rows, frame), each) in all.filter(|(_, each)| each.setup.station == station) {
            let q = each.setup.commanded_rad.as_slice();
            let local = discrepancy.local(rows, places, q);
            let new = three_rows(&local.new.diagonal(), 0).sum() / local.left.len().min(3) as f64;
            let Some(factor) = Cholesky::new(local.new) else {
                continue;
            };
            read.push(frame);
            average += new;
            let index = (0..own).chain(local.index.iter().map(|place| own + place));
            let mut matrix = local.matrix.insert_columns(0, own, 0.0);
            matrix.columns_mut(0, own).copy_from(&frame.columns);
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
