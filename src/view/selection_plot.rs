//! Selections of readings, as SVG: every random one a dot, every planned one a mark.

use std::ops::Range;

use plotters::style::RGBColor;

use super::charts::{COLOURS, Chart, ChartAxis, INK, Mark, PlotError, Series};
use crate::study::selection::{Chosen, Selection, choice_name};

/// The random choices of a size stand so far to the left of it at most, the planned ones to the right.
const RANDOM: f64 = 0.35;

/// The mean distances of all choices, size beside size. Returns the SVG text.
///
/// # Errors
/// There are no choices, or the drawing fails.
pub fn selection_plot(title: &str, selection: &Selection<'_>) -> Result<String, PlotError> {
    let mean = |chosen: &Chosen| chosen.numbers_mm()[0];
    let means = selection.sizes.iter().map(|of_size| {
        let planned = of_size.planned.iter();
        let planned = planned.filter_map(|(_, chosen)| mean(chosen.as_ref().ok()?));
        [of_size.random_means_mm(), planned.collect()]
    });
    let of_sizes: Vec<[Vec<f64>; 2]> = means.collect();
    let all = selection.all_mm().mean;
    let heights = heights(all, &of_sizes)?;
    let sizes = || (0..).map(f64::from).zip(&selection.sizes);
    let count = selection.sizes.len() as f64;
    let random = (0..).map(f64::from).zip(&of_sizes);
    let random = random.flat_map(|(place, [means, _])| {
        let step = RANDOM / means.len().max(1) as f64;
        let all = (0..).map(f64::from).zip(means);
        all.map(move |(index, mean)| (place - RANDOM + step * index, *mean))
    });
    // What lies above is counted and not drawn.
    let mut above = 0;
    let mut series = |name: &str, colour: RGBColor, mark: Mark, points: Vec<(f64, f64)>| {
        let points = points.into_iter().map(|(x, mean)| (x, mean.log10()));
        let (seen, higher): (Vec<_>, Vec<_>) = points.partition(|(_, y)| *y < heights.end);
        above += higher.len();
        Series::new(name, colour, mark, seen)
    };
    let across = vec![(-0.5, all), (count - 0.5, all)];
    let grey = RGBColor(150, 150, 150);
    let mut drawn = vec![
        series("fitted to all readings", INK, Mark::Dashed, across),
        series("random", grey, Mark::Dot, random.collect()),
    ];
    let criteria = (selection.sizes.first()).map_or(&[][..], |first| &first.planned);
    for (number, (criterion, _)) in criteria.iter().enumerate() {
        let step = RANDOM / criteria.len() as f64;
        let marks = sizes().filter_map(|(place, of_size)| {
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
    let size_names = selection.sizes.iter().map(|each| each.size.to_string());
    let chart = Chart {
        axes: [
            ChartAxis::named(size_names.collect()),
            ChartAxis::logarithmic(heights),
        ],
        names: [
            format!("{}s that were chosen", selection.parts.unit()),
            "mean distance at all others [mm], logarithmic".to_owned(),
        ],
        series: drawn,
    };
    chart.file(&title)
}

/// From the lowest mean to the highest that matters (logarithms of mm), of the fit to all readings and of each size's random and planned
/// choices (mm): all of them up to three times what three quarters of the size's random ones stay below.
fn heights(all_mm: f64, sizes: &[[Vec<f64>; 2]]) -> Result<Range<f64>, PlotError> {
    let mut ends = [all_mm; 2];
    for [random, planned] in sizes {
        let mut usual = if random.is_empty() { planned } else { random }.clone();
        usual.sort_by(f64::total_cmp);
        let limit = 3.0 * usual.get(usual.len() * 3 / 4).copied().unwrap_or(0.0);
        for mean in random.iter().chain(planned).filter(|mean| **mean <= limit) {
            ends = [ends[0].min(*mean), ends[1].max(*mean)];
        }
    }
    if ends[0] <= 0.0 {
        return Err(PlotError::new("there is nothing to draw"));
    }
    Ok((0.9 * ends[0]).log10()..(1.1 * ends[1]).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size whose choices are all far worse than the best of another, but for one that failed altogether.
    #[test]
    fn all_sizes_are_on_the_picture() {
        let sizes = [
            [vec![0.7, 40.0, 0.9, 0.8, 0.75], vec![0.2, 1.1]],
            [vec![0.1, 0.11, 0.12, 0.13], vec![]],
        ];
        let heights = heights(0.08, &sizes).expect("something to draw");
        assert!(heights.contains(&1.1_f64.log10()) && heights.contains(&0.08_f64.log10()));
        assert!(!heights.contains(&40_f64.log10()));
    }
}
