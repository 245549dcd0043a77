//! What the figures are made of: a drawing that fits any width, and a chart with a named row for
//! each thing.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::text::wording::shortened;
use crate::view::markup::escaped;
use crate::view::plots::PlotError;

/// The width of a figure that takes half a page (in units of the drawing).
pub const HALF: u32 = 960;
/// The width of a figure that takes the whole page.
pub const WHOLE: u32 = 1500;
/// The height of text. Plotters makes it smaller by a quarter.
pub const TEXT: u32 = 28;
/// The height of a row.
const ROW: u32 = 74;
/// The height of the axis below the rows, and the space above them.
const AXIS: u32 = 76;
const TOP: u32 = 12;
/// Longer names are cut.
const LONGEST_NAME: usize = 26;

/// Dark text and lines, soft ones, and the grid.
pub const INK: RGBColor = RGBColor(28, 37, 48);
pub const SOFT: RGBColor = RGBColor(91, 102, 115);
pub const GRID: RGBColor = RGBColor(222, 227, 232);

/// A drawing area on SVG text.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// An axis whose ticks were chosen.
#[derive(Debug, Clone)]
pub struct ChartAxis {
    /// From where to where.
    pub range: std::ops::Range<f64>,
    /// Where its ticks are.
    pub ticks: Vec<f64>,
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
            Vec::new()
        } else {
            self.ticks.clone()
        }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range.clone()
    }
}

/// A chart with two of them.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<ChartAxis, ChartAxis>>;

/// An SVG drawing with a name, which takes the width that it is given.
pub fn drawing(
    size: (u32, u32),
    name: &str,
    draw: impl FnOnce(&Area<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        draw(&area)?;
        area.present()?;
    }
    let content = svg.split_once('>').map_or("", |(_, content)| content);
    let class = if size.0 >= WHOLE { "whole" } else { "half" };
    Ok(format!(
        "<svg class=\"{class}\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\">{content}",
        escaped(name),
        size.0,
        size.1
    ))
}

/// Text of the figures.
pub fn text(colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", TEXT).into_font().color(&colour)
}

/// A chart with a named row for each thing, and room for a note to the right of each.
pub struct Rows<'n> {
    /// The names, from top to bottom.
    pub names: &'n [String],
    /// The notes.
    pub notes: &'n [String],
    /// The width of the drawing.
    pub width: u32,
    /// The axis along x.
    pub axis: ChartAxis,
    /// What it shows, with the unit.
    pub title: String,
}

impl Rows<'_> {
    /// The size of the drawing.
    pub fn size(&self) -> (u32, u32) {
        let rows = u32::try_from(self.names.len()).unwrap_or(u32::MAX);
        (self.width, TOP + AXIS + rows.saturating_mul(ROW))
    }

    /// The height of the middle of a row on the chart's y axis, where rows have height one.
    pub fn middle(&self, row: usize) -> f64 {
        (self.names.len() - row) as f64 - 0.5
    }

    /// Draws names, notes and axis; `label` writes a tick.
    pub fn draw<'a, 'b>(
        &self,
        area: &'a Area<'b>,
        label: &dyn Fn(&f64) -> String,
    ) -> Result<Chart<'a, 'b>, PlotError> {
        let names: Vec<String> = (self.names.iter())
            .map(|name| shortened(name, LONGEST_NAME))
            .collect();
        let count = names.len();
        let middles: Vec<f64> = (0..count).map(|row| self.middle(row)).collect();
        let mut chart = ChartBuilder::on(area)
            .margin_top(TOP)
            .margin_right(12 + width_of(self.notes))
            .x_label_area_size(AXIS)
            .y_label_area_size(26 + width_of(&names))
            .build_cartesian_2d(
                self.axis.clone(),
                ChartAxis {
                    range: 0.0..count as f64,
                    ticks: middles,
                },
            )?;
        let name_at = |y: &f64| {
            let from_top = count as f64 - 0.5 - y;
            let row = (0..count).find(|&row| (row as f64 - from_top).abs() < 0.25);
            row.map_or_else(String::new, |row| names[row].clone())
        };
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .axis_style(SOFT)
            .set_tick_mark_size(LabelAreaPosition::Left, 8)
            .label_style(text(INK))
            .x_desc(self.title.clone())
            .axis_desc_style(text(SOFT))
            .x_label_formatter(&label)
            .y_label_formatter(&name_at)
            .draw()?;
        let style = text(INK).pos(Pos::new(HPos::Left, VPos::Center));
        for (row, note) in self.notes.iter().enumerate() {
            let (_, y) = chart.backend_coord(&(self.axis.range.end, self.middle(row)));
            let x = chart.plotting_area().get_pixel_range().0.end + 14;
            area.draw(&Text::new(note.clone(), (x, y), style.clone()))?;
        }
        Ok(chart)
    }
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
pub fn ticks(low: f64, high: f64, about: u32) -> Vec<f64> {
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

/// The logarithms of 1, 2, 5, 10, 20, ... between two logarithms (base 10).
pub fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    (-12_i32..12)
        .flat_map(|power| [1.0, 2.0, 5.0].map(|factor: f64| factor.log10() + f64::from(power)))
        .filter(|tick| (low..=high).contains(tick))
        .collect()
}

/// A number without needless zeros.
pub fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.replace('-', "\u{2212}")
}
