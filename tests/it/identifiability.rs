//! What the measurements do not tell is named, and never guessed or NaN.

use elastocal::identification::{Case, IdentificationError, IdentificationMessage, Sigma};
use elastocal::measurement::Measurement;
use elastocal::plan::Plan;
use elastocal::robot::Load;
use elastocal::scenario::Scenario;
use elastocal::task::Method;
use nalgebra::dvector;
use serde_json::Value;

use crate::recovery::{differing, identified, noise_free, of_compliances};
use crate::support::{
    Workplace, assert_alike, assert_alike_in, experiment, leave_open, list, scenario,
    scenario_text, shipped, table4,
};

const METHODS: [Method; 2] = [Method::Linear, Method::Nonlinear];

fn known(scenario: &Scenario) -> Sigma {
    Sigma::Known(scenario.task.belief.instrument.sigma_m)
}

/// A vertical load turns no vertical axis.
#[test]
fn joint_1_does_not_show_under_a_vertical_load() {
    let scenario = differing("kr270_all_joints");
    let measurements = noise_free(&scenario, &table4(3));
    for method in METHODS {
        let found = identified(&scenario, &measurements, known(&scenario), method);
        assert_eq!(found.unidentifiable(), ["joint_1"], "{method:?}");
        assert_eq!(found.posterior.estimable.rank(), 5);
        let nominal = scenario.task.belief.nominal.compliance_rad_per_nm[0];
        assert_eq!(found.compliance_rad_per_nm[0].to_bits(), nominal.to_bits());
        assert!(
            found
                .posterior
                .covariance
                .row(0)
                .iter()
                .all(|value| *value == 0.0)
        );
        // The linear estimate is biased, see `recovery`.
        let tolerance = if method == Method::Linear { 0.05 } else { 1e-8 };
        for parameter in &found.parameters[1..] {
            let truth = scenario.truth.robot.compliance_rad_per_nm[parameter.joint];
            let estimate = parameter.estimate.expect("determined").value;
            assert!((estimate / truth - 1.0).abs() < tolerance, "{parameter:?}");
        }
    }
}

