//! Residuals of absolute readings in the form in which patterns are looked for.

use nalgebra::{Matrix6xX, Vector3, Vector6};

use super::super::discrepancy::discrepancy_covariance;
use super::super::patterns::{BLOCKS, LookedAt, ReadingRows};
use super::case::whitener;
use super::{AbsoluteCase, AbsoluteFit, FitResult, IdentificationError, Unexplained};
use crate::measurement::AbsoluteReading;
use crate::observation::{Observation, ObservationModel, Reading, ReadingKind};
use crate::parameter::ParameterKind;
use crate::robot::Approach;

impl AbsoluteCase<'_> {
    /// The same of what joint error functions leave beside the parameters, where the fit has some.
    ///
    /// # Errors
    /// The robot has no equilibrium.
    pub fn looked_at_beside_joint_errors(
        &self,
        fit: &AbsoluteFit,
        readings: &[AbsoluteReading],
    ) -> FitResult<Option<LookedAt>> {
        let Some(Unexplained { model, .. }) = &fit.discrepancy_model else {
            return Ok(None);
        };
        let mut beside = fit.clone();
        for (value, shift) in beside.posterior.mean.iter_mut().zip(&model.shift) {
            *value += shift;
        }
        beside.discrepancy = Some(model.rest);
        let looked =
            (self.part_of(|_| true).displaced(&model.joints)).looked_at(&beside, readings)?;
        Ok((!model.joints.is_empty()).then_some(looked))
    }

    /// What a fit leaves of the readings that the case was made of. Each counts by its own covariance and by the fit's discrepancy,
    /// those of one visit, too.
    ///
    /// # Errors
    /// The robot has no equilibrium.
    pub fn looked_at(
        &self,
        fit: &AbsoluteFit,
        readings: &[AbsoluteReading],
    ) -> FitResult<LookedAt> {
        let joints = self.arm.chain.len();
        let kinds = (0..joints).flat_map(|joint| {
            let zero = ParameterKind::JointZero { joint };
            [zero, ParameterKind::JointCompliance { joint }]
        });
        let (set, places) = fit.set.with_more(&fit.reference, kinds)?;
        let places = places.as_chunks::<2>().0;
        let mut values = set.prior().mean.clone();
        values.rows_mut(0, fit.set.len()).copy_from(&fit.values());
        let scales = set.scales();
        let mut model = ObservationModel::new(&set, &fit.reference, values.as_slice());
        let [mut rows, mut other] = [(); 2].map(|()| Matrix6xX::zeros(set.len()));
        let discrepancy = discrepancy_covariance(fit.discrepancy.unwrap_or_default());
        let blocks = self.blocks(BLOCKS.min(self.different() / 2).max(1));
        let mut all = Vec::new();
        for (index, reading) in readings.iter().enumerate() {
            // As if it shared no discrepancy with others.
            let covariance = self.covariances[index] + discrepancy;
            let each = Observation {
                whitener: whitener(&covariance),
                ..self.observations[index].clone()
            };
            let kind = each.reading.kind();
            let predicted = model
                .predict(&each.setup, kind, &mut rows)
                .map_err(|error| IdentificationError::from((index, error)))?;
            let residual = each.whiten(&predicted, &mut rows);
            let position_m = if self.is_length(index) {
                let place = model.predict(&each.setup, ReadingKind::Position, &mut other);
                (place.map_err(|error| IdentificationError::from((index, error)))?).position_m
            } else {
                each.position_m()
            };
            let [moved, mut bent] = [0, 1].map(|which| {
                let chosen = places.iter().map(|place| place[which]);
                rows.select_columns(&chosen.collect::<Vec<_>>())
            });
            for (mut column, [_, place]) in bent.column_iter_mut().zip(places) {
                let parameter = &set.parameters()[*place];
                if parameter.is_logarithmic {
                    column /= parameter.quantity(&fit.reference, values[*place]);
                }
            }
            let torques = (0..joints)
                .map(|joint| {
                    let turned = moved.column(joint);
                    let square = turned.norm_squared();
                    let shared = bent.column(joint).dot(&turned);
                    if square > 0.0 { shared / square } else { 0.0 }
                })
                .collect();
            let mut fitted = rows.columns(0, fit.set.len()).into_owned();
            for (mut column, scale) in fitted.column_iter_mut().zip(&scales) {
                column *= *scale;
            }
            all.push(ReadingRows {
                residual,
                fitted,
                moved,
                bent,
                placed: placed_columns(&each, position_m, fit),
                angles: each.setup.commanded_rad.clone(),
                torques,
                // Joints that are not commanded have no side, and count as positive.
                approach: (reading.approach.as_ref())
                    .map(|approach| Approach::of_all(Some(approach), &self.arm.chain)),
                range_m: Some(each.position_m().norm()),
                time_s: reading.time_s,
                temperature_c: reading.temperature_c,
                count: kind.rows(),
                block: blocks[index],
            });
        }
        Ok(LookedAt::new(&self.arm.chain, all, false))
    }
}

/// Shifts of the station's frame, growth about the base, and an error along the line of sight; of a length what it shows.
fn placed_columns(
    each: &Observation,
    position_m: Vector3<f64>,
    fit: &AbsoluteFit,
) -> Matrix6xX<f64> {
    let base = &fit.arm.instrument_from_base[each.setup.station];
    let length = match each.reading {
        Reading::Length(read) => Some(read.kind.row(&position_m).1),
        _ => None,
    };
    let sight = length.unwrap_or_else(|| position_m.try_normalize(0.0).unwrap_or_default());
    let directions = [
        Vector3::x(),
        Vector3::y(),
        Vector3::z(),
        position_m - base.translation.vector,
        sight,
    ];
    let columns = directions.map(|direction| {
        let mut column = Vector6::zeros();
        match length {
            Some(along) => column[0] = direction.dot(&along),
            None => column.fixed_rows_mut::<3>(0).copy_from(&direction),
        }
        column
    });
    let mut columns = Matrix6xX::from_columns(&columns);
    (each.whitener).whiten(each.reading.kind(), &mut Vector6::zeros(), &mut columns);
    columns
}
