//! Fig. 7 redrawn: the distribution of each plan's residual error over many runs.

use plotters::style::RGBColor;

use crate::record::study::StudyPlanMessage;
use crate::text::wording::micrometres;
use crate::view::charts::{COLOURS, ChartAxis, INK, Mark, PlotError, Rows, Series, WHOLE};
use crate::view::{markup::figure, tables};

/// The share of a row that the highest distribution fills.
const FILL: f64 = 0.86;
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
    /// Its runs.
    pub runs: &'a StudyPlanMessage,
    /// What it is compared as.
    pub role: Role,
}

impl<'a> Line<'a> {
    /// A plan's.
    pub const fn new(runs: &'a StudyPlanMessage, role: Role) -> Self {
        Self { runs, role }
    }
}

/// The figure: a row for each plan with the distribution of its distances and its mean.
pub fn distances_figure(lines: &[Line<'_>], caption: &str) -> Result<String, PlotError> {
    let lines: Vec<&Line<'_>> = (lines.iter()).filter(|line| line.runs.runs > 0).collect();
    if lines.is_empty() {
        return Ok(String::new());
    }
    let note = |line: &&Line<'_>| format!("mean {}", micrometres(line.runs.mean_mm));
    let rows = Rows {
        names: lines.iter().map(|line| line.runs.name.clone()).collect(),
        notes: lines.iter().map(note).collect(),
        width: WHOLE,
        axis: ChartAxis::logarithmic(range(&lines)),
        title: "residual error at the test pose [\u{b5}m], logarithmic",
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

/// A plan's hill in a row, with its mean; `highest` is the highest share of any plan.
fn hill(rows: &Rows<'_>, row: usize, line: &Line<'_>, highest: f64) -> [Series; 3] {
    let (colour, foot) = (line.role.colour(), rows.middle(row) - 0.46);
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
    tables::study(lines.iter().map(|line| line.runs)).html()
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
