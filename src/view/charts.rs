//! What the figures are made of: series over two axes, as SVG that fits any width and takes the colours of its page.

use std::fmt::Write;
use std::ops::Range;

use crate::numeric::tolerance::ends;
use crate::text::wording::{listed, shortened};
use crate::view::markup::escaped;

/// The width of a figure that takes half a page, and of one that takes the whole page (in units of the drawing).
pub const HALF: f64 = 960.0;
pub const WHOLE: f64 = 1500.0;
/// The height of a figure that is no chart of rows, of a row, and of the axis below the rows.
const HEIGHT: f64 = 620.0;
const ROW: f64 = 74.0;
const AXIS: f64 = 88.0;
/// The height of letters, the mean width of one in a wide font, and the height of a line.
const TEXT: f64 = 23.0;
const LETTER: f64 = 14.5;
const LINE: f64 = 46.0;
/// The space around a drawing, and the height of its title.
const MARGIN: f64 = 14.0;
const TITLE: f64 = 50.0;
/// Where a logarithmic axis of numbers of measurements has numbers, as far as they are whole.
const COUNTS: [f64; 9] = [1.0, 1.2, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0];
/// Where other logarithmic axes have numbers, and lines without a number in between.
const NUMBERS: [[&[f64]; 2]; 3] = [
    [&[1.0, 2.0, 5.0], &[3.0, 4.0, 6.0, 7.0, 8.0, 9.0]],
    [&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0], &[]],
    [
        &[1.0, 1.2, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
        &[1.1, 1.3, 1.4, 1.6, 1.7, 1.8, 1.9],
    ],
];
/// Longer names are cut.
const LONGEST_NAME: usize = 26;

/// The colour of dark text and lines, of soft ones, and of the grid, as pages have them.
pub const INK: &str = "currentColor";
pub const SOFT: &str = "var(--soft)";
pub const GRID: &str = "var(--line)";
/// The same in a file of its own.
const ON_WHITE: [(&str, &str); 3] = [(INK, "#1c2530"), (SOFT, "#5b6673"), (GRID, "#dee3e8")];
/// What these and others become where a file is seen in the dark.
const IN_THE_DARK: [(&str, &str); 6] = [
    ("#fff", "#171c22"),
    ("#1c2530", "#e4e9ee"),
    ("#5b6673", "#a3afbb"),
    ("#dee3e8", "#3a4550"),
    ("#0072b2", "#3fa0e0"),
    ("#9467bd", "#b79ad6"),
];
/// Colours of series that the colour-blind can tell apart (Okabe and Ito).
pub const COLOURS: [&str; 7] = [
    "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#9467bd",
];
/// The vermilion of what others are compared with: random plans.
const REFERENCE: &str = COLOURS[5];

/// The colours of plans beside each other, in their order and by whether others are compared with each: the same on pages and in
/// recordings.
pub fn plan_colours(is_reference: impl IntoIterator<Item = bool>) -> Vec<&'static str> {
    let others = COLOURS.into_iter().filter(|colour| *colour != REFERENCE);
    let mut others = others.cycle();
    let colour = |is_reference: bool| {
        let other = (!is_reference).then(|| others.next());
        other.flatten().unwrap_or(REFERENCE)
    };
    is_reference.into_iter().map(colour).collect()
}

/// An axis with its ticks.
#[derive(Debug, Clone)]
pub struct ChartAxis {
    /// From where to where.
    pub range: Range<f64>,
    /// Where its ticks are, and what stands there.
    pub ticks: Vec<(f64, String)>,
    /// Where lines without a number stand between them.
    minor: Vec<f64>,
}

impl ChartAxis {
    /// With numbers at these ticks.
    pub fn at(range: Range<f64>, ticks: impl IntoIterator<Item = f64>) -> Self {
        let numbered = |tick| (tick, listed([tick], 4));
        Self {
            range,
            ticks: ticks.into_iter().map(numbered).collect(),
            minor: Vec::new(),
        }
    }

    /// With about so many round ticks.
    pub fn linear(range: Range<f64>, about: u32) -> Self {
        let ticks = ticks(&range, about);
        Self::at(range, ticks)
    }

    /// Of whole numbers.
    pub fn whole(range: Range<f64>) -> Self {
        let is_whole = |tick: &f64| (tick - tick.round()).abs() < 1e-9;
        let ticks = ticks(&range, 8).into_iter().filter(is_whole);
        Self::at(range, ticks)
    }

