//! Plots of budgets of measurements as SVG.

use super::charts::{
    COLOURS, ChartAxis, INK, Mark, PlotError, SIZE, SOFT, Series, chart_of, plot, whole_ticks,
};
use crate::plan::search::{BudgetPoint, repeated_configurations};
use crate::text::wording::counted;

/// How far lines stand beside each other, in measurements.
const ASIDE: f64 = 0.07;

/// `rho_0` against the number of measurements: a line for each number of configurations, the bound that no plan can beat, and the
/// accuracy that is wanted (m). Returns the SVG text.
///
/// # Errors
/// There are no points, or the drawing fails.
pub fn budget_plot(
    title: &str,
    points: &[BudgetPoint],
    wanted_m: f64,
) -> Result<String, PlotError> {
    let counts = || points.iter().map(|point| f64::from(point.experiments));
    let [fewest, most] = [
        counts().fold(f64::MAX, f64::min),
        counts().fold(0.0, f64::max),
    ];
    if points.is_empty() {
        return Err(PlotError::new("there are no points"));
    }
    let top = points.iter().map(|point| point.rho0_m).fold(0.0, f64::max);
    let micro = |point: &BudgetPoint, value: f64| (f64::from(point.experiments), value * 1e6);
    let line = |keep: &dyn Fn(&&BudgetPoint) -> bool| -> Vec<(f64, f64)> {
        let kept = points.iter().filter(keep);
        kept.map(|point| micro(point, point.rho0_m)).collect()
    };
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = (repeated_configurations(points).into_iter())
        .map(|count| {
            let name = counted(count.into(), "configuration");
            (name, line(&|point| point.configurations == count))
        })
        .collect();
    lines.push((
        "all different".to_owned(),
        line(&|point| point.configurations == point.experiments),
    ));
    let mut bound: Vec<(f64, f64)> = (points.iter())
        .filter_map(|point| Some(micro(point, point.lower_bound_m()?)))
        .collect();
    bound.dedup();
    let mut series: Vec<Series> = (lines.iter().enumerate())
        .map(|(index, (name, _))| Series::new(name, COLOURS[index % COLOURS.len()], Mark::Line))
        .collect();
    series.push(Series::new("no plan is below", INK, Mark::Dashed));
    let is_near = wanted_m < 2.0 * top;
    if is_near {
        series.push(Series::new("wanted", SOFT, Mark::Line));
    }
    let (low, high) = (fewest - 0.3, most.max(fewest + 1.0) + 0.3);
    let wanted = [low, high].map(|at| (at, wanted_m * 1e6));
    let top = if is_near { top.max(wanted_m) } else { top };
    let axes = [
        ChartAxis::new(low..high, whole_ticks(low, high)),
        ChartAxis::linear(0.0..top * 1.05e6, 8),
    ];
    let names = [
        "measurements",
        "\u{3c1}\u{2080}, rms residual error [\u{b5}m]",
    ];
    plot(SIZE, title, |area| {
        let mut chart = chart_of(area, axes, names, &series)?;
        let middle = (lines.len() as f64 - 1.0) / 2.0;
        for (index, (each, (_, line))) in series.iter().zip(&lines).enumerate() {
            // Beside each other, since many of them nearly agree.
            let aside = (index as f64 - middle) * ASIDE;
            let beside: Vec<(f64, f64)> = line.iter().map(|&(m, rho0)| (m + aside, rho0)).collect();
            Series::new("", each.colour, Mark::Dot).draw(&mut chart, &beside)?;
            each.draw(&mut chart, &beside)?;
        }
        let levels = [bound.as_slice(), &wanted];
        (series[lines.len()..].iter().zip(levels))
            .try_for_each(|(each, line)| each.draw(&mut chart, line))
    })
}
