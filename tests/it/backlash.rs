//! Gaps of joints: the side of approach in files, in belief and truth, and loads that turn joints over.

use elastocal::experiment::read_plan;
use elastocal::measurement::{absolute_table, read_measurements};
use elastocal::numeric::random::generator;
use elastocal::parameter::Backlash;
use elastocal::plan::Assessment;
use elastocal::robot::Approach;
use rand::RngExt;
use serde_json::Value;

use crate::one_fit::{SIGMA_M, SIGMA_RAD, between, normal, seen_arm, workplace};
use crate::support::{Workplace, assert_has, blank_reading, project, scenario_text, setup};
use crate::uncertainties::{assert_holds, assert_refused, entry, expected_mm, loaded, with};

/// Table 4's plan of four, its configurations approached from sides of their own.
fn from_sides(place: &Workplace, sides: [&str; 4]) -> std::path::PathBuf {
    let text = std::fs::read_to_string(project("scenarios/plans/klimchik2012_m4.csv"));
    let mut sides = ["approach"].into_iter().chain(sides);
    let text: Vec<String> = (text.expect("a plan").lines())
        .map(|line| match line.strip_prefix('#') {
            Some(_) => line.to_owned(),
            None => format!("{line},{}", sides.next().expect("five rows")),
        })
        .collect();
    place.write("sides.csv", text.join("\n") + "\n");
    place.path("sides.csv")
}

const MIXED: [&str; 4] = ["+", "-", "+-++-+", ""];

/// The paper's scenario with a study of that plan, and with uncertainties.
fn study_from_sides(uncertainties: &str, level: &str, trials: u32) -> Value {
    let place = Workplace::new();
    let plan = from_sides(&place, MIXED);
    let named = project("scenarios/plans/klimchik2012_m4.csv");
    let text = with(uncertainties, level, trials);
    let text = text.replace(&named.display().to_string(), &plan.display().to_string());
    place.write("laboratory.toml", text);
    let outcome = place.run("study laboratory.toml --json --quiet");
    outcome.ends_with(0).json()["plans"][0].clone()
}

const GAPS: &str = "std_arcsec = 20\nturned_over_at_nm = 200";

/// What a plan says of sides is read and written, a plan without them is as it was, and a word that is none is told.
#[test]
fn plan_files_say_from_which_side() {
    let place = Workplace::new();
    let plan = read_plan(&from_sides(&place, MIXED), 6).expect("a plan");
    let words: Vec<Option<String>> = (plan.experiments.iter())
        .map(|each| each.approach.as_ref().map(Approach::word))
        .collect();
    // Where a column of sides has nothing, all joints turn positively.
    let expected = ["++++++", "------", "+-++-+", "++++++"];
    assert_eq!(words, expected.map(|word| Some(word.to_owned())));
    place.write_plan("again.csv", 6, &plan);
    assert_eq!(read_plan(&place.path("again.csv"), 6), Ok(plan.clone()));
    let mut silent = plan;
    for each in &mut silent.experiments {
        each.approach = None;
    }
    place.write_plan("silent.csv", 6, &silent);
    assert!(!place.read("silent.csv").contains("approach"));

    for (word, says) in [("up", "\"up\""), ("+-", "6 signs")] {
        from_sides(&place, [word, "+", "+", "+"]);
        place.write("s.toml", with("", "model", 64));
        let said = place.refused("evaluate s.toml --plan sides.csv --quiet");
        for part in ["sides.csv", "line 3", "approach", says] {
            said.says(part);
        }
    }
}

