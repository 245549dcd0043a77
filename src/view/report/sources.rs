//! The uncertainty budget as a table, with a bar in the cell of each source's share of variance.

use crate::plan::{BudgetSource, UncertaintyBudget};
use crate::record::account::ContributionMessage;
use crate::record::study::StudyPlanMessage;
use crate::text::wording::{micrometres, number, percent, significant};
use crate::view::markup::{escaped, paragraph, section};

/// A row of a table: its words and numbers, the share that ends it (%), and whether the planner's model has the source.
struct SourceRow {
    cells: Vec<String>,
    share_percent: f64,
    is_hidden: bool,
}

/// A table whose last column is a share with its bar, the largest first.
fn with_bars(header: &[&str], mut rows: Vec<SourceRow>) -> String {
    rows.sort_by(|one, other| other.share_percent.total_cmp(&one.share_percent));
    let tagged = |tag: &str, words: &mut dyn Iterator<Item = &str>| {
        words.fold(String::new(), |all, word| {
            all + &format!("<{tag}>{}</{tag}>", escaped(word))
        })
    };
    let head = tagged("th", &mut header.iter().copied());
    let body = rows.iter().fold(String::new(), |all, row| {
        let cells = tagged("td", &mut row.cells.iter().map(String::as_str));
        let class = if row.is_hidden { "bar hidden" } else { "bar" };
        let (share, shown) = (
            row.share_percent,
            percent(Some(row.share_percent / 100.0), 1),
        );
        all + &format!(
            "<tr>{cells}<td class=\"{class}\" style=\"--share: {share:.2}%\">{shown}</td></tr>\n"
        )
    });
    format!(
        "<div class=\"wide\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table></div>\n"
    )
}

/// The section of a budget that has more than the instrument's noise, with what is to be known of it.
pub fn budget_section(budget: Option<&UncertaintyBudget>, about: &str) -> String {
    let Some(budget) = budget.filter(|budget| budget.has_more_than_noise()) else {
        return String::new();
    };
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "\u{2013}".to_owned());
    let row = |each: &BudgetSource| SourceRow {
        cells: vec![
            each.source.clone(),
            each.evaluation.name().to_owned(),
            each.level.name().to_owned(),
            or_none(each.standard_uncertainty.map(|value| significant(value, 3))),
            or_none(each.unit.clone()),
            or_none(each.sensitivity.map(|value| significant(value, 3))),
            number(Some(each.contribution_um), 2),
        ],
        share_percent: each.variance_share_percent,
        is_hidden: false,
    };
    let header = [
        "source",
        "type",
        "level",
        "u(x)",
        "unit",
        "sensitivity [\u{b5}m per unit]",
        "contribution [\u{b5}m]",
        "share of variance",
    ];
    let combined = format!(
        "u_c = {}, U = {} (95 %), k = {}. {about}",
        micrometres(Some(budget.combined_standard_uncertainty_um * 1e-3)),
        micrometres(budget.expanded_uncertainty_um.map(|value| value * 1e-3)),
        number(budget.coverage_factor, 3)
    );
    let table = with_bars(&header, budget.sources.iter().map(row).collect());
    section(
        "sources",
        "Uncertainty budget",
        &(paragraph(&combined) + &table),
    )
}

/// What was predicted of a plan's runs and what became of it, in a sentence; nothing where nothing is listed as uncertain.
pub fn verdict(runs: &StudyPlanMessage) -> Option<String> {
    let (predicted, verdict) = (runs.combined_rms_mm?, runs.verdict.as_ref()?);
    let validation = (runs.validation.as_ref()).map_or_else(String::new, |each| {
        let [predicted, observed, error, tolerance] = [
            each.predicted_um,
            each.monte_carlo_um,
            each.monte_carlo_std_um,
            each.numerical_tolerance_um,
        ]
        .map(|value_um| micrometres(Some(value_um * 1e-3)));
        format!(
            " U = {predicted} (95 %) predicted, {observed} \u{b1} {error} by Monte Carlo, numerical tolerance {tolerance}: {}.",
            each.outcome
        )
    });
    Some(format!(
        "{}: predicted {} rms; the prediction {verdict}.{validation}",
        runs.name,
        micrometres(Some(predicted))
    ))
}

/// The verdict and the contributions of each plan of a study whose scenario lists what is uncertain.
pub fn of_study(plans: &[StudyPlanMessage]) -> String {
    let mut body = String::new();
    for plan in plans {
        let Some(verdict) = verdict(plan) else {
            continue;
        };
        body += &paragraph(&verdict);
        let square = |each: &ContributionMessage| each.contribution_um.powi(2);
        let total: f64 = plan.contributions.iter().map(square).sum();
        let row = |each: &ContributionMessage| {
            let hidden = if each.hidden { " (hidden)" } else { "" };
            SourceRow {
                cells: vec![
                    format!("{}{hidden}", each.source),
                    number(Some(each.contribution_um), 2),
                ],
                share_percent: 100.0 * square(each) / total,
                is_hidden: each.hidden,
            }
        };
        let header = ["source", "contribution [\u{b5}m]", "share of variance"];
        body += &with_bars(&header, plan.contributions.iter().map(row).collect());
    }
    if body.is_empty() {
        return body;
    }
    let about = "Contributions to the errors of the simulated truth, to first order; squares add up. Orange: the planner's model does \
                 not have the source.";
    section("sources", "Uncertainty budget", &(body + &paragraph(about)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_shares_and_the_largest_comes_first() {
        let row = |name: &str, share_percent, is_hidden| SourceRow {
            cells: vec![name.to_owned()],
            share_percent,
            is_hidden,
        };
        let rows = vec![row("a <&", 36.0, false), row("b", 64.0, true)];
        let html = with_bars(&["source", "share"], rows);
        let places = [
            "<td>b</td><td class=\"bar hidden\" style=\"--share: 64.00%\">64.0\u{a0}%</td>",
            "<td>a &lt;&amp;</td><td class=\"bar\" style=\"--share: 36.00%\">36.0\u{a0}%</td>",
        ]
        .map(|part| html.find(part).expect(part));
        assert!(places[0] < places[1]);
    }
}
