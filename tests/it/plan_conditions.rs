//! What is said of a plan and its scenario before a predicted accuracy is relied on; a plan's repeats beside its bound.

use elastocal::codes::ConditionCode;
use elastocal::experiment::SAME_CONFIGURATION;
use elastocal::plan::search::{Bound, BudgetPoint, RepeatsNeeded, random_plan, repeats_needed};
use elastocal::plan::{Assessment, Criterion, Plan, posterior, rho0_m};
use elastocal::scenario::Scenario;

use crate::support::{
    Workplace, assert_alike, assert_has, project, scenario, scenario_text, shipped, table4,
};

const MISFIT: &str = "[[uncertainty]]\nkind = \"discrepancy\"\nstd_mm = 0.05\n\n[design]";

fn loaded(text: &str) -> Scenario {
    let workplace = Workplace::with("s.toml", text);
    workplace.scenario("s.toml")
}

/// Where much is shared by a whole plan, which repeats do not average.
#[test]
fn no_repeated_plan_is_below_the_bound_that_is_shown_beside_it() {
    let scenario = scenario("kr270");
    let (task, seed) = (&scenario.task, scenario.seed);
    let shown = Bound::search(task, seed).with_sizes(seed, [3, 6]);
    // Whichever command asks for a number of measurements, its bound is the same.
    let asked = Bound::search_and_prove(task, Criterion::TestPose, seed, &[6], None);
    let [shown_m, asked_m] = [&shown, &asked].map(|bound| bound.of_size(6).expect("a bound").best);
    assert_alike(shown_m, asked_m, 1e-12);
    let random = random_plan(task, 3, seed, 0).expect("a plan");
    for plan in [table4(3), random] {
        let once = BudgetPoint::repeated(task, &plan, 1, &shown).expect("determined");
        let twice = BudgetPoint::repeated(task, &plan, 2, &shown).expect("determined");
        for point in [&once, &twice] {
            assert!(point.rho0_m >= point.lower_bound_m().expect("a bound"));
        }
        assert!(twice.rho0_m > once.rho0_m / f64::sqrt(2.0) && twice.rho0_m < once.rho0_m);
        // The repeats that are said to be needed are, and what is said never to be reached is not.
        let Some(RepeatsNeeded::Never(limit_m)) = repeats_needed(task, &plan, 1e-7) else {
            panic!("0.1 um is within reach");
        };
        assert!(limit_m > 1e-7 && limit_m < twice.rho0_m);
        let wanted_m = 0.5 * (limit_m + once.rho0_m);
        let Some(RepeatsNeeded::Times(times)) = repeats_needed(task, &plan, wanted_m) else {
            panic!("half of the way is within reach");
        };
        let left =
            |times| BudgetPoint::repeated(task, &plan, times, &shown).map(|each| each.rho0_m);
        assert!(left(times).expect("determined") <= wanted_m);
        assert!(times < 2 || left(times - 1).expect("determined") > wanted_m);
    }
}

/// Two configurations so far apart in their last joint (deg), of which the second has the load of the first.
fn apart(by_deg: f64) -> Plan {
    let mut plan = table4(3);
    let mut other = plan.experiments[0].clone();
    other.configuration_rad[3] += by_deg.to_radians();
    plan.experiments.push(other);
    plan
}

#[test]
fn neighbouring_configurations_with_discrepancies_of_their_own_are_named() {
    let scenario = loaded(&scenario_text("klimchik2012").replace("[design]", MISFIT));
    let named = |plan: &Plan| Assessment::new(&scenario.task, plan, None).conditions;
    assert!(named(&apart(6.0)).is_empty());
    let near = named(&apart(2.0));
    assert!(near.len() == 1 && near[0].code == ConditionCode::NearConfigurations);
    let near = &near[0].text;
    assert_has(near, "experiments 1 and 4 are within 5 deg");
    let accuracy = |plan: &Plan| {
        rho0_m(&scenario.task, &posterior(&scenario.task.belief, plan)).expect("determined")
    };
    let mut as_one = apart(0.0);
    as_one.experiments[3].configuration_rad = as_one.experiments[0].configuration_rad.clone();
    for rho0_m in [accuracy(&as_one), accuracy(&apart(2.0))] {
        let shown = format!("{:.3} um", rho0_m * 1e6);
        assert!(near.contains(&shown), "{near} {shown}");
    }
    // Repeats of one configuration are no neighbours, nor is anything where discrepancies are none.
    assert!(named(&apart(0.0)).is_empty());
    let without = self::scenario("klimchik2012");
    assert!(
        Assessment::new(&without.task, &apart(2.0), None)
            .conditions
            .is_empty()
    );
}

