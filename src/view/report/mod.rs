//! Pages to look at and to hand on: one file each that loads nothing, with figures as SVG.
//!
//! - [`run_page`]: a designed plan, its calibration, and what it is shown beside.
//! - [`absolute_page`]: a plan of absolute readings, and a run of it.
//! - [`study_page`]: a Monte Carlo study.
//!
//! The numbers are those of the JSON records.

mod absolute;
mod cards;
mod distances;
mod figures;
mod overview;
mod sources;
mod study;
mod test_poses;

use std::path::Path;

use super::card::{Card, heading};
use super::markup::{cell, escaped, figure, page, paragraph, section, table_of_cells, unbroken};
use super::tables::{self, RecordTable};
use crate::codes::Condition;
use crate::identification::ParameterGroup;
use crate::record::evidence::{CriterionPlanMessage, EvidenceMessage};
use crate::record::messages::{CalibrationMessage, ProvenanceMessage};
use crate::robot::ReadsAlong;
use crate::scenario::Scenario;
use crate::task::{Belief, Instrument};
use crate::text::wording::{dash, joined, listed, micrometres, naming, number, percent};
use crate::workflow::run::RunOutcome;
use distances::{distances_figure, distances_table, lines};
use figures::{accuracy_figure, compliances_figure, residuals_figure};
use test_poses::test_poses;

pub use absolute::{ABSOLUTE_ACCURACY, absolute_page};
pub use cards::{readings_cards, run_cards};
pub use study::{StudyPageRecord, best_cards, study_page};

/// What a page about a plan has, whatever is measured.
#[derive(Debug, Clone, Copy)]
pub struct PlanPage<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The robot in each configuration (HTML).
    pub stills: &'a str,
    /// What must be looked at.
    pub conditions: &'a [Condition],
    /// Where it comes from.
    pub provenance: &'a ProvenanceMessage,
    /// The command that made the page.
    pub command: &'a str,
    /// Where the plan is, or may be written.
    pub plan: &'a Path,
    /// What is unknown of absolute readings, where that was named.
    pub parameters: &'a [ParameterGroup],
}

/// What a budget's contributions are.
const CONTRIBUTIONS: &str = "Contributions are what the noise and each error source leave after compensation, rms, to first order; \
                             squares add up.";

/// The report of a run as HTML.
pub fn run_page(shown: &PlanPage<'_>, outcome: &RunOutcome) -> String {
    let (scenario, evidence) = (shown.scenario, &outcome.evidence);
    let Some(own) = outcome.tried.first() else {
        return page("elastocal", "");
    };
    let (calibration, assessment) = (&own.record, &own.assessment);
    let cards = run_cards(scenario, outcome, own).into_iter();
    let cards = cards.chain([overview::checks_card(shown, outcome)]);
    let mut body = distances(evidence);
    body += &sources::budget_section(assessment.uncertainty_budget.as_ref(), CONTRIBUTIONS);
    let poses = &calibration.test_poses;
    if poses.len() > 1 {
        let predicted_mm: Vec<_> = poses.iter().map(|pose| pose.rho0_mm).collect();
        let all_mm = assessment.rho0_m.map(|value| value * 1e3);
        let observed = Some((&**poses, "uncompensated"));
        body += &test_poses(&scenario.task.test_poses, &predicted_mm, all_mm, observed);
    }
    let belief = &scenario.task.belief;
    let found = compliances(belief, calibration);
    let left = residuals(&belief.instrument, calibration);
    body += &pair(&[
        section("compliances", "Compliances", &found),
        section("residuals", "Standardised residuals", &left),
    ]);
    let tried = tables::tried(&outcome.tried).html();
    body += &section("plans", "The plans in this run", &tried);
    let criteria = criteria(&evidence.criteria_compared);
    let accuracy = accuracy(evidence, assessment.experiments);
    body += &pair(&[
        section("criteria", "The criteria compared", &criteria),
        section("accuracy", "More or fewer measurements", &accuracy),
    ]);
    let more = overview::more_accurate(evidence, assessment);
    body += &overview::next_steps(shown, more);
    let configurations = configurations(shown, calibration);
    body += &section("configurations", "What to measure", &configurations);
    shown.page(["Calibration plan", "calibration report"], cards, &body)
}

impl PlanPage<'_> {
    /// With these sections: its title and what stands on a browser's tab, of the scenario, and its cards.
    fn page(
        &self,
        titles: [&str; 2],
        cards: impl IntoIterator<Item = Card>,
        sections: &str,
    ) -> String {
        let [title, tab] = titles;
        let (name, lead) = (&self.scenario.name, &self.scenario.description);
        let body = heading(&format!("{title}: {name}"), lead, cards)
            + sections
            + &provenance(self.provenance, self.command);
        page(&format!("{name}: {tab}"), &body)
    }
}

