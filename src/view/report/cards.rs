//! Questions with their answers, in the overview that a page begins with and on a terminal: of a plan and of a run, which plan, how
//! accurate, proved by what, what was observed, and against random plans.

use serde::Serialize;

use super::{PlanPage, each_once};
use crate::calibration::{CompensatedPose, rms_m};
use crate::codes::Condition;
use crate::plan::search::{BoundKind, RepeatsNeeded};
use crate::plan::{Assessment, UncertaintyBudget};
use crate::record::absolute_plan::AbsolutePlanMessage;
use crate::record::evidence::EvidenceMessage;
use crate::scenario::Scenario;
use crate::text::for_terminal;
use crate::text::wording::{counted, joined, micrometres, naming, number, percent};
use crate::workflow::run::{AbsoluteRun, RANDOM_PLANS, RUN, RunOutcome, TriedPlan};

/// What holds where there is nothing to look at.
const ALL_HOLD: &str =
    "the residuals fit the instrument, and the plan keeps all bounds of the scenario.";
/// What holds beside it, where it does.
const ALL_DETERMINED: &str = "every compliance that was asked for is determined";
/// Searches of which at least this share agree count as agreeing.
const MANY: f64 = 0.05;

/// What it is about, the answer in a line, and what is to be known of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Card {
    /// `good`, `bad` (which a page shows open) or nothing.
    tone: &'static str,
    title: &'static str,
    answer: String,
    about: String,
}

impl Card {
    /// A card in a tone.
    pub fn new(
        tone: &'static str,
        title: &'static str,
        answer: impl Into<String>,
        about: impl Into<String>,
    ) -> Self {
        Self {
            tone,
            title,
            answer: answer.into(),
            about: about.into(),
        }
    }

    /// For a terminal: a line.
    pub fn plain(&self) -> String {
        let Self { title, answer, .. } = self;
        let colon = if title.ends_with('?') { "" } else { ":" };
        let text = format!("{title}{colon} {answer}. {}", self.about);
        for_terminal(&text).trim_end().to_owned() + "\n"
    }
}

/// A length (m), for a person.
fn length(value_m: Option<f64>) -> String {
    micrometres(value_m.map(|value_m| value_m * 1e3))
}

/// Of a run of deflections.
pub fn run_cards(scenario: &Scenario, outcome: &RunOutcome, own: &TriedPlan) -> Vec<Card> {
    let assessment = &own.assessment;
    let measurements = counted(assessment.experiments.into(), "measurement");
    let configurations = counted(own.record.plan.len() as u64, "configuration");
    let parameters = scenario.task.belief.parameter_names();
    let place = "the distance of the loaded tool from its place";
    let cards = [
        Card::new(
            "",
            "Plan",
            format!("{measurements} in {configurations}"),
            naming(parameters, "Identifies the compliance of {}."),
        ),
        accuracy_card(own),
        observed_card(&own.calibration.poses, assessment.rho0_m, place, ""),
        proof_card(&outcome.evidence, assessment),
    ];
    let (median_m, repeats) = (outcome.random_rho0_m, repeats(outcome.random_repeats));
    let random = random_card(median_m, assessment.rho0_m, "", &repeats);
    cards.into_iter().chain(random).collect()
}

/// Of a plan of absolute readings, and of its run, where there was one.
pub fn readings_cards(plan: &AbsolutePlanMessage, run: Option<&AbsoluteRun<'_>>) -> Vec<Card> {
    let rows = || plan.plan.iter();
    let configurations = each_once(rows().map(|row| &row.q_deg)).len();
    let loaded = rows().filter(|row| row.wrench.is_some()).count();
    let reads = || rows().filter_map(|row| row.reads.as_ref());
    let targets = each_once(reads().filter_map(|reads| reads.target.as_ref()));
    let stations = each_once(reads().filter_map(|reads| reads.station.as_ref()));
    let readings = counted(plan.experiments.into(), "reading");
    let about = format!(
        "{loaded} of {} under a load.{}{}",
        counted(plan.plan.len() as u64, "row"),
        naming(targets, " Reflectors: {}."),
        naming(stations, " Stations: {}.")
    );
    let configurations = counted(configurations as u64, "configuration");
    let answer = format!("{readings} in {configurations}");
    let mut cards = vec![
        Card::new("", "Plan", answer, about),
        absolute_accuracy_card(plan),
        best_card(plan),
    ];
    if let Some(run) = run {
        let rho0_m = plan.rho0_mm.map(|value| value * 1e-3);
        let [before_m, _] = rms_m(&run.poses);
        let nominal = format!(
            " Of the nominal robot, in the frames that suit the same readings best: {}.",
            length(Some(before_m))
        );
        let place = "the distance of the loaded tool from where the identified robot predicts it";
        cards.push(observed_card(&run.poses, rho0_m, place, &nominal));
        let of = format!(" of {readings} of the same candidates");
        cards.extend(random_card(run.random_rho0_m, rho0_m, &of, ""));
    }
    cards
}