/// What is designed goes to one configuration once, with the same angles under every load.
#[test]
fn experiments_of_one_configuration_are_put_together() {
    let mut plan = apart(0.5 * SAME_CONFIGURATION.to_degrees());
    let mut other = plan.experiments[3].clone();
    other.load.force_n *= 0.5;
    plan.experiments.push(other);
    let readings = plan.measurements();
    plan.put_repeats_together();
    assert_eq!(plan.measurements(), readings);
    assert_eq!(
        (plan.experiments.len(), plan.experiments[0].repeats),
        (4, 2)
    );
    let angles = |place: usize| plan.experiments[place].configuration_rad.clone();
    assert_eq!(angles(0), angles(3));
    let before = plan.clone();
    plan.put_repeats_together();
    assert_eq!(plan, before);
}

/// Tables and controllers round angles: what they make of one configuration stays one.
#[test]
fn configurations_within_a_hundredth_of_a_degree_are_one() {
    let scenario = loaded(&scenario_text("klimchik2012").replace("[design]", MISFIT));
    let limit_deg = SAME_CONFIGURATION.to_degrees();
    let shares = |by_deg: f64| apart(by_deg).by_configuration().len() == 3;
    assert!(shares(0.0) && shares(0.99 * limit_deg) && shares(-0.99 * limit_deg));
    assert!(!shares(1.01 * limit_deg));
    let accuracy = |by_deg: f64| {
        let plan = apart(by_deg);
        rho0_m(&scenario.task, &posterior(&scenario.task.belief, &plan)).expect("determined")
    };
    assert!((accuracy(0.99 * limit_deg) / accuracy(0.0) - 1.0).abs() < 1e-3);
    assert!(accuracy(1.01 * limit_deg) < 0.999 * accuracy(0.0));
}

#[test]
fn loads_in_other_units_or_of_the_wrong_sign_are_named() {
    let workplace = Workplace::new();
    let plan = project("scenarios/plans/klimchik2012_m3.csv");
    let hung = std::fs::read_to_string(&plan).expect("the plan can be read");
    let evaluate = "evaluate s.toml --no-proof --plan p.csv";
    let text = scenario_text("klimchik2012");
    for (from, to, hung_n, code, said) in [
        (
            "force_n = [0, 280, -180]",
            "force_n = [0, 0.28, -0.18]",
            "-2500",
            "C0501",
            "less than sigma = 30.000 um of the instrument",
        ),
        (
            "force_n = [0, 0, -2500]",
            "force_n = [0, 0, 2500]",
            "2500",
            "C0502",
            "load: the force points against gravity",
        ),
        (
            "force_n = [0, 0, -2500]",
            "force_n = [0, 0, -2.5]",
            "-2.5",
            "C0104",
            "compensation gains next to nothing",
        ),
    ] {
        workplace.write("s.toml", text.replace(from, to));
        workplace.write("p.csv", hung.replace("-2500", hung_n));
        let outcome = workplace.doubted(evaluate);
        let outcome = outcome.says(&format!("condition {code}: "));
        outcome.says(said);
        if !said.starts_with("compensation") {
            let check = workplace.done("check s.toml");
            assert!(format!("{check:?}").contains(said), "{check:#?}");
        }
    }
    workplace.write("s.toml", text);
    let evaluate = format!("evaluate s.toml --no-proof --plan {}", plan.display());
    assert!(!workplace.run(&evaluate).stderr.contains("next to nothing"));
}

