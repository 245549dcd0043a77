//! What a study comes to: its records, and text for people.

use std::path::Path;

use elastocal::files::output::write_whole;
use elastocal::record::study::{StudyPlanMessage, study_csv};
use elastocal::record::tally_file::Header;
use elastocal::study::Level;
use elastocal::study::switched_off::SeenShare;
use elastocal::study::tally::Tally;
use elastocal::task::AccuracyKind;
use elastocal::text::wording::inverse_interval;
use elastocal::workflow::study::{Timing, plan_messages, study_json};
use serde_json::Value;

use crate::cli::Report;
use crate::cli::absolute_plan::ABSOLUTE;
use crate::cli::table::{number, table};
use crate::cli::views::{STUDY_PAGE, StudyShown, study_page};
use crate::cli::written::Written;

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
    pub fn new(
        header: &Header,
        tallies: &[Tally],
        timing: Option<Timing>,
        seen: &[Option<Vec<SeenShare>>],
    ) -> anyhow::Result<Self> {
        let mut messages = plan_messages(header, tallies)?;
        for (message, shares) in messages.iter_mut().zip(seen) {
            message.see(shares.as_deref().unwrap_or_default());
        }
        let json = study_json(header, &messages, timing);
        Ok(Self {
            header: header.clone(),
            messages,
            json,
            timing,
        })
    }

    /// Results for stdout, and the conditions that did not hold.
    pub fn report(&self, folder: &Path) -> Report {
        let took = self.timing.map_or_else(String::new, |timing| {
            format!(", in {:.2} s", timing.elapsed_s)
        });
        Report {
            json: self.json.clone(),
            text: format!(
                "{}\n{}{}{} runs of each plan, {}{took}. Results are in {}\n",
                describe(&self.messages),
                promises(&self.messages, self.accuracy()),
                sentence(&self.messages, &self.header),
                self.header.trials,
                describe_level(self.header.level),
                folder.display()
            ),
            conditions: self.conditions(),
        }
    }

    /// What is accurate here.
    fn accuracy(&self) -> AccuracyKind {
        match self.header.absolute {
            Some(_) => AccuracyKind::Absolute,
            None => AccuracyKind::Relative,
        }
    }

    fn conditions(&self) -> Vec<String> {
        self.messages.iter().filter_map(condition).collect()
    }

    /// The page to look at; none for a sweep, where no plan is best under all conditions.
    fn page(&self) -> anyhow::Result<Option<String>> {
        let plans = &self.header.plans;
        let first = &plans[0];
        if plans
            .iter()
            .any(|plan| plan.conditions() != first.conditions())
        {
            return Ok(None);
        }
        study_page(&StudyShown {
            header: &self.header,
            level: describe_level(self.header.level),
            plans: &self.messages,
            conditions: &self.conditions(),
        })
    }
}

/// The files of the results, the page apart.
pub const FILES: [&str; 2] = ["study.json", "study.csv"];

/// Writes study.json, study.csv and, for one set of conditions, study.html.
pub fn write(folder: &Path, results: &Results, written: &mut Written) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(&results.json)? + "\n";
    let [json, csv] = FILES.map(|name| folder.join(name));
    written.note(&json, write_whole(&json, text.as_bytes()));
    let table = study_csv(&results.messages);
    written.note(&csv, write_whole(&csv, table.as_bytes()));
    if let (Some(page), Some(name)) = (results.page()?, STUDY_PAGE.first()) {
        let html = folder.join(name);
        written.note(&html, write_whole(&html, page.as_bytes()));
    }
    Ok(())
}

/// Failed runs with their reasons.
fn condition(message: &StudyPlanMessage) -> Option<String> {
    let reasons: Vec<String> = (message.failures.iter())
        .map(|(reason, count)| format!("{count}: {reason}"))
        .collect();
    (message.failed > 0).then(|| {
        format!(
            "{} of {} runs failed with the plan {:?} ({})",
            message.failed,
            message.failed + message.runs,
            message.name,
            reasons.join("; ")
        )
    })
}

/// What runs are made of, for people.
pub const fn describe_level(level: Level) -> &'static str {
    match level {
        Level::Model => "by the linear model",
        Level::Robot => "on the virtual robot",
    }
}

/// The table for a person, with a column for each condition that varies.
pub fn describe(messages: &[StudyPlanMessage]) -> String {
    let micro = |value: Option<f64>| number(value.map(|value| value * 1e3), 3);
    let swept: Vec<_> = SWEPT
        .into_iter()
        .filter(|(_, value)| {
            messages
                .iter()
                .any(|each| value(each) != value(&messages[0]))
        })
        .collect();
    let row = |message: &StudyPlanMessage| {
        let interval = message.mean_ci95_mm.map_or_else(
            || "-".to_owned(),
            |[low, high]| format!("{:.3} to {:.3}", low * 1e3, high * 1e3),
        );
        let mut row = vec![message.name.clone()];
        row.extend(swept.iter().map(|(_, value)| value(message)));
        row.extend([
            micro(message.mean_mm),
            interval,
            micro(message.rms_mm),
            micro(message.predicted_rms_mm),
            number(message.z, 1),
            micro(message.quantiles_mm.map(|quantiles| quantiles[2])),
            number(message.nees, 3),
            message.failed.to_string(),
        ]);
        row
    };
    let mut header = vec!["plan"];
    header.extend(swept.iter().map(|(name, _)| name));
    header.extend([
        "mean [um]",
        "95 % interval [um]",
        "rms [um]",
        "predicted rms [um]",
        "z",
        "95 % below [um]",
        "NEES",
        "failed",
    ]);
    table(&header, &messages.iter().map(row).collect::<Vec<_>>())
}

