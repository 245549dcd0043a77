//! Selections of readings, as SVG: every random one a dot, every planned one a mark.

use plotters::prelude::*;

use super::plots::{COLOURS, PlotError, draw_legend};
use crate::record::selection::{SelectionMessage, SelectionSizeMessage};

const SIZE: (u32, u32) = (900, 520);
/// Where the planned choices stand beside the random ones, which take the place from 0 to this of each size.
const RANDOM: f64 = 0.3;

/// The mean distances of all choices, size beside size. Returns the SVG text.
///
/// # Errors
/// There are no choices, or the drawing fails.
pub fn selection_plot(title: &str, message: &SelectionMessage) -> Result<String, PlotError> {
    let [lowest, top] = heights(message)?;
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let count = message.sizes.len() as f64;
        let mut chart = ChartBuilder::on(&area)
            .caption(title, ("sans-serif", 20))
            .margin(15)
            .x_label_area_size(45)
            .y_label_area_size(60)
            .build_cartesian_2d(-0.1..count + 0.7, (0.85 * lowest)..top)?;
        let label = |x: &f64| {
            let place = x.round();
            let size = message.sizes.iter().enumerate();
            let mut here = size.filter(|(index, _)| (*index as f64 - place).abs() < 0.5);
            match here.next() {
                Some((_, of_size)) if (x - place).abs() < 1e-9 => {
                    format!("{} readings", of_size.size)
                }
                _ => String::new(),
            }
        };
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels(2 * message.sizes.len() + 2)
            .x_label_formatter(&label)
            .y_desc("mean distance at all other readings [mm]")
            .label_style(("sans-serif", 15))
            .draw()?;
        let line = [
            (-0.1, message.all_mm.mean),
            (count - 0.1, message.all_mm.mean),
        ];
        chart
            .draw_series(DashedLineSeries::new(line, 6, 4, BLACK.stroke_width(1)))?
            .label("fitted to all readings")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 20, y)], BLACK));
        let dots = message
            .sizes
            .iter()
            .enumerate()
            .flat_map(|(index, of_size)| {
                let means = &of_size.random.means_mm;
                let step = RANDOM / means.len().max(1) as f64;
                (means.iter().enumerate())
                    .filter(|(_, mean)| **mean < top)
                    .map(move |(place, mean)| (index as f64 + step * place as f64, *mean))
            });
        chart
            .draw_series(dots.map(|at| Circle::new(at, 2, RGBColor(150, 150, 150).filled())))?
            .label("random")
            .legend(|(x, y)| Circle::new((x + 10, y), 3, RGBColor(150, 150, 150).filled()));
        let criteria = message
            .sizes
            .first()
            .map_or(&[][..], |first| &first.planned);
        for (number, first) in criteria.iter().enumerate() {
            let colour = *COLOURS.get(number).unwrap_or(&BLACK);
            let marks = message
                .sizes
                .iter()
                .enumerate()
                .filter_map(|(index, of_size)| {
                    let mean = of_size.planned.get(number)?.distance_mm.as_ref()?.mean;
                    let offset = RANDOM + 0.08 * (number + 1) as f64;
                    (mean < top).then_some((index as f64 + offset, mean))
                });
            let name = match first.criterion.as_str() {
                "test_pose" => "absolute accuracy".to_owned(),
                other => other.to_uppercase(),
            };
            chart
                .draw_series(marks.map(|at| TriangleMarker::new(at, 7, colour.filled())))?
                .label(name)
                .legend(move |(x, y)| TriangleMarker::new((x + 10, y), 7, colour.filled()));
        }
        draw_legend(&mut chart)?;
        area.present()?;
    }
    Ok(svg)
}

/// The lowest mean (mm), and how high the picture goes.
fn heights(message: &SelectionMessage) -> Result<[f64; 2], PlotError> {
    let means = |of_size: &SelectionSizeMessage| -> Vec<f64> {
        let planned = of_size.planned.iter();
        let planned = planned.filter_map(|each| Some(each.distance_mm.as_ref()?.mean));
        let random = of_size.random.mean_mm.iter().map(|spread| spread[2] * 1.1);
        planned.chain(random).collect()
    };
    let all: Vec<f64> = message.sizes.iter().flat_map(means).collect();
    let highest = all.iter().copied().fold(0.0, f64::max);
    if highest <= 0.0 {
        return Err(PlotError::new("there is nothing to draw"));
    }
    let lowest = all.iter().copied().fold(message.all_mm.mean, f64::min);
    // A planned choice that failed altogether does not hide the others.
    Ok([lowest, highest.min(4.0 * lowest) * 1.05])
}
