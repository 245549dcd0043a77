//! Plots of budgets of measurements as SVG.

use super::charts::{COLOURS, Chart, INK, Mark, PlotError, SOFT, Series};
use crate::plan::search::{BudgetPoint, repeated_configurations};
use crate::text::wording::counted;

/// By what factor lines stand beside each other.
const ASIDE: f64 = 1.01;

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
    let mut lines: Vec<(String, Vec<&BudgetPoint>)> = (repeated_configurations(points).into_iter())
        .map(|count| {
            let name = counted(count.into(), "configuration");
            let kept = points.iter().filter(|point| point.configurations == count);
            (name, kept.collect())
        })
        .collect();
    let different = points
        .iter()
        .filter(|point| point.configurations == point.experiments);
    lines.push(("all different".to_owned(), different.collect()));
    let middle = (lines.len() as f64 - 1.0) / 2.0;
    let mut series = Vec::new();
    for (index, (name, line)) in lines.iter().enumerate() {
        // Beside each other, since many of them nearly agree.
        let aside = ASIDE.powf(index as f64 - middle);
        let beside = line.iter().map(|point| micro(point, point.rho0_m));
        let beside: Vec<(f64, f64)> = beside.map(|(m, rho0)| (m * aside, rho0)).collect();
        let colour = COLOURS[index % COLOURS.len()];
        series.push(Series::new("", colour, Mark::Dot, beside.clone()));
        series.push(Series::new(name, colour, Mark::Line, beside));
    }
    let mut bound: Vec<(f64, f64)> = (points.iter())
        .filter_map(|point| Some(micro(point, point.lower_bound_m()?)))
        .filter(|(_, bound)| *bound > 0.0)
        .collect();
    bound.dedup();
    series.push(Series::new("no plan is below", INK, Mark::Dashed, bound));
    if wanted_m < 2.0 * top {
        let wanted = [fewest, most.max(fewest + 1.0)].map(|at| (at, wanted_m * 1e6));
        series.push(Series::new("wanted", SOFT, Mark::Line, wanted.into()));
    }
    Chart::of_accuracy(series).file(title)
}
