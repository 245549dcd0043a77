//! Fig. 7 redrawn: the distribution of each plan's residual error over many runs.

use plotters::prelude::*;

use crate::numeric::tolerance::ends;
use crate::record::study::StudyPlanMessage;
use crate::text::wording::{inverse_interval, micrometres, number};
use crate::view::charts::{COLOURS, PlotError};
use crate::view::charts::{
    Chart, ChartAxis, INK, Mark, Rows, Series, WHOLE, chart_of, drawing, interval,
};
use crate::view::markup::{figure, table_of};

/// The share of a row that the highest distribution fills.
const FILL: f64 = 0.86;
/// The room beside the intervals of means (decades).
const MARGIN: f64 = 0.08;
/// The vermilion of random plans.
const RANDOM: RGBColor = RGBColor(213, 94, 0);

/// What a plan is compared as; each has its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The plan that the page is about.
    Own,
    /// A plan beside it.
    Other,
    /// Random plans.
    Random,
}

impl Role {
    const fn colour(self) -> RGBColor {
        match self {
            Self::Own => COLOURS[0],
            Self::Other => COLOURS[4],
            Self::Random => RANDOM,
        }
    }
}

/// A plan's runs, with what they are drawn and listed as.
pub struct Line<'a> {
    /// What the plan is called here.
    pub name: String,
    /// Its runs.
    pub runs: &'a StudyPlanMessage,
    /// What it is compared as.
    pub role: Role,
}

impl<'a> Line<'a> {
    /// A plan under its own name.
    pub fn new(runs: &'a StudyPlanMessage, role: Role) -> Self {
        Self {
            name: runs.name.clone(),
            runs,
            role,
        }
    }
}

/// The figure: a row for each plan with the distribution of its distances and its mean.
pub fn distances_figure(lines: &[Line<'_>], caption: &str) -> Result<String, PlotError> {
    let lines: Vec<&Line<'_>> = (lines.iter()).filter(|line| line.runs.runs > 0).collect();
    if lines.is_empty() {
        return Ok(String::new());
    }
    let names: Vec<String> = lines.iter().map(|line| line.name.clone()).collect();
    let notes: Vec<String> = (lines.iter())
        .map(|line| format!("mean {}", micrometres(line.runs.mean_mm)))
        .collect();
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: WHOLE,
        axis: ChartAxis::logarithmic(range(&lines)),
        title: "residual error at the test pose [\u{b5}m], logarithmic".to_owned(),
    };
    let highest = (lines.iter())
        .flat_map(|line| shares(line.runs).map(|(_, share)| share))
        .fold(f64::MIN_POSITIVE, f64::max);
    let title = "Distribution of the residual error of each plan";
    let svg = rows.drawn(title, |chart| {
        (lines.iter().enumerate()).try_for_each(|(row, line)| {
            draw_line(chart, &rows.axis, rows.middle(row) - 0.46, line, highest)
        })
    })?;
    Ok(figure(&svg, caption))
}

