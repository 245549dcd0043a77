//! Plans that are chosen from a list of candidates: held to all plans that there are of short lists, and their bound, too.

use elastocal::experiment::{Candidate, Experiment};
use elastocal::plan::search::{BoundKind, Candidates, PlanSize, random_plan};
use elastocal::plan::{Assessment, Criterion, Plan};
use elastocal::scenario::Scenario;
use elastocal::task::Task;
use std::fmt::Write as _;

use crate::support::{
    Workplace, assert_alike, assert_has, number, scenario, scenario_text, unwatched,
};

/// Random feasible rows, each of which may be measured so often.
fn rows(task: &Task, count: u32, most: Option<u32>) -> Vec<Candidate> {
    let plan = random_plan(task, count, 7, 0).expect("a plan");
    (plan.experiments.iter().enumerate())
        .map(|(index, each)| Candidate {
            approach: None,
            line: index + 2,
            configuration_rad: each.configuration_rad.clone(),
            load: Some(each.load),
            most,
            target: None,
            station: None,
        })
        .collect()
}

fn designed(
    task: &Task,
    candidates: &Candidates,
    criterion: Criterion,
    size: PlanSize,
) -> (Plan, Assessment) {
    let watch = unwatched();
    let (exact, bound) = candidates
        .design(task, criterion, size, 1, watch)
        .expect("a plan");
    let rho0 = candidates.bound(task, Criterion::TestPose, &exact.plan);
    let assessment = Assessment::new(task, &exact.plan, Some(&rho0)).beside(&bound, &exact.plan);
    (exact.plan, assessment)
}

/// All ways to measure so many of the candidates, each at most so often as it may be, in so many configurations.
fn all_plans(candidates: &[Experiment], size: PlanSize) -> Vec<Plan> {
    fn go(
        left: &[Experiment],
        measurements: u32,
        configurations: u32,
        plan: &Plan,
        all: &mut Vec<Plan>,
    ) {
        if measurements == 0 {
            all.push(plan.clone());
            return;
        }
        let Some((first, others)) = left.split_first() else {
            return;
        };
        go(others, measurements, configurations, plan, all);
        if configurations > 0 {
            for repeats in 1..=measurements.min(first.repeats) {
                let mut plan = plan.clone();
                plan.experiments.push(Experiment {
                    repeats,
                    ..first.clone()
                });
                go(
                    others,
                    measurements - repeats,
                    configurations - 1,
                    &plan,
                    all,
                );
            }
        }
    }
    let mut all = Vec::new();
    go(
        candidates,
        size.measurements,
        size.configurations,
        &Plan::default(),
        &mut all,
    );
    all
}

/// The best of all plans is found, and none is better than the bound, which is near.
fn holds_up(
    scenario: &Scenario,
    criterion: Criterion,
    most: Option<u32>,
    size: PlanSize,
    near: f64,
) {
    let task = &scenario.task;
    let candidates = Candidates::new(task, &rows(task, 9, most)).expect("candidates");
    let (plan, assessment) = designed(task, &candidates, criterion, size);
    assert_eq!(plan.measurements(), size.measurements);
    let value = assessment.value(criterion).expect("a value");
    let sign = if criterion.is_maximised() { -1.0 } else { 1.0 };
    let mandatory = task.design.mandatory.measurements();
    let free = PlanSize {
        measurements: size.measurements - mandatory,
        ..size
    };
    let best = (all_plans(&candidates.experiments, free).into_iter())
        .map(|free| Plan {
            experiments: [task.design.mandatory.experiments.clone(), free.experiments].concat(),
        })
        .filter_map(|plan| Assessment::new(task, &plan, None).value(criterion))
        .map(|value| sign * value)
        .fold(f64::INFINITY, f64::min);
    let case = format!("{} {} {most:?} {size:?}", scenario.name, criterion.name());
    assert!(
        (sign * value - best).abs() <= 1e-9 * best.abs(),
        "{case}: {value} against {best}"
    );
    if criterion.bounded_as().is_none() {
        assert_eq!(assessment.criterion_efficiency(), None);
        return;
    }
    let (_, bound) = assessment.asked_for().expect("a bound");
    let bound = bound.as_ref().expect("a bound");
    assert_eq!(bound.kind, BoundKind::Proved);
    assert!(
        sign * bound.best <= best * (1.0 + sign * 1e-9),
        "{case}: {} against {best}",
        bound.best
    );
    let efficiency = assessment.criterion_efficiency().expect("a bound");
    assert!(efficiency > near, "{case}: {efficiency}");
}

/// Whatever is known before, mandatory, limited or shared by repeats.
#[test]
fn the_best_of_all_plans_is_found() {
    let paper = scenario("klimchik2012");
    holds_up(
        &paper,
        Criterion::TestPose,
        None,
        PlanSize::all_different(3),
        0.8,
    );
    holds_up(
        &paper,
        Criterion::TestPose,
        Some(1),
        PlanSize::all_different(4),
        0.8,
    );
    holds_up(
        &paper,
        Criterion::TestPose,
        Some(2),
        PlanSize {
            measurements: 6,
            configurations: 3,
        },
        0.8,
    );
    holds_up(&paper, Criterion::D, None, PlanSize::all_different(4), 0.8);
    for unbounded in [Criterion::E, Criterion::G, Criterion::O3, Criterion::O5] {
        holds_up(&paper, unbounded, None, PlanSize::all_different(4), 0.0);
    }
    let mut mandatory = scenario("klimchik2012");
    let first = random_plan(&mandatory.task, 1, 3, 0).expect("a plan");
    mandatory.task.design.mandatory = first;
    holds_up(
        &mandatory,
        Criterion::TestPose,
        None,
        PlanSize::all_different(4),
        0.7,
    );
}

