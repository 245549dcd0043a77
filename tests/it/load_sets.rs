//! One load set decides which loads are allowed, in every command that meets one.

use elastocal::experiment::Loads;
use elastocal::plan::{Assessment, Plan};
use elastocal::robot::Load;
use elastocal::study::Conditions;
use nalgebra::Vector3;

use crate::support::{Workplace, scenario, scenario_text, table4};

/// Table 4's plan of three under other loads.
fn plan_text(loads: &[[f64; 3]]) -> String {
    let mut text =
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n"
            .to_owned();
    for (experiment, [x, y, z]) in table4(3).experiments.iter().zip(loads) {
        let q: Vec<String> = (experiment.configuration_rad.iter())
            .map(|angle| format!("{:.1}", angle.to_degrees()))
            .collect();
        text += &format!("{},{x},{y},{z},0,0,0,1\n", q.join(","));
    }
    text
}

const VERTICAL: [f64; 3] = [0.0, 0.0, -2500.0];
const HEAVY: [f64; 3] = [0.0, 0.0, -250_000.0];
const IN_WORDS: &str = "experiment 2: load is (0, 0, -250000) N; allowed is (0, 0, -2500) N";

fn workplace() -> Workplace {
    let workplace = Workplace::with("cell.toml", scenario_text("klimchik2012"));
    workplace.write("heavy.csv", plan_text(&[VERTICAL, HEAVY, VERTICAL]));
    workplace
}

#[test]
fn a_load_outside_the_set_is_a_violation() {
    let workplace = workplace();
    let check = workplace.doubted("check cell.toml --plan heavy.csv --json");
    let json = check.json();
    assert_eq!(json["ok"], false);
    assert!(
        json["problems"]
            .as_array()
            .is_some_and(|all| all.iter().any(|each| each == IN_WORDS))
    );
    let text = workplace
        .doubted("check cell.toml --plan heavy.csv --quiet")
        .stdout;
    assert!(text.contains(IN_WORDS), "{text}");

    let evaluated = workplace
        .doubted("evaluate cell.toml --plan heavy.csv --json")
        .json();
    let violation = &evaluated["violations"][0];
    assert_eq!(
        (&violation["what"], &violation["text"]),
        (&"load".into(), &IN_WORDS.into())
    );
    assert_eq!(violation["experiment"], 2);
    assert!(violation["found"].is_null() && violation["bound"].is_null());
}

/// What is measured is measured, but not without a word.
#[test]
fn measurements_under_foreign_loads_are_named() {
    let workplace = workplace();
    let measured =
        workplace.refused("measure cell.toml --plan heavy.csv --measurements-out m.csv --quiet");
    // 250 kN bend the virtual robot beyond any equilibrium; ten times the load does not.
    measured.says("heavy.csv");
    let tenfold = VERTICAL.map(|force| 2.0 * force);
    workplace.write("heavy.csv", plan_text(&[VERTICAL, tenfold, tenfold]));
    let measured =
        workplace.doubted("measure cell.toml --plan heavy.csv --measurements-out m.csv --quiet");
    let words =
        "2 of 3 experiments have loads outside the load set; experiment 2: load is (0, 0, -5000) N";
    measured.says(words);
    let identified = workplace.doubted("identify cell.toml --measurements m.csv --quiet");
    let words = words.replace("experiment", "measurement");
    identified.says(&words);
    identified.prints("joint_2");
}

#[test]
fn plan_files_of_a_study_are_judged() {
    let workplace = workplace();
    let mut text = scenario_text("klimchik2012");
    let study = text.find("[study]").expect("there is a study");
    text.truncate(study);
    text += "[study]\ntrials = 100\nexperiments = 3\n[[study.plan]]\nname = \"mine\"\nkind = \"file\"\nfile = \"heavy.csv\"\n";
    workplace.write("cell.toml", text);
    let outcome = workplace.doubted("study cell.toml --quiet");
    let words = format!("plan \"mine\": {IN_WORDS}");
    outcome.says(&words);
}

