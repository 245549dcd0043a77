//! Series of points, their marks and colours.

use serde::Serialize;

use crate::text::wording::shortened;

/// Longer names are cut.
const LONGEST_NAME: usize = 40;

/// The colour of dark text and lines, of soft ones, and of the grid, as pages have them.
pub const INK: &str = "currentColor";
pub const SOFT: &str = "var(--soft)";
pub const GRID: &str = "var(--line)";
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

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "kind", content = "size", rename_all = "snake_case")]
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

/// Points with a colour and a mark.
pub struct Series {
    /// What it is called in the legend; without a name it is not there.
    pub(super) name: String,
    pub(super) colour: &'static str,
    pub(super) mark: Mark,
    pub(super) points: Vec<(f64, f64)>,
    /// What is read at each point when it is pointed at.
    pub(super) tips: Vec<String>,
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_have_colours_of_their_own_and_the_reference_its_own() {
        let colours = plan_colours([true, false, false]);
        assert_eq!(colours, [REFERENCE, COLOURS[0], COLOURS[1]]);
        assert_eq!(plan_colours([false, true])[0], colours[1]);
    }
}
