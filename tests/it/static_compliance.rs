//! The static compliance of the tool at the test poses, beside MuJoCo and beside robots that are sampled.

use elastocal::compensation::{KnownArm, StaticCompliance};
use elastocal::experiment::{Candidate, write_candidates};
use elastocal::numeric::random::generator;
use elastocal::plan::search::random_plan;
use elastocal::plan::{Plan, posterior};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::task::Belief;
use elastocal::testbed::VirtualRobot;
use nalgebra::{DVector, Matrix3, Vector3};
use serde_json::Value;

use crate::one_fit::normal;
use crate::support::{
    Workplace, absolute_scenario_text, assert_near_in, list, number, project, scenario, table4,
};
use crate::uncertainties::{loaded, with};

/// The force that MuJoCo hangs on the tool (N).
const FORCE_N: f64 = 100.0;

/// The displacement per force of the simulated truth (m/N), by forces of both signs along each axis.
fn hung(scenario: &Scenario, q: &DVector<f64>) -> Matrix3<f64> {
    let site = &scenario.task.belief.machining_tool.name;
    let mut robot = VirtualRobot::new(&scenario.truth.robot, site).expect("the site exists");
    let mut place = |force: Vector3<f64>| {
        let load = Load::force(force.x, force.y, force.z);
        robot.rest(q, &load).expect("stable").0
    };
    let columns = [0, 1, 2].map(|axis| {
        let [up, down] = [1.0, -1.0].map(|sign| place(Vector3::ith(axis, sign * FORCE_N)));
        (up - down) / (2.0 * FORCE_N)
    });
    Matrix3::from_columns(&columns)
}

fn known_after(belief: &Belief, plan: &Plan, q: &DVector<f64>) -> StaticCompliance {
    let (arm, set) = (belief.uncertain.arm(), belief.uncertain.set());
    let known = KnownArm {
        tool: arm.tools.len() - 1,
        arm,
        set,
        posterior: &posterior(belief, plan),
    };
    known.static_compliance(q).expect("stable")
}

/// Springs beside the joints' own, a wrist that carries nothing, another robot: MuJoCo at +-100 N agrees to 0.1 % of the largest.
#[test]
fn mujoco_shows_the_same() {
    let nothing = Plan {
        experiments: Vec::new(),
    };
    for name in ["kr270", "klimchik2012", "kr270_compensator", "ur10"] {
        let scenario = scenario(name);
        for pose in &scenario.task.test_poses {
            let q = &pose.configuration_rad;
            let judged = hung(&scenario, q);
            let found = known_after(&scenario.task.belief, &nothing, q).m_per_n;
            let apart = (found - judged).amax() / judged.amax();
            assert!(apart < 1e-3, "{name}: {apart}\n{found}{judged}");
        }
    }
}

/// Robots sampled from what is known after a plan have compliances that scatter as the standard uncertainties say.
#[test]
fn uncertainties_are_those_of_sampled_robots() {
    let scenario = scenario("kr270");
    let belief = &scenario.task.belief;
    let q = &scenario.task.test_poses[0].configuration_rad;
    let plan = table4(4);
    let (arm, set) = (belief.uncertain.arm(), belief.uncertain.set());
    let after = posterior(belief, &plan);
    let found = known_after(belief, &plan, q);
    let root = after
        .covariance
        .clone()
        .cholesky()
        .expect("definite")
        .unpack();
    let mut random = generator(11, 0);
    let robots = 600;
    let mut squares = Matrix3::zeros();
    for _ in 0..robots {
        let normals = DVector::from_fn(set.len(), |_, _| normal(&mut random));
        let mut sampled = after.clone();
        let values = DVector::from_vec(after.mean.clone()) + &root * normals;
        sampled.mean = values.as_slice().to_vec();
        let known = KnownArm {
            tool: arm.tools.len() - 1,
            arm,
            set,
            posterior: &sampled,
        };
        let compliance = known.static_compliance(q).expect("stable").m_per_n;
        squares += (compliance - found.m_per_n).map(|each| each * each) / f64::from(robots);
    }
    // Four standard errors, and 2 % for what is not linear.
    let room = 4.0 / (2.0 * f64::from(robots)).sqrt() + 0.02;
    for (row, column) in (0..9).map(|index| (index / 3, index % 3)) {
        let uncertainty = found.standard_uncertainty_m_per_n[row][column].expect("determined");
        let ratio = squares[(row, column)].sqrt() / uncertainty;
        assert!((ratio - 1.0).abs() < room, "{row} {column}: {ratio}");
        let [low, high] = found.interval95_m_per_n(row, column).expect("determined");
        let half = 1.959_964 * uncertainty;
        assert!(((high - low) / 2.0 / half - 1.0).abs() < 1e-6);
    }
}