/// The accuracy of more and of fewer measurements than these.
fn accuracy(evidence: &EvidenceMessage, experiments: u32) -> String {
    let caption = format!(
        "The bound holds for every plan of as many measurements. Crosses: this plan of {experiments}, measured again as a whole; what its \
         repeats share they do not average. The searches for other numbers were short; the command budget looks closer."
    );
    let points = (&*evidence.accuracy, &*evidence.repeated);
    let svg = accuracy_figure(points, &evidence.lower_bounds_rho0_mm, experiments);
    figure(&svg, &caption)
}

/// What comes several times, once.
fn each_once<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for each in all {
        if !once.contains(&each) {
            once.push(each);
        }
    }
    once
}

/// Two sections beside each other, where there is room.
fn pair(sections: &[String; 2]) -> String {
    format!("<div class=\"pair\">\n{}</div>\n", sections.concat())
}

/// Many runs of every plan, the designed one first.
fn distances(evidence: &EvidenceMessage) -> String {
    // Random plans come last.
    let lines = lines(&evidence.study, |place, _| {
        place + 1 == evidence.study.len()
    });
    let caption = format!(
        "{} runs of each plan by the linear model, all with the same noise; \u{201c}random\u{201d} is a fresh \
         feasible plan in every run. Each area is the distribution of the residual error; the vertical line is the mean.",
        evidence.trials
    );
    let body = distances_figure(&lines, &caption) + &distances_table(&lines);
    section("distances", DISTANCES, &body)
}

/// The title of the distributions of residual errors.
const DISTANCES: &str = "How far off the tool is after compensation";

/// The accuracy of the best plan for each criterion.
fn criteria(plans: &[CriterionPlanMessage]) -> String {
    let best = plans.first().and_then(|plan| plan.rho0_mm);
    let largest = plans.iter().filter_map(|plan| plan.rho0_mm);
    let largest = largest.fold(f64::MIN_POSITIVE, f64::max);
    let name = |plan: &CriterionPlanMessage| {
        let name = |name: &String| match name.as_str() {
            "test_pose" => "test pose".to_owned(),
            other => other.to_uppercase(),
        };
        joined(plan.criteria.iter().map(name), ", ")
    };
    let row = |plan: &CriterionPlanMessage| {
        let rho0_mm = plan.rho0_mm;
        let shown = match rho0_mm {
            None if plan.problem.is_some() => "no plan".to_owned(),
            rho0_mm => micrometres(rho0_mm),
        };
        let share = 100.0 * rho0_mm.unwrap_or(0.0) / largest;
        let more = rho0_mm.zip(best).map(|(rho0, best)| rho0 / best - 1.0);
        let more = more.filter(|more| *more > 0.001);
        let more = more.map_or_else(String::new, |more| format!("+{}", percent(Some(more), 0)));
        cell(&name(plan)) + &sources::bar(share, false, &shown) + &cell(&more)
    };
    let header = ["criterion", "\u{3c1}\u{2080} at the test pose", "more"];
    let alone =
        |plan: &&CriterionPlanMessage| plan.searches_agreeing.is_some_and(|count| count < 2);
    let rough = joined(plans.iter().filter(alone).map(name), "; ");
    let rough = Some(rough).filter(|rough| !rough.is_empty());
    let words = " Searches for {} did not agree: by that criterion there may be better plans.";
    let caption = "The best plan found for each criterion, of as many measurements, evaluated at the test pose.";
    table_of_cells(&header, plans.iter().map(row))
        + &paragraph(&(caption.to_owned() + &naming(rough, words)))
        + CRITERIA_LEGEND
}

/// What the letters stand for.
const CRITERIA_LEGEND: &str = "<details><summary>What the criteria ask for</summary>\n<dl>\
    <dt>test pose</dt><dd>the smallest rms distance at the test pose</dd>\
    <dt>A</dt><dd>the smallest sum of the variances</dd>\
    <dt>D, O1</dt><dd>the smallest volume of the confidence ellipsoid</dd></dl>\n\
    <p>Variances are those of relative errors of the compliances.</p></details>\n";

/// What is measured: the stills, and the plan as a table.
fn configurations(shown: &PlanPage<'_>, calibration: &CalibrationMessage) -> String {
    let reads_along = shown.scenario.task.reads_along();
    let rows = (calibration.plan.iter().enumerate()).map(|(index, experiment)| {
        let mut row = plan_row(index, &experiment.q_deg, Some(&experiment.wrench));
        if reads_along {
            let along = experiment.direction.map(|each| unbroken(&listed(each, 4)));
            row.push(along.unwrap_or_else(|| "all coordinates".to_owned()));
        }
        row.push(experiment.repeats.to_string());
        row
    });
    let own = if reads_along {
        "experiment | read along | times"
    } else {
        "experiment | times"
    };
    plan_table(shown, "plan.csv has", own, rows)
}

