//! The figures of a calibration's report.

use std::ops::Range;

use plotters::prelude::*;

use crate::plan::search::BudgetPoint;
use crate::record::evidence::CriterionPlanMessage;
use crate::text::wording::{micrometres, percent};
use crate::view::charts::{
    COLOURS, ChartAxis, GRID, HALF, INK, Mark, PlotError, Rows, Series, Tip, WHOLE, chart_of,
    drawing, interval, whole_ticks,
};

/// The height of the figures that are no row charts.
const HEIGHT: u32 = 620;
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
    let last = bounds_mm.len() as f64;
    let first = found.first().map_or(1.0, |point| point.0);
    let bound: Vec<(f64, f64)> = (1..)
        .map(f64::from)
        .zip(bounds_mm)
        .filter_map(|(m, bound)| Some((m, (*bound)? * 1e3)))
        .filter(|point| point.0 >= first)
        .collect();
    let repeated: Vec<(f64, f64)> = repeated.iter().map(micro).collect();
    let all = found.iter().chain(&bound).map(|point| point.1);
    let top = all.fold(0.0, f64::max) * 1.12;
    let [blue, orange, ..] = COLOURS;
    let series = [
        (Series::new("no plan is below", INK, Mark::Dashed), bound),
        (Series::new("best plan found", blue, Mark::Dot), found),
        (
            Series::new("this plan, repeated", orange, Mark::Cross),
            repeated,
        ),
        (
            Series::new("this plan", INK, Mark::Ring),
            own.map(micro).into_iter().collect(),
        ),
    ];
    let (series, points): (Vec<Series>, Vec<Vec<(f64, f64)>>) = series.into_iter().unzip();
    let x = (first - 0.4).max(0.0)..last + 0.4;
    drawing(
        (HALF, HEIGHT),
        "Accuracy against the number of measurements",
        |area| {
            let names = [
                "measurements",
                "\u{3c1}\u{2080}, rms residual error [\u{b5}m]",
            ];
            let axes = over_numbers(&x, ChartAxis::linear(0.0..top, 5));
            let mut chart = chart_of(area, axes, names, &series)?;
            let mut tips = Vec::new();
            for (each, points) in series.iter().zip(&points) {
                each.draw(&mut chart, points)?;
                tips.extend(points.iter().map(|&(x, y)| {
                    Tip::new(
                        &chart,
                        (x, y),
                        format!("{}, {x}: {y:.2} \u{b5}m", each.name),
                    )
                }));
            }
            Ok(tips)
        },
    )
}

/// What is predicted along a path, or over a region (um), by the number of each pose, and over all of them.
pub fn path_figure(values_um: &[f64], over_all_um: Option<f64>) -> Result<String, PlotError> {
    let points: Vec<(f64, f64)> = (1..)
        .map(f64::from)
        .zip(values_um.iter().copied())
        .collect();
    let last = values_um.len() as f64;
    let top = values_um.iter().copied().fold(0.0, f64::max) * 1.12;
    let x = 0.0..last + 1.0;
    drawing((WHOLE, HEIGHT), "Accuracy along the test poses", |area| {
        let axes = over_numbers(&x, ChartAxis::linear(0.0..top.max(f64::MIN_POSITIVE), 5));
        let names = ["test pose", "\u{3c1}\u{2080} [\u{b5}m]"];
        let mut chart = chart_of(area, axes, names, &[])?;
        if let Some(all) = over_all_um {
            let across = [(x.start, all), (x.end, all)];
            Series::new("", INK, Mark::Dashed).draw(&mut chart, &across)?;
        }
        for mark in [Mark::Line, Mark::Dot] {
            Series::new("", COLOURS[0], mark).draw(&mut chart, &points)?;
        }
        let tip = |&(x, y): &(f64, f64)| Tip::new(&chart, (x, y), format!("{x}: {y:.2} \u{b5}m"));
        Ok(points.iter().map(tip).collect())
    })
}

/// The accuracy of the best plan for each criterion.
pub fn criteria_figure(plans: &[CriterionPlanMessage]) -> Result<String, PlotError> {
    let names: Vec<String> = plans.iter().map(criteria_names).collect();
    let best = plans.first().and_then(|plan| plan.rho0_mm);
    let note = |(index, plan): (usize, &CriterionPlanMessage)| match (plan.rho0_mm, best) {
        (Some(rho0), Some(best)) if index > 0 && rho0 > best * 1.001 => {
            let more = percent(Some(rho0 / best - 1.0), 0);
            format!("{} (+{more})", micrometres(Some(rho0)))
        }
        (None, _) if plan.problem.is_some() => "no plan".to_owned(),
        (rho0, _) => micrometres(rho0),
    };
    let notes: Vec<String> = plans.iter().enumerate().map(note).collect();
    let largest = (plans.iter()).filter_map(|plan| plan.rho0_mm);
    let high = largest.fold(f64::MIN_POSITIVE, f64::max) * 1e3 * 1.04;
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: HALF,
        axis: ChartAxis::linear(0.0..high, 4),
        title: "\u{3c1}\u{2080} at the test pose [\u{b5}m]".to_owned(),
    };
    let title = "Accuracy of the best plan for each criterion";
    rows.drawn(title, |chart| {
        for (row, plan) in plans.iter().enumerate() {
            let Some(rho0) = plan.rho0_mm else { continue };
            let colour = if row == 0 { COLOURS[0] } else { COLOURS[4] };
            let (middle, half) = (rows.middle(row), 0.32);
            let corners = [(0.0, middle - half), (rho0 * 1e3, middle + half)];
            chart.draw_series([Rectangle::new(corners, colour.filled())])?;
        }
        Ok(())
    })
}

