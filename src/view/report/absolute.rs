//! The page of a plan of absolute readings: what is predicted, of what it is made, what to read, and what virtual robots make of it.

use super::cards::{conditions_card, readings_cards, verdict_card};
use super::distances::{distances_figure, distances_table, lines};
use super::overview::next_steps;
use super::test_poses::test_poses;
use super::{PlanPage, plan_row, plan_table, sources};
use crate::observation::LengthKind;
use crate::quantities::units::shown_unit;
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::robot_trials::RobotTrials;
use crate::study::verdict::Kept;
use crate::text::wording::{counted, dash, micrometres, naming, percent};
use crate::view::card::Card;
use crate::view::markup::{micro_sign, paragraph, paragraphs, section};
use crate::view::tables::{self, RecordTable};
use crate::workflow::run::{AbsoluteRun, RUN};

/// A smaller discrepancy (mm) is not said.
const LEAST_MM: f64 = 5e-6;

/// Which accuracy a page of absolute readings is about.
pub const ABSOLUTE_ACCURACY: &str = "An absolute accuracy: where the loaded tool is, with frames, geometry and elasticity as far as they are unknown.";

/// The page of a plan of absolute readings as HTML; with what virtual robots made of it, where some were drawn, and of its run, where it was
/// carried out.
pub fn absolute_page(
    shown: &PlanPage<'_>,
    plan: &AbsolutePlanMessage,
    trials: Option<&RobotTrials>,
    run: Option<&AbsoluteRun<'_>>,
) -> String {
    let scenario = shown.scenario;
    let mut cards = readings_cards(plan, run);
    if let Some(trials) = trials {
        let is_kept = trials.prediction == Kept::Holds;
        let verdict = trials.runs.verdict.as_deref().unwrap_or_default();
        cards.push(verdict_card(is_kept, verdict, trials.outcome()));
    }
    if !plan.assumed_exact.is_empty() {
        let about = plan.assumed_exact.join("; ") + ".";
        let answer = "not all is in the prediction";
        cards.push(Card::new("bad", "Assumed exact", answer, about));
    }
    cards.extend(conditions_card(shown.conditions));
    let trials =
        trials.map(|trials| section("trials", "Do virtual robots keep it?", &of_trials(trials)));
    let mut body = trials.unwrap_or_default();
    let about = "Contributions are what the instrument's noise and each error source leave, rms, to first order; squares add up. \
                 Frames, and what else nothing is known of before, are found from readings: they are in the contributions of what \
                 disturbs these.";
    body += &sources::budget_section(plan.uncertainty_budget.as_ref(), about);
    if plan.test_poses.len() > 1 || run.is_some() {
        let predicted_mm: Vec<_> = plan.test_poses.iter().map(|pose| pose.rho0_mm).collect();
        let observed = run.map(|run| (&*run.record.test_poses, "of the nominal robot"));
        let poses = &scenario.task.test_poses;
        body += &test_poses(poses, &predicted_mm, plan.rho0_mm, observed);
    }
    body += &run.map_or_else(String::new, identified);
    body += &next_steps(shown, None);
    let readings = readings(shown, plan, run.is_some());
    body += &section("readings", "What to read", &readings);
    body += &section("unknowns", "What is found", &unknowns(plan));
    let titles = match run {
        Some(_) => ["Calibration for absolute accuracy", "calibration report"],
        None => ["Plan of absolute readings", "plan of absolute readings"],
    };
    shown.page(titles, cards, &body)
}

/// The verdict in words, the distances that were left, and the numbers.
fn of_trials(trials: &RobotTrials) -> String {
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
    paragraph(&said) + &hidden + &distances_figure(&lines, caption) + &distances_table(&lines)
}

/// The stills, and the plan as a table.
fn readings(shown: &PlanPage<'_>, plan: &AbsolutePlanMessage, is_run: bool) -> String {
    let own = &shown.scenario.task.belief.calibration_tool.name;
    let is_read = |kind: &LengthKind| {
        let mut lengths = plan.plan.iter().filter_map(|reading| reading.length.0);
        lengths.any(|length| length.kind == *kind)
    };
    let kinds: Vec<LengthKind> = LengthKind::ALL.into_iter().filter(is_read).collect();
    let rows = (plan.plan.iter().enumerate()).map(|(index, reading)| {
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
    let same = if is_run {
        "plan.csv has"
    } else {
        "--plan-out writes"
    };
    plan_table(shown, same, &own, rows)
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
    let header = "unknown | standard error | unit | what it is";
    let numbers = RecordTable::new(header, rows).html();
    let has_logarithms = plan.unknowns.iter().any(|each| each.unit == "1");
    let logarithms = has_logarithms.then_some(" Of a logarithm the unit is 1.");
    paragraph(&format!(
        "{count}: the frames of stations and reflectors, which every such plan finds, and what else is unknown of the robot.{}",
        logarithms.unwrap_or_default()
    )) + &format!(
        "<details><summary>How well each is known afterwards</summary>\n{numbers}</details>\n"
    )
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
