//! Fig. 7 redrawn: the distribution of each plan's residual error over many runs.

use std::ops::Range;

use serde_json::{Value, json};

use super::each_once;
use crate::record::study::StudyPlanMessage;
use crate::text::wording::{joined, micrometres};
use crate::view::charts::{
    COLOURS, Chart, ChartAxis, INK, Mark, Series, WHOLE, middle, plan_colours, reach,
};
use crate::view::tables;

/// The share of a row that the highest distribution fills.
const FILL: f64 = 0.86;
/// What figures are over.
const ERRORS: &str = "residual error at the test pose [\u{b5}m], logarithmic";

/// A plan's runs, with their colour.
pub type PlanLine<'a> = (&'a StudyPlanMessage, &'static str);

/// Lines of plans beside each other; `is_reference` says of each, by its place, whether the others are compared with it.
pub fn lines(
    plans: &[StudyPlanMessage],
    is_reference: impl Fn(usize) -> bool,
) -> Vec<PlanLine<'_>> {
    let colours = plan_colours((0..plans.len()).map(is_reference));
    plans.iter().zip(colours).collect()
}

fn with_runs<'a>(lines: &[PlanLine<'a>]) -> Vec<PlanLine<'a>> {
    (lines.iter().copied())
        .filter(|(runs, _)| runs.runs > 0)
        .collect()
}