/// A vertical load does not turn joint 1, which moves the tool sideways and never up.
#[test]
fn an_entry_that_is_not_determined_has_no_interval() {
    let text = with("", "model", 64).replace("[\"joint_2\"", "[\"joint_1\", \"joint_2\"");
    let scenario = loaded(&text);
    let q = &scenario.task.test_poses[0].configuration_rad;
    let found = known_after(&scenario.task.belief, &table4(4), q);
    assert_eq!(found.standard_uncertainty_m_per_n[1][1], None);
    assert!(found.standard_uncertainty_m_per_n[2][2].is_some());
    assert_eq!(found.interval95_m_per_n(1, 1), None);
}

/// The nine entries of a matrix in JSON, row by row.
fn entries(matrix: &Value) -> Vec<&Value> {
    let rows = matrix.as_array().expect("rows").iter();
    rows.flat_map(|row| row.as_array().expect("entries"))
        .collect()
}

/// A robot that is identified has a compliance whose intervals hold that of the robot that was measured, to four standard
/// uncertainties.
#[test]
fn an_identified_robot_has_its_own() {
    let place = Workplace::new();
    let scenario_file = project("scenarios/kr270.toml");
    let plan = project("scenarios/plans/klimchik2012_m12.csv");
    let (scenario_file, plan) = (scenario_file.display(), plan.display());
    place.done(&format!(
        "measure {scenario_file} --plan {plan} --seed 3 --measurements-out m.csv --quiet"
    ));
    place.run("identify --measurements m.csv --identified-out i.json --quiet");
    let known = place.record("compensate --identified i.json --static-compliance");
    let planned = place.json_with_conditions(&format!(
        "evaluate {scenario_file} --plan {plan} --static-compliance --no-proof"
    ));
    let of = |json: &Value| json["static_compliance"]["test_poses"][0].clone();
    let (known, planned) = (of(&known), of(&planned));
    let scenario = Scenario::load(&project("scenarios/kr270.toml")).expect("valid");
    // The virtual robot that was measured.
    let mut robots =
        elastocal::testbed::TrueRobots::new(&scenario.task.belief, &scenario.truth).expect("works");
    robots
        .become_run_of(&scenario.truth, 0, 3, 0)
        .expect("works");
    let mut truth = scenario.clone();
    truth.truth.robot.compliance_rad_per_nm = robots.compliance_rad_per_nm().to_vec();
    let judged = hung(&truth, &scenario.task.test_poses[0].configuration_rad) * 1e3;
    let values = |json: &Value, key: &str| -> Vec<f64> {
        entries(&json[key]).into_iter().map(number).collect()
    };
    let (found, nominal) = (values(&known, "mm_per_n"), values(&planned, "mm_per_n"));
    let errors = values(&known, "standard_uncertainty_mm_per_n");
    let mut moved = 0.0_f64;
    for (index, (found, error)) in found.iter().zip(&errors).enumerate() {
        let judged = judged[(index / 3, index % 3)];
        assert_near_in(&index, *found, judged, 4.0 * error);
        moved = moved.max((found - nominal[index]).abs() / error);
    }
    // It is the robot's and not the data sheet's.
    assert!(moved > 2.0, "{moved}");
}

/// What a plan of absolute readings determines, too.
#[test]
fn plans_of_absolute_readings_have_it() {
    let place = Workplace::with("s.toml", absolute_scenario_text("ur10"));
    let scenario = place.scenario("s.toml");
    let plan = random_plan(&scenario.task, 40, 3, 0).expect("a plan");
    let rows: Vec<Candidate> = (plan.experiments.iter().enumerate())
        .map(|(index, each)| Candidate {
            line: index + 2,
            configuration_rad: each.configuration_rad.clone(),
            load: Some(if index % 2 == 0 {
                Load::NONE
            } else {
                each.load
            }),
            most: Some(1),
            target: None,
            station: None,
            approach: None,
        })
        .collect();
    let commands = scenario.task.belief.commands();
    write_candidates(&place.path("p.csv"), commands, &rows).expect("written");
    let run = "evaluate s.toml --plan p.csv --static-compliance --parameters";
    let json = place.record(&format!("{run} compliances"));
    let message = &json["static_compliance"];
    assert_eq!(message["assumed_exact"], serde_json::json!([]));
    let pose = &message["test_poses"][0];
    let judged = hung(&scenario, &scenario.task.test_poses[0].configuration_rad) * 1e3;
    let zipped = entries(&pose["mm_per_n"]).into_iter().enumerate();
    for (index, value) in zipped {
        let judged_entry = judged[(index / 3, index % 3)];
        assert!((number(value) - judged_entry).abs() < 1e-3 * judged.amax());
    }
    assert!(number(&pose["standard_uncertainty_mm_per_n"][2][2]) > 0.0);
    // Of compliances that are not asked for nothing is uncertain.
    let json = place.record(&format!("{run} zeros"));
    let exact = list(&json["static_compliance"]["assumed_exact"]);
    assert_eq!(exact.len(), 6);
}