    /// Of places 0, 1, 2, ... with these names.
    pub fn named(names: impl IntoIterator<Item = String>) -> Self {
        let ticks: Vec<_> = (0..).map(f64::from).zip(names).collect();
        Self {
            range: -0.5..ticks.len() as f64 - 0.5,
            ticks,
            minor: Vec::new(),
        }
    }

    /// Of logarithms (base 10), with the first of [`NUMBERS`] that are enough.
    pub fn logarithmic(range: Range<f64>) -> Self {
        let ends = [range.start, range.end];
        let is_enough = |major: &[f64]| {
            let mut places = [major, &ends].concat();
            places.sort_by(f64::total_cmp);
            let mut gaps = places.windows(2).map(|pair| pair[1] - pair[0]);
            major.len() >= 3 && gaps.all(|gap| gap <= 0.5 * (ends[1] - ends[0]))
        };
        // Where numbers are few or half of the axis has none, there are more; where those are, round ones in between.
        let numbers = NUMBERS.map(|numbers| numbers.map(|each| logarithms(&range, each)));
        let found = numbers.into_iter().find(|[major, _]| is_enough(major));
        let [major, minor] = found.unwrap_or_else(|| {
            let ends = 10_f64.powf(range.start)..10_f64.powf(range.end);
            let round = ticks(&ends, 6).into_iter().map(f64::log10);
            [round.collect(), Vec::new()]
        });
        Self {
            range,
            ticks: major.into_iter().map(numbered).collect(),
            minor,
        }
    }

    fn labels(&self) -> impl Iterator<Item = &String> {
        self.ticks.iter().map(|(_, label)| label)
    }

    /// Where a value is between two places of a drawing.
    fn place(&self, value: f64, [low, high]: [f64; 2]) -> f64 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        low + share * (high - low)
    }
}

/// The range of values with a share of it to spare on both sides, of at least so much.
pub fn reach(values: impl IntoIterator<Item = f64>, share: f64, least: f64) -> Range<f64> {
    let [low, high] = ends(values.into_iter());
    if low > high {
        return 0.0..1.0;
    }
    let margin = (share * (high - low)).max(least);
    low - margin..high + margin
}

/// The logarithms in a range of these numbers and of their products with powers of ten.
fn logarithms(range: &Range<f64>, factors: &[f64]) -> Vec<f64> {
    let powers = (-12..12).map(f64::from);
    powers
        .flat_map(|power| factors.iter().map(move |factor| factor.log10() + power))
        .filter(|tick| range.contains(tick))
        .collect()
}

/// A tick at a logarithm, with the number.
fn numbered(tick: f64) -> (f64, String) {
    (tick, listed([10_f64.powf(tick)], 4))
}

/// About so many round ticks in a range.
fn ticks(range: &Range<f64>, about: u32) -> Vec<f64> {
    let rough = ((range.end - range.start) / f64::from(about)).max(f64::MIN_POSITIVE);
    let power = 10_f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let step = steps.into_iter().find(|&step| step >= rough * 0.999);
    let step = step.unwrap_or(rough);
    let first = (range.start / step - 1e-9).ceil();
    let all = (0_u32..1000).map(|index| (first + f64::from(index)) * step);
    all.take_while(|&tick| tick <= range.end + 1e-9 * step)
        .collect()
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// A line with a dot at each point.
    Dotted,
    /// A filled circle.
    Dot,
    /// An open circle.
    Ring,
    /// A filled square.
    Square,
    /// A filled triangle.
    Triangle,
    /// A filled diamond.
    Diamond,
    /// A cross.
    Cross,
    /// A large filled circle.
    Disc,
    /// A line between every two points, so thick.
    Segments(f64),
    /// An area with these corners, of this opacity.
    Area(f64),
}

impl Mark {
    /// The outline about a point and the thickness of its line, if it is not filled; none of what is no mark of single points.
    const fn symbol(self) -> Option<(&'static str, Option<f64>)> {
        Some(match self {
            Self::Dot => ("M-6 0a6 6 0 1 0 12 0a6 6 0 1 0-12 0", None),
            Self::Disc => ("M-10 0a10 10 0 1 0 20 0a10 10 0 1 0-20 0", None),
            Self::Ring => ("M-15 0a15 15 0 1 0 30 0a15 15 0 1 0-30 0", Some(3.0)),
            Self::Cross => ("M-9-9L9 9M-9 9L9-9", Some(5.0)),
            Self::Square => ("M-10-10h20v20h-20z", None),
            Self::Triangle => ("M-13 10h26L0-13z", None),
            Self::Diamond => ("M-14 0L0-14 14 0 0 14z", None),
            Self::Line | Self::Dashed | Self::Dotted | Self::Segments(_) | Self::Area(_) => {
                return None;
            }
        })
    }
}

