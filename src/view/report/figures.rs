//! The figures of a calibration's report.

use serde_json::Value;

use crate::identification::IdentificationMessage;
use crate::numeric::quantile::TWO_SIDED_95;
use crate::plan::search::BudgetPoint;
use crate::testbed::RunTruth;
use crate::text::wording::{listed, percent};
use crate::view::charts::{
    COLOURS, Chart, ChartAxis, GRID, HALF, INK, Mark, Series, WHOLE, middle,
};
use crate::workflow::evidence::EvidenceMessage;

/// At so many test poses at most each has its number under the figure.
const MOST_TICKS: usize = 36;
/// Name, colour, mark (the colour is not all that tells them apart) and shift from the measurement's place of each coordinate, and of
/// what a gauge reads along its direction.
const AXES: [(&str, &str, Mark, f64); 4] = [
    ("x", COLOURS[0], Mark::Square, -0.2),
    ("y", COLOURS[1], Mark::Triangle, 0.0),
    ("z", COLOURS[2], Mark::Diamond, 0.2),
    ("along the gauge", COLOURS[3], Mark::Dot, 0.0),
];

/// `rho_0` against the number of measurements: what was searched, this plan, this plan repeated,
/// and the bound.
pub fn accuracy_figure(evidence: &EvidenceMessage, own_experiments: u32) -> Value {
    let (points, bounds_mm) = (&evidence.accuracy, &evidence.lower_bounds_rho0_mm);
    let micro = |point: &BudgetPoint| (f64::from(point.experiments), point.rho0_m * 1e6);
    let own = (points.iter()).find(|point| point.experiments == own_experiments);
    let first = points.first().map_or(1.0, |point| micro(point).0);
    let bound = (1..).map(f64::from).zip(bounds_mm);
    let bound = bound.filter_map(|(m, bound)| Some((m, (*bound)? * 1e3)));
    let bound = bound.filter(|(m, bound)| *m >= first && *bound > 0.0);
    let found = points.iter().map(micro);
    let repeated = evidence.repeated.iter().map(micro);
    let [blue, orange, ..] = COLOURS;
    let series = [
        Series::new("no plan is below", INK, Mark::Dashed, bound),
        Series::new("best plan found", blue, Mark::Dot, found),
        Series::new("this plan, repeated", orange, Mark::Cross, repeated),
        Series::new("this plan", INK, Mark::Ring, own.map(micro)),
    ];
    let tip = |name: &str, x: f64, y: f64| format!("{name}, {x}: {y:.2} \u{b5}m");
    let tipped = series.map(|each| each.tipped(tip));
    let chart = Chart::of_accuracy(tipped.into(), false);
    chart.figure(HALF, "Accuracy against the number of measurements")
}

/// What is predicted along a path, or over a region (um), by the number of each pose, which has a name, and over all of them.
pub fn path_figure(names: &[&str], values_um: &[f64], over_all_um: Option<f64>) -> Value {
    let numbers = || (1_u32..).map(f64::from).take(values_um.len());
    let points = numbers().zip(values_um.iter().copied());
    let top = values_um.iter().copied().fold(f64::MIN_POSITIVE, f64::max) * 1.12;
    let x = 0.0..values_um.len() as f64 + 1.0;
    let across = (over_all_um.into_iter()).flat_map(|all| [(x.start, all), (x.end, all)]);
    let across = Series::new("", INK, Mark::Dashed, across);
    let line = Series::new("", COLOURS[0], Mark::Dotted, points);
    let named = numbers().zip(names).collect::<Vec<_>>();
    let tip = |_: &str, x: f64, y: f64| {
        let name = named.iter().find(|(number, _)| *number >= x);
        format!("{x}, {}: {y:.2} \u{b5}m", name.map_or("", |(_, name)| name))
    };
    let axis = if values_um.len() <= MOST_TICKS {
        ChartAxis::at(x, numbers())
    } else {
        ChartAxis::whole(x)
    };
    let axes = [axis, ChartAxis::linear(0.0..top, 5)];
    let names = ["number of the test pose", "\u{3c1}\u{2080} [\u{b5}m]"];
    let chart = Chart::new(axes, names, vec![across, line.tipped(tip)]);
    chart.figure(WHOLE, "Accuracy along the test poses")
}