/// What a criterion's plan is called.
pub fn criteria_names(plan: &CriterionPlanMessage) -> String {
    let name = |name: &String| match name.as_str() {
        "test_pose" => "test pose".to_owned(),
        other => other.to_uppercase(),
    };
    let names: Vec<String> = plan.criteria.iter().map(name).collect();
    names.join(", ")
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
    let names: Vec<String> = estimates.iter().map(|each| each.name.clone()).collect();
    let notes: Vec<String> = (estimates.iter())
        .map(|each| match each.error {
            Some((error, _)) => {
                let sign = if error < 0.0 { "" } else { "+" };
                sign.to_owned() + &percent(Some(error), 1)
            }
            None => "not determined".to_owned(),
        })
        .collect();
    let ends = (estimates.iter()).filter_map(|each| each.error);
    let widest = ends
        .flat_map(|(error, [low, high])| [error.abs(), low.abs(), high.abs()])
        .fold(0.001, f64::max);
    let high = widest * 100.0 * 1.08;
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: HALF,
        axis: ChartAxis::linear(-high..high, 6),
        title: "estimate less simulated truth, share of it [%]".to_owned(),
    };
    let title = "Identified compliances with 95 % intervals, against the simulated truth";
    rows.drawn(title, |chart| {
        let bottom_to_top = [(0.0, 0.0), (0.0, estimates.len() as f64)];
        chart.draw_series([PathElement::new(bottom_to_top, INK.stroke_width(2))])?;
        for (row, each) in estimates.iter().enumerate() {
            if let Some((error, [low, high])) = each.error {
                let ends = [low, error, high].map(|share| share * 100.0);
                interval(chart, ends, rows.middle(row), COLOURS[0])?;
            }
        }
        Ok(())
    })
}

/// Residuals in standard deviations of their own, of every measurement: of its coordinates, or of what a gauge reads.
pub fn residuals_figure(standardised: &[[Option<f64>; 4]]) -> Result<String, PlotError> {
    let count = standardised.len() as f64;
    let all = standardised.iter().flatten().flatten();
    let largest = all.map(|value| value.abs());
    let high = largest.fold(2.6, f64::max) * 1.12;
    let x = 0.5..count + 0.5;
    let is_read = |axis: &usize| standardised.iter().any(|each| each[*axis].is_some());
    let read: Vec<usize> = (0..AXES.len()).filter(is_read).collect();
    let series: Vec<Series> = (read.iter().map(|&axis| AXES[axis]))
        .map(|(name, colour, mark, _)| Series::new(name, colour, mark))
        .collect();
    drawing((HALF, HEIGHT), "Standardised residuals", |area| {
        let names = ["measurement", "standardised residual"];
        let axes = over_numbers(&x, ChartAxis::linear(-high..high, 6));
        let mut chart = chart_of(area, axes, names, &series)?;
        let band = [(x.start, -NORMAL_95), (x.end, NORMAL_95)];
        chart.draw_series([Rectangle::new(band, GRID.mix(0.6).filled())])?;
        chart.draw_series([PathElement::new([(x.start, 0.0), (x.end, 0.0)], INK)])?;
        let mut tips = Vec::new();
        for (series, &axis) in series.iter().zip(&read) {
            let (name, colour, _, offset) = AXES[axis];
            for (number, residual) in (1..).map(f64::from).zip(standardised) {
                let Some(y) = residual[axis] else { continue };
                let at = (number + offset, y);
                let stem = [(at.0, 0.0), at];
                chart.draw_series([PathElement::new(stem, colour.stroke_width(3))])?;
                series.draw(&mut chart, &[at])?;
                tips.push(Tip::new(&chart, at, format!("{number}, {name}: {y:.2}")));
            }
        }
        Ok(tips)
    })
}

/// Axes over whole numbers.
fn over_numbers(x: &Range<f64>, y: ChartAxis) -> [ChartAxis; 2] {
    [ChartAxis::new(x.clone(), whole_ticks(x.start, x.end)), y]
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
