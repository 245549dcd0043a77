//! Plots of residuals and of model selection, as SVG.

use plotters::prelude::*;

use super::plots::{COLOURS, PlotError, SIZE, draw_legend};
use crate::identification::DistanceStatistics;
use crate::record::model_selection::{ModelSelectionMessage, NestedModelMessage};
use crate::record::patterns::{PatternMessage, PatternsMessage};

/// What each nested model of a model selection leaves of the readings that it was fitted to and of blocks that it was not; the recommended one
/// is marked. Returns the SVG text.
///
/// # Errors
/// There are no nested models, or the drawing fails.
pub fn model_selection_plot(
    title: &str,
    model_selection: &ModelSelectionMessage,
) -> Result<String, PlotError> {
    let nested_models = &model_selection.nested_models;
    if nested_models.is_empty() {
        return Err(PlotError("there are no models".to_owned()));
    }
    let rms = |lengths: Option<&DistanceStatistics>| lengths.map(|lengths| lengths.rms);
    let fitted = |nested_model: &NestedModelMessage| rms(nested_model.distance_mm.as_ref());
    let predicted = |nested_model: &NestedModelMessage| {
        let judged = nested_model.cross_validation.as_ref()?;
        rms(judged.distance_mm.as_ref())
    };
    let line = |of: &dyn Fn(&NestedModelMessage) -> Option<f64>| -> Vec<(f64, f64)> {
        let all = nested_models.iter().enumerate();
        all.filter_map(|(place, nested_model)| Some((place as f64, of(nested_model)?)))
            .collect()
    };
    let lines = [
        ("readings that were fitted", line(&fitted)),
        ("blocks that were not", line(&predicted)),
    ];
    let all = lines.iter().flat_map(|(_, line)| line);
    let top = all.map(|(_, value)| *value).fold(0.0, f64::max) * 1.1;
    let names = |place: &f64| {
        let mut all = nested_models.iter().enumerate();
        let nested_model = all.find(|(index, _)| (*index as f64 - place).abs() < 1e-6);
        nested_model.map_or_else(String::new, |(_, nested_model)| {
            let plus = if *place > 0.5 { "+ " } else { "" };
            format!("{plus}{} ({})", nested_model.added, nested_model.unknowns)
        })
    };
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, ("sans-serif", 20))
            .margin(15)
            .x_label_area_size(45)
            .y_label_area_size(60)
            .build_cartesian_2d(-0.5..nested_models.len() as f64 - 0.5, 0.0..top.max(1e-9))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(2 * nested_models.len() + 1)
            .x_label_formatter(&names)
            .x_desc("parameters (unknowns)")
            .y_desc("rms residual [mm]")
            .label_style(("sans-serif", 15))
            .draw()?;
        for (index, (name, line)) in lines.into_iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(2)).point_size(4))?
                .label(name)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(2))
                });
        }
        let chosen = model_selection.recommended.and_then(|place| {
            let nested_model = nested_models.get(place)?;
            Some((place as f64, predicted(nested_model)?))
        });
        chart
            .draw_series(chosen.map(|at| Circle::new(at, 9, BLACK.stroke_width(2))))?
            .label("recommended")
            .legend(|(x, y)| Circle::new((x + 10, y), 6, BLACK.stroke_width(2)));
        draw_legend(&mut chart)?;
        area.present()?;
    }
    Ok(svg)
}

/// A panel's size (pixels).
const PANEL: (u32, u32) = (400, 300);
/// The height of the title (pixels).
const HEAD: u32 = 30;
/// So many patterns are drawn.
const MOST_PANELS: usize = 6;

/// The strongest patterns in residuals, a panel each: means over readings with their standard errors, and the pattern. Returns
/// the SVG text.
///
/// # Errors
/// The drawing fails.
pub fn patterns_plot(title: &str, patterns: &PatternsMessage) -> Result<String, PlotError> {
    let found: Vec<&PatternMessage> = patterns.found.iter().take(MOST_PANELS).collect();
    let columns = if found.len() > 1 { 2 } else { 1 };
    let rows = found.len().div_ceil(columns).max(1);
    let [wide, high] = [columns, rows].map(|count| u32::try_from(count).unwrap_or(1));
    let size = (PANEL.0 * wide, PANEL.1 * high + HEAD);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)?;
        let title = if found.is_empty() {
            format!("{title}: none of {} looked at", patterns.looked_at)
        } else {
            title.to_owned()
        };
        let area = area.titled(&title, ("sans-serif", 18))?;
        for (pattern, panel) in found.iter().zip(area.split_evenly((rows, columns))) {
            draw_pattern(pattern, &panel)?;
        }
        area.present()?;
    }
    Ok(svg)
}

fn draw_pattern(
    pattern: &PatternMessage,
    panel: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
) -> Result<(), PlotError> {
    let (factor, unit) = match pattern.unit.as_str() {
        "rad" => (1e3, "mrad"),
        "m" => (1e3, "mm"),
        "1" => (1e6, "um/m"),
        _ => (1e6, "1e-6 rad/(N m)"),
    };
    let points = &pattern.points;
    let reach = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let margin = ((high - low) * 0.05).max(1e-9 * high.abs().max(1e-9));
        if low <= high {
            (low - margin)..(high + margin)
        } else {
            0.0..1.0
        }
    };
    let ends = points.iter().flat_map(|point| {
        [
            point.observed - point.standard_error,
            point.observed + point.standard_error,
            point.pattern,
        ]
    });
    let mut chart = ChartBuilder::on(panel)
        .caption(panel_title(pattern), ("sans-serif", 14))
        .margin(8)
        .x_label_area_size(35)
        .y_label_area_size(55)
        .build_cartesian_2d(
            reach(&mut points.iter().map(|point| point.at)),
            reach(&mut ends.map(|value| value * factor)),
        )?;
    chart
        .configure_mesh()
        .x_desc(format!("[{}]", pattern.at_unit))
        .y_desc(format!("[{unit}]"))
        .x_labels(6)
        .y_labels(6)
        .label_style(("sans-serif", 12))
        .draw()?;
    chart.draw_series(points.iter().map(|point| {
        let [low, high] = [-1.0, 1.0].map(|side| point.observed + side * point.standard_error);
        PathElement::new(
            [(point.at, low * factor), (point.at, high * factor)],
            COLOURS[0],
        )
    }))?;
    chart.draw_series(
        points
            .iter()
            .map(|point| Circle::new((point.at, point.observed * factor), 2, COLOURS[0].filled())),
    )?;
    chart.draw_series(LineSeries::new(
        points
            .iter()
            .map(|point| (point.at, point.pattern * factor)),
        COLOURS[1].stroke_width(2),
    ))?;
    Ok(())
}

fn panel_title(pattern: &PatternMessage) -> String {
    let joint = pattern.joint.as_deref();
    let share = 100.0 * pattern.share;
    let what = match (pattern.harmonic, joint) {
        (Some(waves), Some(joint)) => format!("{joint}, harmonic {waves}"),
        (None, Some(joint)) => format!("{joint}, {}", pattern.against),
        _ => pattern.against.clone(),
    };
    format!("{what}: {share:.1} % of the residuals' variance")
}
