//! The figures of a calibration's report.

use plotters::style::RGBColor;

use crate::plan::search::BudgetPoint;
use crate::record::evidence::CriterionPlanMessage;
use crate::text::wording::{joined, percent};
use crate::view::charts::{
    COLOURS, Chart, ChartAxis, GRID, HALF, INK, Mark, PlotError, Rows, Series, WHOLE,
};

/// The height of the figures that are no row charts.
const HEIGHT: u32 = 620;
/// At so many test poses at most each has its number under the figure.
const MOST_TICKS: usize = 36;
/// The half width of a 95 % interval of a standard normal.
const NORMAL_95: f64 = 1.96;
/// Name, colour, mark (the colour is not all that tells them apart) and shift from the measurement's place of each coordinate, and of
/// what a gauge reads along its direction.
const AXES: [(&str, RGBColor, Mark, f64); 4] = [
    ("x", COLOURS[0], Mark::Square, -0.2),
    ("y", COLOURS[1], Mark::Triangle, 0.0),
    ("z", COLOURS[2], Mark::Diamond, 0.2),
    ("along the gauge", COLOURS[3], Mark::Dot, 0.0),
];

/// `rho_0` against the number of measurements: what was searched, this plan, this plan repeated,
/// and the bound.
pub fn accuracy_figure(
    (points, repeated): (&[BudgetPoint], &[BudgetPoint]),
    bounds_mm: &[Option<f64>],
    own_experiments: u32,
) -> Result<String, PlotError> {
    let micro = |point: &BudgetPoint| (f64::from(point.experiments), point.rho0_m * 1e6);
    let found: Vec<(f64, f64)> = points.iter().map(micro).collect();
    let own = (points.iter()).find(|point| point.experiments == own_experiments);
    let first = found.first().map_or(1.0, |point| point.0);
    let bound = (1..).map(f64::from).zip(bounds_mm);
    let bound = bound.filter_map(|(m, bound)| Some((m, (*bound)? * 1e3)));
    let bound = bound.filter(|(m, bound)| *m >= first && *bound > 0.0);
    let bound: Vec<(f64, f64)> = bound.collect();
    let repeated = repeated.iter().map(micro).collect();
    let own = own.map(micro).into_iter().collect();
    let [blue, orange, ..] = COLOURS;
    let series = [
        Series::new("no plan is below", INK, Mark::Dashed, bound),
        Series::new("best plan found", blue, Mark::Dot, found),
        Series::new("this plan, repeated", orange, Mark::Cross, repeated),
        Series::new("this plan", INK, Mark::Ring, own),
    ];
    let tip = |name: &str, x: f64, y: f64| format!("{name}, {x}: {y:.2} \u{b5}m");
    let tipped = series.map(|each| each.tipped(tip));
    Chart::of_accuracy(tipped.into()).figure(
        (HALF, HEIGHT),
        "Accuracy against the number of measurements",
    )
}

/// What is predicted along a path, or over a region (um), by the number of each pose, which has a name, and over all of them.
pub fn path_figure(
    names: &[&str],
    values_um: &[f64],
    over_all_um: Option<f64>,
) -> Result<String, PlotError> {
    let values = values_um.iter().copied();
    let points: Vec<(f64, f64)> = (1..).map(f64::from).zip(values).collect();
    let top = values_um.iter().copied().fold(0.0, f64::max) * 1.12;
    let x = 0.0..values_um.len() as f64 + 1.0;
    let across = over_all_um.map_or_else(Vec::new, |all| vec![(x.start, all), (x.end, all)]);
    let dots = Series::new("", COLOURS[0], Mark::Dot, points.clone());
    let mut across_axis = ChartAxis::whole(x);
    if points.len() <= MOST_TICKS {
        across_axis.ticks = points.iter().map(|point| point.0).collect();
    }
    let tip = |_: &str, x: f64, y: f64| {
        let place = points.iter().position(|point| point.0 >= x);
        let name = place.and_then(|place| names.get(place)).unwrap_or(&"");
        format!("{x}, {name}: {y:.2} \u{b5}m")
    };
    let dots = dots.tipped(tip);
    let chart = Chart {
        axes: [
            across_axis,
            ChartAxis::linear(0.0..top.max(f64::MIN_POSITIVE), 5),
        ],
        names: [
            "number of the test pose".to_owned(),
            "\u{3c1}\u{2080} [\u{b5}m]".to_owned(),
        ],
        series: vec![
            Series::new("", INK, Mark::Dashed, across),
            Series::new("", COLOURS[0], Mark::Line, points),
            dots,
        ],
    };
    chart.figure((WHOLE, HEIGHT), "Accuracy along the test poses")
}

