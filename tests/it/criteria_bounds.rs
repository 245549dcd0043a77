//! Bounds by the criteria of Table 1 that are convex: against optima known by hand, against plans of every kind, proved
//! and checked; and what is said of those that have none.

use elastocal::plan::proof::ProofLimits;
use elastocal::plan::search::{Bound, BoundKind, Problem, RandomPlans, approximate_design};
use elastocal::plan::{Assessment, Criterion, Plan};
use elastocal::scenario::Scenario;
use serde_json::Value;

use crate::planning::exact;
use crate::proofs::{checked, python};
use crate::support::{Workplace, project, scenario};

const CONVEX: [Criterion; 7] = [
    Criterion::A,
    Criterion::D,
    Criterion::E,
    Criterion::G,
    Criterion::O1,
    Criterion::O3,
    Criterion::O5,
];

fn proved(scenario: &Scenario, criterion: Criterion, size: u32) -> Bound {
    let effort = ProofLimits {
        gap: 1e-3,
        boxes: 200_000,
        stop: &|| false,
        progress: &|_, _| {},
    };
    let proof = Some((effort, false));
    Bound::search_and_prove(&scenario.task, criterion, scenario.seed, &[size], proof)
}

/// How good a value is beside a bound: 1 or less.
fn efficiency(criterion: Criterion, value: f64, best: f64) -> f64 {
    if criterion.is_maximised() {
        value / best
    } else {
        best / value
    }
}

// The optimum of every criterion is derived beside the test of `known_optima` that splits one measurement, for the
// spatial arm with a known elbow under a force of any direction: s_j = k_j^2 m L^4 F^2 / sigma^2. The smallest eigenvalue of
// the best plan by E is double, and both variances of that by G are the largest.
#[test]
fn bounds_are_the_optima_that_are_known_by_hand() {
    let mut scenario = scenario("spatial_3r");
    scenario.task.belief.parameters = vec![0, 1];
    let information = (1.5_f64.powi(2) * 400.0 / 0.03e-3).powi(2);
    for measurements in [1, 3] {
        let s: Vec<f64> = scenario.task.belief.nominal.compliance_rad_per_nm[..2]
            .iter()
            .map(|k| k.powi(2) * f64::from(measurements) * information)
            .collect();
        let sum = |power: f64| s[0].powf(power) + s[1].powf(power);
        let e = sum(-1.0).recip();
        for criterion in CONVEX {
            let optimum = match criterion {
                Criterion::A => sum(-0.5).powi(2),
                Criterion::D => (s[0] * s[1]).sqrt() / 2.0,
                Criterion::O1 => ((s[0] * s[1]).sqrt() / 2.0).sqrt(),
                Criterion::E => e,
                Criterion::G => e.recip(),
                Criterion::O3 => e.sqrt(),
                _ => sum(-1.0 / 3.0).powf(1.5),
            };
            let bound = proved(&scenario, criterion, measurements)
                .of_size(measurements)
                .expect("a bound");
            let proof = bound.proof.expect("a proof");
            for best in [bound.best, proof.best] {
                // Room for printed loads and the proof's gap.
                let found = efficiency(criterion, optimum, best);
                assert!(found <= 1.0 && found > 0.993, "{criterion:?}: {found}");
            }
        }
    }
}

/// Random plans, and plans of very many measurements that come near the approximate design, of the shipped arms: none is
/// better than its bound, and the latter are as good but for what printed loads are allowed.
#[test]
fn no_plan_beats_the_bound_of_its_criterion() {
    for name in ["planar_3r", "spatial_3r", "klimchik2012"] {
        let scenario = scenario(name);
        for criterion in CONVEX {
            let problem = Problem::new(&scenario.task, criterion);
            let design = approximate_design(&problem, 2).expect("there is a design");
            let bound = Bound::by(&scenario.task, criterion, &design);
            let weighed = design.support.iter().zip(&design.weights);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "up to 1e5"
            )]
            let near = Plan {
                experiments: weighed
                    .map(|(point, weight)| point.experiment((weight * 1e5).ceil() as u32))
                    .collect(),
            };
            let mut random_plans = RandomPlans::new(&problem, 5);
            let mut plans: Vec<Plan> = (0..30)
                .map(|run| random_plans.draw(4, run).expect("there is a plan"))
                .collect();
            plans.push(near);
            let efficiencies: Vec<f64> = (plans.iter())
                .filter_map(|plan| {
                    Assessment::new(&scenario.task, plan, None)
                        .beside(&bound, plan)
                        .criterion_efficiency()
                })
                .collect();
            let best = efficiencies.iter().copied().fold(0.0, f64::max);
            assert!(efficiencies.len() > 20, "{name} {criterion:?}");
            assert!(best <= 1.0 && best > 0.993, "{name} {criterion:?}: {best}");
        }
    }
}

/// A search for many measurements comes within 0.1 % of the best that there can be, also where several eigenvalues are
/// the smallest.
#[test]
fn many_measurements_come_near_the_bound() {
    let scenario = scenario("planar_3r");
    for criterion in CONVEX {
        let mut problem = Problem::new(&scenario.task, criterion);
        problem.effort.searches = 8;
        let design = approximate_design(&problem, 3).expect("there is a design");
        let certificate = &design.certificate;
        let m = 1000;
        // What no plan with loads as they are is better than.
        let least = certificate.cost.powi(2) / (certificate.largest_inside * f64::from(m));
        let best = criterion.value_of_cost(least);
        let plan = exact(&problem, &design, m, 12, 3).expect("there is a plan");
        let information = problem.information(&plan.plan);
        let value = problem.cost().value(&information).expect("regular");
        let found = efficiency(criterion, value, best);
        assert!(
            found > 0.999 && found < 1.0 + 1e-6,
            "{criterion:?}: {found}"
        );
    }
}

