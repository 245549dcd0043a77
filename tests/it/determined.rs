//! What is determined is one decision: every command names the same compliances, and what is determined
//! keeps its right number.

use elastocal::calibration::calibrate;
use elastocal::identification::Sigma;
use elastocal::numeric::estimable::Estimable;
use elastocal::plan::search::{PlanSize, Problem, SearchError, approximate_design, exact_design};
use elastocal::plan::{Assessment, Criterion, Experiment, Plan, posterior};
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::study::runner::Runner;
use elastocal::study::{Entry, Level};
use elastocal::task::Method;
use nalgebra::{DMatrix, dvector};
use serde_json::Value;

use crate::identifiability::{TWINS, TWINS_SCENARIO};
use crate::support::{
    Outcome, Workplace, assert_alike, assert_near_in, leave_open, list, project, scenario_text,
    unwatched,
};

/// The paper's robot with the reflector where the tool machines, on axis 6: no weight turns joint 6.
fn reflector_on_axis_6(workplace: &Workplace) {
    let site = "calibration_site = \"machining_tcp\"";
    let text =
        scenario_text("klimchik2012").replace("calibration_site = \"calibration_tcp\"", site);
    let end = text.find("[[plan]]").expect("it brings plans");
    let study = "[study]\ntrials = 2000\nexperiments = 4\n[[study.plan]]\nname = \"best\"\nkind = \"file\"\nfile = \"p.csv\"\n";
    workplace.write(
        "s.toml",
        text[..end].replace("experiments = 3", "experiments = 4") + study,
    );
    workplace.write(
        "p.csv",
        std::fs::read(project("scenarios/plans/klimchik2012_m4.csv")).expect("is there"),
    );
}

/// An arm stretched along x, two joints turning about y: in this configuration a weight moves the tool
/// by the one as by the other.
const STRETCHED: &str = r#"<mujoco model="stretched"><compiler angle="degree"/><option gravity="0 0 0"/><worldbody>
  <body name="a" pos="0 0 1"><inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="near" axis="0 1 0" range="-170 170"/>
    <body name="b" pos="1 0 0"><inertial pos="0.5 0 0" mass="1" diaginertia="1 1 1"/>
      <joint name="far" axis="0 1 0" range="-170 170"/>
      <site name="tcp" pos="1 0 0"/>
    </body>
  </body>
</worldbody></mujoco>"#;

/// Experiments in the stretched configuration only; the test pose is bent.
fn stretched(workplace: &Workplace, test_pose_deg: [f64; 2]) {
    workplace.write("stretched.xml", STRETCHED);
    let text = format!(
        r#"
[robot]
model = "stretched.xml"
calibration_site = "tcp"
machining_site = "tcp"
parameters = ["near", "far"]
compliance_rad_per_nm = [1e-6, 2e-6]
[true_robot]
compliance_rad_per_nm = [1.1e-6, 2.1e-6]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
name = "milling"
q_deg = {test_pose_deg:?}
force_n = [0, 0, 100]
[load]
kind = "fixed"
force_n = [0, 0, -500]
[region]
joint_range_deg = {{ near = [0, 0], far = [0, 0] }}
[design]
experiments = 3
[study]
trials = 2000
[[study.plan]]
name = "best"
kind = "file"
file = "p.csv"
"#
    );
    workplace.write("s.toml", text);
    workplace.write(
        "p.csv",
        "q1_deg,q2_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n0,0,0,0,-500,0,0,0,3\n",
    );
}

/// The joints that the conditions on stderr call not determined.
fn named(outcome: &Outcome) -> Vec<String> {
    let lines = outcome.stderr.lines();
    let after = lines.filter_map(|line| line.split_once("not determine the compliance of "));
    after.map(|(_, joint)| joint.to_owned()).collect()
}

fn null_entries(json: &Value, key: &str) -> Vec<usize> {
    let values = list(&json[key]);
    (0..values.len())
        .filter(|&index| values[index].is_null())
        .collect()
}

