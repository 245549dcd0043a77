//! The plot of a model selection, as SVG.

use super::charts::{COLOURS, ChartAxis, INK, Mark, PlotError, SIZE, Series, chart_of, plot};
use crate::identification::DistanceStatistics;
use crate::record::model_selection::{ModelSelectionMessage, NestedModelMessage};

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
    let lines = [line(&fitted), line(&predicted)];
    let all = lines.iter().flatten();
    let top = all.map(|(_, value)| *value).fold(0.0, f64::max) * 1.1;
    let label = |place: &f64| {
        let mut all = (0..).map(f64::from).zip(nested_models);
        let nested_model = all.find(|(index, _)| (index - place).abs() < 1e-6);
        nested_model.map_or_else(String::new, |(_, nested_model)| {
            let plus = if *place > 0.5 { "+ " } else { "" };
            format!("{plus}{} ({})", nested_model.added, nested_model.unknowns)
        })
    };
    let chosen = model_selection.recommended.and_then(|place| {
        let nested_model = nested_models.get(place)?;
        Some((place as f64, predicted(nested_model)?))
    });
    let series = [
        Series::new("fitted readings", COLOURS[0], Mark::Line),
        Series::new("blocks that were not", COLOURS[1], Mark::Line),
        Series::new("recommended", INK, Mark::Ring),
    ];
    let count = nested_models.len();
    let axes = [
        ChartAxis::new(
            -0.5..count as f64 - 0.5,
            (0_u32..).map(f64::from).take(count).collect(),
        ),
        ChartAxis::linear(0.0..top.max(1e-9), 8),
    ];
    let names = ["parameters (unknowns)", "rms residual [mm]"];
    plot(SIZE, title, |area| {
        let mut chart = chart_of(area, axes, names, &series, &label)?;
        for (each, line) in series.iter().zip(&lines) {
            each.draw(&mut chart, line)?;
            Series::new("", each.colour, Mark::Dot).draw(&mut chart, line)?;
        }
        series[2].draw(&mut chart, chosen.as_slice())
    })
}
