//! Fig. 7 redrawn: the distribution of each plan's residual error over many runs.

use plotters::style::RGBColor;

use crate::numeric::tolerance::ends;
use crate::record::study::StudyPlanMessage;
use crate::text::wording::micrometres;
use crate::view::charts::{
    COLOURS, Chart, ChartAxis, INK, Mark, PlotError, Rows, Series, WHOLE, plan_colours,
};
use crate::view::{markup::figure, tables};

/// The share of a row that the highest distribution fills.
const FILL: f64 = 0.86;
/// The room beside the intervals of means (decades).
const MARGIN: f64 = 0.08;
/// What figures are over.
const ERRORS: &str = "residual error at the test pose [\u{b5}m], logarithmic";

/// A plan's runs, with their colour.
pub struct Line<'a> {
    runs: &'a StudyPlanMessage,
    colour: RGBColor,
}

/// Lines of plans beside each other; `is_reference` says of each, by its place, whether the others are compared with it.
pub fn lines(
    plans: &[StudyPlanMessage],
    is_reference: impl Fn(usize, &StudyPlanMessage) -> bool,
) -> Vec<Line<'_>> {
    let is_reference = |(place, runs)| is_reference(place, runs);
    let colours = plan_colours(plans.iter().enumerate().map(is_reference));
    let both = plans.iter().zip(colours);
    both.map(|(runs, colour)| Line { runs, colour }).collect()
}

/// Lines that have runs.
fn with_runs<'l, 'a>(lines: &'l [Line<'a>]) -> Vec<&'l Line<'a>> {
    (lines.iter()).filter(|line| line.runs.runs > 0).collect()
}

/// The figure: a row for each plan with the distribution of its distances and its mean.
pub fn distances_figure(lines: &[Line<'_>], caption: &str) -> Result<String, PlotError> {
    let lines = with_runs(lines);
    if lines.is_empty() {
        return Ok(String::new());
    }
    let note = |line: &&Line<'_>| format!("mean {}", micrometres(line.runs.mean_mm));
    let rows = Rows {
        names: lines.iter().map(|line| line.runs.name.clone()).collect(),
        notes: lines.iter().map(note).collect(),
        width: WHOLE,
        axis: ChartAxis::logarithmic(range(&lines)),
        title: ERRORS,
    };
    let highest = (lines.iter())
        .flat_map(|line| shares(line.runs).map(|(_, share)| share))
        .fold(f64::MIN_POSITIVE, f64::max);
    let hills = lines.iter().enumerate();
    let hills = hills.flat_map(|(row, line)| hill(&rows, row, line, highest));
    let title = "Distribution of the residual error of each plan";
    let svg = rows.figure(title, &hills.collect::<Vec<_>>())?;
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
    let note = |(_, ends): &(&Line<'_>, [f64; 3])| {
        let [low, mean, high] = ends.map(|logarithm| format!("{:.2}", 10_f64.powf(logarithm)));
        format!("{mean} ({low} to {high})")
    };
    let rows = Rows {
        names: means
            .iter()
            .map(|(line, _)| line.runs.name.clone())
            .collect(),
        notes: means.iter().map(note).collect(),
        width: WHOLE,
        axis: ChartAxis::logarithmic(low - MARGIN..high + MARGIN),
        title: "mean residual error [\u{b5}m], logarithmic",
    };
    let intervals = (means.iter().enumerate())
        .flat_map(|(row, (line, ends))| Series::interval(*ends, rows.middle(row), line.colour));
    let title = "Mean residual error of each plan with its 95 % interval";
    let svg = rows.figure(title, &intervals.collect::<Vec<_>>())?;
    Ok(figure(
        &svg,
        "Mean of each plan's runs with its 95 % interval, in \u{b5}m.",
    ))
}

/// The share of each plan's runs that stay below an error.
pub fn shares_figure(lines: &[Line<'_>]) -> Result<String, PlotError> {
    let lines = with_runs(lines);
    if lines.is_empty() {
        return Ok(String::new());
    }
    let inside = range(&lines);
    let series = |(index, line): (usize, &&Line<'_>)| {
        // Colours come again.
        let mark = if index < COLOURS.len() {
            Mark::Line
        } else {
            Mark::Dashed
        };
        let points = below(line.runs).filter(|(x, _)| inside.contains(x));
        Series::new(&line.runs.name, line.colour, mark, points.collect())
    };
    let chart = Chart {
        series: lines.iter().enumerate().map(series).collect(),
        axes: [
            ChartAxis::logarithmic(inside.clone()),
            ChartAxis::linear(0.0..100.0, 5),
        ],
        names: [ERRORS, "runs below it [%]"].map(str::to_owned),
    };
    let title = "Cumulative distribution of the residual error";
    let caption = "Empirical cumulative distribution of each plan's runs.";
    Ok(figure(&chart.figure((WHOLE, 620), title)?, caption))
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

/// A plan's hill in a row, with its mean; `highest` is the highest share of any plan.
fn hill(rows: &Rows<'_>, row: usize, line: &Line<'_>, highest: f64) -> [Series; 3] {
    let (colour, foot) = (line.colour, rows.middle(row) - 0.46);
    let inside = |x: &f64| rows.axis.range.contains(x);
    let shape: Vec<(f64, f64)> = shares(line.runs)
        .filter(|(x, _)| inside(x))
        .map(|(x, share)| (x, foot + FILL * share / highest))
        .collect();
    let ends = [shape.last(), shape.first()].into_iter().flatten();
    let ends = ends.map(|(x, _)| (*x, foot));
    let closed = shape.iter().copied().chain(ends).collect();
    let mean = line.runs.mean_mm.map(logarithm).filter(inside);
    let mean = mean.map_or_else(Vec::new, |mean| vec![(mean, foot), (mean, foot + FILL)]);
    [
        Series::new("", colour, Mark::Area, closed),
        Series::new("", colour, Mark::Line, shape),
        Series::new("", INK, Mark::Segments(4), mean),
    ]
}

/// The numbers below the figure.
pub fn distances_table(lines: &[Line<'_>]) -> String {
    let plans: Vec<_> = lines.iter().map(|line| line.runs).collect();
    tables::study(&plans, true).html()
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