#[test]
fn an_unidentifiable_joint_ends_with_code_3_and_null() {
    let workplace = Workplace::with("s.toml", scenario_text("kr270_all_joints"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    workplace.done(&format!(
        "measure s.toml --plan {plan} --measurements-out m.csv"
    ));
    let identify = "identify s.toml --measurements m.csv --identified-out i.json --json";
    let outcome = workplace.doubted(&format!("{identify} --quiet"));
    let condition =
        "condition C0201: the measurements do not determine the compliance of joint_1\n";
    assert_eq!(outcome.stderr, condition);
    let json = outcome.json();
    for key in [
        "compliance_rad_per_nm",
        "compliance_std_rad_per_nm",
        "compliance_ci95_rad_per_nm",
    ] {
        let values = list(&json[key]);
        assert_eq!(
            values.iter().map(Value::is_null).collect::<Vec<_>>(),
            [true, false, false, false, false, false],
            "{key}"
        );
    }
    assert_eq!(json["rank"], 5);
    // The file serves all the same: joint 1 keeps its nominal compliance, but it matters at the test pose.
    let compensated = workplace.doubted("compensate s.toml --identified i.json --json");
    compensated.says("not determined: joint_1;");
    assert!(compensated.json()["rho0_mm"].is_null());

    let evaluated = workplace.doubted(&format!("evaluate s.toml --plan {plan} --json"));
    let condition = "condition C0101: the plan does not determine the compliance of joint_1\n";
    evaluated.says(condition);
    let json = evaluated.json();
    assert!(json["compliance_std_rad_per_nm"][0].is_null());
    assert!(json["compliance_std_rad_per_nm"][1].is_f64());
    assert!(json["rho0_mm"].is_null(), "the test pose needs joint 1");
    assert!(json["efficiency"].is_null());
}

/// Two hinges on one axis: only the sum of their compliances shows. A third turns across.
pub const TWINS: &str = r#"<mujoco model="twins"><worldbody>
  <body name="a" pos="0 0 1"><inertial pos="0.5 0 0" mass="10" diaginertia="1 1 1"/>
    <joint name="first" axis="0 1 0"/>
    <joint name="second" axis="0 1 0"/>
    <body name="b" pos="1 0 0"><inertial pos="0.5 0 0" mass="10" diaginertia="1 1 1"/>
      <joint name="third" axis="0 0 1"/>
      <site name="tcp" pos="0.5 0 0.3"/>
    </body>
  </body>
</worldbody></mujoco>"#;

pub const TWINS_SCENARIO: &str = r#"
[robot]
model = "twins.xml"
calibration_site = "tcp"
machining_site = "tcp"
parameters = ["first", "second", "third"]
compliance_rad_per_nm = [1e-6, 2e-6, 3e-6]
[true_robot]
compliance_rad_per_nm = [1.5e-6, 2.5e-6, 4e-6]
[instrument]
sigma_mm = 0.03
sigma_of = "deflection"
[[test_pose]]
q_deg = [0, 0, 0]
force_n = [0, 0, 1]
[load]
kind = "fixed"
force_n = [0, 700, -700]
[design]
experiments = 3
"#;

fn twins() -> (Scenario, Vec<Measurement>) {
    let workplace = Workplace::with("twins.xml", TWINS);
    workplace.write("twins.toml", TWINS_SCENARIO);
    let scenario = workplace.scenario("twins.toml");
    let experiment = |first, second, third| {
        experiment(
            dvector![first, second, third],
            Load::force(0.0, 700.0, -700.0),
        )
    };
    let plan = Plan {
        experiments: vec![experiment(0.1, 0.2, 0.3), experiment(0.6, -0.9, -0.4)],
    };
    let measurements = noise_free(&scenario, &plan);
    (scenario, measurements)
}

#[test]
fn joints_that_cannot_be_told_apart_are_both_named() {
    let (scenario, measurements) = twins();
    for method in METHODS {
        let found = identified(&scenario, &measurements, known(&scenario), method);
        assert_eq!(found.unidentifiable(), ["first", "second"], "{method:?}");
        assert_eq!(found.posterior.estimable.rank(), 2);
        // Their sum is determined; what tells them apart keeps its nominal value, in typical sizes.
        let [first, second] = [0, 1].map(|joint| found.compliance_rad_per_nm[joint]);
        let tolerance = if method == Method::Linear { 0.02 } else { 1e-6 };
        assert_alike(first + second, 4e-6, tolerance);
        let share = (first - 1e-6) / 1e-6 / ((second - 2e-6) / 2e-6);
        assert!((share - 0.5).abs() < 1e-6, "{share}");
        assert!(found.condition.is_finite());
        let third = found.parameters[2].estimate.expect("determined");
        assert_alike_in(&method, third.value, 4e-6, 0.02);
    }
}

/// What the two do together is determined, so that it must not be left in the residuals, where it
/// would look like a wrong model.
#[test]
fn a_determined_sum_is_no_residual() {
    let (scenario, measurements) = twins();
    let found = identified(
        &scenario,
        &measurements,
        known(&scenario),
        Method::Nonlinear,
    );
    let third = found.parameters[2].estimate.expect("determined").value;
    assert!((third / 4e-6 - 1.0).abs() < 1e-6, "{third}");
    let largest = found
        .residuals_m
        .iter()
        .fold(0.0_f64, |most, each| most.max(each.abs()));
    assert!(
        largest < 1e-8,
        "{largest} m of {}",
        measurements[0].deflection_m.norm()
    );
    assert!(found.consistency.expect("residuals are left") > 0.99);
}

#[test]
fn nothing_to_identify_from() {
    let scenario = scenario("klimchik2012");
    let mut unloaded = noise_free(&scenario, &table4(3));
    for each in &mut unloaded {
        each.load = Load::NONE;
    }
    for method in METHODS {
        let failure = |measurements: &[Measurement], parameters: &[usize], sigma| {
            let belief = of_compliances(&scenario.task.belief, parameters);
            let case = Case::of_belief(&belief, measurements, sigma, method);
            case.identify().expect_err("fails")
        };
        let sigma = known(&scenario);
        assert_eq!(
            failure(&[], &[1], sigma),
            IdentificationError::NoMeasurements
        );
        let nothing = IdentificationError::NothingObserved;
        assert_eq!(failure(&unloaded, &[1, 2, 3], sigma), nothing, "{method:?}");
        let vertical = noise_free(&scenario, &table4(3));
        assert_eq!(
            failure(&vertical, &[0], sigma),
            nothing,
            "joint 1, {method:?}"
        );
        let none_left = IdentificationError::NoResiduals {
            equations: 3,
            rank: 3,
        };
        assert_eq!(
            failure(&vertical[..1], &[1, 2, 3], Sigma::FromResiduals(3e-5)),
            none_left
        );
    }
}

/// As many equations as unknowns: estimates, but no word on sigma.
#[test]
fn without_residuals_there_is_no_consistency() {
    let mut scenario = differing("klimchik2012");
    scenario.task.belief.nominal.compliance_rad_per_nm =
        scenario.truth.robot.compliance_rad_per_nm.clone();
    leave_open(&mut scenario, &[1, 2, 3]);
    let measurements = noise_free(&scenario, &table4(3));
    let mut found = identified(
        &scenario,
        &measurements[..1],
        known(&scenario),
        Method::Nonlinear,
    );
    assert_eq!(
        (
            found.posterior.estimable.rank(),
            found.consistency,
            found.residual_sigma_m
        ),
        (3, None, None)
    );
    let nominal = &scenario.task.belief.nominal.compliance_rad_per_nm;
    let message = IdentificationMessage::new(&found, nominal);
    let json = serde_json::to_value(message).expect("serializes");
    assert!(json["consistency"].is_null() && json["residual_sigma_mm"].is_null());
    assert!(
        found
            .parameters
            .iter()
            .all(|parameter| parameter.estimate.is_some())
    );
    // What no joint has is not applied, and the others are what they are then.
    let (before, of_first) = (
        found.posterior.mean.clone(),
        nominal[found.parameters[0].joint],
    );
    found.posterior.mean[0] = -1e-9;
    let applied = IdentificationMessage::new(&found, nominal).compliance_applied_rad_per_nm;
    assert!(
        applied[0].to_bits() == of_first.to_bits() && (applied[1] / before[1] - 1.0).abs() > 1e-9,
        "{applied:?} {before:?}"
    );
}
