//! What the figures are made of: series over two axes, as SVG that fits any width and takes the colours of its page.

mod axis;
mod series;

use std::fmt::Write;

use crate::text::wording::shortened;
use crate::view::markup::escaped;

pub use axis::{ChartAxis, reach};
pub use series::{COLOURS, GRID, INK, Mark, SOFT, Series, plan_colours};

/// The width of a figure that takes half a page, and of one that takes the whole page (in units of the drawing).
pub const HALF: f64 = 960.0;
pub const WHOLE: f64 = 1300.0;
/// The height of a figure that is no chart of rows, of a row, and of the axis below the rows.
const HEIGHT: f64 = 620.0;
const ROW: f64 = 74.0;
const AXIS: f64 = 88.0;
/// The height of letters, the mean width of one in a wide font, and the height of a line.
const TEXT: f64 = 23.0;
const LETTER: f64 = 14.5;
const LINE: f64 = 46.0;
/// The space around a drawing, the height of its title, and the room of a mark in the legend.
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

    /// The series that the legend names.
    fn named(&self) -> impl Iterator<Item = &Series> {
        (self.series.iter()).filter(|each| !each.name.is_empty())
    }

    /// A figure of a page, under a name.
    pub fn figure(&self, width: f64, name: &str) -> String {
        let class = if width >= WHOLE { "whole" } else { "half" };
        let height = match self.notes.len() {
            0 => HEIGHT,
            rows => AXIS + ROW * rows as f64,
        };
        format!(
            "<svg class=\"{class}\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {width} {height}\" {}>\n{}</svg>",
            escaped(name),
            letters(TEXT),
            self.drawing([width, height], "")
        )
    }

    /// A file of its own.
    pub fn file(&self, title: &str) -> String {
        let size = [WHOLE, 840.0];
        file(size, &self.drawing(size, title))
    }

    /// Its drawing (SVG) of a width and a height, with what is to be read at its points; the title stands above.
    pub fn drawing(&self, [width, height]: [f64; 2], title: &str) -> String {
        let plane = Plane::new(self, [width, height], title);
        let [left, right] = plane.across;
        let mut svg = heading(title, f64::midpoint(left, right));
        svg += &(plane.grid() + &plane.legend());
        let mut tips = String::new();
        for each in &self.series {
            let places: Vec<_> = each.points.iter().map(|point| plane.at(*point)).collect();
            svg += &each.picture(each.mark, &places);
            for ((x, y), words) in places.iter().zip(&each.tips) {
                let words = escaped(words);
                let _ = writeln!(
                    tips,
                    "<circle class=\"tip\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"22\"><title>{words}</title></circle>"
                );
            }
        }
        svg + &tips
    }
}

/// The height of the middle of a row on the y axis of a chart of so many rows, which have height one.
pub fn middle(rows: usize, row: usize) -> f64 {
    (rows - row) as f64 - 0.5
}

/// Drawings (SVG) as a file of its own, on white, or dark where the reader's screen is.
pub fn file([width, height]: [f64; 2], drawings: &str) -> String {
    let fixed = |svg: String, (of_page, own): &(&str, &str)| svg.replace(of_page, own);
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" {}>\n\
         <style>\n{IN_THE_DARK}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{drawings}</svg>\n",
        letters(TEXT)
    );
    ON_WHITE.iter().fold(svg, fixed)
}

/// The title of a drawing above the middle of its plane; nothing without one.
pub fn heading(title: &str, middle: f64) -> String {
    if title.is_empty() {
        return String::new();
    }
    let style = format!("text-anchor=\"middle\" font-size=\"{}\"", TEXT + 5.0);
    text((middle, 0.64 * TITLE), title, &style)
}

fn letters(size: f64) -> String {
    format!("font-family=\"sans-serif\" font-size=\"{size}\" fill=\"{INK}\"")
}

fn text((x, y): (f64, f64), words: &str, style: &str) -> String {
    let words = escaped(words);
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{words}</text>\n")
}

/// Room for the longest of some texts.
fn width_of<'t>(texts: impl IntoIterator<Item = &'t String>) -> f64 {
    let longest = texts.into_iter().map(|text| text.chars().count()).max();
    LETTER * longest.unwrap_or(0) as f64
}

/// Where a chart is in its drawing.
struct Plane<'a> {
    chart: &'a Chart,
    /// From left to right, and from the lower to the upper end.
    across: [f64; 2],
    upwards: [f64; 2],
    /// Where the names of series stand above it: where they begin, and their middle.
    legend: Vec<(f64, f64)>,
    /// So many lines have the names along x, by turns, where they are too long to stand beside one another.
    lines: usize,
}