/// So does one that may take as many configurations as measurements, without a search: the design's weights, rounded.
#[test]
fn many_measurements_round_the_design() {
    let scenario = scenario("klimchik2012");
    for criterion in [
        Criterion::TestPose,
        Criterion::A,
        Criterion::D,
        Criterion::O1,
        Criterion::O5,
    ] {
        let problem = Problem::new(&scenario.task, criterion);
        let design = approximate_design(&problem, 3).expect("there is a design");
        let m = 1000;
        let plan = exact(&problem, &design, m, m, 3).expect("there is a plan");
        assert_eq!(plan.searches, 0, "{criterion:?}");
        assert_eq!(plan.plan.measurements(), m);
        let certificate = &design.certificate;
        let least = certificate.cost.powi(2) / (certificate.largest_inside * f64::from(m));
        let information = problem.information(&plan.plan);
        let value = problem.cost().value(&information).expect("regular");
        let found = efficiency(criterion, value, criterion.value_of_cost(least));
        assert!(
            found > 0.999 && found < 1.0 + 1e-6,
            "{criterion:?}: {found}"
        );
    }
}

/// Costs, their smooth stand-ins and minus their derivatives.
#[test]
fn smooth_stand_ins_have_the_derivatives_of_differences() {
    let information =
        nalgebra::DMatrix::from_row_slice(3, 3, &[5.0, 1.0, 0.2, 1.0, 4.0, -0.5, 0.2, -0.5, 3.0]);
    let poses = nalgebra::DMatrix::identity(3, 3);
    for criterion in [Criterion::E, Criterion::O3, Criterion::G] {
        let plain = elastocal::plan::CriterionFunction::new(criterion, poses.clone());
        let mut room = information.clone();
        let worst = plain.clone().cost(&information, &mut room);
        for power in [2.0, 16.0, 64.0] {
            let mut smooth = plain.clone().smoothed(power);
            let mut directions = information.clone();
            let cost = smooth.cost(&information, &mut directions);
            assert!(cost >= worst && cost <= worst * 3.0_f64.powf(1.0 / power));
            for (row, column) in [(0, 0), (1, 1), (0, 2), (1, 2)] {
                let step = 1e-5;
                let mut at = |sign: f64| {
                    let mut moved = information.clone();
                    moved[(row, column)] += sign * step;
                    if row != column {
                        moved[(column, row)] += sign * step;
                    }
                    smooth.cost(&moved, &mut room)
                };
                let slope = (at(-1.0) - at(1.0)) / (2.0 * step);
                let both = if row == column { 1.0 } else { 2.0 };
                let expected = both * directions[(row, column)];
                assert!(
                    (slope - expected).abs() < 1e-6 * cost,
                    "{criterion:?} {power}"
                );
            }
        }
    }
}

#[test]
fn commands_tell_and_write_the_proof_of_every_criterion() {
    let place = Workplace::new();
    let scenario = project("scenarios/spatial_3r.toml");
    let python = python();
    for criterion in ["test-pose", "a", "d", "e", "g", "o1", "o3", "o5"] {
        let arguments = format!(
            "plan {} --experiments 3 --criterion {criterion} --prove 10% --proof-out proof.json --json --quiet \
             --plan-out plan.csv",
            scenario.display()
        );
        let json: Value = place.run(&arguments).json();
        assert_eq!(json["bound_kind"], "evidence", "{criterion}");
        let number = |key: &str| json[key].as_f64().unwrap_or(f64::NAN);
        let efficiency = number("criterion_efficiency");
        assert!(
            efficiency > 0.8 && efficiency <= 1.0,
            "{criterion}: {efficiency}"
        );
        let ratio = number("proved_criterion_bound") / number("criterion_bound");
        assert!(
            (1e-4..0.11).contains(&(ratio - 1.0).abs()),
            "{criterion}: {ratio}"
        );
        assert!(
            json["proof"]["gap"]
                .as_f64()
                .is_some_and(|gap| gap <= 0.1001)
        );
        assert!(number("lower_bound_rho0_mm") > 0.0);
        if let Some(python) = &python {
            let (code, text) = checked(python, &place.path("proof.json"));
            assert_eq!(code, Some(0), "{criterion}: {text}");
            let file = place.read("proof.json");
            let mut file: Value = serde_json::from_str(&file).expect("it is JSON");
            let bound = &mut file["bounds"][3][1];
            let better = if matches!(criterion, "d" | "e" | "o1" | "o3") {
                0.999
            } else {
                1.001
            };
            *bound = serde_json::json!(bound.as_f64().expect("a number") * better);
            place.write("tampered.json", file.to_string());
            let (code, text) = checked(python, &place.path("tampered.json"));
            assert_eq!(code, Some(1), "{criterion}: {text}");
        }
    }
    for criterion in ["o2", "o4"] {
        let arguments = format!(
            "evaluate {} --plan plan.csv --criterion {criterion} --quiet",
            scenario.display()
        );
        let reason = format!("the criterion {criterion} is not convex in the information");
        assert!(place.run(&arguments).stdout.contains(&reason));
        let json = place.run(&(arguments + " --json")).json();
        assert!(json["criterion_bound"].is_null() && json["bound_kind"].is_null());
        let told = json["no_bound_reason"].as_str().expect("a reason");
        assert!(told.contains(&reason), "{told}");
    }
    let bound = proved(&crate::support::scenario("spatial_3r"), Criterion::D, 3);
    assert!(
        bound
            .of_size(3)
            .is_ok_and(|bound| bound.kind == BoundKind::Evidence)
    );
}
