//! Plots as SVG: budgets of measurements, selections of readings, models compared, and patterns in residuals.

use std::ops::Range;

use plotters::style::RGBColor;

use super::charts::{
    Area, COLOURS, Chart, ChartAxis, INK, Mark, PlotError, SOFT, Series, plot, text,
};
use crate::identification::patterns::{Pattern, PatternPoint, Patterns};
use crate::identification::{DistanceStatistics, ModelSelection, NestedModel};
use crate::numeric::tolerance::ends;
use crate::plan::search::{BudgetPoint, repeated_configurations};
use crate::study::selection::{Chosen, Selection, choice_name};
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

/// The random choices of a size stand so far to the left of it at most, the planned ones to the right.
const RANDOM: f64 = 0.35;

/// The mean distances of all choices, size beside size. Returns the SVG text.
///
/// # Errors
/// There are no choices, or the drawing fails.
pub fn selection_plot(title: &str, selection: &Selection<'_>) -> Result<String, PlotError> {
    let mean = |chosen: &Chosen| chosen.numbers_mm()[0];
    let means = selection.sizes.iter().map(|of_size| {
        let planned = of_size.planned.iter();
        let planned = planned.filter_map(|(_, chosen)| mean(chosen.as_ref().ok()?));
        [of_size.random_means_mm(), planned.collect()]
    });
    let of_sizes: Vec<[Vec<f64>; 2]> = means.collect();
    let all = selection.all_mm().mean;
    let heights = heights(all, &of_sizes)?;
    let sizes = || (0..).map(f64::from).zip(&selection.sizes);
    let count = selection.sizes.len() as f64;
    let random = (0..).map(f64::from).zip(&of_sizes);
    let random = random.flat_map(|(place, [means, _])| {
        let step = RANDOM / means.len().max(1) as f64;
        let all = (0..).map(f64::from).zip(means);
        all.map(move |(index, mean)| (place - RANDOM + step * index, *mean))
    });
    // What lies above is counted and not drawn.
    let mut above = 0;
    let mut series = |name: &str, colour: RGBColor, mark: Mark, points: Vec<(f64, f64)>| {
        let points = points.into_iter().map(|(x, mean)| (x, mean.log10()));
        let (seen, higher): (Vec<_>, Vec<_>) = points.partition(|(_, y)| *y < heights.end);
        above += higher.len();
        Series::new(name, colour, mark, seen)
    };
    let across = vec![(-0.5, all), (count - 0.5, all)];
    let grey = RGBColor(150, 150, 150);
    let mut drawn = vec![
        series("fitted to all readings", INK, Mark::Dashed, across),
        series("random", grey, Mark::Dot, random.collect()),
    ];
    let criteria = (selection.sizes.first()).map_or(&[][..], |first| &first.planned);
    for (number, (criterion, _)) in criteria.iter().enumerate() {
        let step = RANDOM / criteria.len() as f64;
        let marks = sizes().filter_map(|(place, of_size)| {
            let (_, chosen) = of_size.planned.get(number)?;
            let mean = mean(chosen.as_ref().ok()?)?;
            Some((place + step * (number + 1) as f64, mean))
        });
        let colour = *COLOURS.get(number).unwrap_or(&INK);
        let name = choice_name(criterion);
        drawn.push(series(name, colour, Mark::Triangle, marks.collect()));
    }
    let title = match above {
        0 => title.to_owned(),
        _ => format!("{title} ({above} lie above)"),
    };
    let size_names = selection.sizes.iter().map(|each| each.size.to_string());
    let chart = Chart {
        axes: [
            ChartAxis::named(size_names.collect()),
            ChartAxis::logarithmic(heights),
        ],
        names: [
            format!("{}s that were chosen", selection.parts.unit()),
            "mean distance at all others [mm], logarithmic".to_owned(),
        ],
        series: drawn,
    };
    chart.file(&title)
}