/// The identified compliances with their 95 % intervals, relative to the simulated truth.
pub fn compliances_figure(found: &IdentificationMessage, truth: &RunTruth) -> Value {
    // The estimate less the truth, over the truth (%), between the ends of its interval.
    let errors = found.compliance_rad_per_nm.iter().enumerate();
    let errors = errors.map(|(index, value)| {
        let truth = truth.compliance_rad_per_nm.get(index)?;
        let [low, high] = found.compliance_ci95_rad_per_nm[index]?;
        Some([low, (*value)?, high].map(|value| 100.0 * (value / truth - 1.0)))
    });
    let errors: Vec<Option<[f64; 3]>> = errors.collect();
    let ends = errors.iter().flatten().flatten();
    let high = 1.08 * ends.fold(0.1, |widest: f64, end| widest.max(end.abs()));
    let count = errors.len();
    let upwards = [(0.0, 0.0), (0.0, count as f64)];
    let mut series = vec![Series::new("", INK, Mark::Segments(2.0), upwards)];
    let mut rows = Vec::new();
    for (row, (name, ends)) in found.parameters.iter().zip(&errors).enumerate() {
        let note = match ends {
            Some([_, error, _]) => {
                let sign = if *error < 0.0 { "" } else { "+" };
                sign.to_owned() + &percent(Some(error / 100.0), 1)
            }
            None => "not determined".to_owned(),
        };
        rows.push((name.clone(), note));
        let interval = ends.map(|ends| Series::interval(ends, middle(count, row), COLOURS[0]));
        let tip = |_: &str, x: f64, _| format!("{name}: {x:.2} %");
        series.extend(interval.into_iter().flatten().map(|each| each.tipped(tip)));
    }
    let axis = ChartAxis::linear(-high..high, 6);
    let title = "estimate less simulated truth, share of it [%]";
    let chart = Chart::of_rows(rows, axis, title, series);
    let name = "Identified compliances with 95 % intervals, against the simulated truth";
    chart.figure(HALF, name)
}

/// Residuals in standard deviations of their own, of every measurement: of its coordinates, or of what a gauge reads.
pub fn residuals_figure(standardised: &[[Option<f64>; 4]]) -> Value {
    let all = standardised.iter().flatten().flatten();
    let high = all.map(|value| value.abs()).fold(2.6, f64::max) * 1.12;
    let x = 0.5..standardised.len() as f64 + 0.5;
    let [low_95, high_95] = [-TWO_SIDED_95, TWO_SIDED_95].map(|y| [(x.start, y), (x.end, y)]);
    let band = low_95.into_iter().chain(high_95.into_iter().rev());
    let nought = [(x.start, 0.0), (x.end, 0.0)];
    let mut series = vec![
        Series::new("", GRID, Mark::Area(0.6), band),
        Series::new("", INK, Mark::Segments(1.0), nought),
    ];
    for (axis, (name, colour, mark, aside)) in AXES.into_iter().enumerate() {
        let numbered = (1..).map(f64::from).zip(standardised);
        let points = numbered.filter_map(|(number, each)| Some((number + aside, each[axis]?)));
        let points: Vec<(f64, f64)> = points.collect();
        if points.is_empty() {
            continue;
        }
        let stems = points.iter().flat_map(|&(x, y)| [(x, 0.0), (x, y)]);
        series.push(Series::new("", colour, Mark::Segments(3.0), stems));
        let marks = Series::new(name, colour, mark, points);
        series
            .push(marks.tipped(|name, x, y| format!("{}, {name}: {y:.2}", listed([x - aside], 0))));
    }
    let axes = [ChartAxis::whole(x), ChartAxis::linear(-high..high, 6)];
    let chart = Chart::new(axes, ["measurement", "standardised residual"], series);
    chart.figure(HALF, "Standardised residuals")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_gauge_reads_is_no_coordinate() {
        let along = [None, None, None, Some(1.0)];
        let figure = residuals_figure(&[along, along]).to_string();
        assert!(figure.contains("2, along the gauge: 1.00") && !figure.contains(", x: "));
        let whole = [Some(1.0), Some(2.0), Some(-1.0), None];
        let figure = residuals_figure(&[whole, along]).to_string();
        assert!(figure.contains("1, z: -1.00") && figure.contains("2, along the gauge"));
    }
}