/// A robot that gives way under its own weight has no accuracy anywhere.
#[test]
fn no_command_predicts_for_a_robot_that_does_not_stand() {
    let workplace = Workplace::new();
    let soft = "compliance_rad_per_nm = [1e-6, 100, 1e-6, 1e-6, 1e-6, 1e-6]\n[instrument]";
    workplace.write(
        "s.toml",
        scenario_text("klimchik2012").replacen("[instrument]", soft, 1),
    );
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let said = "static equilibrium";
    let check = workplace.doubted("check s.toml");
    assert!(!check.stdout.contains("is valid"), "{check:#?}");
    check.says("condition C0504: ").says(said);
    for command in [
        format!("evaluate s.toml --no-proof --plan {plan}"),
        "plan s.toml --no-proof".to_owned(),
        "budget s.toml --no-proof --up-to 3".to_owned(),
        "run s.toml --no-proof".to_owned(),
        "study s.toml --trials 10".to_owned(),
    ] {
        let outcome = workplace.refused(&command);
        assert!(outcome.stderr.contains(said), "{command}: {outcome:#?}");
    }
}

/// The virtual robot's distances are no laboratory's.
#[test]
fn only_a_virtual_robots_distances_are_shown() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m3.csv");
    let measure = format!("measure s.toml --quiet --plan {plan} --measurements-out");
    workplace.done(&format!("{measure} virtual.csv --seed 5 --run 3"));
    let table = workplace.read("virtual.csv");
    assert_has(&table, "# simulated: {\"seed\":5,\"run\":3}");
    let is_row = |line: &&str| !line.starts_with('#');
    let rows: Vec<&str> = table.lines().filter(is_row).collect();
    workplace.write("laboratory.csv", rows.join("\n"));
    let mut compensated = Vec::new();
    for name in ["virtual", "laboratory"] {
        let identify = format!(
            "identify s.toml --quiet --measurements {name}.csv --identified-out {name}.json"
        );
        workplace.done(&identify);
        let compensate = format!("compensate s.toml --identified {name}.json");
        let text = workplace.done(&compensate).stdout;
        assert_eq!(
            text.contains("compensated [mm]"),
            name == "virtual",
            "{text}"
        );
        compensated.push(workplace.json(&compensate));
    }
    let [of_virtual, of_laboratory] = [&compensated[0], &compensated[1]];
    assert!(
        of_virtual["residual_mm"].is_f64() && of_virtual["test_poses"][0]["residual_mm"].is_f64()
    );
    assert!(of_laboratory["residual_mm"].is_null());
    assert!(of_laboratory["test_poses"][0]["uncompensated_xyz_mm"].is_null());
    assert_eq!(
        of_virtual["q_commanded_deg"],
        of_laboratory["q_commanded_deg"]
    );
    // A controller that compensates by itself leaves nothing to identify.
    workplace.write(
        "compensated.csv",
        format!("# controller_compensates: yes\n{}", rows.join("\n")),
    );
    let outcome = workplace.doubted("identify s.toml --quiet --measurements compensated.csv");
    outcome.says("condition C0212: the controller compensated deflections itself");
}

/// A compliance that a plan shows less well than its nominal value does is named: identification keeps it nominal then.
#[test]
fn compliances_less_certain_than_nominal_are_named() {
    let place = Workplace::with("s.toml", scenario_text("ur10"));
    let plan = shipped("tests/golden/plans/ur10.csv");
    let evaluate = format!("evaluate s.toml --no-proof --plan {plan}");
    let told = place.done(&evaluate);
    let note =
        "note: identification keeps wrist_3.compliance nominal: predicted standard errors of 3.0";
    told.prints(note);
    place.write(
        "p.toml",
        scenario_text("ur10").replace("sigma_mm = 0.02", "sigma_mm = 0.002"),
    );
    let precise = evaluate.replace("s.toml", "p.toml");
    let told = place.run(&precise).stdout;
    assert!(!told.contains("identification keeps"), "{told}");
}

/// A load in kilonewtons that is written as newtons, a thousandfold, bends the robot beyond what first order is for.
#[test]
fn deflections_that_are_not_small_are_a_condition() {
    let scenario = scenario("klimchik2012");
    let codes = |plan: &Plan| -> Vec<ConditionCode> {
        let found = Assessment::new(&scenario.task, plan, None).conditions;
        found.into_iter().map(|each| each.code).collect()
    };
    let mut plan = table4(3);
    assert!(!codes(&plan).contains(&ConditionCode::LargeDeflection));
    for experiment in &mut plan.experiments {
        experiment.load.force_n *= 100.0;
    }
    assert!(codes(&plan).contains(&ConditionCode::LargeDeflection));
}