/// What is drawn green in the robot's pictures.
fn green(instrument: &Instrument) -> &'static str {
    match instrument.reads_along() {
        ReadsAlong::Never => "the line of sight from the instrument to the reflector that is read",
        ReadsAlong::Always => "the way that the gauge reads",
        ReadsAlong::Sometimes => {
            "the line of sight from the instrument to the reflector, or the way that the gauge reads"
        }
    }
}

/// Stills, what is to be known of them and where the same numbers are, and the rows of a plan; `own` names the rows and the columns that
/// follow angles and load.
fn plan_table(
    PlanPage {
        scenario, stills, ..
    }: &PlanPage<'_>,
    same: &str,
    own: &str,
    rows: impl Iterator<Item = Vec<String>>,
) -> String {
    let (row, own) = own.split_once(" | ").unwrap_or((own, ""));
    let columns = scenario.task.belief.commands().columns();
    let angles = columns.iter().map(|column| column.replace('_', " [") + "]");
    let angles = joined(angles, " | ");
    let header = format!("{row} | {angles} | force [N] | torque [N m] | {own}");
    let about = format!(
        "Red: the load, which acts at the calibration tool; forces are in the world frame, z up. Green: {}. {same} the same numbers.",
        green(&scenario.task.belief.instrument)
    );
    format!("<div class=\"stills\">{stills}</div>\n")
        + &paragraph(&about)
        + &RecordTable::new(&header, rows).html()
}

/// A row of it: number, angles and load, where there is one.
fn plan_row(index: usize, q_deg: &[f64], wrench: Option<&[f64; 6]>) -> Vec<String> {
    let mut row = vec![(index + 1).to_string()];
    row.extend(q_deg.iter().map(|&angle| number(Some(angle), 3)));
    for half in [0..3, 3..6] {
        let vector = wrench.map(|wrench| listed(wrench[half].iter().copied(), 4));
        row.push(vector.map_or_else(dash, |vector| unbroken(&vector)));
    }
    row
}

/// The identified compliances.
fn compliances(belief: &Belief, calibration: &CalibrationMessage) -> String {
    let caption = "From this run's measurements of the virtual robot, beside the simulated truth of this run: 95 % of such intervals cover it.";
    let unit = belief.compliance_unit("1e-6");
    figure(&compliances_figure(calibration), caption)
        + &tables::compliances(calibration, &unit).html()
}

/// What the fit leaves of each measurement.
fn residuals(instrument: &Instrument, calibration: &CalibrationMessage) -> String {
    let identification = &calibration.identification;
    let measured = calibration.residuals.iter().zip(&calibration.measurements);
    let standardised = measured.map(|(each, measured)| {
        let value = |row: usize| each.standardised.get(row).copied().flatten();
        match measured.direction {
            Some(_) => [None, None, None, value(0)],
            None => [value(0), value(1), value(2), None],
        }
    });
    let svg = residuals_figure(&standardised.collect::<Vec<_>>());
    let residuals = || calibration.residuals.iter();
    let numbers: usize = residuals().map(|each| each.standardised.len()).sum();
    let effective: f64 = residuals().map(|each| each.leverage).sum();
    let caption = format!(
        "Measured less modelled deflection of each measurement, each coordinate over its own standard deviation: that of the \
         measurement less what the fit takes up. Of {numbers} degrees of freedom the fit takes up {effective:.1} (the effective \
         number of parameters). 95 % belong into the grey band (\u{b1}1.96)."
    );
    let sigma = micrometres(Some(identification.sigma_mm));
    let both = instrument.both_sigmas(|value| micrometres(Some(value * 1e3)));
    let given = both.map_or_else(
        || format!("{sigma} as given"),
        |both| format!("{both} as given, {sigma} rms over all that is read"),
    );
    let observed = format!(
        "sigma: {given}; {} from the residuals, p = {} (chi-square).",
        micrometres(identification.residual_sigma_mm),
        number(identification.consistency, 3)
    );
    figure(&svg, &caption) + &paragraph(&observed)
}

/// Where a page comes from.
fn provenance(from: &ProvenanceMessage, command: &str) -> String {
    let entries = [
        (
            "program",
            format!("elastocal {} ({})", from.version, from.commit),
        ),
        ("scenario", from.scenario.clone()),
        (
            "SHA-256 of scenario and models",
            from.scenario_sha256.clone(),
        ),
        ("seed", from.seed.to_string()),
        ("command", command.to_owned()),
    ];
    let entry =
        |(key, value): &(&str, String)| format!("<dt>{key}</dt><dd>{}</dd>\n", escaped(value));
    let list: String = entries.iter().map(entry).collect();
    let list = format!("<dl>\n{list}</dl>\n");
    section("provenance", "Where this page comes from", &list)
}