/// What one set-up must give with every command.
struct Case {
    set_up: fn(&Workplace),
    /// The joints that are not determined, and their places among the parameters.
    joints: &'static [&'static str],
    places: &'static [usize],
    rank: usize,
    /// Whether a test pose needs them.
    is_needed: bool,
}

const CASES: [Case; 3] = [
    Case {
        set_up: reflector_on_axis_6,
        joints: &["joint_6"],
        places: &[4],
        rank: 4,
        is_needed: false,
    },
    Case {
        set_up: |workplace| stretched(workplace, [0.0, 0.0]),
        joints: &["near", "far"],
        places: &[0, 1],
        rank: 1,
        is_needed: false,
    },
    Case {
        set_up: |workplace| stretched(workplace, [0.0, 90.0]),
        joints: &["near", "far"],
        places: &[0, 1],
        rank: 1,
        is_needed: true,
    },
];

fn rho0(json: &Value) -> Option<f64> {
    json["rho0_mm"].as_f64()
}

/// A case's files, and what `evaluate` predictions of its plan.
fn evaluated(case: &Case) -> (Workplace, Option<f64>) {
    let workplace = Workplace::new();
    (case.set_up)(&workplace);

    let evaluated = workplace.doubted("evaluate s.toml --plan p.csv --json --quiet");
    assert_eq!(named(&evaluated), case.joints);
    let json = evaluated.json();
    assert_eq!(
        null_entries(&json, "compliance_std_rad_per_nm"),
        case.places
    );
    let predicted = rho0(&json);
    assert_eq!(predicted.is_none(), case.is_needed, "{json:#}");
    for (name, value) in json["criteria"].as_object().expect("an object") {
        let is_number = name == "test_pose" && !case.is_needed;
        assert_eq!(value.is_number(), is_number, "{name}: {value}");
    }
    (workplace, predicted)
}

#[test]
fn the_steps_name_what_the_plan_does_not_determine() {
    for case in &CASES {
        let (workplace, predicted) = evaluated(case);
        workplace.done("measure s.toml --plan p.csv --measurements-out m.csv");
        for method in ["linear", "nonlinear"] {
            let identified = workplace
                .doubted(&format!("identify s.toml --measurements m.csv --method {method} --identified-out i.json --json --quiet"));
            assert_eq!(named(&identified), case.joints);
            let json = identified.json();
            assert_eq!(null_entries(&json, "compliance_rad_per_nm"), case.places);
            assert_eq!(json["rank"], case.rank);
            let compensated = workplace.run("compensate s.toml --identified i.json --json --quiet");
            let compensated = compensated.ends_with(if case.is_needed { 3 } else { 0 });
            let condition = "condition C0305: test pose \"milling\" depends on what is not determined: near, far;";
            assert_eq!(compensated.stderr.contains(condition), case.is_needed);
            let found = rho0(&compensated.json());
            match (found, predicted) {
                (Some(found), Some(predicted)) => {
                    assert_alike(found, predicted, 0.05);
                    let left = compensated.json()["residual_mm"]
                        .as_f64()
                        .expect("a number");
                    assert!(left < 5.0 * found, "{left} of {found}");
                }
                (found, predicted) => assert_eq!(found, predicted),
            }
        }
    }
}

#[test]
fn studies_count_what_the_plan_determines() {
    for case in &CASES {
        let (workplace, predicted) = evaluated(case);
        for level in ["model", "robot"] {
            let study = workplace.run(&format!(
                "study s.toml --level {level} --trials 500 --json --quiet"
            ));
            if case.is_needed {
                let study = study.ends_with(1);
                study.says("do not determine the compliances that the test poses need");
                continue;
            }
            let json = study.ends_with(0).json();
            let plan = &json["plans"][0];
            assert_eq!(
                (&plan["nees_expected"], &plan["failed"]),
                (&case.rank.into(), &0.into())
            );
            let number = |key: &str| plan[key].as_f64().expect("a number");
            let ratio = number("predicted_rms_mm") / predicted.expect("determined");
            assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
            assert!(
                number("nees_z").abs() < 4.0 && number("z").abs() < 4.0,
                "{level}: {plan:#}"
            );
        }
    }
}

