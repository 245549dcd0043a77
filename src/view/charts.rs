//! What the figures are made of: a drawing that fits any width, and charts of series.

mod palette;
mod rows;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use thiserror::Error;

use crate::numeric::tolerance::ends;
use crate::text::wording::{listed, shortened};
use crate::view::markup::escaped;

pub use palette::{COLOURS, plan_colours};
pub use rows::Rows;

/// The size of a plot that is a file of its own.
pub const SIZE: (u32, u32) = (1500, 840);
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

/// The width of a figure that takes half a page (in units of the drawing).
pub const HALF: u32 = 960;
/// The width of a figure that takes the whole page.
pub const WHOLE: u32 = 1500;
/// The height of text. Plotters makes it smaller by a quarter.
pub const TEXT: u32 = 28;
/// Longer names are cut.
const LONGEST_NAME: usize = 26;

/// Dark text and lines, soft ones, and the grid.
pub const INK: RGBColor = RGBColor(28, 37, 48);
pub const SOFT: RGBColor = RGBColor(91, 102, 115);
pub const GRID: RGBColor = RGBColor(222, 227, 232);

/// What stands for the colours of text and lines in a page, which may be dark.
const OF_PAGE: [(&str, &str); 4] = [
    ("\"#1C2530\"", "\"currentColor\""),
    ("\"#5B6673\"", "\"var(--soft)\""),
    ("\"#DEE3E8\"", "\"var(--line)\""),
    ("\"#FFFFFF\"", "\"var(--paper)\""),
];

/// A drawing area on SVG text.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// An axis whose ticks were chosen.
#[derive(Debug, Clone)]
pub struct ChartAxis {
    /// From where to where.
    pub range: std::ops::Range<f64>,
    /// Where its ticks are.
    pub ticks: Vec<f64>,
    /// Where lines without a number stand between them.
    pub minor: Vec<f64>,
    /// Whether it is of logarithms (base 10).
    pub is_logarithmic: bool,
    /// What stands at the ticks in place of numbers.
    pub names: Vec<String>,
}

impl ChartAxis {
    /// With about so many round ticks.
    pub fn linear(range: std::ops::Range<f64>, about: u32) -> Self {
        Self::new(range.clone(), ticks(range.start, range.end, about))
    }

    /// With these ticks.
    const fn new(range: std::ops::Range<f64>, ticks: Vec<f64>) -> Self {
        Self {
            range,
            ticks,
            minor: Vec::new(),
            is_logarithmic: false,
            names: Vec::new(),
        }
    }

    /// Of places 0, 1, 2, ... with these names.
    pub fn named(names: Vec<String>) -> Self {
        let count = names.len() as f64;
        let places = (0_u32..).map(f64::from).take(names.len()).collect();
        Self {
            names,
            ..Self::new(-0.5..count - 0.5, places)
        }
    }

    /// What stands at a tick.
    fn written(&self, tick: f64) -> String {
        let is_here = |other: &f64| (other - tick).abs() < 1e-9;
        let place = self.ticks.iter().position(is_here);
        match place.and_then(|place| self.names.get(place)) {
            Some(name) => name.clone(),
            None if self.is_logarithmic => listed([10_f64.powf(tick)], 4),
            None => listed([tick], 4),
        }
    }

    /// Of whole numbers.
    pub fn whole(range: std::ops::Range<f64>) -> Self {
        let mut ticks = ticks(range.start, range.end, 8);
        if ticks.windows(2).any(|pair| pair[1] - pair[0] < 1.0) {
            ticks.retain(|tick| (tick - tick.round()).abs() < 1e-9);
        }
        Self::new(range, ticks)
    }

    /// Of logarithms (base 10): numbers at 1, 2, 5, 10, ..., lines at all of 1, 2, 3, ... 10, 20, ...
    pub fn logarithmic(range: std::ops::Range<f64>) -> Self {
        let at = |factors: &[u8]| -> Vec<f64> {
            (-12_i32..12)
                .flat_map(|power| {
                    (factors.iter())
                        .map(move |factor| f64::from(*factor).log10() + f64::from(power))
                })
                .filter(|tick| range.contains(tick))
                .collect()
        };
        let (mut ticks, mut minor) = (at(&[1, 2, 5]), at(&[3, 4, 6, 7, 8, 9]));
        // Where these are few, all have numbers; where those are, round numbers in between.
        if ticks.len() < 3 {
            ticks.append(&mut minor);
        }
        if ticks.len() < 3 {
            let [low, high] = [range.start, range.end].map(|end| 10_f64.powf(end));
            ticks = self::ticks(low, high, 6)
                .into_iter()
                .map(f64::log10)
                .collect();
        }
        Self {
            range,
            ticks,
            minor,
            is_logarithmic: true,
            names: Vec::new(),
        }
    }
}