/// What a criterion's plan is called.
pub fn criteria_names(plan: &CriterionPlanMessage) -> String {
    let name = |name: &String| match name.as_str() {
        "test_pose" => "test pose".to_owned(),
        other => other.to_uppercase(),
    };
    joined(plan.criteria.iter().map(name), ", ")
}

/// A compliance with its 95 % interval, relative to the truth.
pub struct RelativeEstimate {
    /// The joint.
    pub name: String,
    /// The estimate less the truth, over the truth, and the ends of its interval.
    pub error: Option<(f64, [f64; 2])>,
}

/// The identified compliances against the truth.
pub fn compliances_figure(estimates: &[RelativeEstimate]) -> Result<String, PlotError> {
    let note = |each: &RelativeEstimate| match each.error {
        Some((error, _)) => {
            let sign = if error < 0.0 { "" } else { "+" };
            sign.to_owned() + &percent(Some(error), 1)
        }
        None => "not determined".to_owned(),
    };
    let ends = (estimates.iter()).filter_map(|each| each.error);
    let widest = ends
        .flat_map(|(error, [low, high])| [error.abs(), low.abs(), high.abs()])
        .fold(0.001, f64::max);
    let high = widest * 100.0 * 1.08;
    let rows = Rows {
        names: estimates.iter().map(|each| each.name.clone()).collect(),
        notes: estimates.iter().map(note).collect(),
        width: HALF,
        axis: ChartAxis::linear(-high..high, 6),
        title: "estimate less simulated truth, share of it [%]",
    };
    let upwards = vec![(0.0, 0.0), (0.0, estimates.len() as f64)];
    let mut series = vec![Series::new("", INK, Mark::Segments(2), upwards)];
    for (row, each) in estimates.iter().enumerate() {
        if let Some((error, [low, high])) = each.error {
            let ends = [low, error, high].map(|share| share * 100.0);
            series.extend(Series::interval(ends, rows.middle(row), COLOURS[0]));
        }
    }
    let title = "Identified compliances with 95 % intervals, against the simulated truth";
    rows.figure(title, &series)
}

/// Residuals in standard deviations of their own, of every measurement: of its coordinates, or of what a gauge reads.
pub fn residuals_figure(standardised: &[[Option<f64>; 4]]) -> Result<String, PlotError> {
    let all = standardised.iter().flatten().flatten();
    let high = all.map(|value| value.abs()).fold(2.6, f64::max) * 1.12;
    let x = 0.5..standardised.len() as f64 + 0.5;
    let band = vec![(x.start, -NORMAL_95), (x.end, NORMAL_95)];
    let mut series = vec![
        Series::new("", GRID, Mark::Bars(0.6), band),
        Series::new(
            "",
            INK,
            Mark::Segments(1),
            vec![(x.start, 0.0), (x.end, 0.0)],
        ),
    ];
    for (axis, (name, colour, mark, aside)) in AXES.into_iter().enumerate() {
        let numbered = (1..).map(f64::from).zip(standardised);
        let points = numbered.filter_map(|(number, each)| Some((number + aside, each[axis]?)));
        let points: Vec<(f64, f64)> = points.collect();
        if points.is_empty() {
            continue;
        }
        let stems = points.iter().flat_map(|&(x, y)| [(x, 0.0), (x, y)]);
        series.push(Series::new("", colour, Mark::Segments(3), stems.collect()));
        let marks = Series::new(name, colour, mark, points);
        series.push(marks.tipped(|name, x, y| format!("{:.0}, {name}: {y:.2}", x - aside)));
    }
    let chart = Chart {
        axes: [ChartAxis::whole(x), ChartAxis::linear(-high..high, 6)],
        names: ["measurement", "standardised residual"].map(str::to_owned),
        series,
    };
    chart.figure((HALF, HEIGHT), "Standardised residuals")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_gauge_reads_is_no_coordinate() -> Result<(), PlotError> {
        let along = [None, None, None, Some(1.0)];
        let svg = residuals_figure(&[along, along])?;
        assert!(svg.contains("2, along the gauge: 1.00") && !svg.contains(", x: "));
        let whole = [Some(1.0), Some(2.0), Some(-1.0), None];
        let svg = residuals_figure(&[whole, along])?;
        assert!(svg.contains("1, z: -1.00") && svg.contains("2, along the gauge"));
        Ok(())
    }
}
