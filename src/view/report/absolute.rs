//! The page of a plan of absolute readings: what is predicted, of what it is made, what to read, and what virtual robots make of it.

use super::distances::{distances_figure, distances_table, lines};
use super::overview::next_steps;
use super::test_poses::test_poses;
use super::{
    PlanPage, bound_card, checks_card, each_once, plan_row, plan_table, provenance, random_card,
    sources, verdict_card,
};
use crate::calibration::rms_m;
use crate::observation::LengthKind;
use crate::plan::UncertaintyBudget;
use crate::quantities::units::shown_unit;
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::robot_trials::RobotTrials;
use crate::study::verdict::Kept;
use crate::text::wording::{counted, dash, micrometres, naming, percent};
use crate::view::charts::PlotError;
use crate::view::markup::{card, heading, micro_sign, page, paragraph, paragraphs, section, table};
use crate::view::tables;
use crate::workflow::run::{AbsoluteRun, RUN};

/// What the page of a plan of absolute readings is made of.
#[derive(Debug, Clone, Copy)]
pub struct AbsolutePageRecord<'a> {
    /// What every page has.
    pub page: PlanPage<'a>,
    /// The predicted accuracy of the plan.
    pub plan: &'a AbsolutePlanMessage,
    /// What virtual robots made of it, where some were drawn.
    pub trials: Option<&'a RobotTrials>,
    /// What came of one run, where it was carried out.
    pub run: Option<&'a AbsoluteRun<'a>>,
}

/// A smaller discrepancy (mm) is not said.
const LEAST_MM: f64 = 5e-6;

/// Which accuracy a page of absolute readings is about.
pub const ABSOLUTE_ACCURACY: &str = "An absolute accuracy: where the loaded tool is, with frames, geometry and elasticity as far as they are unknown.";

/// The page of a plan of absolute readings as HTML.
pub fn absolute_page(shown: &AbsolutePageRecord<'_>) -> Result<String, PlotError> {
    let (plan, scenario) = (shown.plan, shown.page.scenario);
    let name = &scenario.name;
    let [title, tab] = match shown.run {
        Some(_) => ["Calibration for absolute accuracy", "calibration report"],
        None => ["Plan of absolute readings", "plan of absolute readings"],
    };
    let title = format!("{title}: {name}");
    let mut body = heading(&title, &scenario.description, &cards(shown));
    if let Some(trials) = shown.trials {
        body += &section("trials", "Do virtual robots keep it?", &of_trials(trials)?);
    }
    let about = "Contributions are what the instrument's noise and each error source leave, rms, to first order; squares add up. \
                 Frames, and what else nothing is known of before, are found from readings: they are in the contributions of what \
                 disturbs these.";
    body += &sources::budget_section(plan.uncertainty_budget.as_ref(), about);
    if plan.test_poses.len() > 1 || shown.run.is_some() {
        let predicted_mm: Vec<_> = plan.test_poses.iter().map(|pose| pose.rho0_mm).collect();
        let observed = (shown.run).map(|run| (&*run.record.test_poses, "of the nominal robot"));
        let poses = &scenario.task.test_poses;
        body += &test_poses(poses, &predicted_mm, plan.rho0_mm, observed)?;
    }
    body += &shown.run.map_or_else(String::new, identified);
    body += &next_steps(&scenario.path, None);
    body += &section("readings", "What to read", &readings(shown));
    body += &section("unknowns", "What is found", &unknowns(plan));
    body += &provenance(shown.page.provenance, shown.page.command);
    Ok(page(&format!("{name}: {tab}"), &body))
}

fn cards(shown: &AbsolutePageRecord<'_>) -> String {
    let mut cards = plan_card(shown.plan) + &accuracy_card(shown.plan) + &best_card(shown.plan);
    cards += &(shown.run).map_or_else(String::new, |run| run_cards(shown.plan, run));
    if let Some(trials) = shown.trials {
        let is_kept = trials.prediction == Kept::Holds;
        let verdict = trials.runs.verdict.as_deref().unwrap_or_default();
        cards += &verdict_card(is_kept, verdict, &trials.outcome());
    }
    if !shown.plan.assumed_exact.is_empty() {
        let about = shown.plan.assumed_exact.join("; ") + ".";
        cards += &card(
            "bad",
            "Assumed exact",
            "not all is in the prediction",
            &about,
        );
    }
    cards + &checks_card(shown.page.conditions, ("", ""))
}

