//! The page of a Monte Carlo study.

use serde_json::{Value, json};

use super::absolute::ABSOLUTE_ACCURACY;
use super::cards::{Card, conditions_card, verdict_card};
use super::distances::{distances, lines, means_figure, shares_figure};
use super::each_once;
use crate::codes::Condition;
use crate::record::{study::StudyPlanMessage, tally_file::Header};
use crate::task::AccuracyKind;
use crate::text::wording::{counted, inverse_interval, joined, micrometres, number};
use crate::view::markup::{PageError, Templates, for_page};

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
    let experiments = header.plans[0].conditions.experiments;
    let caption = format!(
        "{} runs of each plan {}, {} each, all with the same noise.",
        header.trials,
        header.level.words(),
        counted(experiments.into(), header.accuracy().noun())
    );
    let shown = json!({
        "cards": cards(header, plans, conditions),
        "caption": caption,
        "means": means_figure(&lines),
        "distances": distances(&lines),
        "shares": shares_figure(&lines),
        "sources": sources(plans),
        "provenance_record": header.provenance,
        "command": command,
    });
    let title = format!("{}: study", header.provenance.scenario);
    Templates::new()?.page(&title, "study.html", &shown)
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

/// Which accuracy the study is about.
fn accuracy_card(accuracy: AccuracyKind) -> Card {
    let about = match accuracy {
        AccuracyKind::Absolute => ABSOLUTE_ACCURACY,
        AccuracyKind::Relative => {
            "Of the deflection by the task load, as in the paper, whatever the pose without it."
        }
    };
    Card::new("", "Accuracy", accuracy.name(), about)
}

/// The plan of the smallest mean, and how much better than a random one it is.
pub fn best_cards(best: &StudyPlanMessage) -> Vec<Card> {
    let interval = best.mean_ci95_mm.map_or_else(String::new, |ends| {
        let [low, high] = ends.map(|end| micrometres(Some(end)));
        format!("95 % interval of the mean: {low} to {high}.")
    });
    let answer = format!("{}: {}", best.name, micrometres(best.mean_mm));
    let smallest = Card::new("", "Smallest mean distance", answer, interval);
    let ratio = (best.mean_ratio_to_random).zip(best.mean_ratio_to_random_ci95);
    let random = ratio.map(|(ratio, interval)| {
        let answer = format!("{} times as accurate", number(Some(ratio.recip()), 2));
        let about = format!("95 % interval: {}.", inverse_interval(interval));
        Card::new("", "Against a random plan", answer, about)
    });
    [smallest].into_iter().chain(random).collect()
}

/// The best plan, how much better than random it is, and whether the prediction holds.
fn cards(header: &Header, plans: &[StudyPlanMessage], conditions: &[Condition]) -> Vec<Card> {
    let mut cards = vec![accuracy_card(header.accuracy())];
    if let Some(best) = header.best(plans) {
        cards.extend(best_cards(best));
        if let Some(verdict) = &best.verdict {
            let about = "Observed of the best plan beside what is predicted, with all error sources of the scenario.";
            cards.push(verdict_card(verdict.starts_with("holds"), verdict, about));
        }
    }
    // Where the scenario lists error sources, the verdict is on all of them, which the linear model does not have.
    if plans.iter().all(|plan| plan.combined_rms_mm.is_none()) {
        cards.push(linear_card(plans));
    }
    cards.extend(conditions_card(conditions));
    cards
}

/// How well the linear model predicts the mean squares.
fn linear_card(plans: &[StudyPlanMessage]) -> Card {
    let z = (plans.iter()).filter_map(|plan| plan.z).map(f64::abs);
    let largest = z.fold(0.0, f64::max);
    let about = "The largest difference between the observed and the expected mean square, in standard deviations; \
                 among a few plans it rarely exceeds 3.";
    let tone = match largest {
        ..3.0 => "good",
        ..4.0 => "",
        _ => "bad",
    };
    let answer = format!("off by {largest:.1} sigma at most");
    Card::new(tone, "Prediction", answer, about)
}