/// Points with a colour and a mark.
pub struct Series {
    /// What it is called in the legend; without a name it is not there.
    name: String,
    colour: &'static str,
    mark: Mark,
    points: Vec<(f64, f64)>,
    /// What is read at each point when it is pointed at.
    tips: Vec<String>,
}

impl Series {
    /// A series; the points are in the axes' units.
    pub fn new(
        name: &str,
        colour: &'static str,
        mark: Mark,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self {
            name: shortened(name, LONGEST_NAME),
            colour,
            mark,
            points: points.into_iter().collect(),
            tips: Vec::new(),
        }
    }

    /// The same with words about each of its points, of its name and the point.
    pub fn tipped(mut self, words: impl Fn(&str, f64, f64) -> String) -> Self {
        let words = |&(x, y): &(f64, f64)| words(&self.name, x, y);
        self.tips = self.points.iter().map(words).collect();
        self
    }

    /// A value between the ends of its interval, at a height: `[low, value, high]`.
    pub fn interval([low, value, high]: [f64; 3], y: f64, colour: &'static str) -> [Self; 2] {
        let cap = |x: f64| [(x, y - 0.16), (x, y + 0.16)];
        let lines = [[(low, y), (high, y)], cap(low), cap(high)].concat();
        let lines = Self::new("", colour, Mark::Segments(5.0), lines);
        [lines, Self::new("", colour, Mark::Disc, [(value, y)])]
    }

    /// Points in units of the drawing by a mark in its colour.
    fn picture(&self, mark: Mark, places: &[(f64, f64)]) -> String {
        let colour = self.colour;
        if let Some((outline, thick)) = mark.symbol() {
            let style = thick.map_or_else(
                || format!("fill=\"{colour}\""),
                |thick| format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{thick}\""),
            );
            let symbol = |(x, y): &(f64, f64)| {
                format!("<path transform=\"translate({x:.1} {y:.1})\" d=\"{outline}\" {style}/>\n")
            };
            return places.iter().map(symbol).collect();
        }
        let path = |places: &[(f64, f64)]| {
            let corners = places.iter().map(|(x, y)| format!("{x:.1} {y:.1}"));
            format!("M{}", corners.collect::<Vec<_>>().join("L"))
        };
        let line = |thick: f64, d: &str, dashes: &str| {
            format!(
                "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"{thick}\"{dashes} d=\"{d}\"/>\n"
            )
        };
        match mark {
            _ if places.is_empty() => String::new(),
            Mark::Area(opacity) => format!(
                "<path fill=\"{colour}\" fill-opacity=\"{opacity}\" d=\"{}z\"/>\n",
                path(places)
            ),
            Mark::Segments(thick) => {
                let pairs: String = places.chunks(2).map(path).collect();
                line(thick, &pairs, "")
            }
            Mark::Dashed => line(3.0, &path(places), " stroke-dasharray=\"10 7\""),
            Mark::Dotted => line(3.0, &path(places), "") + &self.picture(Mark::Dot, places),
            _ => line(3.0, &path(places), ""),
        }
    }
}

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
            |(row, name): (usize, &String)| (middle(count, row), shortened(name, LONGEST_NAME));
        let rows = ChartAxis {
            range: 0.0..count as f64,
            ticks: names.iter().enumerate().map(named).collect(),
            minor: Vec::new(),
        };
        Self {
            notes,
            ..Self::new([axis, rows], [title, ""], series)
        }
    }

    /// The rms residual error (um) over numbers of measurements, both logarithmic, as far as the series go.
    pub fn of_accuracy(mut series: Vec<Series>) -> Self {
        for (x, y) in series.iter_mut().flat_map(|each| &mut each.points) {
            (*x, *y) = (x.log10(), y.log10());
        }
        let axis = |of: fn(&(f64, f64)) -> f64| {
            let values = series.iter().flat_map(|each| &each.points).map(of);
            ChartAxis::logarithmic(reach(values, 0.05, 0.02))
        };
        let mut axes = [axis(|point| point.0), axis(|point| point.1)];
        let is_whole = |tick: &f64| ((10_f64.powf(*tick) + 0.5).fract() - 0.5).abs() < 1e-9;
        let counts = logarithms(&axes[0].range, &COUNTS).into_iter();
        axes[0].ticks = counts.filter(is_whole).map(numbered).collect();
        axes[0].minor.retain(is_whole);
        let error = "\u{3c1}\u{2080}, rms residual error [\u{b5}m], logarithmic";
        Self::new(axes, ["measurements, logarithmic", error], series)
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
        svg += &(plane.grid() + &plane.legend(width));
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
    let dark = IN_THE_DARK.map(|(light, dark)| {
        format!("[fill=\"{light}\"] {{ fill: {dark} }} [stroke=\"{light}\"] {{ stroke: {dark} }}\n")
    });
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" {}>\n\
         <style>@media screen and (prefers-color-scheme: dark) {{\n{}}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{drawings}</svg>\n",
        letters(TEXT),
        dark.concat()
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
    /// Whether the legend stands beside it, not above.
    is_wide: bool,
    /// So many lines have the names along x, by turns, where they are too long to stand beside one another.
    lines: usize,
}

