//! Where the error comes from: a bar for each of its sources, as long as what it alone leaves.

use plotters::prelude::*;

use super::charts::{ChartAxis, INK, Rows, WHOLE, drawing, short, ticks};
use crate::record::messages::ShareMessage;
use crate::record::study::StudyPlanMessage;
use crate::text::wording::micrometres;
use crate::view::markup::{figure, paragraph};
use crate::view::plots::{COLOURS, PlotError};

/// The vermilion of what the belief does not know of.
const HIDDEN: RGBColor = RGBColor(213, 94, 0);
/// Half of a bar's height, where rows have height one.
const HALF_BAR: f64 = 0.3;
/// More sources share a row.
const MOST: usize = 14;
/// What the row of all that is less is called.
const OTHERS: &str = "all others";

/// A source of the error.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceBar {
    /// What it is called.
    pub name: String,
    /// Whether the belief does not know of it.
    pub is_hidden: bool,
    /// What it alone leaves (mm), as is to be expected.
    pub expected_mm: f64,
    /// What of that was seen (mm), where runs were made without it.
    pub seen_mm: Option<f64>,
}

impl From<&ShareMessage> for SourceBar {
    fn from(share: &ShareMessage) -> Self {
        Self {
            name: share.name.clone(),
            is_hidden: false,
            expected_mm: share.rho0_mm,
            seen_mm: None,
        }
    }
}

/// The sources of a plan's errors, the largest first; the least of many together.
pub fn sorted(bars: impl IntoIterator<Item = SourceBar>) -> Vec<SourceBar> {
    let mut bars: Vec<SourceBar> = bars.into_iter().collect();
    bars.sort_by(|one, other| other.expected_mm.total_cmp(&one.expected_mm));
    if bars.len() > MOST {
        let least = bars.split_off(MOST - 1);
        let root = |squares: f64| squares.sqrt();
        let seen: Option<Vec<f64>> = least.iter().map(|bar| bar.seen_mm).collect();
        bars.push(SourceBar {
            name: OTHERS.to_owned(),
            is_hidden: least.iter().any(|bar| bar.is_hidden),
            expected_mm: root(least.iter().map(|bar| bar.expected_mm.powi(2)).sum()),
            seen_mm: seen.map(|seen| root(seen.iter().map(|value| value * value).sum())),
        });
    }
    bars
}

/// The sources of the errors in a plan's runs; none where the scenario lists nothing uncertain.
pub fn of_runs(runs: &StudyPlanMessage) -> Vec<SourceBar> {
    sorted(runs.parts.iter().map(|part| SourceBar {
        name: part.name.clone(),
        is_hidden: part.hidden,
        expected_mm: part.rms_mm,
        seen_mm: part.seen_rms_mm,
    }))
}

/// What was promised of a plan's runs and what became of it, in a sentence; nothing where nothing is listed as uncertain.
pub fn verdict(runs: &StudyPlanMessage) -> Option<String> {
    let (promised, verdict) = (runs.promised_rms_mm?, runs.verdict.as_ref()?);
    let tolerance = runs.promised_quantile95_mm.zip(runs.quantiles_mm);
    let tolerance = tolerance.map_or_else(String::new, |(promised, seen)| {
        format!(
            " (95 % below {}, seen {})",
            micrometres(Some(promised)),
            micrometres(Some(seen[2]))
        )
    });
    Some(format!(
        "{}: promised {} rms{tolerance}; the promise {verdict}.",
        runs.name,
        micrometres(Some(promised))
    ))
}

