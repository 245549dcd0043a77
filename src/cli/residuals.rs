//! Residuals by measurement, for a person.

use elastocal::identification::{Identification, MeasurementResidual, RejectedReading};
use elastocal::measurement::Measurement;
use nalgebra::Vector3;

use super::table::{number, or_dash, table};

/// So many measurements are listed, those that fit least first.
const LISTED: usize = 6;

/// The residuals that are farthest from what chance explains.
pub fn describe(
    identification: &Identification,
    measurements: &[Measurement],
    residuals: &[MeasurementResidual],
    rejected: &[RejectedReading],
) -> String {
    let mut order: Vec<usize> = (0..residuals.len()).collect();
    let rank = |index: usize| residuals[index].probability.unwrap_or(1.0);
    let far = |index: usize| residuals[index].distance;
    order.sort_by(|&one, &other| {
        (rank(one).total_cmp(&rank(other))).then(far(other).total_cmp(&far(one)))
    });
    let all = order.len();
    order.truncate(LISTED);
    let three = |values: &mut dyn Iterator<Item = String>| values.collect::<Vec<_>>().join(" ");
    let rows = order.into_iter().map(|index| {
        let residual = &residuals[index];
        let is_rejected = rejected.iter().any(|each| each.reading == index);
        let residual_m = Vector3::from_column_slice(&identification.residuals_m[3 * index..][..3]);
        let read_m = match measurements[index].direction {
            Some(direction) => vec![direction.dot(&residual_m)],
            None => residual_m.as_slice().to_vec(),
        };
        let standardised = residual.standardised.iter();
        vec![
            format!(
                "{}{}",
                index + 1,
                if is_rejected { " (left out)" } else { "" }
            ),
            three(&mut read_m.iter().map(|value| format!("{:7.4}", value * 1e3))),
            three(&mut standardised.map(|value| format!("{:>5}", number(*value, 1)))),
            or_dash(residual.probability, probability),
        ]
    });
    let is_along = |each: &&Measurement| each.direction.is_some();
    let coordinates = match measurements.iter().filter(is_along).count() {
        0 => "x, y, z",
        all if all == measurements.len() => "along the gauge",
        _ => "x, y, z, or along the gauge",
    };
    let header = format!(
        "measurement | residual {coordinates} [mm] | over its standard deviation | probability"
    );
    let mut text = table(&header, rows);
    if all > LISTED {
        text += &format!("  ({} more fit better)\n", all - LISTED);
    }
    text
}

/// A probability with two digits.
pub fn probability(value: f64) -> String {
    if value >= 0.01 {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}
