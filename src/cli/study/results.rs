//! What a study comes to: its records, and text for people.

use std::collections::BTreeSet;

use crate::record::study::{StudyPlanMessage, study_csv};
use crate::record::tally_file::{Header, PlanHeader};
use crate::study::tally::Tally;
use crate::view::markup::PageError;
use crate::view::report::{ABSOLUTE_ACCURACY, cards, study_page};
use crate::view::tables;
use crate::workflow::study::{Timing, plan_messages, study_json};

use crate::cli::command_prelude::*;
use crate::cli::views::{STUDY_PAGE, command_line};
use crate::cli::written::{Written, record_text};

/// What a study comes to.
#[derive(Debug)]
pub struct Results {
    header: Header,
    pub messages: Vec<StudyPlanMessage>,
    json: Value,
    timing: Option<Timing>,
}

impl Results {
    /// Sums up the tallies of a study.
    pub fn new(header: &Header, tallies: &[Tally], timing: Option<Timing>) -> Self {
        let messages = plan_messages(header, tallies);
        let json = study_json(header, &messages, timing);
        Self {
            header: header.clone(),
            messages,
            json,
            timing,
        }
    }

    /// Results for stdout, and the conditions that did not hold.
    pub fn report(&self, folder: &Path) -> Result<Report, PageError> {
        let took = self.timing.map_or_else(String::new, |timing| {
            format!(", in {:.2} s", timing.elapsed_s)
        });
        let text = format!(
            "{}\n{}{}{}{} runs of each plan, {}{took}. Results are in {}\n",
            describe(&self.messages),
            predictions(&self.messages, self.header.accuracy()),
            sentence(&self.messages, &self.header)?,
            noted(&[self.failures(true), self.unjudged()].concat()),
            self.header.trials,
            self.header.level.words(),
            folder.display()
        );
        Ok(Report::new(self.json.clone(), text, self.conditions()))
    }

    fn conditions(&self) -> Vec<Condition> {
        let failures = self.failures(false).into_iter();
        let failures = failures.map(|text| ConditionCode::FailedRuns.with(text));
        let exceeded =
            self.messages.iter().enumerate().filter(|(place, message)| {
                message.is_beyond_noise() && !self.is_comparison(*place)
            });
        let exceeded = exceeded.map(|(_, message)| {
            let um = |value_mm: Option<f64>| in_um(value_mm.map(|mm| mm * 1e-3), 3);
            ConditionCode::PredictionExceeded.with(format!(
                "residual error with the plan {:?} {} +- {} um rms, predicted {} um",
                message.name,
                um(message.rms_mm),
                um(message.rms_std_mm),
                um(message.predicted_rms_mm)
            ))
        });
        failures.chain(exceeded).collect()
    }

    /// Whether a plan is random, and others are compared with it.
    fn is_comparison(&self, place: usize) -> bool {
        let plans = &self.header.plans;
        let refers =
            |(other, each): (usize, &PlanHeader)| other != place && each.reference == Some(place);
        let is_drawn_anew = plans[place].sha256.is_none();
        let has_others = plans.iter().any(|each| each.sha256.is_some());
        plans.iter().enumerate().any(refers) || (is_drawn_anew && has_others)
    }

    /// Failed runs: of random plans that others are compared with, which nobody chose, or of the others.
    fn failures(&self, of_comparison: bool) -> Vec<String> {
        (self.messages.iter().enumerate())
            .filter(|(place, _)| self.is_comparison(*place) == of_comparison)
            .filter_map(|(_, message)| failed_runs(message))
            .collect()
    }

    /// Why plans have no verdict where others have one.
    fn unjudged(&self) -> Vec<String> {
        let plans = &self.header.plans;
        let is_judged = plans.iter().any(|each| each.account.is_some());
        let unjudged = plans
            .iter()
            .filter(|each| each.sha256.is_none() && is_judged);
        // Under several conditions each plan stands several times.
        let names: BTreeSet<&str> = unjudged.map(|each| each.name.as_str()).collect();
        let words = |name: &&str| {
            format!(
                "{name}: no verdict, as every run has a plan of its own, of which noise alone is predicted"
            )
        };
        names.iter().map(words).collect()
    }

    /// The page to look at; none for a sweep, where no plan is best under all conditions.
    fn page(&self) -> anyhow::Result<Option<String>> {
        if self.header.is_swept() {
            return Ok(None);
        }
        let (header, plans, conditions) = (&self.header, &self.messages, self.conditions());
        let page = study_page(header, plans, &conditions, &command_line())?;
        Ok(Some(page))
    }
}

/// The files of the results, the page apart.
pub const FILES: [&str; 2] = ["study.json", "study.csv"];

/// Writes study.json, study.csv and, for one set of conditions, study.html.
pub fn write(folder: &Path, results: &Results, written: &mut Written) -> anyhow::Result<()> {
    let text = record_text(&mut results.json.clone(), &results.conditions())?;
    let [json, csv] = FILES.map(|name| folder.join(name));
    written.save(&json, &text);
    let table = study_csv(&results.messages);
    written.save(&csv, &table);
    if let Some(page) = results.page()? {
        let html = folder.join(STUDY_PAGE);
        written.save(&html, &page);
    }
    Ok(())
}

/// Failed runs with their reasons.
fn failed_runs(message: &StudyPlanMessage) -> Option<String> {
    let reasons = (message.failures.iter()).map(|(reason, count)| format!("{count}: {reason}"));
    (message.failed > 0).then(|| {
        format!(
            "{} of {} runs failed with the plan {:?} ({})",
            message.failed,
            message.failed + message.runs,
            message.name,
            joined(reasons, "; ")
        )
    })
}

/// The table for a person.
pub fn describe(messages: &[StudyPlanMessage]) -> String {
    tables::study(messages, false).plain()
}

/// What each plan predicted, what its errors are made of, and whether the prediction holds.
fn predictions(messages: &[StudyPlanMessage], accuracy: AccuracyKind) -> String {
    let mut text = match accuracy {
        AccuracyKind::Absolute => format!("{ABSOLUTE_ACCURACY}\n"),
        AccuracyKind::Relative => String::new(),
    };
    let swept = tables::swept(messages);
    for message in messages {
        let conditions = swept.iter();
        let conditions = conditions.map(|(name, value)| format!(", {name} {}", value(message)));
        let name = message.name.clone() + &conditions.collect::<String>();
        let outcome = message.outcome();
        let validation = message.validation.iter().map(ToString::to_string);
        for words in outcome.iter().cloned().chain(validation) {
            text += &format!("{name}: {words}\n");
        }
        if outcome.is_none() {
            continue;
        }
        if let Some(share) = message.coverage95 {
            let percent = share * 100.0;
            text += &match accuracy {
                AccuracyKind::Relative => format!(
                    "  95 % intervals of compliances hold the true ones in {percent:.1} %\n"
                ),
                AccuracyKind::Absolute => format!(
                    "  at the test poses, the tool is within the predicted 95 % region in {percent:.1} %\n"
                ),
            };
        }
        if !message.contributions.is_empty() {
            text += &tables::contributions(&message.contributions).plain();
        }
        text.push('\n');
    }
    text
}

/// What it comes to under one set of conditions: the best plan against a random one.
fn sentence(messages: &[StudyPlanMessage], header: &Header) -> Result<String, PageError> {
    let best = header.best(messages).filter(|_| !header.is_swept());
    best.map_or_else(|| Ok(String::new()), |best| cards("of_best", &json!(best)))
}