#[test]
fn a_mandatory_plan_keeps_to_the_loads() {
    let workplace = workplace();
    let text = scenario_text("klimchik2012").replace(
        "experiments = 3\n",
        "experiments = 4\nmandatory = \"heavy.csv\"\n",
    );
    workplace.write("cell.toml", text);
    let outcome = workplace.refused("check cell.toml");
    let words = format!("cell.toml: design.mandatory: {IN_WORDS}");
    outcome.says(&words);
    outcome.says("hint: ");
}

/// A load is printed with one decimal: its components are off by half a unit of that at most, and a
/// light one by a thousandth.
#[test]
fn loads_may_be_off_by_their_printing() {
    let aslant = Vector3::new(1.0, 0.0, -1.0).normalize();
    let fixed = Loads::Fixed(Load::force(aslant.x * 2500.0, 0.0, aslant.z * 2500.0));
    let direction = Loads::Direction {
        direction: aslant,
        force_n: [100.0, 2500.0],
    };
    let any = Loads::Any {
        force_max_n: 2500.0,
    };
    let list = Loads::List(vec![
        Load::force(0.0, 0.0, 1.0),
        Load::force(1767.767, 0.0, -1767.767),
    ]);
    for set in [&fixed, &direction, &any, &list] {
        assert!(set.contains(&Load::force(1767.8, 0.0, -1767.8)), "{set:?}");
        assert!(
            set.contains(&Load::force(1767.77, 0.0, -1767.77)),
            "{set:?}"
        );
        assert!(!set.contains(&Load::force(1768.0, 0.0, -1768.0)), "{set:?}");
    }
    for other in [
        Load::force(1000.0, 0.0, -1000.0),
        Load::force(71.0, 0.0, -71.0),
    ] {
        assert!(!fixed.contains(&other) && !list.contains(&other));
        assert!(direction.contains(&other) && any.contains(&other));
    }
    let weak = Load::force(70.0, 0.0, -70.0);
    assert!(!direction.contains(&weak) && any.contains(&weak));
    let across = Load::force(1000.0, 1.0, -1000.0);
    assert!(!direction.contains(&across) && any.contains(&across));
    let light = Loads::Fixed(Load::force(0.0, 0.0, -2.0));
    assert!(light.contains(&Load::force(0.0, 0.0, -2.001)));
    assert!(!light.contains(&Load::force(0.0, 0.0, -2.01)));
    let twisted = Load {
        torque_nm: Vector3::new(0.0, 0.0, 1.0),
        ..Load::force(0.0, 0.0, 1.0)
    };
    for set in [&fixed, &direction, &any, &list] {
        assert!(!set.contains(&twisted), "{set:?}");
    }
    let words = direction.outside(&twisted).expect("outside");
    assert_eq!(
        words,
        "load is (0, 0, 1) N with (0, 0, 1) N m; allowed is a force along (0.707107, 0, -0.707107) of 100 to 2500 N"
    );
}

/// All calibration loads are scaled alike, those of mandatory experiments too.
#[test]
fn a_scale_of_loads_scales_mandatory_experiments() {
    let mut scenario = scenario("klimchik2012");
    scenario.task.design.mandatory = table4(2);
    let conditions = Conditions {
        sigma_m: 1e-4,
        experiments: 3,
        load_scale: 0.5,
    };
    let scaled = conditions.of(&scenario.task);
    for experiment in &scaled.design.mandatory.experiments {
        assert_eq!(experiment.load, Load::force(0.0, 0.0, -1250.0));
        assert!(scaled.loads.contains(&experiment.load));
    }
}

#[test]
fn a_plan_without_experiments_predictions_nothing() {
    let assessment = Assessment::new(&scenario("klimchik2012").task, &Plan::default(), None);
    assert_eq!((assessment.experiments, assessment.rho0_m), (0, None));
    assert!(assessment.standard_errors.iter().all(Option::is_none));
    assert!(assessment.criteria.iter().all(|(_, value)| value.is_none()));
}