/// A condition that a sweep can vary: what it is called, and its value as text.
type Swept = (&'static str, fn(&StudyPlanMessage) -> String);

const SWEPT: [Swept; 3] = [
    ("measurements", |message| message.experiments.to_string()),
    ("load scale", |message| message.load_scale.to_string()),
    ("sigma [mm]", |message| format!("{:.4}", message.sigma_mm)),
];

/// What is promised as a tolerance, and what of the runs keeps it.
fn tolerance(message: &StudyPlanMessage) -> String {
    let quantiles = message.promised_quantile95_mm.zip(message.quantiles_mm);
    quantiles.map_or_else(String::new, |(promised, seen)| {
        format!(
            " (95 % below {:.3}, seen {:.3})",
            promised * 1e3,
            seen[2] * 1e3
        )
    })
}

/// What each plan promised, what its errors are made of, and whether the promise holds.
fn promises(messages: &[StudyPlanMessage], accuracy: AccuracyKind) -> String {
    let mut text = match accuracy {
        AccuracyKind::Absolute => format!("{ABSOLUTE}\n"),
        AccuracyKind::Relative => String::new(),
    };
    let micro = |value: f64| format!("{:.3}", value * 1e3);
    let promised = messages
        .iter()
        .filter_map(|message| Some((message, message.promised_rms_mm?, message.verdict.as_ref()?)));
    for (message, promised_mm, verdict) in promised {
        text += &format!(
            "{}: promised {} um{}; the promise {verdict}\n",
            message.name,
            micro(promised_mm),
            tolerance(message)
        );
        if let Some(share) = message.coverage95 {
            let percent = share * 100.0;
            text += &match accuracy {
                AccuracyKind::Relative => format!(
                    "  95 % intervals of compliances hold the true ones in {percent:.1} %\n"
                ),
                AccuracyKind::Absolute => format!(
                    "  at the test poses, the tool is within the promised region of 95 % in {percent:.1} %\n"
                ),
            };
        }
        if let (Some(worst), Some(chance)) =
            (message.worst_rank(), message.rank_deviation_by_chance)
        {
            text += &format!(
                "  ranks of true values among what is known of them: even within {:.1} % (worst: {}; chance leaves {:.1} %)\n",
                worst.deviation * 100.0,
                worst.name,
                chance * 100.0
            );
        }
        let is_seen = message.parts.iter().any(|part| part.seen_rms_mm.is_some());
        let total: f64 = message.parts.iter().map(|part| part.rms_mm.powi(2)).sum();
        let rows: Vec<Vec<String>> = (message.parts.iter())
            .map(|part| {
                let name = if part.hidden {
                    format!("{} (hidden)", part.name)
                } else {
                    part.name.clone()
                };
                let share = part.rms_mm.powi(2) / total * 100.0;
                let mut row = vec![name, micro(part.rms_mm), format!("{share:.1}")];
                if is_seen {
                    row.push(part.seen_rms_mm.map_or_else(|| "-".to_owned(), micro));
                }
                row
            })
            .collect();
        let mut header = vec!["of it", "alone [um]", "share of the square [%]"];
        if is_seen {
            header.push("seen [um]");
        }
        text += &table(&header, &rows);
        text.push('\n');
    }
    text
}

/// What it comes to under one set of conditions: the best plan against a random one.
fn sentence(messages: &[StudyPlanMessage], header: &Header) -> String {
    let reference = header.plans.iter().find_map(|plan| plan.reference);
    let plans = || messages.iter().enumerate();
    let best = plans()
        .filter(|(index, _)| Some(*index) != reference)
        .filter_map(|(_, message)| Some((message, message.mean_mm?)))
        .min_by(|one, other| one.1.total_cmp(&other.1));
    let is_swept =
        (header.plans.iter()).any(|plan| plan.conditions() != header.plans[0].conditions());
    let (Some((best, mean_mm)), false) = (best, is_swept) else {
        return String::new();
    };
    let mut text = format!(
        "After calibration with the plan {:?}, compensation leaves {:.2} um on average",
        best.name,
        mean_mm * 1e3
    );
    let random = reference.and_then(|index| messages[index].mean_mm);
    if let (Some(random), Some(interval)) = (random, best.mean_ratio_to_random_ci95) {
        text += &format!(
            "; with a random plan of as many measurements it is {:.2} um, {:.2} times as much ({})",
            random * 1e3,
            random / mean_mm,
            inverse_interval(interval)
        );
    }
    text + ".\n"
}