/// The figure of some sources, with what each is of the square of the whole.
pub fn sources_figure(bars: &[SourceBar], caption: &str) -> Result<String, PlotError> {
    let total: f64 = bars.iter().map(|bar| bar.expected_mm.powi(2)).sum();
    if bars.len() < 2 || total <= 0.0 {
        return Ok(String::new());
    }
    let longest = (bars.iter())
        .flat_map(|bar| [bar.expected_mm, bar.seen_mm.unwrap_or(0.0)])
        .fold(0.0, f64::max)
        * 1e3;
    let name = |bar: &SourceBar| {
        let hidden = if bar.is_hidden { " (hidden)" } else { "" };
        format!("{}{hidden}", bar.name)
    };
    let share = |bar: &SourceBar| format!("{:.1} %", bar.expected_mm.powi(2) / total * 100.0);
    let names: Vec<String> = bars.iter().map(name).collect();
    let notes: Vec<String> = bars.iter().map(share).collect();
    let rows = Rows {
        names: &names,
        notes: &notes,
        width: WHOLE,
        axis: ChartAxis {
            range: 0.0..longest * 1.04,
            ticks: ticks(0.0, longest * 1.04, 8),
        },
        title: "what it alone leaves, rms [\u{b5}m]; right: share of the square".to_owned(),
    };
    let svg = drawing(rows.size(), "Where the error comes from", |area| {
        let mut chart = rows.draw(area, &|tick| short(*tick))?;
        for (row, bar) in bars.iter().enumerate() {
            let middle = rows.middle(row);
            let colour = if bar.is_hidden { HIDDEN } else { COLOURS[0] };
            let corners = [
                (0.0, middle - HALF_BAR),
                (bar.expected_mm * 1e3, middle + HALF_BAR),
            ];
            chart.draw_series([Rectangle::new(corners, colour.mix(0.75).filled())])?;
            if let Some(seen_mm) = bar.seen_mm {
                let seen = seen_mm * 1e3;
                let mark = [
                    (seen, middle - HALF_BAR - 0.1),
                    (seen, middle + HALF_BAR + 0.1),
                ];
                chart.draw_series([PathElement::new(mark, INK.stroke_width(5))])?;
            }
        }
        Ok(())
    })?;
    Ok(figure(&svg, caption))
}

/// The verdict and the figure of each plan of a study whose scenario lists what is uncertain.
pub fn of_study(plans: &[StudyPlanMessage]) -> Result<String, PlotError> {
    let mut body = String::new();
    for plan in plans {
        let Some(verdict) = verdict(plan) else {
            continue;
        };
        body += &paragraph(&verdict);
        let bars = of_runs(plan);
        let mut caption = format!(
            "{}: what each source alone leaves, to first order; squares add up.",
            plan.name
        );
        if bars.iter().any(|bar| bar.is_hidden) {
            caption += " Orange: the belief does not know of it.";
        }
        if bars.iter().any(|bar| bar.seen_mm.is_some()) {
            caption += " Dark marks: what was seen of it, by the same runs without it.";
        }
        body += &sources_figure(&bars, &caption)?;
    }
    Ok(body)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(name: &str, expected_mm: f64) -> SourceBar {
        SourceBar {
            name: name.to_owned(),
            is_hidden: name == "b",
            expected_mm,
            seen_mm: Some(expected_mm),
        }
    }

    #[test]
    fn the_least_of_many_share_a_row() {
        let many = (0..20_u8).map(|index| bar("a", 1e-3 * f64::from(index)));
        let bars = sorted(many);
        assert_eq!((bars.len(), bars[13].name.as_str()), (MOST, OTHERS));
        let least: f64 = (0..7).map(|index| f64::from(index * index)).sum();
        assert!((bars[13].expected_mm - 1e-3 * least.sqrt()).abs() < 1e-15);
        assert_eq!(bars[13].seen_mm, Some(bars[13].expected_mm));
        assert!(
            bars.windows(2)
                .take(12)
                .all(|two| two[0].expected_mm >= two[1].expected_mm)
        );
    }

    #[test]
    fn a_figure_names_its_sources() {
        let svg = sources_figure(&[bar("a <&", 3e-3), bar("b", 4e-3)], "said").expect("drawn");
        for part in ["a &lt;&amp;", "b (hidden)", "36.0 %", "64.0 %", "said"] {
            assert!(svg.contains(part), "{part}");
        }
        assert_eq!(
            sources_figure(&[bar("noise", 1.0)], "").expect("nothing"),
            ""
        );
    }
}
