//! Plots of residuals and of model selection, as SVG.

use super::charts::{Area, COLOURS, Chart, ChartAxis, INK, Mark, PlotError, Series, plot, text};
use crate::identification::patterns::{Pattern, PatternPoint, Patterns};
use crate::identification::{DistanceStatistics, ModelSelection, NestedModel};
use crate::numeric::tolerance::ends;

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
        return Err(PlotError("there are no models".to_owned()));
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