/// Measurements of such a plan say from which side; the sides of the virtual robot are those of the plan.
#[test]
fn measurements_say_from_which_side() {
    let place = Workplace::new();
    from_sides(&place, MIXED);
    place.write("s.toml", with(&entry(("backlash", GAPS), ""), "model", 64));
    (place.run("measure s.toml --plan sides.csv --measurements-out m.csv --quiet")).ends_with(0);
    let found = read_measurements(&place.path("m.csv"), 6).expect("measurements");
    let words: Vec<Option<String>> = (found.iter())
        .map(|each| each.approach.as_ref().map(Approach::word))
        .collect();
    assert_eq!(words[1].as_deref(), Some("------"));
    assert_eq!(words[3].as_deref(), Some("++++++"));
    // Whoever identifies from another side is told other compliances.
    let identified = |file: &str| {
        let arguments = format!("identify s.toml --measurements {file} --json --quiet");
        place.done(&arguments).json()["compliance_applied_rad_per_nm"].clone()
    };
    let text = place.read("m.csv").replace("------", "++++++");
    place.write("other.csv", &text);
    assert_ne!(identified("m.csv"), identified("other.csv"));
    // Of a measurement an empty side is one that nobody knows.
    let text = place.read("m.csv");
    place.write("blank.csv", text.replace(",'------", ","));
    let blank = place.run("identify s.toml --measurements blank.csv --quiet");
    let says = "condition C0216: 1 of 4 measurements do not say from which side";
    blank.ends_with(3).says(says);
    place.write("s.toml", with("", "model", 64));
    (place.run("identify s.toml --measurements blank.csv --quiet")).ends_with(0);
}

/// With the same side unloaded and loaded a gap hardly shows in deflections; one that a load turns over does, where the arm's
/// own weight does not hold the joint.
#[test]
fn gaps_cost_where_loads_turn_them_over() {
    let rho0 = |list: &str| {
        let scenario = loaded(&with(list, "model", 64));
        let plan = crate::support::table4(4);
        Assessment::new(&scenario.task, &plan, None)
            .rho0_m
            .expect("determined")
    };
    let (noise, held) = (rho0(""), rho0(&entry(("backlash", "std_arcsec = 20"), "")));
    assert!(held >= noise && held < 1.01 * noise, "{held} {noise}");
    let turned = rho0(&entry(("backlash", GAPS), ""));
    assert!(turned > 1.5 * noise, "{turned} {noise}");
    let remarks = |list: &str| {
        let scenario = loaded(&with(list, "robot", 64));
        let budget = Assessment::new(&scenario.task, &crate::support::table4(4), None);
        let budget = budget.uncertainty_budget;
        let sources = budget.expect("determined").sources.into_iter();
        sources.filter_map(|each| each.remark).collect::<String>()
    };
    let masses = entry(("link_mass", "std_relative = 0.05"), "");
    let gaps = entry(("backlash", GAPS), "");
    assert!(!remarks(&gaps).contains("turn it over"));
    assert!(remarks(&(gaps + &masses)).contains("turn it over does not count"));
    // What no torque of this arm reaches turns nothing over; the test pose is then seen at rest, and not to first order.
    let never = rho0(&entry(
        ("backlash", "std_arcsec = 20\nturned_over_at_nm = 1e11"),
        "",
    ));
    assert!((never / held - 1.0).abs() < 1e-3, "{never} {held}");
}

/// From any sides, known or hidden: what is seen on the virtual robot is what is predicted, or what the account says.
#[test]
fn predictions_hold_from_any_side() {
    for list in [
        entry(("backlash", "std_arcsec = 120"), ""),
        entry(("backlash", GAPS), ""),
    ] {
        assert_holds(&study_from_sides(&list, "robot", 600), &list);
    }
    let plan = study_from_sides(&entry(("backlash", GAPS), "hidden = true"), "robot", 600);
    let number = |key: &str| plan[key].as_f64().expect("a number");
    let expected = expected_mm(&plan);
    let room = 3.0 * number("rms_std_mm") + 0.03 * expected;
    assert!((number("rms_mm") - expected).abs() < room, "{plan}");
    assert!(
        plan["verdict"]
            .as_str()
            .is_some_and(|verdict| verdict.starts_with("exceeded"))
    );
    let exact = study_from_sides(&entry(("backlash", GAPS), ""), "model", 20_000);
    let number = |key: &str| exact[key].as_f64().expect("a number");
    let off = (number("rms_mm") - number("combined_rms_mm")) / number("rms_std_mm");
    assert!(off.abs() < 4.5, "{off}");
}