/// From the lowest mean to the highest that matters (logarithms of mm), of the fit to all readings and of each size's random and planned
/// choices (mm): all of them up to three times what three quarters of the size's random ones stay below.
fn heights(all_mm: f64, sizes: &[[Vec<f64>; 2]]) -> Result<Range<f64>, PlotError> {
    let mut ends = [all_mm; 2];
    for [random, planned] in sizes {
        let mut usual = if random.is_empty() { planned } else { random }.clone();
        usual.sort_by(f64::total_cmp);
        let limit = 3.0 * usual.get(usual.len() * 3 / 4).copied().unwrap_or(0.0);
        for mean in random.iter().chain(planned).filter(|mean| **mean <= limit) {
            ends = [ends[0].min(*mean), ends[1].max(*mean)];
        }
    }
    if ends[0] <= 0.0 {
        return Err(PlotError::new("there is nothing to draw"));
    }
    Ok((0.9 * ends[0]).log10()..(1.1 * ends[1]).log10())
}

/// What each nested model of a model selection leaves of the readings that it was fitted to and of blocks that it was not; the recommended one
/// is marked. Returns the SVG text.
///
/// # Errors
/// There are no nested models, or the drawing fails.
pub fn model_selection_plot(
    title: &str,
    model_selection: &ModelSelection,
) -> Result<String, PlotError> {
    let nested_models = &model_selection.nested_models;
    if nested_models.is_empty() {
        return Err(PlotError::new("there are no models"));
    }
    let rms = |lengths: Option<&DistanceStatistics>| lengths.map(|lengths| lengths.rms * 1e3);
    let fitted = |nested_model: &NestedModel| rms(nested_model.distances.as_ref());
    let predicted = |nested_model: &NestedModel| {
        let judged = nested_model.cross_validation.as_ref().ok()?;
        rms(judged.distances.as_ref())
    };
    let line = |of: &dyn Fn(&NestedModel) -> Option<f64>| -> Vec<(f64, f64)> {
        let all = nested_models.iter().enumerate();
        all.filter_map(|(place, nested_model)| Some((place as f64, of(nested_model)?)))
            .collect()
    };
    let lines = [line(&fitted), line(&predicted)];
    let all = lines.iter().flatten();
    let top = all.map(|(_, value)| *value).fold(0.0, f64::max) * 1.1;
    let name = |(place, nested_model): (usize, &NestedModel)| {
        let plus = if place > 0 { "+ " } else { "" };
        format!(
            "{plus}{} ({})",
            nested_model.added.word(),
            nested_model.unknowns
        )
    };
    let chosen = model_selection.recommendation.as_ref().and_then(|each| {
        let place = each.nested_model;
        let nested_model = nested_models.get(place)?;
        Some((place as f64, predicted(nested_model)?))
    });
    let [fitted, predicted] = lines;
    let dots = |line: &Vec<_>, colour| Series::new("", colour, Mark::Dot, line.clone());
    let chosen = chosen.into_iter().collect();
    let [blue, orange, ..] = COLOURS;
    let chart = Chart {
        axes: [
            ChartAxis::named(nested_models.iter().enumerate().map(name).collect()),
            ChartAxis::linear(0.0..top.max(1e-9), 8),
        ],
        names: ["parameters (unknowns)", "rms residual [mm]"].map(str::to_owned),
        series: vec![
            dots(&fitted, blue),
            Series::new("fitted readings", blue, Mark::Line, fitted),
            dots(&predicted, orange),
            Series::new("blocks that were not", orange, Mark::Line, predicted),
            Series::new("recommended", INK, Mark::Ring, chosen),
        ],
    };
    chart.file(title)
}

/// A panel's size (pixels).
const PANEL: (u32, u32) = (900, 600);
/// The height of the title (pixels).
const HEAD: u32 = 50;
/// So many patterns are drawn.
const MOST_PANELS: usize = 6;