/// What the runs came to: the figure of their distances, and the numbers below it.
pub fn distances(plans: &[StudyPlanMessage], lines: &[PlanLine<'_>]) -> Value {
    let expected = each_once(plans.iter().map(|runs| runs.nees_expected));
    json!({
        "figure": distances_figure(lines),
        "table": tables::study(plans, true),
        "nees_expected": joined(expected, ", "),
    })
}

/// The figure: a row for each plan with the distribution of its distances and its mean.
fn distances_figure(lines: &[PlanLine<'_>]) -> Value {
    let lines = with_runs(lines);
    let range = range(&lines);
    let outlines: Vec<_> = (lines.iter().map(|(runs, _)| outline(runs, &range))).collect();
    let highest =
        (outlines.iter().flatten()).fold(f64::MIN_POSITIVE, |most, corner| most.max(corner.1));
    let (mut rows, mut hills) = (Vec::new(), Vec::new());
    for (row, ((runs, colour), outline)) in lines.iter().zip(&outlines).enumerate() {
        let note = format!("mean {}", micrometres(runs.mean_mm));
        let foot = middle(lines.len(), row) - 0.46;
        let shape = outline.iter();
        let shape: Vec<_> = shape
            .map(|(x, share)| (*x, foot + FILL * share / highest))
            .collect();
        let ends = [shape.last(), shape.first()].into_iter().flatten();
        let ends: Vec<_> = ends.map(|(x, _)| (*x, foot)).collect();
        let mean = runs.mean_mm.map(logarithm).filter(|x| range.contains(x));
        let mean = mean.map(|mean| [(mean, foot), (mean, foot + FILL)]);
        hills.extend([
            Series::new("", colour, Mark::Area(0.35), [&*shape, &ends].concat()),
            Series::new("", colour, Mark::Line, shape),
            Series::new("", INK, Mark::Segments(4.0), mean.into_iter().flatten())
                .tipped(|_, _, _| format!("{}: {note}", runs.name)),
        ]);
        rows.push((runs.name.clone(), note));
    }
    let axis = ChartAxis::logarithmic(range.clone());
    let chart = Chart::of_rows(rows, axis, ERRORS, hills);
    chart.figure(WHOLE, "Distribution of the residual error of each plan")
}

/// The mean of each plan with its 95 % interval.
pub fn means_figure(lines: &[PlanLine<'_>]) -> Value {
    let means = lines.iter().filter_map(|&(runs, colour)| {
        let [low, high] = runs.mean_ci95_mm?;
        Some((&runs.name, [low, runs.mean_mm?, high], colour))
    });
    let means: Vec<_> = means.collect();
    // An interval that reaches zero has no end on this axis: it is drawn to a tenth of the mean.
    let places = |[low, mean, high]: [f64; 3]| [low.max(0.1 * mean), mean, high].map(logarithm);
    let ends = (means.iter()).flat_map(|(_, ends_mm, _)| places(*ends_mm));
    let axis = ChartAxis::logarithmic(reach(ends, 0.0, 0.08));
    let (mut rows, mut intervals) = (Vec::new(), Vec::new());
    for (row, (name, ends_mm, colour)) in means.iter().enumerate() {
        let [low, mean, high] = ends_mm.map(|end| format!("{:.2}", end * 1e3));
        rows.push(((*name).clone(), format!("{mean} ({low} to {high})")));
        let interval = Series::interval(places(*ends_mm), middle(means.len(), row), colour);
        let tip = |_: &str, x: f64, _| format!("{name}: {:.2} \u{b5}m", 10_f64.powf(x));
        intervals.extend(interval.map(|each| each.tipped(tip)));
    }
    let title = "mean residual error [\u{b5}m], logarithmic";
    let chart = Chart::of_rows(rows, axis, title, intervals);
    let name = "Mean residual error of each plan with its 95 % interval";
    chart.figure(WHOLE, name)
}

/// The share of each plan's runs that stay below an error.
pub fn shares_figure(lines: &[PlanLine<'_>]) -> Value {
    let lines = with_runs(lines);
    let range = range(&lines);
    let series = |(index, (runs, colour)): (usize, &PlanLine<'_>)| {
        // Colours come again.
        let mark = [Mark::Line, Mark::Dashed][usize::from(index >= COLOURS.len())];
        // From the axis' beginning on.
        let before = below(runs).take_while(|(x, _)| *x <= range.start).last();
        let first = (range.start, before.map_or(0.0, |(_, share)| share));
        let points = below(runs).filter(|(x, _)| range.contains(x));
        Series::new(&runs.name, colour, mark, [first].into_iter().chain(points))
    };
    let axes = [
        ChartAxis::logarithmic(range.clone()),
        ChartAxis::linear(0.0..100.0, 5),
    ];
    let series = lines.iter().enumerate().map(series).collect();
    let chart = Chart::new(axes, [ERRORS, "runs below it [%]"], series);
    chart.figure(WHOLE, "Cumulative distribution of the residual error")
}

/// Each end of a bin (logarithm of um) and the share of the runs below it (%).
fn below(runs: &StudyPlanMessage) -> impl Iterator<Item = (f64, f64)> {
    let ends = runs.histogram.edges_mm.iter();
    let counts = [0].iter().chain(&runs.histogram.counts);
    counts.zip(ends).scan(0, |below, (count, end)| {
        *below += count;
        Some((logarithm(*end), 100.0 * *below as f64 / runs.runs as f64))
    })
}

/// The bins within a range from end to end (logarithms of um), each with the share of the runs for each unit of the axis, so that areas are
/// shares.
fn outline(runs: &StudyPlanMessage, range: &Range<f64>) -> Vec<(f64, f64)> {
    let bins = runs.histogram.bins().into_iter();
    let bins = bins.map(|[low, high, share]| {
        let ends = [low, high].map(logarithm);
        let height = share / (ends[1] - ends[0]);
        ends.map(|end| (end.clamp(range.start, range.end), height))
    });
    bins.filter(|[low, high]| low.0 < high.0)
        .flatten()
        .collect()
}

/// From the smallest to the largest distances that are not rare (logarithms of um).
fn range(lines: &[PlanLine<'_>]) -> Range<f64> {
    let all = || (lines.iter()).filter_map(|(runs, _)| runs.quantiles_mm);
    let low = all().map(|each| each[0] / 2.5).fold(f64::MAX, f64::min);
    let high = all().map(|each| each[3] * 1.3);
    let high = high.fold(f64::MIN_POSITIVE, f64::max);
    logarithm(low.min(high / 2.0))..logarithm(high)
}

/// The decimal logarithm of a distance in um.
fn logarithm(value_mm: f64) -> f64 {
    (value_mm * 1e3).max(f64::MIN_POSITIVE).log10()
}