impl Ranged for ChartAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    fn map(&self, value: &f64, (low, high): (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        low + (share * f64::from(high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            self.minor.clone()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range.clone()
    }
}

/// Two of them, to draw over.
type Plane<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<ChartAxis, ChartAxis>>;

/// Series over two axes.
pub struct Chart {
    /// Along x, and upwards.
    pub axes: [ChartAxis; 2],
    /// What they show, with units.
    pub names: [String; 2],
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

impl Chart {
    /// The rms residual error (um) over numbers of measurements, both logarithmic, as far as the series go.
    pub fn of_accuracy(mut series: Vec<Series>) -> Self {
        for (x, y) in series.iter_mut().flat_map(|each| &mut each.points) {
            (*x, *y) = (x.log10(), y.log10());
        }
        let axis = |of: fn(&(f64, f64)) -> f64| {
            let [low, high] = ends(series.iter().flat_map(|each| &each.points).map(of));
            let margin = (0.05 * (high - low)).max(0.02);
            ChartAxis::logarithmic(low - margin..high + margin)
        };
        let mut axes = [axis(|point| point.0), axis(|point| point.1)];
        let is_whole = |tick: &f64| (10_f64.powf(*tick) + 0.5).fract() - 0.5;
        axes[0].ticks.retain(|tick| is_whole(tick).abs() < 1e-9);
        let names = [
            "measurements",
            "\u{3c1}\u{2080}, rms residual error [\u{b5}m]",
        ];
        Self {
            axes,
            names: names.map(str::to_owned),
            series,
        }
    }

    /// A chart as a figure of a page, under a name.
    pub fn figure(&self, size: (u32, u32), name: &str) -> Result<String, PlotError> {
        drawing(size, name, |area| self.draw(area))
    }

    /// A chart as a file of its own.
    pub fn file(&self, title: &str) -> Result<String, PlotError> {
        plot(SIZE, title, |area| self.draw(area).map(drop))
    }

    /// Draws it; returns what is to be read at its points (SVG).
    pub fn draw(&self, area: &Area<'_>) -> Result<String, PlotError> {
        draw_series(&mut self.plane(area)?, &self.series)
    }
}

/// Draws series; returns what is to be read at their points (SVG).
fn draw_series(plane: &mut Plane<'_, '_>, series: &[Series]) -> Result<String, PlotError> {
    let mut tips = String::new();
    for each in series {
        each.draw(plane)?;
        for (point, words) in each.points.iter().zip(&each.tips) {
            let ((x, y), words) = (plane.backend_coord(point), escaped(words));
            tips += &format!(
                "<circle class=\"tip\" cx=\"{x}\" cy=\"{y}\" r=\"22\"><title>{words}</title></circle>\n"
            );
        }
    }
    Ok(tips)
}

/// An SVG drawing with a name, which takes the width that it is given and the colours of its page.
fn drawing(
    size: (u32, u32),
    name: &str,
    draw: impl FnOnce(&Area<'_>) -> Result<String, PlotError>,
) -> Result<String, PlotError> {
    let mut tips = String::new();
    let svg = svg(size, |area| {
        tips = draw(area)?;
        Ok(())
    })?;
    let content = svg.split_once('>').map_or("", |(_, content)| content);
    let content = content.replace("</svg>", &(tips + "</svg>"));
    let content = (OF_PAGE.iter()).fold(content, |content, (own, of_page)| {
        content.replace(own, of_page)
    });
    let class = if size.0 >= WHOLE { "whole" } else { "half" };
    Ok(format!(
        "<svg class=\"{class}\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\">{content}",
        escaped(name),
        size.0,
        size.1
    ))
}

/// A plot that is a file of its own, with its title, on white.
pub fn plot(
    size: (u32, u32),
    title: &str,
    draw: impl FnOnce(&Area<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    svg(size, |area| {
        area.fill(&WHITE)?;
        let style = ("sans-serif", TEXT + 6).into_font().color(&INK);
        draw(&area.titled(title, style)?)
    })
}

fn svg(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&area)?;
        area.present()?;
    }
    Ok(svg)
}

/// Text of the figures.
pub fn text(colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", TEXT).into_font().color(&colour)
}

/// Room for the longest of some texts.
fn width_of(texts: &[String]) -> u32 {
    let longest = texts.iter().map(|text| text.chars().count()).max();
    // The mean width of a letter at this size in a wide font, with something to spare.
    u32::try_from(longest.unwrap_or(0))
        .unwrap_or(u32::MAX)
        .saturating_mul(33)
        / 2
}

/// About so many round ticks between two values.
fn ticks(low: f64, high: f64, about: u32) -> Vec<f64> {
    let rough = ((high - low) / f64::from(about)).max(f64::MIN_POSITIVE);
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|&step| step >= rough * 0.999)
        .unwrap_or(rough);
    let first = (low / step - 1e-9).ceil();
    (0_u32..1000)
        .map(|index| (first + f64::from(index)) * step)
        .take_while(|&tick| tick <= high + 1e-9 * step)
        .collect()
}

/// Draws its axes with their names and the grid; rows with names of their own have no lines.
fn draw_axes(chart: &mut Plane<'_, '_>, [x, y]: [&str; 2]) -> Result<(), PlotError> {
    let spec = chart.as_coord_spec();
    let (across, upwards) = (spec.x_spec().clone(), spec.y_spec().clone());
    let mut mesh = chart.configure_mesh();
    if !upwards.names.is_empty() {
        mesh.disable_y_mesh();
    }
    mesh.light_line_style(GRID.mix(0.5))
        .bold_line_style(GRID)
        .axis_style(SOFT)
        .label_style(text(INK))
        .axis_desc_style(text(SOFT))
        .x_desc(x)
        .y_desc(y)
        .x_label_formatter(&|x| across.written(*x))
        .y_label_formatter(&|y| upwards.written(*y))
        .draw()?;
    Ok(())
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
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
    /// A line between every two points, so thick (pixels).
    Segments(u32),
    /// A rectangle between every two points, with an opacity.
    Bars(f64),
    /// A translucent area with these corners.
    Area,
}

/// The corners of a filled mark with straight sides (pixels from its middle).
const fn corners(mark: Mark) -> &'static [(i32, i32)] {
    match mark {
        Mark::Square => &[(-10, -10), (10, -10), (10, 10), (-10, 10)],
        Mark::Diamond => &[(-14, 0), (0, -14), (14, 0), (0, 14)],
        _ => &[(-13, 10), (13, 10), (0, -13)],
    }
}

/// Points with a colour and a mark.
pub struct Series {
    /// What it is called in the legend; without a name it is not there.
    name: String,
    colour: RGBColor,
    mark: Mark,
    points: Vec<(f64, f64)>,
    /// What is read at each point when it is pointed at.
    tips: Vec<String>,
}

impl Series {
    /// A series; the points are in the axes' units.
    pub fn new(name: &str, colour: RGBColor, mark: Mark, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: shortened(name, LONGEST_NAME),
            colour,
            mark,
            points,
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
    pub fn interval([low, value, high]: [f64; 3], y: f64, colour: RGBColor) -> [Self; 2] {
        let cap = |x: f64| [(x, y - 0.16), (x, y + 0.16)];
        let lines = [[(low, y), (high, y)], cap(low), cap(high)].concat();
        let lines = Self::new("", colour, Mark::Segments(5), lines);
        [lines, Self::new("", colour, Mark::Disc, vec![(value, y)])]
    }

    fn draw(&self, plane: &mut Plane<'_, '_>) -> Result<(), PlotError> {
        let points = self.points.iter().copied();
        let (colour, thick) = (self.colour, self.colour.stroke_width(3));
        match self.mark {
            Mark::Line => drop(plane.draw_series(LineSeries::new(points, thick))?),
            Mark::Dashed => drop(plane.draw_series(DashedLineSeries::new(points, 10, 7, thick))?),
            Mark::Segments(width) => {
                let pairs = self.points.chunks(2);
                let line = |pair: &[_]| PathElement::new(pair.to_vec(), colour.stroke_width(width));
                plane.draw_series(pairs.map(line))?;
            }
            Mark::Bars(opacity) => {
                let pairs = self.points.chunks_exact(2);
                let style = colour.mix(opacity).filled();
                plane.draw_series(pairs.map(|pair| Rectangle::new([pair[0], pair[1]], style)))?;
            }
            Mark::Area => {
                let area = Polygon::new(self.points.clone(), colour.mix(0.35).filled());
                plane.draw_series([area])?;
            }
            _ => {
                let area = plane.plotting_area().strip_coord_spec();
                let (left, top) = area.get_base_pixel();
                for point in points {
                    let (x, y) = plane.backend_coord(&point);
                    self.draw_mark(&area, (x - left, y - top))?;
                }
            }
        }
        Ok(())
    }

    fn draw_mark(&self, area: &Area<'_>, (x, y): (i32, i32)) -> Result<(), PlotError> {
        let (thick, filled) = (self.colour.stroke_width(3), self.colour.filled());
        match self.mark {
            Mark::Dot => area.draw(&Circle::new((x, y), 6, filled))?,
            Mark::Disc => area.draw(&Circle::new((x, y), 10, filled))?,
            Mark::Ring => area.draw(&Circle::new((x, y), 15, thick))?,
            Mark::Cross => area.draw(&Cross::new((x, y), 9, self.colour.stroke_width(5)))?,
            mark => {
                let corners = corners(mark).iter().map(|(dx, dy)| (x + dx, y + dy));
                area.draw(&Polygon::new(corners.collect::<Vec<_>>(), filled))?;
            }
        }
        Ok(())
    }

    /// Draws its entry of a legend.
    fn draw_entry(&self, area: &Area<'_>, (x, y): (i32, i32)) -> Result<(), PlotError> {
        let line = |from: i32, to: i32| {
            PathElement::new([(x + from, y), (x + to, y)], self.colour.stroke_width(3))
        };
        match self.mark {
            Mark::Line => area.draw(&line(0, 34))?,
            Mark::Dashed => {
                area.draw(&line(0, 13))?;
                area.draw(&line(21, 34))?;
            }
            _ => self.draw_mark(area, (x + 17, y))?,
        }
        let style = text(INK).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(self.name.clone(), (x + 48, y), style))?;
        Ok(())
    }
}

impl Chart {
    /// Draws its axes, and the names of its series off the data, beside it or, where it is narrow, above.
    fn plane<'a, 'b>(&self, area: &'a Area<'b>) -> Result<Plane<'a, 'b>, PlotError> {
        const LINE: u32 = 46;
        let named = || self.series.iter().filter(|each| !each.name.is_empty());
        let entries: Vec<String> = named().map(|each| each.name.clone()).collect();
        let width = area.dim_in_pixel().0;
        let is_wide = width >= WHOLE;
        let (above, beside) = match pixels(entries.len()) {
            0 => (0, 0),
            _ if is_wide => (0, 70 + width_of(&entries)),
            count => (count.div_ceil(2) * LINE, 0),
        };
        let [mut x, y] = self.axes.clone();
        // Names that are too long to stand beside one another are in several lines by turns.
        let room = width.saturating_sub(140 + beside).max(1);
        let needed = width_of(&x.names) * pixels(x.names.len());
        let lines = needed.div_ceil(room).clamp(1, 4);
        let ticks = x.ticks.clone();
        // Half of the last name stands beyond the axis.
        let beside = beside.max(width_of(x.names.last().map_or(&[], std::slice::from_ref)) / 2);
        let below = match lines {
            1 => Vec::new(),
            _ => std::mem::replace(&mut x.names, vec![String::new(); ticks.len()]),
        };
        let mut chart = ChartBuilder::on(area)
            .margin(14)
            .margin_top(14 + above)
            .margin_right(14 + beside)
            .x_label_area_size(78 + LINE * (lines - 1))
            .y_label_area_size(112)
            .build_cartesian_2d(x, y)?;
        draw_axes(&mut chart, self.names.each_ref().map(String::as_str))?;
        let (left, top) = area.get_base_pixel();
        let (across, down) = chart.plotting_area().get_pixel_range();
        for (row, each) in (0..).zip(named()) {
            let at = if is_wide {
                (
                    across.end - left + 24,
                    down.start - top + signed(LINE * row) + 23,
                )
            } else {
                (
                    112 + signed(row % 2 * (width / 2 - 50)),
                    28 + signed(LINE * (row / 2)),
                )
            };
            each.draw_entry(area, at)?;
        }
        let style = text(INK).pos(Pos::new(HPos::Center, VPos::Top));
        for (row, (tick, name)) in (0..).zip(ticks.into_iter().zip(below)) {
            let (x, _) = chart.backend_coord(&(tick, 0.0));
            let y = down.end - top + 12 + signed(LINE * (row % lines));
            area.draw(&Text::new(name, (x - left, y), style.clone()))?;
        }
        Ok(chart)
    }
}

fn pixels(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

fn signed(pixels: u32) -> i32 {
    i32::try_from(pixels).unwrap_or(i32::MAX)
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
    }
}