fn accuracy_card(own: &TriedPlan) -> Card {
    let (assessment, poses) = (&own.assessment, &*own.record.test_poses);
    let largest = poses.iter().map(|pose| pose.uncompensated_mm);
    let bent = micrometres(largest.max_by(f64::total_cmp));
    let uncompensated = match poses {
        [pose] => format!("at \u{201c}{}\u{201d} it bends by {bent}", pose.name),
        _ => format!("it bends by up to {bent}"),
    };
    let counts = UncertaintyBudget::in_words(assessment.uncertainty_budget.as_ref(), "measurement");
    let quantile = assessment.quantile95_m.map(|value_m| length(Some(value_m)));
    let below = naming(quantile, "; 95 % stay below {}");
    let about = format!(
        "\u{3c1}\u{2080}, the rms distance between the loaded tool and its place, predicted {counts}{below}: a relative accuracy, of what \
         the load bends. Uncompensated, {uncompensated}."
    );
    let answer = length(assessment.rho0_m) + " rms";
    Card::new("", "Accuracy after compensation", answer, about)
}

fn absolute_accuracy_card(plan: &AbsolutePlanMessage) -> Card {
    let station = naming(&plan.frame, "the frame of station \u{201c}{}\u{201d}");
    let frame = match &*station {
        "" => "the instrument's frame",
        station => station,
    };
    let quantile = plan.quantile95_mm.map(|value| micrometres(Some(value)));
    let below = naming(quantile, " 95 % stay below {}.");
    let force = (plan.task_force_mm > 0.0).then(|| micrometres(Some(plan.task_force_mm)));
    let force = naming(
        force,
        " Of it, {} are the task's uncertain force, whatever is read.",
    );
    let counts = UncertaintyBudget::in_words(plan.uncertainty_budget.as_ref(), "reading");
    let about = format!(
        "\u{3c1}\u{2080}, the rms distance of the loaded tool from where it should be in {frame}: an absolute accuracy. Frames, \
         geometry and elasticity count as far as they are unknown; in a relative one, as in the paper, only what the load bends.\
         {below}{force} It is predicted {counts}."
    );
    let answer = micrometres(plan.rho0_mm) + " rms";
    Card::new("", "Absolute accuracy", answer, about)
}

/// What was observed, beside what is predicted (m).
fn observed_card(
    poses: &[CompensatedPose],
    rho0_m: Option<f64>,
    what: &str,
    besides: &str,
) -> Card {
    let [_, after_m] = rms_m(poses);
    let about = format!(
        "Residual error in run {RUN} on the virtual robot: {what}, rms over the test poses; predicted {} rms.{besides}",
        length(rho0_m)
    );
    Card::new("", "Observed in this run", length(Some(after_m)), about)
}

fn proof_card(evidence: &EvidenceMessage, assessment: &Assessment) -> Card {
    let (searches, agreeing) = (evidence.bound_searches, evidence.bound_searches_agreeing);
    let (Some(bound), Some(efficiency)) = (assessment.bound_m(), assessment.efficiency()) else {
        let reason = naming(assessment.no_bound(), ": {}");
        let about = format!("Nothing is known about better plans{reason}.");
        return Card::new("bad", BEST, "no bound", about);
    };
    let found = assessment.bound();
    let proof = found.and_then(|bound| bound.proof.as_ref());
    let is_proved = found.is_some_and(|bound| bound.kind == BoundKind::Proved) && proof.is_some();
    let by = |boxes| format!("by branch and bound over {boxes} boxes of configurations");
    let proved = match proof {
        None => "There is no proof.".to_owned(),
        Some(proof) if is_proved => format!("That is proved, {}.", by(proof.boxes)),
        Some(proof) => format!(
            "Proved, {}: none can be below {}{}.",
            by(proof.boxes),
            length(Some(proof.best)),
            naming(&proof.left_out, ", with {} assumed exact")
        ),
    };
    let searched = format!(
        "The bound rests on {searches} local searches for a more telling experiment; {agreeing} ended in the same best one: strong \
         evidence. {proved}"
    );
    let basis = if is_proved { &proved } else { &searched };
    let is_sure = is_proved || agreeing as f64 >= MANY * searches as f64;
    bound_card(is_sure, bound * 1e3, efficiency, "measurements", basis)
}

