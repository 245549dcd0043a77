//! What the figures are made of: series over two axes, which a template draws as SVG that fits any width and takes the colours of its
//! page.

mod axis;
mod series;

use serde_json::{Value, json};

use crate::text::wording::shortened;
use crate::view::markup::{PageError, filled};

pub use axis::{ChartAxis, reach};
pub use series::{COLOURS, GRID, INK, Mark, SOFT, Series, plan_colours};

/// The width of a figure that takes half a page, and of one that takes the whole page (in units of the drawing).
pub const HALF: f64 = 960.0;
pub const WHOLE: f64 = 1300.0;
/// The height of a figure that is no chart of rows, of a row, and of the axis below the rows.
const HEIGHT: f64 = 620.0;
const ROW: f64 = 74.0;
const AXIS: f64 = 88.0;
/// The mean width of a letter in a wide font, and the height of a line.
const LETTER: f64 = 14.5;
const LINE: f64 = 46.0;
/// The space around a drawing, the height of its title, and the room of a mark in the legend; lengths as in `pages/chart.svg`.
const MARGIN: f64 = 14.0;
const TITLE: f64 = 50.0;
const SAMPLE: f64 = 48.0;
/// Longer names of rows are cut.
const LONGEST_ROW: usize = 26;
/// Minutes on an axis are hours from so many on.
const LONG_MIN: f64 = 240.0;

/// The colours of pages in a file of its own.
const ON_WHITE: [(&str, &str); 3] = [(INK, "#1c2530"), (SOFT, "#5b6673"), (GRID, "#dee3e8")];
/// What becomes of these, and of the colours of series, where a file is seen in the dark.
const IN_THE_DARK: &str = concat!(
    include_str!("pages/dark_plot.css"),
    include_str!("pages/dark_series.css")
);

/// Series over two axes.
pub struct Chart {
    /// Along x, and upwards.
    pub axes: [ChartAxis; 2],
    /// What they show, with units.
    pub names: [String; 2],
    /// What stands to the right of each row, from the top, of a chart of rows.
    pub notes: Vec<String>,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

impl Chart {
    /// With what its axes show.
    pub fn new(axes: [ChartAxis; 2], names: [&str; 2], series: Vec<Series>) -> Self {
        Self {
            axes,
            names: names.map(str::to_owned),
            notes: Vec::new(),
            series,
        }
    }

    /// With a named row for each thing, from top to bottom, and a note to the right of each; the title says what the axis shows.
    pub fn of_rows(
        rows: impl IntoIterator<Item = (String, String)>,
        axis: ChartAxis,
        title: &str,
        series: Vec<Series>,
    ) -> Self {
        let (names, notes): (Vec<String>, Vec<String>) = rows.into_iter().unzip();
        let count = names.len();
        let named =
            |(row, name): (usize, &String)| (middle(count, row), shortened(name, LONGEST_ROW));
        let rows = ChartAxis {
            ticks: names.iter().enumerate().map(named).collect(),
            ..ChartAxis::at(0.0..count as f64, [])
        };
        Self {
            notes,
            ..Self::new([axis, rows], [title, ""], series)
        }
    }

    /// The rms residual error (um), logarithmic, over numbers of measurements (logarithmic) or, `by_minutes`, over the time that they take in
    /// the laboratory (minutes; in hours where it is long), as far as the series go.
    pub fn of_accuracy(mut series: Vec<Series>, by_minutes: bool) -> Self {
        let points = || series.iter().flat_map(|each| &each.points);
        let longest = points().map(|point| point.0).fold(0.0, f64::max);
        let (unit, minutes) = match longest {
            LONG_MIN.. => ("h", 60.0),
            _ => ("min", 1.0),
        };
        for (x, y) in series.iter_mut().flat_map(|each| &mut each.points) {
            *x = if by_minutes { *x / minutes } else { x.log10() };
            *y = y.log10();
        }
        let range = |of: fn(&(f64, f64)) -> f64| {
            let values = series.iter().flat_map(|each| &each.points).map(of);
            reach(values, 0.05, 0.02)
        };
        let (x, y) = (range(|point| point.0), range(|point| point.1));
        let (x, name) = if by_minutes {
            let name = format!("time in the laboratory [{unit}]");
            (ChartAxis::linear(x, 8), name)
        } else {
            (ChartAxis::counts(x), "measurements, logarithmic".to_owned())
        };
        let error = "\u{3c1}\u{2080}, rms residual error [\u{b5}m], logarithmic";
        Self::new([x, ChartAxis::logarithmic(y)], [&name, error], series)
    }