/// With all that a laboratory is uncertain of, repeats share errors.
#[test]
fn repeats_share_errors() {
    let mut laboratory = scenario("kr270_laboratory");
    laboratory.task.region.collision_clearance_m = None;
    laboratory.task.region.line_of_sight = false;
    let task = &laboratory.task;
    let candidates = Candidates::new(task, &rows(task, 6, None)).expect("candidates");
    let (plan, assessment) = designed(
        task,
        &candidates,
        Criterion::TestPose,
        PlanSize::all_different(4),
    );
    let rho0_m = assessment.rho0_m.expect("a prediction");
    let best = (all_plans(&candidates.experiments, PlanSize::all_different(4)).iter())
        .filter_map(|plan| Assessment::new(task, plan, None).rho0_m)
        .fold(f64::INFINITY, f64::min);
    // What makes less than 1 % of the square is left out of the search.
    assert!(rho0_m <= best * 1.01, "{rho0_m} against {best}: {plan:?}");
    assert!(assessment.bound_m().expect("a bound") <= best, "{best}");
}

fn table(plan: &Plan) -> String {
    let mut text = String::from("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n");
    for each in &plan.experiments {
        let angles: Vec<String> = (each.configuration_rad.iter())
            .map(|q| q.to_degrees().to_string())
            .collect();
        let _ = writeln!(text, "{}", angles.join(","));
    }
    text
}

/// The commands: a plan of candidates, what is left out of them, and the same bound for the plan's file; on any number of threads.
#[test]
fn commands_say_what_they_chose_from() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let task = scenario("klimchik2012").task;
    let text = table(&random_plan(&task, 60, 1, 0).expect("a plan")) + "0,0,0,0,0,0\n9,0,0,0,0,0\n";
    place.write("c.csv", &text);
    let plan = "plan s.toml --experiments 4 --candidates c.csv --plan-out p.csv";
    let one = place.json(&format!("{plan} --threads 1"));
    let two = place.json(&format!("{plan} --threads 2"));
    assert_eq!(one["plan"], two["plan"]);
    assert_eq!(one["rho0_mm"], two["rho0_mm"]);
    assert_eq!(one["bound_kind"], "proved");
    assert_eq!(one["candidates"]["offered"], 62);
    assert_eq!(one["candidates"]["possible"], 60);
    assert_eq!(one["candidates"]["left_out"][0]["line"], 62);
    assert!(number(&one["efficiency"]) > 0.8, "{one:#}");
    let again = place.json("evaluate s.toml --plan p.csv --candidates c.csv");
    assert_eq!(again["rho0_mm"], one["rho0_mm"]);
    assert_eq!(again["bound_kind"], "proved");
    let [searched, found] = [&again, &one].map(|json| number(&json["lower_bound_rho0_mm"]));
    assert_alike(searched, found, 1e-3);
    let text = place.done(plan);
    text.prints("these 60 candidates, all of which were looked at");
    text.prints("Of 62 in c.csv, 2 are left out:");
    // Another plan is none of theirs.
    place.done("plan s.toml --experiments 3 --no-proof --plan-out other.csv --quiet");
    let other = place.json("evaluate s.toml --plan other.csv --candidates c.csv");
    assert!(other["lower_bound_rho0_mm"].is_null());
    let reason = other["no_bound_reason"].as_str().expect("a reason");
    assert_has(reason, "experiment 1 is none of the candidates");
}

/// Wrong files are named by file, line and column.
#[test]
fn wrong_candidates_are_refused() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let any = scenario_text("klimchik2012").replace(
        "kind = \"fixed\"\nforce_n = [0, 0, -2500]",
        "kind = \"any\"\nforce_max_n = 2500",
    );
    place.write("any.toml", any);
    let header = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg";
    let row = "0,-84.0,126.9,-119.4,-61.2,-172.9";
    for (scenario, text, wanted) in [
        ("s", format!("{header}\n"), "no row"),
        ("s", format!("q1_deg,q2_deg\n{row}\n"), "q3_deg"),
        (
            "s",
            format!("{header},fz_n\n{row},-2500\n"),
            "come together",
        ),
        (
            "s",
            format!("{header},repeats\n{row},0.5\n"),
            "line 2: repeats: found 0.5",
        ),
        (
            "s",
            format!("{header},target\n{row},spindle\n"),
            "line 2: target: found \"spindle\"",
        ),
        ("s", format!("{header},where\n{row},1\n"), "where"),
        (
            "s",
            format!("{header},direction_x,direction_y,direction_z\n{row},0,0,1\n"),
            "candidates have no directions, a gauge reads each along any of instrument.directions",
        ),
        (
            "s",
            format!("{header}\n0,0,0,0,0,0\n"),
            "none of 1 candidates is possible",
        ),
        ("s", format!("{header}\n{row}\n{row}\n"), "separate"),
        (
            "s",
            format!("{header},repeats\n{row},1\n0,-106.0,106.8,49.4,-38.5,22.2,1\n"),
            "the candidates allow 2 measurements, and 3 are wanted",
        ),
        ("any", format!("{header}\n{row}\n"), "does not say which"),
    ] {
        place.write("c.csv", &text);
        let outcome = place.refused(&format!(
            "plan {scenario}.toml --experiments 3 --candidates c.csv --quiet"
        ));
        outcome.says(wanted);
    }
    place.misused("plan s.toml --candidates c.csv --prove 1%");
    place.misused("plan s.toml --candidates c.csv --minutes 60");
}
