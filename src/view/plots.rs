//! Plots as SVG: budgets of measurements, selections of readings, models compared, and patterns in residuals.

use serde_json::json;

use super::charts::{COLOURS, Chart, ChartAxis, INK, Mark, SOFT, Series, file, reach};
use super::markup::PageError;
use crate::identification::patterns::{Pattern, Patterns};
use crate::identification::{ModelSelection, NestedModel};
use crate::numeric::tolerance::ends;
use crate::plan::search::{BudgetPoint, repeated_configurations};
use crate::study::selection::{Chosen, Selection, choice_name};
use crate::text::wording::{counted, listed, naming};

/// The marks of the lines of a budget, by turns; that of plans whose configurations are all different is a dot.
const MARKS: [Mark; 3] = [Mark::Square, Mark::Triangle, Mark::Diamond];

/// What the plot of a budget shows.
pub struct BudgetPlot<'a> {
    /// The best plans that were found.
    pub points: &'a [BudgetPoint],
    /// How long each takes (minutes), as far as a way is found, where it is drawn over time in place of numbers of measurements.
    pub minutes: Option<&'a [Option<f64>]>,
    /// The accuracy that is wanted (m).
    pub wanted_m: f64,
    /// What it needs.
    pub needed: Option<&'a BudgetPoint>,
}

impl BudgetPlot<'_> {
    /// `rho_0` against the number of measurements or the time: a line for each number of configurations, what is wanted and needed, and
    /// over numbers the bound that no plan of as many can beat. Returns the SVG text.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn drawn(&self, title: &str) -> Result<String, PageError> {
        let points = self.points;
        let place = |index: usize| match self.minutes {
            Some(minutes) => minutes[index],
            None => Some(points[index].experiments.into()),
        };
        let at = |index: usize| Some((place(index)?, points[index].rho0_m * 1e6));
        let lines = repeated_configurations(points).into_iter().map(Some);
        let line = |(index, count): (usize, Option<u32>)| {
            let name = count.map(|count| counted(count.into(), "configuration"));
            let name = name.unwrap_or("all different".to_owned());
            let is_of =
                |point: &BudgetPoint| point.configurations == count.unwrap_or(point.experiments);
            let line = (0..points.len()).filter(|&index| is_of(&points[index]));
            let line: Vec<(f64, f64)> = line.filter_map(at).collect();
            let colour = COLOURS[index % COLOURS.len()];
            // Where lines lie on one another, the marks of those below look out.
            let mark = count.map_or(Mark::Dot, |_| MARKS[index % MARKS.len()]);
            [("", Mark::Line), (&*name, mark)]
                .map(|(name, mark)| Series::new(name, colour, mark, line.iter().copied()))
        };
        let lines = lines.chain([None]).enumerate().flat_map(line);
        let mut series: Vec<Series> = lines.collect();
        if self.minutes.is_none() {
            let bound_um = |point: &BudgetPoint| Some(point.lower_bound_m()? * 1e6);
            let bound = (points.iter())
                .filter_map(|point| Some((f64::from(point.experiments), bound_um(point)?)));
            let mut bound: Vec<_> = bound.filter(|(_, bound)| *bound > 0.0).collect();
            bound.dedup();
            series.push(Series::new("no plan is below", INK, Mark::Dashed, bound));
        }
        let [_, top] = ends(points.iter().map(|point| point.rho0_m));
        let [least, most] = ends((0..points.len()).filter_map(place));
        if self.wanted_m < 2.0 * top && least <= most {
            let wanted_um = self.wanted_m * 1e6;
            let wanted = [least, most.max(least + 1.0)].map(|at| (at, wanted_um));
            let name = format!("wanted: {} \u{b5}m", listed([wanted_um], 4));
            series.push(Series::new(&name, SOFT, Mark::Line, wanted));
        }
        let size = |each: &BudgetPoint| (each.experiments, each.configurations);
        let is_needed = |index: &usize| self.needed.map(size) == Some(size(&points[*index]));
        let needed = (0..points.len()).find(is_needed).and_then(at);
        if needed.is_some() {
            series.push(Series::new("needed", INK, Mark::Ring, needed));
        }
        Chart::of_accuracy(series, self.minutes.is_some()).file(title)
    }
}

/// The random choices of a size stand so far to the left of it at most, the planned ones to the right.
const RANDOM: f64 = 0.35;

