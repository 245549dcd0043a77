//! Bounds that are proved of arms with springs beside the joints' own, joints that slide, and joints that nothing commands.

use elastocal::plan::Criterion;
use elastocal::plan::proof::ProofLimits;
use elastocal::plan::search::{Bound, Problem, RandomPlans};
use elastocal::robot::{Drive, JointSpring, Place, Spring};
use elastocal::scenario::Scenario;
use nalgebra::Vector3;

use crate::support::{Workplace, scenario, scenario_text};

const LIMITS: ProofLimits<'static> = ProofLimits {
    gap: 0.03,
    boxes: 60_000,
    stop: &|| false,
    progress: &|_, _| {},
};

/// No random plan is below what is proved, and searches are not far above.
fn assert_proved(scenario: &Scenario) {
    let task = &scenario.task;
    let proof = Some((LIMITS, false));
    let bound = Bound::search_and_prove(task, Criterion::TestPose, scenario.seed, &[], proof);
    let of_three = bound.of_size(3).expect("a bound");
    let proved = of_three.proof.expect("a proof");
    assert!(proved.left_out.is_empty());
    assert!(proved.best <= of_three.best * (1.0 + 1e-9));
    assert!(
        proved.best > 0.9 * of_three.best,
        "{proved:?} {}",
        of_three.best
    );
    let problem = Problem::new(task, Criterion::TestPose);
    let mut random_plans = RandomPlans::new(&problem, 5);
    for run in 0..300 {
        let plan = random_plans.draw(3, run).expect("there is a plan");
        let value = problem.cost().value(&problem.information(&plan));
        assert!(value.is_none_or(|value| value > proved.best));
    }
}

/// A spring between links and one in a joint, both so stiff that they bear a good part of loads.
#[test]
fn arms_with_springs_are_proved() {
    let mut scenario = scenario("spatial_3r");
    let chain = &mut scenario.task.belief.nominal.chain;
    let compliance = scenario.task.belief.nominal.compliance_rad_per_nm[1];
    chain.elements.joint_springs.push(JointSpring {
        joint: 2,
        stiffness: 0.5 / compliance,
        rest: 0.2,
    });
    chain.elements.springs.push(Spring {
        name: "compensator".to_owned(),
        stiffness_n_per_m: 2.0 / compliance,
        rest_m: [0.3; 2],
        path: vec![
            Place {
                joints: 1,
                position_m: Vector3::new(-0.5, 0.0, 0.3),
            },
            Place {
                joints: 2,
                position_m: Vector3::new(0.1, 0.05, 0.3),
            },
        ],
    });
    assert_proved(&scenario);
}

/// The middle joint is held by its spring alone; then it slides.
#[test]
fn arms_with_joints_that_slide_or_are_passive_are_proved() {
    let mut scenario = scenario("spatial_3r");
    let joint = &mut scenario.task.belief.nominal.chain.joints[1];
    joint.drive.passive_at = Some(0.4);
    joint.range_rad = [0.4; 2];
    scenario.task.region.joint_range_rad[1] = [0.4; 2];
    for pose in &mut scenario.task.test_poses {
        pose.configuration_rad[1] = 0.4;
    }
    assert_proved(&scenario);
    let joint = &mut scenario.task.belief.nominal.chain.joints[1];
    joint.drive = Drive {
        slides: true,
        passive_at: None,
    };
    joint.range_rad = [-0.1, 0.3];
    scenario.task.region.joint_range_rad[1] = [-0.1, 0.3];
    for pose in &mut scenario.task.test_poses {
        pose.configuration_rad[1] = 0.1;
    }
    assert_proved(&scenario);
}

/// The proof of the arm with the compensator is near with the usual effort. Where more is uncertain than the noise, what
/// compensation leaves depends on where the arm rests: nothing is proved, and the reason is told.
#[test]
fn a_gravity_compensator_is_in_the_proof() {
    let place = Workplace::new();
    let text = scenario_text("kr270_compensator");
    place.write("noise.toml", &text);
    let uncertain = "\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 0.2\n";
    place.write("uncertain.toml", text + uncertain);
    let evaluate = |name: &str, options: &str| {
        let plan = crate::support::project("scenarios/plans/klimchik2012_m3.csv");
        let plan = plan.display();
        place.run(&format!(
            "evaluate {name}.toml --plan {plan} --quiet {options}"
        ))
    };
    let json = evaluate("noise", "--prove 10% --json").json();
    let number = |key: &str| json[key].as_f64().expect("a number");
    let [proved, evidence] = ["proved_lower_bound_rho0_mm", "lower_bound_rho0_mm"].map(number);
    assert!(proved <= evidence && proved > 0.95 * evidence);
    assert!(
        json["proof"]["boxes"].as_u64() < Some(200_000),
        "{}",
        json["proof"]
    );
    let refused = evaluate("uncertain", "");
    let reason = "make what compensation leaves depend on where the arm rests";
    assert!(refused.stdout.contains(reason), "{}", refused.stdout);
    let json = evaluate("uncertain", "--json").json();
    assert!(json["proved_lower_bound_rho0_mm"].is_null() && json["bound_kind"] == "evidence");
}