/// The strongest patterns in residuals, a panel each: means over readings with their standard errors, and the pattern. Returns
/// the SVG text.
pub fn patterns_plot(title: &str, patterns: &Patterns) -> Result<String, PlotError> {
    let found: Vec<&Pattern> = patterns.found.iter().take(MOST_PANELS).collect();
    let columns = if found.len() > 1 { 2 } else { 1 };
    let rows = found.len().div_ceil(columns).max(1);
    let [wide, high] = [columns, rows].map(|count| u32::try_from(count).unwrap_or(1));
    let size = (PANEL.0 * wide, PANEL.1 * high + HEAD);
    plot(size, title, |area| {
        let panels = area.split_evenly((rows, columns));
        (found.iter().zip(&panels)).try_for_each(|(pattern, panel)| draw_pattern(pattern, panel))
    })
}

fn draw_pattern(pattern: &Pattern, panel: &Area<'_>) -> Result<(), PlotError> {
    let (factor, unit) = match pattern.unit {
        "rad" => (1e3, "mrad"),
        "m" => (1e3, "mm"),
        "1" => (1e6, "\u{b5}m/m"),
        _ => (1e6, "\u{b5}rad/(N m)"),
    };
    let points = &pattern.points;
    let reach = |values: &mut dyn Iterator<Item = f64>| {
        let [low, high] = ends(values);
        let margin = ((high - low) * 0.05).max(1e-9 * high.abs().max(1e-9));
        if low <= high {
            (low - margin)..(high + margin)
        } else {
            0.0..1.0
        }
    };
    let ends = points.iter().flat_map(|point| {
        [
            point.seen - point.standard_error,
            point.seen + point.standard_error,
            point.pattern,
        ]
    });
    let x = reach(&mut points.iter().map(|point| point.at));
    let y = reach(&mut ends.map(|value| value * factor));
    let panel = panel.titled(&panel_title(pattern), text(INK))?;
    let at = pattern.joint.as_deref().unwrap_or(pattern.kind);
    let bars = points.iter().flat_map(|point| {
        [-1.0, 1.0].map(|side| {
            let end = point.seen + side * point.standard_error;
            (point.at, end * factor)
        })
    });
    let line = |of: fn(&PatternPoint) -> f64| {
        let points = points.iter().map(|point| (point.at, of(point) * factor));
        points.collect()
    };
    let chart = Chart {
        axes: [ChartAxis::linear(x, 6), ChartAxis::linear(y, 6)],
        names: [
            format!("{at} [{}]", pattern.at_unit),
            format!("residual [{unit}]"),
        ],
        series: vec![
            Series::new("", COLOURS[0], Mark::Segments(3), bars.collect()),
            Series::new("", COLOURS[0], Mark::Dot, line(|point| point.seen)),
            Series::new("", COLOURS[1], Mark::Line, line(|point| point.pattern)),
        ],
    };
    chart.draw(&panel).map(drop)
}

fn panel_title(pattern: &Pattern) -> String {
    let joint = pattern.joint.as_deref();
    let share = 100.0 * pattern.share;
    let what = match (pattern.harmonic, joint) {
        (Some(waves), Some(joint)) => format!("{joint}, harmonic {waves}"),
        (None, Some(joint)) => format!("{joint}, {}", pattern.kind),
        _ => pattern.kind.to_owned(),
    };
    format!("{what}: {share:.1} % of the residuals' variance")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size whose choices are all far worse than the best of another, but for one that failed altogether.
    #[test]
    fn all_sizes_are_on_the_picture() {
        let sizes = [
            [vec![0.7, 40.0, 0.9, 0.8, 0.75], vec![0.2, 1.1]],
            [vec![0.1, 0.11, 0.12, 0.13], vec![]],
        ];
        let heights = heights(0.08, &sizes).expect("something to draw");
        assert!(heights.contains(&1.1_f64.log10()) && heights.contains(&0.08_f64.log10()));
        assert!(!heights.contains(&40_f64.log10()));
    }
}