#[test]
fn designs_name_what_no_plan_determines() {
    for case in &CASES {
        let (workplace, predicted) = evaluated(case);
        let planned = workplace.run("plan s.toml --json --quiet");
        let ran = workplace.run("run s.toml --json --quiet");
        if case.is_needed {
            let message = "no feasible experiments separate the compliances of near, far";
            for outcome in [planned, ran] {
                assert!(outcome.ends_with(1).stderr.contains(message));
            }
            continue;
        }
        let (planned, ran) = (planned.ends_with(3), ran.ends_with(3));
        assert_eq!(named(&planned), case.joints);
        assert_eq!(named(&ran), case.joints);
        let best = rho0(&planned.json()).expect("determined");
        assert!(
            best <= predicted.expect("determined") * (1.0 + 1e-6),
            "{best}"
        );
        assert_eq!(rho0(&ran.json()), Some(best));
        // Table 1's criteria ask for all: their entries say why there is no plan.
        let compared = ran.json()["criteria_compared"].clone();
        for entry in &compared.as_array().expect("an array")[1..] {
            let problem = entry["problem"].as_str().expect("a text");
            assert!(
                case.joints.iter().all(|joint| problem.contains(joint)),
                "{problem}"
            );
        }
        let planned = workplace.refused("plan s.toml --criterion a --quiet");
        assert!(
            case.joints
                .iter()
                .all(|joint| planned.stderr.contains(joint))
        );
    }
}

fn load(workplace: &Workplace) -> Scenario {
    workplace.scenario("s.toml")
}

/// Joint 6 left out of the parameters is the same problem: the prediction has the same number.
#[test]
fn the_number_is_that_of_the_problem_without_the_undetermined_joint() {
    let workplace = Workplace::new();
    reflector_on_axis_6(&workplace);
    let with = load(&workplace);
    let mut without = with.clone();
    let joints = &with.task.belief.parameters;
    leave_open(&mut without, &joints[..joints.len() - 1]);
    let plan = crate::support::table4(4);
    let [one, other] =
        [&with, &without].map(|scenario| Assessment::new(&scenario.task, &plan, None));
    let (one, other) = (
        one.rho0_m.expect("determined"),
        other.rho0_m.expect("determined"),
    );
    assert!((one / other - 1.0).abs() < 1e-9, "{one}, {other}");
}

/// Two hinges on one axis are one hinge of both compliances together: the same best plan, the same
/// prediction, the same compensation.
#[test]
fn a_determined_sum_is_as_good_as_one_joint() {
    let workplace = Workplace::with("twins.xml", TWINS);
    workplace.write("s.toml", TWINS_SCENARIO);
    let twins = load(&workplace);
    let one_joint = TWINS.replace("    <joint name=\"second\" axis=\"0 1 0\"/>\n", "");
    workplace.write("twins.xml", one_joint);
    let text = TWINS_SCENARIO
        .replace("\"second\", ", "")
        .replace("[1e-6, 2e-6, 3e-6]", "[3e-6, 3e-6]")
        .replace("[1.5e-6, 2.5e-6, 4e-6]", "[4e-6, 4e-6]")
        .replace("q_deg = [0, 0, 0]", "q_deg = [0, 0]");
    workplace.write("s.toml", text);
    let single = load(&workplace);

    let best = |scenario: &Scenario| {
        let mut problem = Problem::new(&scenario.task, Criterion::TestPose);
        problem.effort.searches = 16;
        let bound = approximate_design(&problem, 1).expect("feasible");
        let watch = unwatched();
        let exact = exact_design(&problem, &bound, PlanSize::all_different(3), 1, watch, &[])
            .expect("determined");
        (exact.cost.sqrt(), exact.plan)
    };
    let (of_twins, plan) = best(&twins);
    let (of_single, _) = best(&single);
    assert_alike(of_twins, of_single, 1e-3);

    let shown = calibrate(&twins.task, &twins.truth, &plan, twins.seed, 0).expect("works");
    assert_eq!(shown.identification.unidentifiable(), ["first", "second"]);
    let sum: f64 = shown.identification.compliance_rad_per_nm[..2].iter().sum();
    let error = (posterior(&twins.task.belief, &plan).variance_of(&DMatrix::from_row_slice(
        1,
        3,
        &[1.0, 1.0, 0.0],
    )))
    .expect("the sum is determined")
    .sqrt();
    assert!((sum - 4e-6).abs() < 5.0 * error, "{sum} +- {error}");
    let predicted = shown.poses[0].predicted_m.clone().expect("determined");
    assert!((predicted / of_twins - 1.0).abs() < 0.05);
    assert!(shown.poses[0].seen.residual_m.norm() < 5.0 * predicted);
    let wanted = Problem::new(&twins.task, Criterion::D);
    let watch = unwatched();
    let bound =
        approximate_design(&Problem::new(&twins.task, Criterion::TestPose), 1).expect("feasible");
    let joints = vec!["first".to_owned(), "second".to_owned()];
    assert_eq!(
        exact_design(&wanted, &bound, PlanSize::all_different(3), 1, watch, &[]),
        Err(SearchError::Inseparable(joints))
    );
}