fn best_card(plan: &AbsolutePlanMessage) -> Card {
    let (Some(bound), Some(efficiency)) = (plan.lower_bound_rho0_mm, plan.efficiency) else {
        let about = "Without candidates, nothing is said about better plans: give --candidates.";
        return Card::new("", BEST, "no bound", about);
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
    let is_sure = plan.drawn.is_none();
    bound_card(is_sure, bound, efficiency, "candidates", &basis)
}

const BEST: &str = "Is it the best?";

/// A card that says by how much a plan of as many could be better, and on what the bound (mm) rests.
fn bound_card(is_sure: bool, bound_mm: f64, efficiency: f64, noun: &str, basis: &str) -> Card {
    let better = percent(Some((1.0 - efficiency).max(0.0)), 1);
    let about = format!(
        "No plan of as many {noun} can be below {}: efficiency {}. {basis}",
        micrometres(Some(bound_mm)),
        percent(Some(efficiency), 1)
    );
    let tone = if is_sure { "good" } else { "" };
    Card::new(tone, BEST, format!("at most {better} can be gained"), about)
}

/// A card of what random plans predict (m) in the median, beside the plan's own; nothing where there are none.
fn random_card(median_m: Option<f64>, own_m: Option<f64>, of: &str, repeats: &str) -> Option<Card> {
    let (median_m, own_m) = median_m.zip(own_m)?;
    let about = format!(
        "Median predicted accuracy of {RANDOM_PLANS} random plans{of}: {}.{repeats}",
        length(Some(median_m))
    );
    let answer = format!("{} times as accurate", number(Some(median_m / own_m), 1));
    Some(Card::new("", "Against a random plan", answer, about))
}

/// How often a random plan is to be repeated for the accuracy of the designed one.
fn repeats(needed: Option<RepeatsNeeded>) -> String {
    match needed {
        Some(RepeatsNeeded::Times(times)) => {
            format!(" That plan gets as far if it is measured {times} times as a whole.")
        }
        Some(RepeatsNeeded::Never(limit_m)) => format!(
            " No number of repeats of that plan gets as far: {} remain however often it is measured.",
            length(Some(limit_m))
        ),
        None => String::new(),
    }
}

/// A card of what became of a prediction.
pub(super) fn verdict_card(is_kept: bool, verdict: &str, about: impl Into<String>) -> Card {
    let tone = if is_kept { "good" } else { "bad" };
    Card::new(tone, "Does the prediction hold?", verdict, about)
}

/// A card of what must be looked at, or that all holds.
pub(super) fn checks_card(shown: &PlanPage<'_>, outcome: &RunOutcome) -> Card {
    let violating = (outcome.tried.iter().skip(1))
        .filter(|plan| plan.assessment.violated().is_some())
        .map(|plan| &plan.record.name);
    let words = " Of the plans beside it, {} keep not all of them.";
    let of_others = naming(violating, words);
    let found = outcome.tried[0]
        .calibration
        .identification
        .parameters
        .iter();
    let unknown = found.filter(|each| each.estimate.is_none());
    let unknown = unknown.map(|each| &each.name);
    let unknown = naming(unknown, "the plan does not determine the compliance of {}");
    let (tone, answer, determined) = match (&*unknown, &*of_others) {
        ("", "") => ("good", "all hold", ALL_DETERMINED),
        ("", _) => ("good", "all hold for this plan", ALL_DETERMINED),
        (unknown, _) => ("", "not every compliance is determined", unknown),
    };
    let about = format!("On the virtual robot: {determined}, {ALL_HOLD}{of_others}");
    let holds = || Card::new(tone, "Checks", answer, about);
    conditions_card(shown.conditions).unwrap_or_else(holds)
}

/// A card of what must be looked at, if something must.
pub(super) fn conditions_card(conditions: &[Condition]) -> Option<Card> {
    let count = counted(conditions.len() as u64, "condition") + " to look at";
    let about = joined(conditions, "; ") + ".";
    (!conditions.is_empty()).then(|| Card::new("bad", "Checks", count, about))
}
