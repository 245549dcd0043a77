//! What exchanging one measurement of a plan can gain, proved: against optima known by hand and against exchanges of every
//! kind.

use elastocal::compensation::test_pose_matrix;
use elastocal::plan::proof::ProofLimits;
use elastocal::plan::search::{Exchanges, NoBound, Problem, RandomPlans};
use elastocal::plan::{Criterion, Plan};
use elastocal::scenario::Scenario;
use serde_json::{Value, json};

use crate::planning::designed;
use crate::proofs::{Edit, all_are_refused, checked, python, scale};
use crate::support::{Workplace, project, scenario, scenario_text};

const LIMITS: ProofLimits<'static> = ProofLimits {
    gap: 1e-3,
    boxes: 100_000,
    stop: &|| false,
    progress: &|_, _| {},
};

fn exchanges(scenario: &Scenario, criterion: Criterion, plan: &Plan) -> Exchanges {
    Exchanges::prove(
        &scenario.task,
        criterion,
        scenario.seed,
        plan,
        (LIMITS, false),
    )
    .expect("a statement")
}

/// With one unknown, every measurement tells at most L^4 F^2 / sigma^2 of it (see `known_optima`), so that the best exchange
/// puts a stretched arm in the place of a bent one, and nothing in the place of a stretched one gains anything.
#[test]
fn a_bent_arm_is_exchanged_for_a_stretched_one() {
    let mut scenario = scenario("planar_3r");
    scenario.task.belief.parameters = vec![0];
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let mut plan = designed(&problem, 1, 1, 1).expect("there is a plan").1.plan;
    let column = test_pose_matrix(&scenario.task.belief, &scenario.task.test_poses[0], &[0]);
    let optimum = |m: f64| 0.03e-3 * column.norm() / (m.sqrt() * 1.7_f64.powi(2) * 200.0);
    let near = |value: f64, optimum: f64| value <= optimum && value > 0.995 * optimum;
    let alone = exchanges(&scenario, Criterion::TestPose, &plan);
    assert!((alone.value / optimum(1.0) - 1.0).abs() < 1e-6);
    assert!(alone.largest_gain().is_some_and(|gain| gain < 5e-3));
    let mut bent = plan.experiments[0].clone();
    bent.configuration_rad[1] += 0.8;
    plan.experiments[0].repeats = 2;
    plan.experiments.push(bent);
    let both = exchanges(&scenario, Criterion::TestPose, &plan);
    assert!(both.value > 1.05 * optimum(3.0));
    assert_eq!(both.each.len(), 2);
    let best = both.best().expect("it is proved");
    assert!(near(best, optimum(3.0)), "{best} against {}", optimum(3.0));
    let proved = |index: usize| both.each[index].proof.as_ref().expect("it is proved").best;
    assert!(near(proved(1), optimum(3.0)) && near(proved(0), both.value));
    assert!((both.each[1].found / optimum(3.0) - 1.0).abs() < 1e-4);
    let gain = both.largest_gain().expect("it is proved");
    assert!((gain - (1.0 - best / both.value)).abs() < 1e-12);
    assert_eq!(
        both.boxes(),
        (both.each.iter())
            .map(|each| each.proof.as_ref().expect("it is proved").boxes)
            .sum::<u64>()
    );
}

/// Random experiments in the place of every one of a plan, and what searches come across: none is better than what is
/// proved. Mandatory experiments stay.
#[test]
fn no_exchange_beats_what_is_proved() {
    let mut scenario = scenario("spatial_3r");
    for criterion in [
        Criterion::TestPose,
        Criterion::A,
        Criterion::D,
        Criterion::E,
        Criterion::G,
        Criterion::O5,
    ] {
        let problem = Problem::new(&scenario.task, criterion);
        let mut random_plans = RandomPlans::new(&problem, 7);
        let mut plan = random_plans.draw(3, 0).expect("there is a plan");
        plan.experiments[1].repeats = 2;
        let proved = exchanges(&scenario, criterion, &plan);
        assert_eq!(proved.each.len(), 3);
        let is_better = |one: f64, other: f64| {
            if criterion.is_maximised() {
                one > other
            } else {
                one < other
            }
        };
        for each in &proved.each {
            let best = each.proof.as_ref().expect("it is proved").best;
            assert!(!is_better(each.found, best), "{criterion:?}");
            for run in 1..150 {
                let one = random_plans.draw(1, run).expect("there is a plan");
                let mut exchanged = plan.clone();
                let place = &mut exchanged.experiments[each.experiment];
                place.repeats -= 1;
                if place.repeats == 0 {
                    exchanged.experiments.remove(each.experiment);
                }
                exchanged.experiments.extend(one.experiments);
                let value = problem.cost().value(&problem.information(&exchanged));
                assert!(value.is_none_or(|value| !is_better(value, best)));
            }
        }
    }
    let problem = Problem::new(&scenario.task, Criterion::TestPose);
    let plan = (RandomPlans::new(&problem, 7).draw(3, 0)).expect("there is a plan");
    let mut mandatory = plan.clone();
    mandatory.experiments.truncate(1);
    scenario.task.design.mandatory = mandatory.clone();
    let beside = exchanges(&scenario, Criterion::TestPose, &plan);
    let places: Vec<usize> = beside.each.iter().map(|each| each.experiment).collect();
    assert_eq!(places, [1, 2]);
    let lacking = Plan {
        experiments: plan.experiments[1..].to_vec(),
    };
    let error = Exchanges::prove(
        &scenario.task,
        Criterion::TestPose,
        1,
        &lacking,
        (LIMITS, false),
    );
    assert!(matches!(error, Err(NoBound::NotMandatory(_))));
}

