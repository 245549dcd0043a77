//! The uncertainty budget as a table, with a bar in the cell of each source's share of variance.

use super::each_once;
use crate::plan::{BudgetSource, UncertaintyBudget};
use crate::record::study::StudyPlanMessage;
use crate::text::wording::{dash, joined, micrometres, number, percent, significant};
use crate::view::markup::{cell, micro_sign, paragraph, paragraphs, section, table_of_cells};

/// A table of rows with a share (%) that ends each, with its bar, the largest first.
fn with_bars(header: &str, mut rows: Vec<(Vec<String>, f64)>) -> String {
    rows.sort_by(|one, other| other.1.total_cmp(&one.1));
    let cells = rows.iter().map(|(row, share)| {
        let cells: String = row.iter().map(|text| cell(text)).collect();
        cells + &bar(*share, false, &percent(Some(share / 100.0), 1))
    });
    table_of_cells(&header.split(" | ").collect::<Vec<_>>(), cells)
}

/// A cell with a bar over so many percent of it behind its text.
pub(super) fn bar(percent: f64, is_hidden: bool, text: &str) -> String {
    let class = if is_hidden { "bar hidden" } else { "bar" };
    format!("<td class=\"{class}\" style=\"--share: {percent:.2}%\">{text}</td>")
}

/// The section of a budget that has more than the instrument's noise, with what is to be known of it.
pub fn budget_section(budget: Option<&UncertaintyBudget>, about: &str) -> String {
    let Some(budget) = budget.filter(|budget| budget.has_more_than_noise()) else {
        return String::new();
    };
    let unit = |each: &BudgetSource| Some(micro_sign(each.unit.as_deref()?));
    let or_none = |text: Option<String>| text.unwrap_or_else(dash);
    let row = |each: &BudgetSource| {
        let cells = vec![
            each.source.clone(),
            each.evaluation.name().to_owned(),
            each.level.name().to_owned(),
            or_none(each.standard_uncertainty.map(|value| significant(value, 3))),
            or_none(unit(each)),
            or_none(each.sensitivity.map(|value| significant(value, 3))),
            number(Some(each.contribution_um), 2),
        ];
        (cells, each.variance_share_percent)
    };
    let header = "source | type | level | u(x) | unit | sensitivity [\u{b5}m per unit] | contribution [\u{b5}m] | share of variance";
    let combined = format!(
        "u_c = {}, U = {} (95 %), k = {}. {about}",
        micrometres(Some(budget.combined_standard_uncertainty_um * 1e-3)),
        micrometres(budget.expanded_uncertainty_um.map(|value| value * 1e-3)),
        number(budget.coverage_factor, 3)
    );
    let table = with_bars(header, budget.sources.iter().map(row).collect());
    let remark = |each: &BudgetSource| Some(format!("{} {}.", each.source, each.remark.as_ref()?));
    let remarks = paragraphs([joined(budget.sources.iter().filter_map(remark), " ")]);
    let body = paragraph(&combined) + &table + &remarks;
    section("sources", "Uncertainty budget", &body)
}

/// What was predicted of a plan's runs and what became of it, in a sentence.
fn verdict(runs: &StudyPlanMessage) -> Option<String> {
    let validation = (runs.validation.iter()).map(|each| format!(" {each}."));
    let validation: String = validation.collect();
    Some(format!("{}: {}.{validation}", runs.name, runs.outcome()?))
}

/// The verdict of each plan of a study whose scenario lists what is uncertain, and the contributions of all beside each other.
pub fn of_study(plans: &[StudyPlanMessage]) -> String {
    let verdicts = paragraphs(plans.iter().filter_map(verdict));
    let plans: Vec<&StudyPlanMessage> = (plans.iter())
        .filter(|plan| plan.outcome().is_some() && !plan.contributions.is_empty())
        .collect();
    if plans.is_empty() {
        return String::new();
    }
    let about = "Contributions to the errors of the simulated truth (\u{b5}m), to first order; squares add up. Orange: the planner's model \
                 does not have the source.";
    let body = verdicts + &contributions(&plans) + &paragraph(about);
    section("sources", "Uncertainty budget", &body)
}

/// A row for each source and a column for each plan; bars are as long as contributions, the largest source comes first.
fn contributions(plans: &[&StudyPlanMessage]) -> String {
    let all = || plans.iter().flat_map(|plan| &plan.contributions);
    let largest_of = |source: &str| {
        let of_source = all().filter(|each| each.source == source);
        of_source
            .filter_map(|each| each.contribution_um)
            .fold(0.0, f64::max)
    };
    let mut sources = each_once(all().map(|each| &*each.source));
    sources.sort_by(|one, other| largest_of(other).total_cmp(&largest_of(one)));
    let largest = largest_of(sources.first().unwrap_or(&"")).max(f64::MIN_POSITIVE);
    let contribution = |plan: &&StudyPlanMessage, source: &str| {
        let found = plan.contributions.iter().find(|each| each.source == source);
        let computed = found.and_then(|each| Some((each.hidden, each.contribution_um?)));
        match (found, computed) {
            (_, Some((is_hidden, um))) => {
                bar(100.0 * um / largest, is_hidden, &number(Some(um), 2))
            }
            (Some(_), None) => cell(&number(None, 2)),
            (None, None) => cell(""),
        }
    };
    let row = |source: &str| {
        let is_hidden = all().any(|each| each.source == source && each.hidden);
        let name = format!("{source}{}", if is_hidden { " (hidden)" } else { "" });
        let cells = plans.iter().map(|plan| contribution(plan, source));
        cell(&name) + &cells.collect::<String>()
    };
    let names = plans.iter().map(|plan| plan.name.as_str());
    let header: Vec<&str> = ["source"].into_iter().chain(names).collect();
    table_of_cells(&header, sources.into_iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_long_as_shares_and_the_largest_comes_first() {
        let rows =
            [("a <&", 36.0), ("b", 64.0)].map(|(name, share)| (vec![name.to_owned()], share));
        let html = with_bars("source | share", rows.into());
        let places = [
            "<td>b</td><td class=\"bar\" style=\"--share: 64.00%\">64.0\u{a0}%</td>",
            "<td>a &lt;&amp;</td><td class=\"bar\" style=\"--share: 36.00%\">36.0\u{a0}%</td>",
        ]
        .map(|part| html.find(part).expect(part));
        assert!(places[0] < places[1]);
    }
}