/// The two ends of the law, and its slope in between, which is that of differences.
#[test]
fn sides_of_a_gap() {
    let gap = Backlash {
        half_width_rad: 1e-4,
        turned_over_at_nm: Some(50.0),
    };
    for came in [false, true] {
        let of_approach = if came { -1.0 } else { 1.0 };
        assert!((gap.side(came, 0.0) - of_approach).abs() < 1e-12);
        assert!((gap.side(came, 1e7) - 1.0).abs() < 1e-9);
        assert!((gap.side(came, -1e7) + 1.0).abs() < 1e-9);
        // As much as the side of approach: they cancel, or agree.
        let at = [gap.side(came, 50.0), gap.side(came, -50.0)];
        assert!((at[0] - f64::midpoint(of_approach, 1.0)).abs() < 1e-12);
        assert!((at[1] - f64::midpoint(of_approach, -1.0)).abs() < 1e-12);
        let torques = (-400..=400).map(|torque| gap.side(came, f64::from(torque)));
        assert!(torques.clone().all(|side| side.abs() <= 1.0 + 1e-12));
    }
    assert!((Backlash::NONE.side(true, 1e9) + 1.0).abs() < 1e-12);
}

/// A bound is about one side of approach.
#[test]
fn bounds_are_about_one_side() {
    let place = Workplace::new();
    from_sides(&place, MIXED);
    let evaluate = || {
        let command = "evaluate s.toml --plan sides.csv --no-proof --json --quiet";
        place.done(command).json()
    };
    place.write(
        "s.toml",
        with(&entry(("backlash", "std_arcsec = 20"), ""), "model", 64),
    );
    let found = evaluate();
    assert_eq!(found["lower_bound_rho0_mm"], Value::Null, "{found}");
    assert!(found.to_string().contains("turning positively"), "{found}");
    // Without gaps no side matters.
    place.write("s.toml", with("", "model", 64));
    assert!(evaluate()["lower_bound_rho0_mm"].is_number());
}

/// The laboratory approaches as the plan says, and its table says so.
#[test]
fn the_laboratory_approaches_as_the_plan_says() {
    let place = Workplace::new();
    let sides = ["-", "+-++-+", "+", "+"];
    from_sides(&place, sides);
    let text = scenario_text("kr270").replace("line_of_sight = true", "");
    place.write("s.toml", text.replace("tool_elevation_max_deg = 30", ""));
    let outcome = place.run("lab s.toml --plan sides.csv --out lab --json --quiet");
    let stops = outcome.json()["stops"].clone();
    let table = place.read("lab/s/lab/measurements.csv");
    assert!(table.contains("approach"), "{table}");
    for stop in stops.as_array().expect("stops") {
        let Some(begins) = stop["approach_deg"].as_array() else {
            continue;
        };
        let experiment = stop["experiments"][0].as_u64().expect("a number") - 1;
        let word = Approach::of_word(sides[usize::try_from(experiment).expect("small")], 6);
        let ends = stop["q_deg"].as_array().expect("angles");
        for ((begin, end), positive) in begins.iter().zip(ends).zip(word.expect("signs").0) {
            let turned = end.as_f64().expect("a number") - begin.as_f64().expect("a number");
            assert_eq!(turned > 0.0, positive, "{stop}");
        }
    }
    assert_has(&table, "------");
    assert_has(&table, "+-++-+");
}