/// A reflector almost on the axis tells next to nothing of joint 6: the fit does not follow that.
#[test]
fn a_direction_that_hardly_shows_does_not_run_away() {
    for offset_mm in [0.0, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.0, 10.0, 30.0] {
        let workplace = Workplace::new();
        let model = std::fs::read_to_string(project("models/kr270.xml")).expect("is there");
        let on_axis = "name=\"machining_tcp\" pos=\"0.986 0 0\"";
        let off_axis = format!(
            "name=\"machining_tcp\" pos=\"0.986 0 {}\"",
            offset_mm * 1e-3
        );
        workplace.write("kr270.xml", model.replace(on_axis, &off_axis));
        let text = scenario_text("klimchik2012").replace("calibration_tcp", "machining_tcp");
        workplace.write(
            "s.toml",
            text.replace(&*project("models").to_string_lossy(), "."),
        );
        let scenario = load(&workplace);
        let plan = crate::support::table4(4);
        let predicted = Assessment::new(&scenario.task, &plan, None);
        for run in 0..3 {
            let shown = calibrate(&scenario.task, &scenario.truth, &plan, scenario.seed, run)
                .expect("the fit ends");
            let found: Vec<bool> = (shown.identification.parameters.iter())
                .map(|parameter| parameter.estimate.is_some())
                .collect();
            let expected: Vec<bool> = predicted
                .standard_errors
                .iter()
                .map(Option::is_some)
                .collect();
            // One that is known worse than by a guess stays nominal.
            let held = &shown.identification.stays_nominal;
            let or_held = found
                .iter()
                .zip(&shown.identification.parameters)
                .map(|(found, each)| *found || held.iter().any(|other| other.name == each.name));
            assert_eq!(or_held.collect::<Vec<bool>>(), expected, "{offset_mm} mm");
            if let Some(error) = predicted.standard_errors[4].filter(|_| !found[4]) {
                let nominal = scenario.task.belief.nominal.compliance_rad_per_nm[5];
                assert!(error > 0.5 * nominal, "{offset_mm} mm: {error}");
            }
            if found[4] {
                continue;
            }
            let nominal = scenario.task.belief.nominal.compliance_rad_per_nm[5];
            assert_eq!(
                shown.identification.compliance_rad_per_nm[5].to_bits(),
                nominal.to_bits()
            );
            let rho0 = predicted.rho0_m.expect("joint 6 does not matter there");
            assert!(
                shown.poses[0].seen.residual_m.norm() < 5.0 * rho0,
                "{offset_mm} mm"
            );
        }
    }
}

