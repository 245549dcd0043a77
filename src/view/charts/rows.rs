//! A chart with a named row for each thing.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{
    Area, ChartAxis, INK, LONGEST_NAME, Plane, PlotError, Series, draw_axes, draw_series, drawing,
    text, width_of,
};
use crate::text::wording::shortened;

/// The height of a row.
const ROW: u32 = 74;
/// The height of the axis below the rows, and the space above them.
const AXIS: u32 = 76;
const TOP: u32 = 12;

/// A chart with a named row for each thing, and room for a note to the right of each.
pub struct Rows<'t> {
    /// The names, from top to bottom.
    pub names: Vec<String>,
    /// The notes.
    pub notes: Vec<String>,
    /// The width of the drawing.
    pub width: u32,
    /// The axis along x.
    pub axis: ChartAxis,
    /// What it shows, with the unit.
    pub title: &'t str,
}

impl Rows<'_> {
    /// The size of the drawing.
    fn size(&self) -> (u32, u32) {
        let rows = u32::try_from(self.names.len()).unwrap_or(u32::MAX);
        (self.width, TOP + AXIS + rows.saturating_mul(ROW))
    }

    /// The height of the middle of a row on the chart's y axis, where rows have height one.
    pub fn middle(&self, row: usize) -> f64 {
        (self.names.len() - row) as f64 - 0.5
    }

    /// A drawing under a name: names, notes, axis and series.
    pub fn figure(&self, name: &str, series: &[Series]) -> Result<String, PlotError> {
        drawing(self.size(), name, |area| {
            draw_series(&mut self.plane(area)?, series)
        })
    }

    /// Draws names, notes and axis.
    fn plane<'a, 'b>(&self, area: &'a Area<'b>) -> Result<Plane<'a, 'b>, PlotError> {
        let names = self.names.iter().map(|name| shortened(name, LONGEST_NAME));
        let names: Vec<String> = names.collect();
        let middles = (0..names.len()).map(|row| self.middle(row)).collect();
        let room = 26 + width_of(&names);
        let rows = ChartAxis {
            names,
            ..ChartAxis::new(0.0..self.names.len() as f64, middles)
        };
        let mut chart = ChartBuilder::on(area)
            .margin_top(TOP)
            .margin_right(12 + width_of(&self.notes))
            .x_label_area_size(AXIS)
            .y_label_area_size(room)
            .build_cartesian_2d(self.axis.clone(), rows)?;
        draw_axes(&mut chart, [self.title, ""])?;
        let style = text(INK).pos(Pos::new(HPos::Left, VPos::Center));
        for (row, note) in self.notes.iter().enumerate() {
            let (_, y) = chart.backend_coord(&(self.axis.range.end, self.middle(row)));
            let x = chart.plotting_area().get_pixel_range().0.end + 14;
            area.draw(&Text::new(note.clone(), (x, y), style.clone()))?;
        }
        Ok(chart)
    }
}