#[test]
fn commands_prove_exchanges_where_asked() {
    let place = Workplace::new();
    let scenario = project("scenarios/spatial_3r.toml");
    let scenario = scenario.display();
    let planned = place.run(&format!(
        "plan {scenario} --experiments 4 --plan-out plan.csv --prove-exchanges --json --quiet"
    ));
    let planned = planned.json();
    let evaluate = format!("evaluate {scenario} --plan plan.csv --quiet");
    let judged = place
        .run(&format!("{evaluate} --prove-exchanges --json"))
        .json();
    for json in [&planned, &judged] {
        let exchanges = &json["exchanges"];
        let number = |key: &str| exchanges[key].as_f64().unwrap_or(f64::NAN);
        let gain = number("proved_largest_gain");
        assert!((0.0..0.2).contains(&gain), "{gain}");
        let rho0_mm = json["rho0_mm"].as_f64().expect("a number");
        assert!(number("proved_best") <= rho0_mm && number("boxes") > 0.0);
        assert!(exchanges["reason"].is_null());
        for each in exchanges["experiments"].as_array().expect("a list") {
            assert!(each["proved"].as_f64() <= each["found"].as_f64());
            assert!(each["proof"]["boxes"].is_u64() && each["no_proof_reason"].is_null());
        }
    }
    let text = place.run(&format!("{evaluate} --prove-exchanges")).stdout;
    let told = "Proved: exchanging any one measurement for any other gains at most ";
    assert!(text.contains(told), "{text}");
    let plain = place.run(&format!("{evaluate} --json")).json();
    assert!(plain["exchanges"].is_null());
    let refused = place.run(&format!("{evaluate} --criterion o2 --prove-exchanges"));
    let reason =
        "Nothing is proved of exchanges: no bound was found: the criterion o2 is not convex";
    assert!(refused.stdout.contains(reason), "{}", refused.stdout);
    let contrary = place.run(&format!("{evaluate} --no-proof --prove-exchanges"));
    assert_eq!(contrary.code, Some(2));
}

/// Exchanges by `rho_0` with more in each reading than noise, and by another criterion.
#[test]
fn another_program_checks_exchanges_and_refuses_what_was_tampered_with() {
    let Some(python) = python() else { return };
    let place = Workplace::new();
    let text = scenario_text("planar_3r");
    let uncertain = "[[uncertainty]]\nkind = \"joint_return\"\nstd_mrad = 0.05\n";
    place.write("uncertain.toml", format!("{text}\n{uncertain}"));
    let plain = project("scenarios/spatial_3r.toml");
    for (scenario, criterion) in [
        ("uncertain.toml".to_owned(), "test-pose"),
        (plain.display().to_string(), "d"),
        (plain.display().to_string(), "o5"),
    ] {
        let options = format!("{scenario} --criterion {criterion} --quiet");
        let planned = place.run(&format!(
            "plan {options} --experiments 3 --no-proof --plan-out plan.csv"
        ));
        assert_eq!(planned.code, Some(0), "{planned:?}");
        let judged = place.run(&format!(
            "evaluate {options} --plan plan.csv --prove 10% --prove-exchanges --proof-out proof.json --json"
        ));
        let gain = judged.json()["exchanges"]["proved_largest_gain"].as_f64();
        let (code, text) = checked(&python, &place.path("proof.json"));
        assert_eq!(code, Some(0), "{criterion}: {text}");
        let gain = gain.expect("it is proved") * 100.0;
        let told = format!("exchanging any one measurement gains at most {gain:.3} %");
        assert!(text.contains(&told), "{criterion}: {told}: {text}");
    }
    let whole: Value = serde_json::from_str(&place.read("proof.json")).expect("it is JSON");
    let tampered: [(&str, Edit); 12] = [
        ("a proof left out", &|file| {
            let proofs = file["exchanges"]["proofs"].as_array_mut();
            proofs.expect("a list").pop();
        }),
        ("all proofs left out", &|file| {
            file["exchanges"]["proofs"] = json!([]);
        }),
        ("a proof in place of another", &|file| {
            file["exchanges"]["proofs"][0] = file["exchanges"]["proofs"][1].clone();
        }),
        ("a proof for another experiment", &|file| {
            file["exchanges"]["proofs"][0][0] = json!(1);
        }),
        ("a smaller largest derivative", &|file| {
            scale(
                &mut file["exchanges"]["proofs"][0][1]["proof"]["largest"],
                0.7,
            );
        }),
        ("less gained in one place", &|file| {
            scale(
                &mut file["exchanges"]["proofs"][0][1]["bounds"][0][1],
                1.001,
            );
        }),
        ("less gained in all", &|file| {
            scale(&mut file["exchanges"]["best"], 1.001);
        }),
        ("a worse plan", &|file| {
            scale(&mut file["exchanges"]["value"], 0.99);
        }),
        ("another plan", &|file| {
            scale(
                &mut file["exchanges"]["plan"][0]["configuration_rad"][1],
                0.9,
            );
        }),
        ("an experiment measured twice", &|file| {
            file["exchanges"]["plan"][0]["repeats"] = json!(2);
        }),
        ("less of the others", &|file| {
            scale(&mut file["exchanges"]["proofs"][0][1]["mandatory"][1], 0.99);
        }),
        ("another region", &|file| {
            let region = &mut file["exchanges"]["proofs"][0][1]["proof"]["question"]["region"];
            scale(&mut region["height_m"][0], 1.5);
        }),
    ];
    all_are_refused(&place, &python, &whole, &tampered);
}
