//! Plots as SVG, in colours that the colour-blind can tell apart (Okabe and Ito).

use plotters::prelude::*;
use thiserror::Error;

use crate::plan::search::{BudgetPoint, repeated_configurations};

pub(super) const SIZE: (u32, u32) = (800, 500);
pub(super) const COLOURS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];

/// A plot could not be drawn.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("the plot could not be drawn: {0}")]
pub struct PlotError(pub(super) String);

impl PlotError {
    /// For a reason.
    pub fn new(reason: &str) -> Self {
        Self(reason.to_owned())
    }
}

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for PlotError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

/// The names of a chart's series, in its upper right corner.
pub(super) fn draw_legend<'chart, 'svg: 'chart, C: plotters::coord::CoordTranslate>(
    chart: &mut ChartContext<'chart, SVGBackend<'svg>, C>,
) -> Result<(), PlotError> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE)
        .border_style(BLACK)
        .label_font(("sans-serif", 14))
        .draw()?;
    Ok(())
}

/// `rho_0` against the number of measurements: a line for each number of configurations, and the
/// bound that no plan can beat. Returns the SVG text.
///
/// # Errors
/// There are no points, or the drawing fails.
pub fn budget_plot(title: &str, points: &[BudgetPoint]) -> Result<String, PlotError> {
    let fewest = points.iter().map(|point| point.experiments).min();
    let largest = points.iter().map(|point| point.experiments).max();
    let (Some(fewest), Some(largest)) = (fewest, largest) else {
        return Err(PlotError("there are no points".to_owned()));
    };
    let top = points
        .iter()
        .map(|point| point.rho0_m * 1e6)
        .fold(0.0, f64::max)
        * 1.05;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, ("sans-serif", 20))
            .margin(15)
            .x_label_area_size(45)
            .y_label_area_size(60)
            .build_cartesian_2d(fewest..largest.max(fewest + 1), 0.0..top)?;
        chart
            .configure_mesh()
            .x_desc("measurements")
            .y_desc("rms residual error at the test pose [um]")
            .label_style(("sans-serif", 15))
            .draw()?;
        let mut lines: Vec<(String, Vec<(u32, f64)>)> = Vec::new();
        let line = |keep: &dyn Fn(&&BudgetPoint) -> bool| -> Vec<(u32, f64)> {
            points
                .iter()
                .filter(keep)
                .map(|point| (point.experiments, point.rho0_m * 1e6))
                .collect()
        };
        for count in repeated_configurations(points) {
            let name = format!("{count} configurations, repeated");
            lines.push((name, line(&|point| point.configurations == count)));
        }
        lines.push((
            "all different".to_owned(),
            line(&|point| point.configurations == point.experiments),
        ));
        for (index, (name, line)) in lines.into_iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(2)).point_size(3))?
                .label(name)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(2))
                });
        }
        let mut bound: Vec<(u32, f64)> = points
            .iter()
            .filter_map(|point| Some((point.experiments, point.lower_bound_m()? * 1e6)))
            .collect();
        bound.dedup();
        chart
            .draw_series(DashedLineSeries::new(bound, 6, 4, BLACK.stroke_width(1)))?
            .label("bound: no plan is below")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 20, y)], BLACK));
        draw_legend(&mut chart)?;
        area.present()?;
    }
    Ok(svg)
}