fn plan_card(plan: &AbsolutePlanMessage) -> String {
    let rows = || plan.plan.iter();
    let configurations = each_once(rows().map(|row| &row.q_deg)).len();
    let loaded = rows().filter(|row| row.wrench.is_some()).count();
    let targets = each_once(rows().filter_map(|row| row.target.as_ref()));
    let stations = each_once(rows().filter_map(|row| row.station.as_ref()));
    let about = format!(
        "{loaded} of {} under a load.{}{}",
        counted(plan.plan.len() as u64, "row"),
        naming(targets, " Reflectors: {}."),
        naming(stations, " Stations: {}.")
    );
    let answer = format!(
        "{} in {}",
        counted(plan.experiments.into(), "reading"),
        counted(configurations as u64, "configuration")
    );
    card("", "Plan", &answer, &about)
}

fn accuracy_card(plan: &AbsolutePlanMessage) -> String {
    let frame = plan.frame.as_ref().map_or_else(
        || "the instrument's frame".to_owned(),
        |station| format!("the frame of station \u{201c}{station}\u{201d}"),
    );
    let mut about = format!(
        "\u{3c1}\u{2080}, the rms distance of the loaded tool from where it should be in {frame}: an absolute accuracy. Frames, \
         geometry and elasticity count as far as they are unknown; in a relative one, as in the paper, only what the load bends."
    );
    if let Some(quantile) = plan.quantile95_mm {
        about += &format!(" 95 % stay below {}.", micrometres(Some(quantile)));
    }
    if plan.task_force_mm > 0.0 {
        about += &format!(
            " Of it, {} are the task's uncertain force, whatever is read.",
            micrometres(Some(plan.task_force_mm))
        );
    }
    let counts = UncertaintyBudget::in_words(plan.uncertainty_budget.as_ref(), "reading");
    about += &format!(" It is predicted {counts}.");
    let answer = micrometres(plan.rho0_mm) + " rms";
    card("", "Absolute accuracy", &answer, &about)
}

fn best_card(plan: &AbsolutePlanMessage) -> String {
    let (Some(bound), Some(efficiency)) = (plan.lower_bound_rho0_mm, plan.efficiency) else {
        let about = "Without candidates, nothing is said about better plans: give --candidates.";
        return card("", "Is it the best?", "no bound", about);
    };
    let possible = counted(plan.candidates.possible as u64, "possible candidate");
    let basis = match &plan.drawn {
        Some(drawn) => format!(
            "Looked at were {possible}, at {} drawn at random and others near those that were chosen: evidence, no proof, for \
             the region has more.",
            counted(drawn.configurations.into(), "configuration")
        ),
        None => format!("Proved by looking at all {possible}, of which it speaks alone."),
    };
    let tone = if plan.drawn.is_some() { "" } else { "good" };
    bound_card(tone, bound, efficiency, "candidates", &basis)
}

/// The verdict in words, the distances that were left, and the numbers.
fn of_trials(trials: &RobotTrials) -> Result<String, PlotError> {
    let runs = &trials.runs;
    let mut said = trials.outcome();
    if let Some(share) = runs.coverage95 {
        let share = percent(Some(share), 1);
        said +=
            &format!(" At {share} of the test poses the tool is within the predicted 95 % region.");
    }
    if runs.failed > 0 {
        let failed = counted(runs.failed, "robot");
        said += &format!(" {failed} could not be evaluated.");
    }
    let lines = lines(std::slice::from_ref(runs), |_, _| false);
    let caption = "Distance of the loaded tool from where the identified model predicts it, rms over the test poses, of each virtual robot. The area is the distribution; the vertical line is the mean.";
    let hidden = (runs.contributions.iter())
        .filter(|each| each.hidden)
        .map(|each| match each.contribution_um {
            Some(um) if um > 0.0 => format!("{} ({})", each.source, micrometres(Some(um * 1e-3))),
            _ => each.source.clone(),
        });
    let hidden = paragraphs([naming(hidden, "Of this the planner does not know: {}.")]);
    Ok(paragraph(&said) + &hidden + &distances_figure(&lines, caption)? + &distances_table(&lines))
}