/// A nominal compliance of zero, or next to it, says nothing of what measurements determine.
#[test]
fn a_nominal_compliance_of_zero_is_a_fine_start() {
    for (nominal, joints) in [(0.0, 2..3), (1e-15, 2..3), (1e-9, 2..3), (0.0, 0..6)] {
        let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
        let mut scenario = load(&workplace);
        for joint in joints {
            scenario.task.belief.nominal.compliance_rad_per_nm[joint] = nominal;
        }
        let parameters = scenario.task.belief.parameters.clone();
        leave_open(&mut scenario, &parameters);
        let plan = crate::support::table4(4);
        let assessment = Assessment::new(&scenario.task, &plan, None);
        let undetermined = assessment.undetermined(&scenario.task.belief);
        assert_eq!(undetermined, [""; 0], "{nominal}");
        assert!(assessment.criteria.iter().all(|(_, value)| value.is_some()));
        let shown = calibrate(&scenario.task, &scenario.truth, &plan, scenario.seed, 0)
            .expect("works")
            .identification;
        for parameter in &shown.parameters {
            let found = parameter.estimate.expect("determined");
            let truth = scenario.truth.robot.compliance_rad_per_nm[parameter.joint];
            assert_near_in(&parameter, found.value, truth, 5.0 * found.standard_error);
        }
    }
}

/// Runs with random plans may determine more or fewer combinations: each counts what it has.
#[test]
fn the_expected_error_counts_what_is_determined() {
    let workplace = Workplace::new();
    reflector_on_axis_6(&workplace);
    let mut scenario = load(&workplace);
    scenario.study.conditions[0].experiments = 4;
    let settings = scenario.settings();
    let entries = [Entry {
        name: "random".into(),
        setting: 0,
        plan: None,
        is_random: true,
    }];
    for (level, trials) in [(Level::Model, 4096), (Level::Robot, 256)] {
        let runner = Runner::new(&settings, scenario.seed, level, &entries).expect("works");
        let tally = runner
            .run(trials, 0..runner.blocks(trials), 1, &|_| ())
            .expect("works")
            .remove(0);
        let freedom = tally.nees_expected();
        assert!((freedom - 4.0).abs() < 0.01, "{freedom}");
        assert!(tally.nees_z().abs() < 4.0, "{}", tally.nees_z());
    }
}

/// Every stage's decision is the same object's: from the plan, and from measurements of it.
#[test]
fn plan_and_measurements_agree_on_the_directions() {
    let workplace = Workplace::new();
    stretched(&workplace, [0.0, 0.0]);
    let scenario = load(&workplace);
    let experiment = Experiment {
        configuration_rad: dvector![0.0, 0.0],
        load: Load::force(0.0, 0.0, -500.0),
        repeats: 3,
        approach: None,
        direction: None,
    };
    let plan = Plan {
        experiments: vec![experiment],
    };
    let planned = posterior(&scenario.task.belief, &plan).estimable;
    let measurements = crate::recovery::noise_free(&scenario, &plan);
    for sigma in [Sigma::Known(3e-5), Sigma::FromResiduals(3e-5)] {
        for method in [Method::Linear, Method::Nonlinear] {
            let found = crate::recovery::identified(&scenario, &measurements, sigma, method);
            let found: Estimable = found.posterior.estimable;
            let off = found.hidden() * found.hidden().transpose()
                - planned.hidden() * planned.hidden().transpose();
            assert!(off.amax() < 1e-9, "{off}");
        }
    }
}

/// A comparison on the side that fails is an entry that says so; the work is done all the same.
#[test]
fn a_comparison_that_fails_does_not_undo_the_run() {
    let workplace = Workplace::new();
    let text = scenario_text("planar_3r") + "\n[[plan]]\nname = \"heavy\"\nfile = \"heavy.csv\"\n";
    workplace.write("s.toml", text);
    let header = "q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n";
    workplace.write("heavy.csv", format!("{header}10,20,30,0,0,-9e7,0,0,0,3\n"));
    // The plan's load is none of the scenario's, which is a condition that does not hold.
    let run = workplace.doubted("run s.toml --json --quiet");
    run.says("the plan \"heavy\" cannot be compared: ");
    let json = run.json();
    let entry = (list(&json["plans"]).iter())
        .find(|plan| plan["name"] == "heavy")
        .expect("it has an entry");
    assert!(
        entry["problem"]
            .as_str()
            .expect("a text")
            .contains("equilibrium")
    );
    assert!(workplace.path("out/s/report.html").exists());
    workplace.done("compare out/s/results.json out/s/results.json");
}
