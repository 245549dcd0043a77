//! Criteria of Table 1: bounds by those that plans are optimised by, against optima known by hand and plans of every kind; and
//! what is said of the others.

use elastocal::plan::search::{Bound, BoundKind, Problem, RandomPlans, approximate_design};
use elastocal::plan::{Assessment, Criterion, CriterionFunction, Plan};
use nalgebra::{DMatrix, DVector};

use crate::planning::{OPTIMISED, assert_close, exact};
use crate::support::{Workplace, assert_has, leave_open, project, scenario, scenario_text};

/// How good a value is beside a bound: 1 or less.
fn efficiency(criterion: Criterion, value: f64, best: f64) -> f64 {
    if criterion.is_maximised() {
        value / best
    } else {
        best / value
    }
}

// The optima are derived beside the test of `known_optima` that splits one measurement, for the spatial arm with a known elbow
// under a force of any direction: s_j = k_j^2 m L^4 F^2 / sigma^2.
#[test]
fn bounds_are_the_optima_that_are_known_by_hand() {
    let mut scenario = scenario("spatial_3r");
    leave_open(&mut scenario, &[0, 1]);
    let information = (1.5_f64.powi(2) * 400.0 / 0.03e-3).powi(2);
    for measurements in [1, 3] {
        let s: Vec<f64> = scenario.task.belief.nominal.compliance_rad_per_nm[..2]
            .iter()
            .map(|k| k.powi(2) * f64::from(measurements) * information)
            .collect();
        let d = (s[0] * s[1]).sqrt() / 2.0;
        let a = (s[0].powf(-0.5) + s[1].powf(-0.5)).powi(2);
        for (criterion, optimum) in [
            (Criterion::A, a),
            (Criterion::D, d),
            (Criterion::O1, d.sqrt()),
        ] {
            let sizes = [measurements];
            let bound =
                Bound::search_and_prove(&scenario.task, criterion, scenario.seed, &sizes, None);
            let bound = bound.of_size(measurements).expect("a bound");
            assert_eq!(bound.kind, BoundKind::Evidence);
            // Room for printed loads.
            let found = efficiency(criterion, optimum, bound.best);
            assert!(found <= 1.0 && found > 0.993, "{criterion:?}: {found}");
        }
    }
}

/// Random plans, and plans of very many measurements that come near the approximate design, of the shipped arms: none is
/// better than its bound, and the latter are as good but for what printed loads are allowed.
#[test]
fn no_plan_beats_the_bound_of_its_criterion() {
    for name in ["planar_3r", "spatial_3r", "klimchik2012"] {
        let scenario = scenario(name);
        for criterion in OPTIMISED {
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
            let mut random_plans = RandomPlans::new(&problem);
            let mut plans: Vec<Plan> = (0..30)
                .map(|run| random_plans.draw(4, 5, run).expect("there is a plan"))
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

/// A plan of many measurements comes within 0.1 % of the best that there can be, without a search: the design's weights, rounded.
#[test]
fn many_measurements_round_the_design() {
    let scenario = scenario("klimchik2012");
    for criterion in OPTIMISED {
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

/// The values of a plan of which the information has known eigenvalues, along the axes and turned: all but G, which is about
/// single compliances, are the same.
#[test]
fn values_are_those_of_the_eigenvalues() {
    let information = DMatrix::from_diagonal(&DVector::from_vec(vec![4.0, 9.0]));
    let (sine, cosine) = 0.7_f64.sin_cos();
    let turn = DMatrix::from_row_slice(2, 2, &[cosine, -sine, sine, cosine]);
    let turned = &turn * &information * turn.transpose();
    for &criterion in <Criterion as clap::ValueEnum>::value_variants() {
        let expected = match criterion {
            Criterion::TestPose => (13.0_f64 / 36.0).sqrt(),
            Criterion::A => 13.0 / 36.0,
            Criterion::D => 6.0,
            Criterion::E => 4.0,
            Criterion::G => 0.25,
            Criterion::O1 => 6.0_f64.sqrt(),
            Criterion::O2 => 1.5,
            Criterion::O3 => 2.0,
            Criterion::O4 => 4.0 / 3.0,
            Criterion::O5 => 5.0 / 6.0,
        };
        let mut function = CriterionFunction::new(criterion, DMatrix::identity(2, 2));
        let value = function.value(&information).expect("regular");
        assert_close(criterion.name(), value, expected, 1e-12);
        let value = function.value(&turned).expect("regular");
        let expected = match criterion {
            Criterion::G => (cosine.powi(2) / 4.0 + sine.powi(2) / 9.0)
                .max(sine.powi(2) / 4.0 + cosine.powi(2) / 9.0),
            _ => expected,
        };
        assert_close(criterion.name(), value, expected, 1e-12);
    }
}

/// Bounds by other criteria than the test pose are searched, and nothing is proved of them; the others are values of any plan, goals
/// of choices from candidates, and refused over a region.
#[test]
fn each_criterion_is_bounded_optimised_or_refused_in_words() {
    let place = Workplace::new();
    let scenario = project("scenarios/spatial_3r.toml");
    for criterion in ["a", "d", "o1"] {
        let arguments = format!(
            "plan {} --experiments 3 --criterion {criterion} --quiet --plan-out plan.csv",
            scenario.display()
        );
        let told = place.done(&arguments);
        told.prints("bounds of rho0 alone are proved");
        let json = place.run(&(arguments + " --json")).json();
        assert_eq!(json["bound_kind"], "evidence", "{criterion}");
        assert!(json["proof"].is_null() && json["proved_criterion_bound"].is_null());
        let efficiency = json["criterion_efficiency"].as_f64().unwrap_or(f64::NAN);
        assert!(
            efficiency > 0.8 && efficiency <= 1.0,
            "{criterion}: {efficiency}"
        );
        assert!(json["lower_bound_rho0_mm"].as_f64() > Some(0.0));
    }
    let plan = place.read("plan.csv");
    let rows: Vec<&str> = plan.lines().collect();
    place.write("candidates.csv", rows.join("\n"));
    place.write(
        "study.toml",
        scenario_text("spatial_3r")
            + "\n[[study.plan]]\nname = \"one\"\nkind = \"optimal\"\ncriterion = \"g\"\n",
    );
    let refused = place.refused("study study.toml --quiet");
    let key = "].criterion";
    refused.says("for g, choose from candidates");
    refused.says(key);
    for criterion in ["e", "g", "o2", "o3", "o4", "o5"] {
        let name = scenario.display();
        let refused = place.run(&format!("plan {name} --criterion {criterion} --quiet"));
        let words = format!("for {criterion}, choose from candidates (plan --candidates FILE)");
        assert!(refused.ends_with(1).stderr.contains(&words), "{criterion}");
        let evaluate =
            format!("evaluate {name} --plan plan.csv --criterion {criterion} --quiet --json");
        let json = place.done(&evaluate).json();
        assert!(json["criteria"][criterion].as_f64().is_some());
        assert!(json["criterion_bound"].is_null() && json["bound_kind"].is_null());
        let told = json["no_bound_reason"].as_str().expect("a reason");
        assert_has(told, "plans are optimised and bounded by");
        let chosen = format!(
            "plan {name} --criterion {criterion} --candidates candidates.csv --experiments 3 --quiet --json"
        );
        let json = place.done(&chosen).json();
        assert!(json["criteria"][criterion].as_f64().is_some());
        let told = json["no_bound_reason"].as_str().expect("a reason");
        assert!(told.contains(&format!("and not by {criterion}")), "{told}");
    }
}