/// The mean distances of all choices, size beside size. Returns the SVG text.
///
/// # Errors
/// See [`PageError`].
pub fn selection_plot(title: &str, selection: &Selection<'_>) -> Result<String, PageError> {
    let mean = |chosen: &Chosen| chosen.numbers_mm()[0];
    let all = selection.all_mm().mean;
    let heights = reach(selection.usual_mm().map(f64::log10), 0.0, 0.044);
    let places = || (0..).map(f64::from);
    let count = selection.sizes.len() as f64;
    let random = places().zip(&selection.sizes).flat_map(|(place, of_size)| {
        let means = of_size.random_means_mm();
        let step = RANDOM / means.len().max(1) as f64;
        let all = places().zip(means);
        all.map(move |(index, mean)| (place - RANDOM + step * index, mean))
    });
    // What lies above is counted and not drawn.
    let mut above = 0;
    let mut series = |name: &str, colour, mark: Mark, points: Vec<(f64, f64)>| {
        let points = points.into_iter().map(|(x, mean)| (x, mean.log10()));
        let (within, higher): (Vec<_>, Vec<_>) = points.partition(|(_, y)| *y < heights.end);
        above += higher.len();
        Series::new(name, colour, mark, within)
    };
    let across = vec![(-0.5, all), (count - 0.5, all)];
    let mut drawn = vec![
        series("fitted to all readings", INK, Mark::Dashed, across),
        series("random", "#969696", Mark::Dot, random.collect()),
    ];
    let criteria = (selection.sizes.first()).map_or(&[][..], |first| &first.planned);
    for (number, (criterion, _)) in criteria.iter().enumerate() {
        let step = RANDOM / criteria.len() as f64;
        let marks = places().zip(&selection.sizes);
        let marks = marks.filter_map(|(place, of_size)| {
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
    let sizes = selection.sizes.iter().map(|each| each.size.to_string());
    let axes = [ChartAxis::named(sizes), ChartAxis::logarithmic(heights)];
    let chosen = format!("{}s that were chosen", selection.parts.unit());
    let names = [&*chosen, "mean distance at all others [mm], logarithmic"];
    Chart::new(axes, names, drawn).file(&title)
}

/// What a plot of nested models calls what a model was not fitted to, and the bars there.
const OTHERS: &str = "blocks left out (cross-validation)";
const ERROR: &str = "\u{b1} error of the difference to the best";

/// What each nested model of a model selection leaves of the readings that it was fitted to and of blocks that it was not; the recommended one
/// is marked. Returns the SVG text.
///
/// # Errors
/// See [`PageError`].
pub fn model_selection_plot(
    title: &str,
    model_selection: &ModelSelection,
) -> Result<String, PageError> {
    let nested_models: Vec<&NestedModel> = (model_selection.nested_models.iter())
        .chain(&model_selection.with_joint_errors)
        .collect();
    let numbered = || nested_models.iter().enumerate();
    let fitted = numbered().filter_map(|(place, nested_model)| {
        Some((place as f64, nested_model.distances.as_ref()?.rms * 1e3))
    });
    let fitted: Vec<(f64, f64)> = fitted.collect();
    let predicted = numbered().filter_map(|(place, nested_model)| {
        let judged = nested_model.cross_validation.as_ref().ok()?;
        Some((place, judged.rms_interval_m()?.map(|end_m| end_m * 1e3)))
    });
    let predicted: Vec<(usize, [f64; 3])> = predicted.collect();
    let nested = model_selection.nested_models.len();
    let chosen = model_selection.recommendation.as_ref().map(|each| {
        let is_last = each.with_joint_errors && nested < nested_models.len();
        if is_last { nested } else { each.nested_model }
    });
    let at = |(place, ends): &(usize, [f64; 3]), end: usize| (*place as f64, ends[end]);
    let middles: Vec<(f64, f64)> = predicted.iter().map(|each| at(each, 1)).collect();
    let bars = predicted.iter().flat_map(|each| [at(each, 0), at(each, 2)]);
    let bars: Vec<(f64, f64)> = bars.collect();
    let chosen = predicted.iter().find(|each| chosen == Some(each.0));
    let chosen = chosen.map(|each| at(each, 1));
    let name = |(place, nested_model): (usize, &&NestedModel)| {
        let name = if place < nested {
            model_selection.name(place)
        } else {
            "joint errors".to_owned()
        };
        format!("{name} ({})", nested_model.unknowns)
    };
    let all = fitted.iter().chain(&middles).chain(&bars);
    let top = all.fold(1e-9, |top: f64, (_, value)| top.max(*value));
    let [blue, orange, ..] = COLOURS;
    let series = vec![
        Series::new("fitted readings", blue, Mark::Dotted, fitted),
        Series::new(OTHERS, orange, Mark::Dotted, middles),
        Series::new(ERROR, orange, Mark::Segments(3.0), bars),
        Series::new("recommended", INK, Mark::Ring, chosen),
    ];
    let axes = [
        ChartAxis::named(numbered().map(name)),
        ChartAxis::linear(0.0..top * 1.1, 8),
    ];
    let names = ["parameters (unknowns)", "rms residual [mm]"];
    Chart::new(axes, names, series).file(title)
}

/// A panel's size with the gap below it, and the height of the title over all (in units of the drawing).
const PANEL: [f64; 2] = [900.0, 630.0];
const GAP: f64 = 30.0;
const HEAD: f64 = 50.0;
/// So many patterns are drawn, and waves at so many places.
const MOST_PANELS: usize = 6;
const SAMPLES: u32 = 120;

/// The strongest patterns in residuals, a panel each: means over readings with their standard errors, and the pattern. Returns
/// the SVG text.
///
/// # Errors
/// See [`PageError`].
pub fn patterns_plot(title: &str, patterns: &Patterns) -> Result<String, PageError> {
    let found = patterns.found.iter().take(MOST_PANELS);
    let columns = found.len().clamp(1, 2);
    let rows = found.len().div_ceil(columns).max(1);
    let size = [PANEL[0] * columns as f64, PANEL[1] * rows as f64 + HEAD];
    let drawing = |(place, pattern): (usize, &Pattern)| {
        let x = PANEL[0] * (place % columns) as f64;
        let y = PANEL[1] * (place / columns) as f64 + HEAD;
        let size = [PANEL[0], PANEL[1] - GAP];
        let chart = panel(pattern).drawing(size, &panel_title(pattern));
        json!({ "at": [x, y], "chart": chart })
    };
    let drawings: Vec<_> = found.enumerate().map(drawing).collect();
    file(size, title, &drawings)
}

fn panel(pattern: &Pattern) -> Chart {
    let (factor, unit) = match pattern.unit {
        "rad" => (1e3, "mrad"),
        "m" => (1e3, "mm"),
        "1" => (1e6, "\u{b5}m/m"),
        _ => (1e6, "\u{b5}rad/(N m)"),
    };
    let points = &pattern.points;
    let seen = points.iter().map(|point| (point.at, point.seen * factor));
    let bars = points.iter().flat_map(|point| {
        let ends = [-1.0, 1.0].map(|side| point.seen + side * point.standard_error);
        ends.map(|end| (point.at, end * factor))
    });
    let bars: Vec<(f64, f64)> = bars.collect();
    let fitted = pattern.curve(SAMPLES).into_iter();
    let fitted: Vec<_> = fitted.map(|(at, value)| (at, value * factor)).collect();
    let axis = |values: Vec<f64>| {
        let largest = values
            .iter()
            .fold(1e-9, |most: f64, value| most.max(value.abs()));
        ChartAxis::linear(reach(values, 0.05, 1e-9 * largest), 6)
    };
    let x = axis(bars.iter().map(|point| point.0).collect());
    let y = axis(bars.iter().chain(&fitted).map(|point| point.1).collect());
    let of_joint = pattern.kind.starts_with("joint").then_some(&pattern.joint);
    let of = naming(of_joint.into_iter().flatten(), " of {}");
    let names = [
        &*format!("{}{of} [{}]", pattern.kind, pattern.at_unit),
        &*format!("residual [{unit}]"),
    ];
    let series = vec![
        Series::new("", COLOURS[0], Mark::Segments(3.0), bars),
        Series::new("", COLOURS[0], Mark::Dot, seen),
        Series::new("", COLOURS[1], Mark::Line, fitted),
    ];
    Chart::new([x, y], names, series)
}

fn panel_title(pattern: &Pattern) -> String {
    let joint = pattern.joint.as_deref();
    let share = 100.0 * pattern.share;
    let what = match (pattern.harmonic, joint) {
        (Some(waves), Some(joint)) => format!("{joint}, harmonic {waves}"),
        (None, Some(joint)) => format!("{joint}, {}", pattern.kind),
        _ => pattern.kind.to_owned(),
    };
    format!("{what}: {share:.1} % of variance")
}