/// The stills, and the plan as a table.
fn readings(shown: &AbsolutePageRecord<'_>) -> String {
    let own = &shown.page.scenario.task.belief.calibration_tool.name;
    let is_read = |kind: &LengthKind| {
        let mut lengths = shown
            .plan
            .plan
            .iter()
            .filter_map(|reading| reading.length.0);
        lengths.any(|length| length.kind == *kind)
    };
    let kinds: Vec<LengthKind> = LengthKind::ALL.into_iter().filter(is_read).collect();
    let rows = (shown.plan.plan.iter().enumerate()).map(|(index, reading)| {
        let mut row = plan_row(index, &reading.q_deg, reading.wrench.as_ref());
        row.push(reading.target.clone().unwrap_or_else(|| own.clone()));
        row.push(reading.station.clone().unwrap_or_else(dash));
        row.push(reading.repeats.to_string());
        row.extend(kinds.iter().map(|&kind| {
            let length = reading.length.0.filter(|length| length.kind == kind);
            length.map_or_else(dash, |length| format!("{:.3}", length.length_m * 1e3))
        }));
        row
    });
    let columns = kinds.iter().map(|kind| format!(" | {} [mm]", kind.name()));
    let own = "row | reflector | station | times".to_owned() + &columns.collect::<String>();
    let same = shown.run.map_or("--plan-out writes", |_| "plan.csv has");
    plan_table(&shown.page, same, &own, rows)
}

/// All unknowns, with how well each is known afterwards.
fn unknowns(plan: &AbsolutePlanMessage) -> String {
    let rows = (plan.unknowns.iter()).map(|unknown| {
        let (factor, unit) = shown_unit(&unknown.unit);
        let error = unknown.standard_error;
        vec![
            unknown.name.clone(),
            error.map_or_else(
                || "not by itself".to_owned(),
                |error| format!("{:.3e}", error * factor),
            ),
            micro_sign(unit),
            match &unknown.mounted {
                Some(mounted) => format!("{} ({mounted})", unknown.what),
                None => unknown.what.clone(),
            },
        ]
    });
    let count = counted(rows.len() as u64, "unknown");
    let numbers = table("unknown | standard error | unit | what it is", rows);
    paragraph(&format!(
        "{count}: the frames of stations and reflectors, which every such plan finds, and what else is unknown of the robot.{}",
        if plan.unknowns.iter().any(|each| each.unit == "1") {
            " Of a logarithm the unit is 1."
        } else {
            ""
        }
    )) + &format!(
        "<details><summary>How well each is known afterwards</summary>\n{numbers}</details>\n"
    )
}

/// What was observed beside what was predicted, and random plans.
fn run_cards(plan: &AbsolutePlanMessage, run: &AbsoluteRun<'_>) -> String {
    let [before, after] = rms_m(&run.poses).map(|value| micrometres(Some(value * 1e3)));
    let about = format!(
        "Residual error in run {} on the virtual robot: the distance of the loaded tool from where the identified robot predicts it, \
         rms over the test poses; predicted {} rms. Of the nominal robot, in the frames that suit the same readings best: {before}.",
        RUN,
        micrometres(plan.rho0_mm)
    );
    let observed = card("", "Observed in this run", &after, &about);
    let of = format!(
        " of {} of the same candidates",
        counted(plan.experiments.into(), "reading")
    );
    let own_m = plan.rho0_mm.map(|value| value * 1e-3);
    observed + &random_card(run.random_rho0_m, own_m, &of, "")
}

/// What was identified, beside the simulated truth.
fn identified(run: &AbsoluteRun<'_>) -> String {
    let found = &run.record.identification;
    let mut about = format!(
        "From {} of the virtual robot of run {}, beside the simulated truth of that run. Frames are found besides.",
        counted(found.readings as u64, "reading"),
        RUN
    );
    about += &naming(
        found.left_out.iter().map(|each| &each.name),
        " Redundant, not fitted: {}. Frames take their part; where links do, too, no truth stands beside geometry.",
    );
    let distances = &found.distance_mm;
    about += &format!(
        " Read less predicted: {} rms, at most {}.",
        micrometres(Some(distances.rms)),
        micrometres(Some(distances.largest))
    );
    if let Some(discrepancy_mm) = found.discrepancy_mm.filter(|mm| *mm > LEAST_MM) {
        about += &format!(
            " Standard errors count a model discrepancy of {} in each coordinate.",
            micrometres(Some(discrepancy_mm))
        );
    }
    let body = paragraph(&about) + &tables::unknowns(&run.record).html();
    section("identified", "What was identified", &body)
}
