//! The page of a Monte Carlo study.

use super::absolute::ABSOLUTE_ACCURACY;
use super::distances::{distances_figure, distances_table, lines, means_figure, shares_figure};
use super::{DISTANCES, checks_card, provenance, sources, verdict_card};
use crate::codes::Condition;
use crate::record::{study::StudyPlanMessage, tally_file::Header};
use crate::task::AccuracyKind;
use crate::text::wording::{counted, micrometres, number};
use crate::view::charts::PlotError;
use crate::view::markup::{card, heading, page, section};

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

/// The smallest mean is what a page of several plans is about.
fn best<'a>(
    plans: &'a [StudyPlanMessage],
    reference: Option<&str>,
) -> Option<&'a StudyPlanMessage> {
    let others = (plans.iter()).filter(|plan| Some(plan.name.as_str()) != reference);
    let with_mean = others.filter_map(|plan| Some((plan, plan.mean_mm?)));
    let best = with_mean.min_by(|one, other| one.1.total_cmp(&other.1));
    best.map(|(plan, _)| plan)
}

/// The page of a study as HTML.
pub fn study_page(study: &StudyPageRecord<'_>) -> Result<String, PlotError> {
    let (header, plans) = (study.header, &study.header.plans);
    let reference = header.reference();
    let is_absolute = header.accuracy() == AccuracyKind::Absolute;
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
    let cards = accuracy_card(is_absolute) + &cards(study);
    let mut body = heading(&title, &caption, &cards);
    let distances = means_figure(&lines)?
        + &distances_figure(&lines, &caption)?
        + &shares_figure(&lines)?
        + &distances_table(&lines);
    body += &section("distances", DISTANCES, &distances);
    body += &sources::of_study(study.plans);
    body += &provenance(&header.provenance, study.command);
    let title = format!("{}: study", header.provenance.scenario);
    Ok(page(&title, &body))
}

/// Which accuracy the study is about.
fn accuracy_card(is_absolute: bool) -> String {
    let (answer, about) = if is_absolute {
        ("absolute", ABSOLUTE_ACCURACY)
    } else {
        (
            "relative",
            "Of the deflection by the task load, as in the paper, whatever the pose without it.",
        )
    };
    card("", "Accuracy", answer, about)
}

/// The best plan, how much better than random it is, and whether the prediction holds.
fn cards(study: &StudyPageRecord<'_>) -> String {
    let mut cards = String::new();
    if let Some(best) = best(study.plans, study.header.reference()) {
        let interval = best.mean_ci95_mm.map_or_else(String::new, |ends| {
            let [low, high] = ends.map(|end| micrometres(Some(end)));
            format!("95 % interval of the mean: {low} to {high}.")
        });
        let answer = format!("{}: {}", best.name, micrometres(best.mean_mm));
        cards += &card("", "Smallest mean distance", &answer, &interval);
        if let (Some(ratio), Some([low, high])) =
            (best.mean_ratio_to_random, best.mean_ratio_to_random_ci95)
        {
            let answer = format!("{} times as accurate", number(Some(ratio.recip()), 2));
            let about = format!("95 % interval: {:.2} to {:.2}.", high.recip(), low.recip());
            cards += &card("", "Against a random plan", &answer, &about);
        }
        if let Some(verdict) = &best.verdict {
            let about = "Observed of the best plan beside what is predicted, with all error sources of the scenario.";
            cards += &verdict_card(verdict.starts_with("holds"), verdict, about);
        }
    }
    let z = (study.plans.iter()).filter_map(|plan| plan.z).map(f64::abs);
    let largest = z.fold(0.0, f64::max);
    let about = "The largest difference between the observed and the predicted mean square, in standard deviations; \
                 among a few plans it rarely exceeds 3.";
    let tone = if largest < 4.0 { "good" } else { "bad" };
    let answer = format!("off by {largest:.1} sigma at most");
    cards += &card(tone, "Prediction", &answer, about);
    cards + &checks_card(study.conditions, ("", ""))
}
