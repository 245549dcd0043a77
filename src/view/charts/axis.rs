//! Axes with their ticks.

use std::ops::Range;

use serde_json::{Value, json};

use crate::numeric::tolerance::ends;
use crate::text::wording::listed;

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

/// An axis with its ticks.
#[derive(Debug, Clone)]
pub struct ChartAxis {
    /// From where to where.
    pub range: Range<f64>,
    /// Where its ticks are, and what stands there.
    pub ticks: Vec<(f64, String)>,
    /// Where lines without a number stand between them.
    pub(super) minor: Vec<f64>,
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

    /// Of logarithms (base 10) of numbers of measurements.
    pub fn counts(range: Range<f64>) -> Self {
        let is_whole = |tick: &f64| ((10_f64.powf(*tick) + 0.5).fract() - 0.5).abs() < 1e-9;
        let counts = logarithms(&range, &COUNTS).into_iter();
        let ticks = counts.filter(is_whole).map(numbered).collect();
        let mut axis = Self::logarithmic(range);
        axis.minor.retain(is_whole);
        Self { ticks, ..axis }
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

    pub(super) fn labels(&self) -> impl Iterator<Item = &String> {
        self.ticks.iter().map(|(_, label)| label)
    }

    /// Where its ticks and the lines between them are between two places of a drawing, with what stands there.
    pub(super) fn shown(&self, ends: [f64; 2]) -> Value {
        let ticks = self.ticks.iter();
        let ticks = ticks.map(|(tick, label)| (self.place(*tick, ends), label));
        let minor = self.minor.iter().map(|&tick| (self.place(tick, ends), ""));
        json!({ "ticks": ticks.collect::<Vec<_>>(), "minor": minor.collect::<Vec<_>>() })
    }

    /// Where a value is between two places of a drawing.
    pub(super) fn place(&self, value: f64, [low, high]: [f64; 2]) -> f64 {
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
}