impl<'a> Plane<'a> {
    fn new(chart: &'a Chart, [width, height]: [f64; 2], title: &str) -> Self {
        let ([x, y], [x_name, y_name]) = (&chart.axes, &chart.names);
        let room = |is_there: bool, room: f64| if is_there { room } else { 0.0 };
        // Half of the last name stands beyond the axis.
        let beyond = 0.5 * width_of(x.labels().last());
        let across = [
            MARGIN + 12.0 + width_of(y.labels()) + room(!y_name.is_empty(), LINE),
            width - MARGIN - beyond.max(width_of(&chart.notes)),
        ];
        let (mut end, mut below) = (width, room(!title.is_empty(), TITLE));
        let place = |each: &Series| {
            let room = SAMPLE + width_of([&each.name]);
            if end + room > width {
                (end, below) = (across[0], below + LINE);
            }
            end += room + LINE;
            (end - room - LINE, below - 0.5 * LINE)
        };
        let legend = chart.named().map(place).collect();
        let needed = width_of(x.labels()) * x.ticks.len() as f64;
        let lines = (1..4).find(|&lines| needed <= (across[1] - across[0]) * lines as f64);
        let lines = lines.unwrap_or(4);
        let names = lines as f64 * LINE + room(!x_name.is_empty(), 32.0);
        Self {
            chart,
            across,
            upwards: [height - names, below + MARGIN],
            legend,
            lines,
        }
    }

    /// Where a point is.
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let [across, upwards] = &self.chart.axes;
        (across.place(x, self.across), upwards.place(y, self.upwards))
    }

    /// The axes with their names and the grid; rows with names of their own have no lines.
    fn grid(&self) -> String {
        let ([x, y], [left, right], [bottom, top]) = (&self.chart.axes, self.across, self.upwards);
        let has_lines = self.chart.notes.is_empty();
        let mut svg = String::new();
        let mut line = |colour: &str, opacity: f64, d: String| {
            let _ = writeln!(
                svg,
                "<path fill=\"none\" stroke=\"{colour}\" stroke-opacity=\"{opacity}\" d=\"{d}\"/>"
            );
        };
        let upright = |tick: &f64| format!("M{:.1} {bottom:.1}V{top:.1}", self.at((*tick, 0.0)).0);
        let level = |tick: &f64| format!("M{left:.1} {:.1}H{right:.1}", self.at((0.0, *tick)).1);
        let majors = |axis: &ChartAxis| axis.ticks.iter().map(|each| each.0).collect::<Vec<f64>>();
        for (opacity, of_x, of_y) in [(0.5, &x.minor, &y.minor), (1.0, &majors(x), &majors(y))] {
            let levels = of_y.iter().map(level).filter(|_| has_lines);
            let lines = of_x.iter().map(upright).chain(levels);
            lines.for_each(|d| line(GRID, opacity, d));
        }
        line(
            SOFT,
            1.0,
            format!("M{left:.1} {top:.1}V{bottom:.1}H{right:.1}"),
        );
        for (place, (tick, label)) in x.ticks.iter().enumerate() {
            let down = bottom + 12.0 + 0.75 * TEXT + LINE * (place % self.lines) as f64;
            svg += &text(
                (self.at((*tick, 0.0)).0, down),
                label,
                "text-anchor=\"middle\"",
            );
        }
        for (tick, label) in &y.ticks {
            let height = self.at((0.0, *tick)).1 + 0.35 * TEXT;
            svg += &text((left - 12.0, height), label, "text-anchor=\"end\"");
        }
        let rows = self.chart.notes.iter().enumerate();
        for (row, note) in rows {
            let (_, height) = self.at((0.0, middle(self.chart.notes.len(), row)));
            svg += &text((right + MARGIN, height + 0.35 * TEXT), note, "");
        }
        let [x_name, y_name] = &self.chart.names;
        let soft = format!("text-anchor=\"middle\" fill=\"{SOFT}\"");
        let below = bottom + 12.0 + LINE * self.lines as f64 + 0.3 * TEXT;
        svg += &text((f64::midpoint(left, right), below), x_name, &soft);
        let (x, y) = (MARGIN + 0.75 * TEXT, f64::midpoint(top, bottom));
        let turned = format!("{soft} transform=\"rotate(-90 {x:.1} {y:.1})\"");
        svg + &text((x, y), y_name, &turned)
    }

    /// The names of series above the data.
    fn legend(&self) -> String {
        let mut svg = String::new();
        for (each, &(x, y)) in self.chart.named().zip(&self.legend) {
            svg += &match each.mark.symbol() {
                Some(_) => each.picture(each.mark, &[(x + 17.0, y)]),
                None => each.picture(each.mark, &[(x, y), (x + 34.0, y)]),
            };
            svg += &text((x + SAMPLE, y + 0.35 * TEXT), &each.name, "");
        }
        svg
    }
}
