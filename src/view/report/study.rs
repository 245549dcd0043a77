//! The page of a Monte Carlo study.

use serde_json::{Value, json};

use super::absolute::ABSOLUTE_ACCURACY;
use super::distances::{distances, lines, means_figure, shares_figure};
use super::{each_once, texts};
use crate::codes::Condition;
use crate::record::{study::StudyPlanMessage, tally_file::Header};
use crate::text::wording::joined;
use crate::view::markup::{PageError, for_page, page};

/// The page of a study under one set of conditions as HTML: what its runs say, what must be looked at, and the command that made it.
///
/// # Errors
/// See [`PageError`].
pub fn study_page(
    header: &Header,
    plans: &[StudyPlanMessage],
    conditions: &[Condition],
    command: &str,
) -> Result<String, PageError> {
    let reference = header.reference();
    let lines = lines(plans, |place| Some(&*plans[place].name) == reference);
    let shown = json!({
        "accuracy": header.accuracy().name(),
        "absolute": ABSOLUTE_ACCURACY,
        "best": header.best(plans),
        "plans": plans,
        "found": texts(conditions),
        "header": header,
        "level": header.level.words(),
        "noun": header.accuracy().noun(),
        "means": means_figure(&lines),
        "distances": distances(plans, &lines),
        "shares": shares_figure(&lines),
        "sources": sources(plans),
        "command": command,
    });
    let title = format!("{}: study", header.provenance.scenario);
    page(&title, "study.html", &shown)
}

/// The verdict of each plan whose scenario lists what is uncertain, and a row for each source with the contributions to all plans; the
/// largest source comes first.
fn sources(plans: &[StudyPlanMessage]) -> Value {
    let verdicts = plans.iter().filter_map(|runs| {
        let validation = joined(runs.validation.iter().map(|each| format!(" {each}.")), "");
        let verdict = for_page(&format!("{}.{validation}", runs.outcome()?));
        Some(format!("{}: {verdict}", runs.name))
    });
    let listed: Vec<&StudyPlanMessage> = (plans.iter())
        .filter(|plan| plan.outcome().is_some() && !plan.contributions.is_empty())
        .collect();
    let all = || listed.iter().flat_map(|plan| &plan.contributions);
    let largest_of = |source: &str| {
        let of_source = all().filter(|each| each.source == source);
        let of_source = of_source.filter_map(|each| each.contribution_um);
        of_source.fold(0.0, f64::max)
    };
    let mut sources = each_once(all().map(|each| &*each.source));
    sources.sort_by(|one, other| largest_of(other).total_cmp(&largest_of(one)));
    let largest_um = largest_of(sources.first().unwrap_or(&"")).max(f64::MIN_POSITIVE);
    let row = |source: &&str| {
        let cells = listed.iter().map(|plan| {
            let mut contributions = plan.contributions.iter();
            contributions.find(|each| each.source == *source)
        });
        let cells: Vec<_> = cells.collect();
        let is_hidden = cells.iter().flatten().any(|each| each.hidden);
        json!({ "source": source, "is_hidden": is_hidden, "cells": cells })
    };
    json!({
        "verdicts": verdicts.collect::<Vec<_>>(),
        "plans": listed.iter().map(|plan| &plan.name).collect::<Vec<_>>(),
        "rows": sources.iter().map(row).collect::<Vec<_>>(),
        "largest_um": largest_um,
    })
}
