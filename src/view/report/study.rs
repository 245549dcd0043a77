//! The page of a Monte Carlo study.

use super::absolute::ABSOLUTE_ACCURACY;
use super::cards::{conditions_card, verdict_card};
use super::distances::{distances_figure, distances_table, lines, means_figure, shares_figure};
use super::{DISTANCES, provenance, sources};
use crate::codes::Condition;
use crate::record::{study::StudyPlanMessage, tally_file::Header};
use crate::task::AccuracyKind;
use crate::text::wording::{counted, inverse_interval, micrometres, number};
use crate::view::card::{Card, heading};
use crate::view::markup::{page, section};

/// What the page of a study is made of.
#[derive(Debug, Clone, Copy)]
pub struct StudyPageRecord<'a> {
    /// The study, under one set of conditions.
    pub header: &'a Header,
    /// What the runs say.
    pub plans: &'a [StudyPlanMessage],
    /// What must be looked at.
    pub conditions: &'a [Condition],
    /// The command that made the page.
    pub command: &'a str,
}

/// The page of a study as HTML.
pub fn study_page(study: &StudyPageRecord<'_>) -> String {
    let (header, plans) = (study.header, &study.header.plans);
    let reference = header.reference();
    let lines = lines(study.plans, |_, runs| Some(&*runs.name) == reference);
    let caption = format!(
        "{} runs of each plan {}, {} each, all with the same noise. Each area is the distribution of the residual error; the vertical line is the mean.",
        header.trials,
        header.level.words(),
        counted(
            plans[0].conditions.experiments.into(),
            header.accuracy().noun()
        )
    );
    let title = format!("Plans compared: {}", header.provenance.scenario);
    let mut body = heading(&title, &caption, cards(study));
    let distances = means_figure(&lines)
        + &distances_figure(&lines, &caption)
        + &shares_figure(&lines)
        + &distances_table(&lines);
    body += &section("distances", DISTANCES, &distances);
    body += &sources::of_study(study.plans);
    body += &provenance(&header.provenance, study.command);
    let title = format!("{}: study", header.provenance.scenario);
    page(&title, &body)
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
fn cards(study: &StudyPageRecord<'_>) -> Vec<Card> {
    let mut cards = vec![accuracy_card(study.header.accuracy())];
    if let Some(best) = study.header.best(study.plans) {
        cards.extend(best_cards(best));
        if let Some(verdict) = &best.verdict {
            let about = "Observed of the best plan beside what is predicted, with all error sources of the scenario.";
            cards.push(verdict_card(verdict.starts_with("holds"), verdict, about));
        }
    }
    let z = (study.plans.iter()).filter_map(|plan| plan.z).map(f64::abs);
    let largest = z.fold(0.0, f64::max);
    let about = "The largest difference between the observed and the predicted mean square, in standard deviations; \
                 among a few plans it rarely exceeds 3.";
    let tone = if largest < 4.0 { "good" } else { "bad" };
    let answer = format!("off by {largest:.1} sigma at most");
    cards.push(Card::new(tone, "Prediction", answer, about));
    cards.extend(conditions_card(study.conditions));
    cards
}
