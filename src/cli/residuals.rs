//! Residuals by measurement, for a person.

use elastocal::identification::{Identification, MeasurementResidual, RejectedReading, Residuals};

use super::table::{number, or_dash, table};

/// So many measurements are listed, those that fit least first.
const LISTED: usize = 6;
/// A measurement is no suspect where chance puts one as far out with a larger probability.
const BY_CHANCE: f64 = 0.01;

/// The residuals that are farthest from what chance explains, and what would be without the farthest.
pub fn describe(
    identification: &Identification,
    residuals: &Residuals,
    rejected: &[RejectedReading],
) -> String {
    let mut order: Vec<usize> = (0..residuals.measurements.len()).collect();
    let rank = |index: usize| residuals.measurements[index].probability.unwrap_or(1.0);
    let far = |index: usize| residuals.measurements[index].distance;
    order.sort_by(|&one, &other| {
        (rank(one).total_cmp(&rank(other))).then(far(other).total_cmp(&far(one)))
    });
    let all = order.len();
    order.truncate(LISTED);
    let rows = order.into_iter().map(|index| {
        let mut row = row(identification, index, &residuals.measurements[index]);
        if rejected.iter().any(|each| each.reading == index) {
            row[0] += " (left out)";
        }
        row
    });
    let mut text = table(
        "measurement | residual x, y, z [mm] | over its standard deviation | probability",
        rows,
    );
    if all > LISTED {
        text += &format!("  ({} more fit better)\n", all - LISTED);
    }
    text + &suspect(identification, residuals)
}

fn row(
    identification: &Identification,
    index: usize,
    residual: &MeasurementResidual,
) -> Vec<String> {
    let three = |values: &mut dyn Iterator<Item = String>| values.collect::<Vec<_>>().join(" ");
    let residuals_m = &identification.residuals_m[3 * index..3 * index + 3];
    vec![
        (index + 1).to_string(),
        three(&mut (residuals_m.iter()).map(|value| format!("{:7.4}", value * 1e3))),
        three(&mut (residual.standardised.iter()).map(|value| format!("{:>5}", number(*value, 1)))),
        or_dash(residual.probability, probability),
    ]
}

/// A probability with two digits.
pub fn probability(value: f64) -> String {
    if value >= 0.01 {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}

fn suspect(identification: &Identification, residuals: &Residuals) -> String {
    let Some(suspect) = &residuals.suspect else {
        return String::new();
    };
    let number = suspect.measurement + 1;
    if suspect.probability_of_any > BY_CHANCE {
        return format!(
            "  Measurement {number} has the largest residual: p = {}, no outlier.\n",
            probability(suspect.probability_of_any)
        );
    }
    let changes: Vec<String> = (identification.parameters.iter().zip(&suspect.change))
        .filter_map(|(parameter, change)| Some(format!("{} {:+.1}", parameter.name, (*change)?)))
        .collect();
    let mut text = format!(
        "  Measurement {number} has the largest residual: p = {}.",
        probability(suspect.probability_of_any)
    );
    if !changes.is_empty() {
        text += &format!(
            " Without it, the compliances change by so many standard errors: {}",
            changes.join(", ")
        );
        text += &suspect.consistency.map_or_else(
            || ".".to_owned(),
            |consistency| {
                format!(
                    "; residuals as large as the others' have a probability of {}.",
                    probability(consistency)
                )
            },
        );
    }
    text + "\n"
}
