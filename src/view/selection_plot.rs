//! Selections of readings, as SVG: every random one a dot, every planned one a mark.

use plotters::style::RGBColor;

use super::charts::{COLOURS, ChartAxis, INK, Mark, PlotError, SIZE, Series, chart_of, plot};
use crate::record::selection::{SelectionMessage, SelectionSizeMessage};

/// The random choices of a size stand so far to the left of it at most, the planned ones to the right.
const RANDOM: f64 = 0.35;

/// The mean distances of all choices, size beside size. Returns the SVG text.
///
/// # Errors
/// There are no choices, or the drawing fails.
pub fn selection_plot(title: &str, message: &SelectionMessage) -> Result<String, PlotError> {
    let [lowest, top] = heights(message)?;
    let sizes = || (0..).map(f64::from).zip(&message.sizes);
    let count = message.sizes.len() as f64;
    let all = message.all_mm.mean;
    let random = sizes().flat_map(|(place, of_size)| {
        let means = &of_size.random.means_mm;
        let step = RANDOM / means.len().max(1) as f64;
        let all = (0..).map(f64::from).zip(means);
        all.map(move |(index, mean)| (place - RANDOM + step * index, *mean))
    });
    let grey = RGBColor(150, 150, 150);
    let mut drawn = vec![
        (
            Series::new("fitted to all readings", INK, Mark::Dashed),
            vec![(-0.5, all), (count - 0.5, all)],
        ),
        (Series::new("random", grey, Mark::Dot), random.collect()),
    ];
    let criteria = message
        .sizes
        .first()
        .map_or(&[][..], |first| &first.planned);
    for (number, first) in criteria.iter().enumerate() {
        let step = RANDOM / criteria.len() as f64;
        let marks = sizes().filter_map(|(place, of_size)| {
            let mean = of_size.planned.get(number)?.distance_mm.as_ref()?.mean;
            Some((place + step * (number + 1) as f64, mean))
        });
        let name = match first.criterion.as_str() {
            "test_pose" => "absolute accuracy".to_owned(),
            "test_pose_with_joint_errors" => "with joint errors".to_owned(),
            other => other.to_uppercase(),
        };
        let colour = *COLOURS.get(number).unwrap_or(&INK);
        drawn.push((Series::new(&name, colour, Mark::Triangle), marks.collect()));
    }
    let (series, points): (Vec<Series>, Vec<Vec<(f64, f64)>>) = drawn.into_iter().unzip();
    let axes = [
        ChartAxis::new(-0.5..count - 0.5, sizes().map(|(place, _)| place).collect()),
        ChartAxis::linear(0.85 * lowest..top, 8),
    ];
    let label = |place: &f64| {
        let mut here = sizes().filter(|(at, _)| (at - place).abs() < 1e-9);
        here.next()
            .map_or_else(String::new, |(_, of_size)| of_size.size.to_string())
    };
    let names = [
        "readings that were chosen",
        "mean distance at all others [mm]",
    ];
    plot(SIZE, title, |area| {
        let mut chart = chart_of(area, axes, names, &series, &label)?;
        for (each, points) in series.iter().zip(points) {
            let seen = points.into_iter().filter(|(_, mean)| *mean < top);
            each.draw(&mut chart, &seen.collect::<Vec<_>>())?;
        }
        Ok(())
    })
}

/// The lowest mean (mm), and how high the picture goes.
fn heights(message: &SelectionMessage) -> Result<[f64; 2], PlotError> {
    let means = |of_size: &SelectionSizeMessage| -> Vec<f64> {
        let planned = of_size.planned.iter();
        let planned = planned.filter_map(|each| Some(each.distance_mm.as_ref()?.mean));
        planned.chain(of_size.random.means_mm.clone()).collect()
    };
    let all: Vec<f64> = message.sizes.iter().flat_map(means).collect();
    let highest = all.iter().copied().fold(0.0, f64::max);
    if highest <= 0.0 {
        return Err(PlotError::new("there is nothing to draw"));
    }
    let lowest = all.iter().copied().fold(message.all_mm.mean, f64::min);
    // A choice that failed altogether does not hide the others.
    Ok([lowest, highest.min(4.0 * lowest) * 1.05])
}