impl<'a> Plane<'a> {
    fn new(chart: &'a Chart, [width, height]: [f64; 2], title: &str) -> Self {
        let is_wide = width >= WHOLE;
        let ([x, y], [x_name, y_name]) = (&chart.axes, &chart.names);
        let names = || chart.named().map(|each| &each.name);
        let room = |is_there: bool, room: f64| if is_there { room } else { 0.0 };
        let legend = [
            room(!is_wide, LINE * names().count().div_ceil(2) as f64),
            room(is_wide && names().count() > 0, 84.0 + width_of(names())),
        ];
        let above = MARGIN + legend[0] + room(!title.is_empty(), TITLE);
        // Half of the last name stands beyond the axis.
        let beyond = 0.5 * width_of(x.labels().last());
        let beside = legend[1].max(beyond).max(width_of(&chart.notes));
        let across = [
            MARGIN + 12.0 + width_of(y.labels()) + room(!y_name.is_empty(), LINE),
            width - MARGIN - beside,
        ];
        let needed = width_of(x.labels()) * x.ticks.len() as f64;
        let lines = (1..4).find(|&lines| needed <= (across[1] - across[0]) * lines as f64);
        let lines = lines.unwrap_or(4);
        let below = lines as f64 * LINE + room(!x_name.is_empty(), 32.0);
        Self {
            chart,
            across,
            upwards: [height - below, above],
            is_wide,
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

    /// The names of series off the data: beside it or, where it is narrow, above in two columns.
    fn legend(&self, width: f64) -> String {
        let mut svg = String::new();
        for (row, each) in self.chart.named().enumerate() {
            let (x, y) = if self.is_wide {
                (self.across[1] + 24.0, self.upwards[1] + LINE * row as f64)
            } else {
                let column = (row % 2) as f64 * (0.5 * width - LINE);
                (self.across[0] + column, MARGIN + LINE * (row / 2) as f64)
            };
            let y = y + 0.5 * LINE;
            svg += &match each.mark.symbol() {
                Some(_) => each.picture(each.mark, &[(x + 17.0, y)]),
                None => each.picture(each.mark, &[(x, y), (x + 34.0, y)]),
            };
            svg += &text((x + 48.0, y + 0.35 * TEXT), &each.name, "");
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_decades_have_a_number_at_every_line() {
        let wide = ChartAxis::logarithmic(0.0..2.0);
        assert_eq!([wide.ticks.len(), wide.minor.len()], [6, 12]);
        let narrow = ChartAxis::logarithmic(0.36..0.77);
        assert_eq!([narrow.ticks.len(), narrow.minor.len()], [3, 0]);
        assert!(ChartAxis::logarithmic(0.62..0.68).ticks.len() >= 3);
        let beyond_ten = ChartAxis::logarithmic(7.6_f64.log10()..14.0_f64.log10());
        let numbers: Vec<&String> = beyond_ten.labels().collect();
        assert_eq!(numbers, ["8", "9", "10", "12"]);
    }

    #[test]
    fn plans_have_colours_of_their_own_and_the_reference_its_own() {
        let colours = plan_colours([true, false, false]);
        assert_eq!(colours, [REFERENCE, COLOURS[0], COLOURS[1]]);
        assert_eq!(plan_colours([false, true])[0], colours[1]);
    }
}