/// Absolute readings from both sides tell the gaps apart from the zeros, within what is known of them before.
#[test]
fn absolute_readings_find_gaps() {
    let scenario = crate::one_fit::ur10();
    let random = &mut generator(31, 0);
    let mut arm = seen_arm(random, &scenario, 1, 1);
    let gaps = [1.5e-4, -2e-4, 1e-4, 2.5e-4, -1e-4, 1.5e-4];
    for (gap, half) in arm.backlash.iter_mut().zip(gaps) {
        gap.half_width_rad = half;
    }
    let mut readings = Vec::new();
    for _ in 0..120 {
        let approach = Approach((0..6).map(|_| random.random_range(0..2) == 0).collect());
        // The arm stands where its zeros would have it.
        let mut standing = arm.clone();
        let told = nalgebra::DVector::from_fn(6, |_, _| between(random, -2.6, 2.6));
        standing.zero_rad = arm.offsets_rad(
            told.as_slice(),
            0,
            &elastocal::robot::Load::NONE,
            Some(&approach),
        );
        standing.backlash = vec![Backlash::NONE; 6];
        let mut reading = pose_of(&standing, &told);
        reading.position_m += nalgebra::Vector3::from_fn(|_, _| normal(random) * SIGMA_M);
        reading.approach = Some(approach);
        readings.push(reading);
    }
    let place = workplace(&readings);
    let text = place.read("s.toml") + &entry(("backlash", "std_arcsec = 60"), "");
    place.write("s.toml", text);
    place.write("m.csv", absolute_table(&6.into(), &readings));
    let outcome =
        place.run("identify s.toml --parameters zeros --measurements m.csv --json --quiet");
    let found = outcome.json();
    let unknowns = found["unknowns"].as_array().expect("unknowns");
    for each in &mut readings[..2] {
        each.approach = None;
    }
    place.write("m.csv", absolute_table(&6.into(), &readings));
    let blank = place.run("identify s.toml --parameters zeros --measurements m.csv --quiet");
    blank.says("condition C0216: 2 of 120 readings do not say from which side");
    for (joint, half) in gaps.iter().enumerate() {
        let name = &scenario.task.belief.nominal.chain.joints[joint].name;
        let name = format!("{name}.backlash");
        let unknown = unknowns.iter().find(|each| each["name"] == name.as_str());
        let unknown = unknown.expect("it is found");
        let number = |key: &str| unknown[key].as_f64().expect("a number");
        assert!(number("standard_error") < 1e-5, "{unknown}");
        assert!(
            (number("value") - half).abs() < 5.0 * number("standard_error"),
            "{unknown}"
        );
    }
}

/// The pose of an arm without a load, with its precision.
pub fn pose_of(
    arm: &elastocal::parameter::ElasticArm,
    told: &nalgebra::DVector<f64>,
) -> elastocal::measurement::AbsoluteReading {
    use elastocal::observation::{ObservationModel, ReadingKind};
    let nothing = elastocal::parameter::ParameterSet::empty();
    let setup = setup(told.clone(), elastocal::robot::Load::NONE, 0);
    let mut ignored = nalgebra::Matrix6xX::zeros(0);
    let seen = ObservationModel::new(&nothing, arm, &[])
        .predict(&setup, ReadingKind::Pose, &mut ignored)
        .expect("stable");
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(seen.rotation);
    let variances = [SIGMA_M, SIGMA_RAD].map(|sigma| sigma * sigma);
    elastocal::measurement::AbsoluteReading {
        configuration_rad: told.clone(),
        load: setup.load,
        position_m: seen.position_m,
        rotation: Some(nalgebra::UnitQuaternion::from_rotation_matrix(&rotation)),
        covariance: Some(nalgebra::Matrix6::from_diagonal(
            &nalgebra::Vector6::from_fn(|row, _| variances[row / 3]),
        )),
        ..blank_reading()
    }
}

/// Wrong entries are named with their key and what is allowed.
#[test]
fn wrong_entries() {
    for (text, key, says) in [
        ("std_arcsec = -1", "std_arcsec", "-1"),
        ("std_mrad = 1", "std_mrad", "it has std_arcsec or std_mm"),
        ("std_mm = 1", "joints", "no joint is left"),
        (
            "turned_over_at_nm = 5",
            "[0]",
            "needs its standard deviation",
        ),
        (
            "std_arcsec = 20\nturned_over_at_nm = 0",
            "turned_over_at_nm",
            "a positive number",
        ),
        (
            "joints = [\"joint_7\"]\nstd_arcsec = 20",
            "joints",
            "the robot's joints are",
        ),
        (
            "std_arcsec = 20\n[[uncertainty]]\nkind = \"backlash\"\nname = \"more\"\nstd_arcsec = 20",
            "",
            "twice",
        ),
        (
            "std_arcsec = 20\n[[uncertainty]]\nkind = \"backlash\"\nname = \"more\"\nstd_arcsec = 20\n\
             turned_over_at_nm = 20\nhidden = true",
            "[1].turned_over_at_nm",
            "something else of joint_1",
        ),
        (
            "std_arcsec = 20\n[[uncertainty]]\nkind = \"joint_zero\"\nstd_mrad = 1\nturned_over_at_nm = 20",
            "[1].turned_over_at_nm",
            "a joint_zero has no such key",
        ),
    ] {
        assert_refused(&format!("kind = \"backlash\"\n{text}"), key, says);
    }
}