/// The mean of each plan with its 95 % interval.
pub fn means_figure(lines: &[Line<'_>]) -> Result<String, PlotError> {
    let means: Vec<(&Line<'_>, [f64; 3])> = (lines.iter())
        .filter_map(|line| {
            let [low, high] = line.runs.mean_ci95_mm?;
            Some((line, [low, line.runs.mean_mm?, high].map(logarithm)))
        })
        .collect();
    let [low, high] = ends(means.iter().flat_map(|(_, ends)| *ends));
    if means.is_empty() {
        return Ok(String::new());
    }
    let names: Vec<String> = means.iter().map(|(line, _)| line.name.clone()).collect();
    let micro = |logarithm: f64| format!("{:.2}", 10_f64.powf(logarithm));
    let notes: Vec<String> = (means.iter())
        .map(|(_, [low, mean, high])| {
            format!("{} ({} to {})", micro(*mean), micro(*low), micro(*high))
        })
        .collect();
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: WHOLE,
        axis: ChartAxis::logarithmic(low - MARGIN..high + MARGIN),
        title: "mean residual error [\u{b5}m], logarithmic".to_owned(),
    };
    let title = "Mean residual error of each plan with its 95 % interval";
    let svg = rows.drawn(title, |chart| {
        (means.iter().enumerate()).try_for_each(|(row, (line, ends))| {
            interval(chart, *ends, rows.middle(row), line.role.colour())
        })
    })?;
    Ok(figure(
        &svg,
        "Mean of each plan's runs with its 95 % interval, in \u{b5}m.",
    ))
}

/// The share of each plan's runs that stay below an error.
pub fn shares_figure(lines: &[Line<'_>]) -> Result<String, PlotError> {
    let lines: Vec<&Line<'_>> = (lines.iter()).filter(|line| line.runs.runs > 0).collect();
    if lines.is_empty() {
        return Ok(String::new());
    }
    let is_free = |colour: &RGBColor| ![Role::Own.colour(), RANDOM].contains(colour);
    let others: Vec<RGBColor> = COLOURS.into_iter().filter(is_free).collect();
    let series = |(index, line): (usize, &&Line<'_>)| {
        let colour = match line.role {
            Role::Other => others[index % others.len()],
            role => role.colour(),
        };
        let mark = if index < others.len() {
            Mark::Line
        } else {
            Mark::Dashed
        };
        Series::new(&line.name, colour, mark)
    };
    let series: Vec<Series> = lines.iter().enumerate().map(series).collect();
    let axes = [
        ChartAxis::logarithmic(range(&lines)),
        ChartAxis::linear(0.0..100.0, 5),
    ];
    let names = [
        "residual error at the test pose [\u{b5}m], logarithmic",
        "runs below it [%]",
    ];
    let title = "Cumulative distribution of the residual error";
    let svg = drawing((WHOLE, 620), title, |area| {
        let inside = axes[0].range.clone();
        let mut chart = chart_of(area, axes, names, &series)?;
        (lines.iter().zip(&series)).try_for_each(|(line, series)| {
            let points = below(line.runs).filter(|(x, _)| inside.contains(x));
            series.draw(&mut chart, &points.collect::<Vec<_>>())
        })?;
        Ok(Vec::new())
    })?;
    Ok(figure(
        &svg,
        "Empirical cumulative distribution of each plan's runs.",
    ))
}

/// The upper end of each bin (logarithm of um) and the share of the runs below it (%).
fn below(runs: &StudyPlanMessage) -> impl Iterator<Item = (f64, f64)> {
    let ends = runs.histogram.edges_mm.iter().skip(1);
    let counts = runs.histogram.counts.iter();
    counts.zip(ends).scan(0, |below, (count, end)| {
        *below += count;
        Some((logarithm(*end), 100.0 * *below as f64 / runs.runs as f64))
    })
}

/// Draws a plan's hill with its foot at a height; `highest` is the highest share of any plan.
fn draw_line(
    chart: &mut Chart<'_, '_>,
    axis: &ChartAxis,
    foot: f64,
    line: &Line<'_>,
    highest: f64,
) -> Result<(), PlotError> {
    let colour = line.role.colour();
    let inside = |x: &f64| axis.range.contains(x);
    let shape: Vec<(f64, f64)> = shares(line.runs)
        .filter(|(x, _)| inside(x))
        .map(|(x, share)| (x, foot + FILL * share / highest))
        .collect();
    let ends = [shape.last(), shape.first()];
    let ends = ends.into_iter().flatten().map(|(x, _)| (*x, foot));
    let closed: Vec<(f64, f64)> = shape.iter().copied().chain(ends).collect();
    chart.draw_series([Polygon::new(closed, colour.mix(0.35).filled())])?;
    chart.draw_series(LineSeries::new(shape, colour.stroke_width(3)))?;
    if let Some(mean) = line.runs.mean_mm.map(logarithm).filter(inside) {
        let mark = [(mean, foot), (mean, foot + FILL)];
        chart.draw_series([PathElement::new(mark, INK.stroke_width(4))])?;
    }
    Ok(())
}

/// The numbers below the figure.
pub fn distances_table(lines: &[Line<'_>]) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let interval = |[low, high]: [f64; 2]| format!("{:.3}\u{a0}to {:.3}", low * 1e3, high * 1e3);
    let header = [
        "plan",
        "mean [\u{b5}m]",
        "95 % interval [\u{b5}m]",
        "rms [\u{b5}m]",
        "rms expected of these runs [\u{b5}m]",
        "95 % of runs below [\u{b5}m]",
        "mean of random over it",
        "95 % interval",
        "failed runs",
    ];
    let rows = (lines.iter()).map(|line| {
        let runs = line.runs;
        let ratio = runs.mean_ratio_to_random.map(f64::recip);
        vec![
            line.name.clone(),
            micro(runs.mean_mm),
            runs.mean_ci95_mm.map_or_else(String::new, interval),
            micro(runs.rms_mm),
            micro(runs.predicted_rms_mm),
            micro(runs.quantiles_mm.map(|quantiles| quantiles[2])),
            number(ratio, 2),
            (runs.mean_ratio_to_random_ci95).map_or_else(String::new, inverse_interval),
            runs.failed.to_string(),
        ]
    });
    table_of(&header, rows)
}

/// The middle of each bin (logarithm of um) and the share of the runs for each unit of the
/// logarithmic axis, so that areas are shares.
fn shares(runs: &StudyPlanMessage) -> impl Iterator<Item = (f64, f64)> {
    let edges = runs.histogram.edges_mm.windows(2);
    let bins = runs.histogram.counts.iter().zip(edges);
    bins.map(|(count, edges)| {
        let (low, high) = (logarithm(edges[0]), logarithm(edges[1]));
        let share = *count as f64 / runs.runs as f64;
        (f64::midpoint(low, high), share / (high - low))
    })
}

/// From the smallest to the largest distances that are not rare.
fn range(lines: &[&Line<'_>]) -> std::ops::Range<f64> {
    let all = || (lines.iter()).filter_map(|line| line.runs.quantiles_mm);
    let low = all().map(|each| each[0] / 2.5).fold(f64::MAX, f64::min);
    let high = all()
        .map(|each| each[3] * 1.3)
        .fold(f64::MIN_POSITIVE, f64::max);
    logarithm(low.min(high / 2.0))..logarithm(high)
}

/// The decimal logarithm of a distance in um.
fn logarithm(value_mm: f64) -> f64 {
    (value_mm * 1e3).max(f64::MIN_POSITIVE).log10()
}