    /// A figure of a page, under a name, for its template.
    pub fn figure(&self, width: f64, name: &str) -> Value {
        let height = match self.notes.len() {
            0 => HEIGHT,
            rows => AXIS + ROW * rows as f64,
        };
        let mut figure = self.drawing([width, height], "");
        figure["class"] = if width >= WHOLE { "whole" } else { "half" }.into();
        figure["name"] = name.into();
        figure
    }

    /// A file of its own.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn file(&self, title: &str) -> Result<String, PageError> {
        let size = [WHOLE, 840.0];
        let drawing = json!({ "at": null, "chart": self.drawing(size, title) });
        file(size, "", &[drawing])
    }

    /// What a template draws in a width and a height, with what is to be read at its points; the title stands above.
    pub fn drawing(&self, [width, height]: [f64; 2], title: &str) -> Value {
        let ([x, y], [x_name, y_name]) = (&self.axes, &self.names);
        let room = |is_there: bool, room: f64| if is_there { room } else { 0.0 };
        // Half of the last name stands beyond the axis.
        let beyond = 0.5 * width_of(x.labels().last());
        let across = [
            MARGIN + 12.0 + width_of(y.labels()) + room(!y_name.is_empty(), LINE),
            width - MARGIN - beyond.max(width_of(&self.notes)),
        ];
        // Where the names of series stand above it: where they begin, and their middle.
        let (mut end, mut below) = (width, room(!title.is_empty(), TITLE));
        let legend = |each: &Series| {
            if each.name.is_empty() {
                return None;
            }
            let room = SAMPLE + width_of([&each.name]);
            if end + room > width {
                (end, below) = (across[0], below + LINE);
            }
            end += room + LINE;
            Some([end - room - LINE, below - 0.5 * LINE])
        };
        let legend: Vec<_> = self.series.iter().map(legend).collect();
        // So many lines have the names along x, by turns, where they are too long to stand beside one another.
        let needed = width_of(x.labels()) * x.ticks.len() as f64;
        let lines = (1..4).find(|&lines| needed <= (across[1] - across[0]) * f64::from(lines));
        let lines = lines.unwrap_or(4);
        let names = f64::from(lines) * LINE + room(!x_name.is_empty(), 32.0);
        let upwards = [height - names, below + MARGIN];
        let series = self.series.iter().zip(legend).map(|(each, legend)| {
            let place = |point: &(f64, f64)| [x.place(point.0, across), y.place(point.1, upwards)];
            let places: Vec<_> = each.points.iter().map(place).collect();
            let (name, colour, mark, tips) = (&each.name, each.colour, each.mark, &each.tips);
            json!({ "name": name, "colour": colour, "mark": mark, "tips": tips, "legend": legend, "places": places })
        });
        let rows = self.notes.len();
        let notes = self.notes.iter().enumerate();
        let notes = notes.map(|(row, note)| (y.place(middle(rows, row), upwards), note));
        json!({
            "size": [width, height],
            "title": title,
            "names": self.names,
            "across": across,
            "upwards": upwards,
            "x": x.shown(across),
            "y": y.shown(upwards),
            "lines": lines,
            "notes": notes.collect::<Vec<_>>(),
            "series": series.collect::<Vec<_>>(),
        })
    }
}

/// The height of the middle of a row on the y axis of a chart of so many rows, which have height one.
pub fn middle(rows: usize, row: usize) -> f64 {
    (rows - row) as f64 - 0.5
}

/// Charts in their places as a file of its own, on white, or dark where the reader's screen is; the title stands above all.
///
/// # Errors
/// See [`PageError`].
pub fn file(size: [f64; 2], title: &str, drawings: &[Value]) -> Result<String, PageError> {
    let shown = json!({ "size": size, "title": title, "style": IN_THE_DARK, "drawings": drawings });
    let svg = filled("charts.svg", &shown)?;
    let fixed = |svg: String, (of_page, own): &(&str, &str)| svg.replace(of_page, own);
    Ok(ON_WHITE.iter().fold(svg, fixed))
}

/// Room for the longest of some texts.
fn width_of<'t>(texts: impl IntoIterator<Item = &'t String>) -> f64 {
    let longest = texts.into_iter().map(|text| text.chars().count()).max();
    LETTER * longest.unwrap_or(0) as f64
}
