//! An earlier identification as what is known before: planning, identification and studies use it.

use elastocal::compensation::{test_pose_rows, weighted_rows};
use elastocal::parameter::ParameterKind;
use elastocal::plan::{ExperimentModel, Plan};
use elastocal::task::Belief;
use nalgebra::DMatrix;
use serde_json::Value;

use crate::support::{
    self, Workplace, assert_alike, assert_alike_in, assert_near, list, number, numbers, project,
    scenario_text,
};

/// klimchik2012 by the linear method, so that two steps are exactly one.
fn linear() -> String {
    let method = "[identification]\nmethod = \"linear\"\n\n[instrument]";
    scenario_text("klimchik2012").replace("[instrument]", method)
}

fn with_prior(text: &str, file: &str) -> String {
    text.replace(
        "\nparameters = ",
        &format!("\nprior = \"{file}\"\nparameters = "),
    )
}

fn table4(experiments: u32) -> String {
    let path = project(&format!("scenarios/plans/klimchik2012_m{experiments}.csv"));
    path.display().to_string()
}

/// Measures a plan of the paper.
fn measured(place: &Workplace, scenario: &str, experiments: u32, out: &str) {
    let plan = table4(experiments);
    let arguments = format!("measure {scenario} --plan {plan} --measurements-out {out}");
    place.done(&arguments);
}

fn identified(place: &Workplace, scenario: &str, measurements: &str, out: &str) -> Value {
    let arguments = format!(
        "identify {scenario} --measurements {measurements} --identified-out {out} --json --quiet"
    );
    place.run(&arguments).json()
}

fn assert_all_alike(one: &Value, other: &Value, key: &str, share: f64) {
    let (one, other) = (numbers(&one[key]), numbers(&other[key]));
    assert_eq!(one.len(), 5);
    for (one, other) in one.iter().zip(&other) {
        assert_alike_in(&key, *one, *other, share);
    }
}

/// Two campaigns one after the other tell what both tell together.
#[test]
fn two_steps_are_one() {
    let place = Workplace::with("first.toml", linear());
    place.write("second.toml", with_prior(&linear(), "first.json"));
    let mut both = String::new();
    for (m, name) in [(3, "a.csv"), (4, "b.csv")] {
        let plan = table4(m);
        let arguments =
            format!("measure first.toml --plan {plan} --measurements-out {name} --seed {m}");
        place.done(&arguments);
        let text = place.read(name);
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        for line in rows.skip(usize::from(!both.is_empty())) {
            both += &format!("{line}\n");
        }
    }
    place.write("both.csv", both);
    identified(&place, "first.toml", "a.csv", "first.json");
    let second = identified(&place, "second.toml", "b.csv", "second.json");
    let together = identified(&place, "first.toml", "both.csv", "together.json");
    assert_all_alike(&second, &together, "compliance_rad_per_nm", 1e-9);
    assert_all_alike(&second, &together, "compliance_std_rad_per_nm", 1e-9);
    // And planning predicts what identification then says.
    let arguments = format!("evaluate second.toml --plan {} --json --quiet", table4(4));
    let predicted = place.run(&arguments).json();
    assert_all_alike(&predicted, &second, "compliance_std_rad_per_nm", 1e-9);
    assert!(
        predicted["efficiency"]
            .as_f64()
            .is_some_and(|share| share > 0.8 && share <= 1.0)
    );
}

/// What an earlier campaign and a data sheet tell of the same compliances is known together: runs sample them once, from both,
/// and errors are those that are predicted, at both levels.
#[test]
fn what_two_sources_tell_of_a_compliance_is_sampled_once() {
    let place = Workplace::new();
    let sheet = "\n[[uncertainty]]\nkind = \"compliance\"\nstd_relative = 0.01\njoints = [\"joint_2\", \"joint_3\", \
                 \"joint_4\", \"joint_5\", \"joint_6\"]\n";
    let plan = format!(
        "\n[study]\nexperiments = 3\n\n[[study.plan]]\nname = \"m3\"\nkind = \"file\"\nfile = \"{}\"\n",
        table4(3)
    );
    let linear = linear();
    let (text, _) = linear.split_once("\n[study]").expect("a study");
    place.write(
        "second.toml",
        with_prior(text, "first.json") + sheet + &plan,
    );
    place.write("first.toml", text);
    measured(&place, "first.toml", 3, "a.csv");
    identified(&place, "first.toml", "a.csv", "first.json");
    for (level, trials) in [("model", 20_000), ("robot", 2000)] {
        let arguments =
            format!("study second.toml --level {level} --trials {trials} --seed 3 --json --quiet");
        let study = place.done(&arguments).json();
        let plan = &study["plans"][0];
        let of = |key: &str| number(&plan[key]);
        let believed = of("combined_rms_mm");
        let error = 4.0 * of("rms_std_mm");
        assert!((of("rms_mm") - believed).abs() < error, "{level}: {plan}");
        // What is said to contribute is all that is predicted.
        let contributions = list(&plan["contributions"]).iter();
        let squares = contributions.map(|each| number(&each["contribution_um"]).powi(2));
        let sum_mm = squares.sum::<f64>().sqrt() * 1e-3;
        assert_alike_in(&level, sum_mm, believed, 1e-9);
        assert!(of("nees_z").abs() < 4.0, "{level}: {plan}");
    }
}

/// The paper's second step: a joint that a vertical load does not show is known from elsewhere. Plans take
/// it along, no plan beats the bound, and runs of a study spread as predicted.
#[test]
fn a_joint_that_no_load_shows_is_known_before() {
    let place = Workplace::new();
    let plan = project("scenarios/plans/kr270_joint1.csv");
    let method = "[identification]\nmethod = \"linear\"\n\n[instrument]";
    let text = scenario_text("klimchik2012_joint1").replace("[instrument]", method);
    place.write("joint1.toml", text);
    let arguments = format!(
        "measure joint1.toml --plan {} --measurements-out m.csv",
        plan.display()
    );
    place.done(&arguments);
    place.done("identify joint1.toml --measurements m.csv --identified-out joint1.json");
    place.write(
        "all.toml",
        with_prior(&scenario_text("klimchik2012"), "joint1.json"),
    );
    place.write("alone.toml", scenario_text("klimchik2012"));
    let planned = place.json("plan all.toml --plan-out p.csv");
    assert_eq!(planned["parameters"][0], "joint_1");
    let efficiency = planned["efficiency"].as_f64().expect("a bound");
    assert!((0.85..=1.0).contains(&efficiency), "{efficiency}");
    // The errors of what is known before and of what is measured are independent.
    let rho0 = |scenario: &str, plan: &str| {
        let results = place.record(&format!("evaluate {scenario} --plan {plan}"));
        results["rho0_mm"].as_f64().expect("determined")
    };
    let (one, five) = (
        rho0("joint1.toml", &plan.display().to_string()),
        rho0("alone.toml", "p.csv"),
    );
    let all = rho0("all.toml", "p.csv");
    // The compliance that was found is not quite the nominal one; to first order that changes nothing.
    assert_alike(all, one.hypot(five), 1e-9);
    for (level, trials) in [("model", 20_000), ("robot", 300)] {
        let arguments = format!("study all.toml --level {level} --trials {trials} --json --quiet");
        let study = place.run(&arguments).json();
        for plan in list(&study["plans"]) {
            let number = |key: &str| plan[key].as_f64().expect("a number");
            assert!(
                number("z").abs() < 5.0,
                "{level}, {}: {}",
                plan["name"],
                number("z")
            );
            // Chi-square with six degrees of freedom.
            let standard_error = (12.0 / f64::from(trials)).sqrt();
            let off = (number("nees") - 6.0) / standard_error;
            assert!(
                off.abs() < 5.0,
                "{level}, {}: NEES is off by {off}",
                plan["name"]
            );
        }
    }
}

/// A plan's whitened rows by all unknowns, in units of `sizes`.
fn whitened(belief: &Belief, plan: &Plan, sizes: &DMatrix<f64>) -> DMatrix<f64> {
    let own = ExperimentModel::new(belief).observation_matrices(plan);
    let rows = (own.iter().zip(&plan.experiments))
        .map(|(own, experiment)| own * f64::from(experiment.repeats).sqrt());
    let rows: Vec<_> = rows
        .flat_map(|own| {
            own.row_iter()
                .map(Into::into)
                .collect::<Vec<nalgebra::RowDVector<f64>>>()
        })
        .collect();
    DMatrix::from_rows(&rows) * sizes / belief.instrument.sigma_m
}

/// The covariance of the last campaign's unknowns, in units of `sizes`, where all campaigns are identified in one: those of `kept` have one
/// value in all, the others one in each. `own` are the precisions that sources give by themselves.
fn in_one(campaigns: &[DMatrix<f64>], kept: &[bool], own: &[f64]) -> DMatrix<f64> {
    let count = kept.len();
    let all = count * campaigns.len();
    let mut information = DMatrix::zeros(all, all);
    for (number, rows) in campaigns.iter().rev().enumerate() {
        let place = |column: usize| column + if kept[column] { 0 } else { count * number };
        let square = rows.tr_mul(rows);
        for row in 0..count {
            for column in 0..count {
                information[(place(row), place(column))] += square[(row, column)];
            }
            let is_first = number == 0 || !kept[row];
            information[(place(row), place(row))] += if is_first { own[row] } else { 0.0 };
        }
    }
    let used: Vec<usize> = (0..all)
        .filter(|&place| information[(place, place)] > 0.0)
        .collect();
    let information = information.select_rows(&used).select_columns(&used);
    let covariance = information.try_inverse().expect("regular");
    covariance.view((0, 0), (count, count)).into_owned()
}

/// Runs of studies err by as much as is predicted.
fn errors_are_predicted(place: &Workplace, (level, trials): (&str, u32), scenarios: &[&str]) {
    for name in scenarios {
        let arguments =
            format!("study {name}.toml --level {level} --trials {trials} --seed 3 --json --quiet");
        let study = place.done(&arguments).json();
        let plan = &study["plans"][0];
        let of = |key: &str| number(&plan[key]);
        let off = of("rms_mm") - of("combined_rms_mm");
        assert!(
            off.abs() < 4.0 * of("rms_std_mm"),
            "{name}, {level}: {plan}"
        );
        // On the robot the linear method errs by more than its covariance says, in the first campaign, too.
        let is_linear = level == "model";
        assert!(
            !is_linear || of("nees_z").abs() < 4.0,
            "{name}, {level}: {plan}"
        );
    }
}

/// A gearbox that was replaced has a compliance of its own, of which the earlier campaign knows nothing; of the others it knows as much.
#[test]
fn a_replaced_gearbox_is_another_unknown() {
    const REPLACED: usize = 1;
    let place = Workplace::new();
    let linear = linear();
    let (text, _) = linear.split_once("\n[study]").expect("a study");
    place.write("first.toml", text);
    let arguments = format!(
        "measure first.toml --plan {} --measurements-out m.csv",
        table4(6)
    );
    place.done(&arguments);
    identified(&place, "first.toml", "m.csv", "first.json");
    let gearbox = "\n[[uncertainty]]\nkind = \"compliance\"\njoints = [\"joint_3\"]\nstd_relative = 0.15\nreplaced = true\n";
    place.write("second.toml", with_prior(text, "first.json") + gearbox);
    let belief = |name: &str| place.scenario(name).task.belief;
    let [first, second] = ["first.toml", "second.toml"].map(belief);
    let nominal = first.nominal.compliance_rad_per_nm[first.parameters[REPLACED]];
    assert_eq!(
        second.nominal.compliance_rad_per_nm[second.parameters[REPLACED]].to_bits(),
        nominal.to_bits()
    );
    let sizes = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(second.sizes()));
    let covariance = (&sizes * second.precision() * &sizes).try_inverse();
    let covariance = &sizes * covariance.expect("known") * &sizes;
    let found = place.parsed("first.json");
    for row in 0..covariance.nrows() {
        for column in 0..covariance.ncols() {
            let expected = match [row, column].map(|each| each == REPLACED) {
                [true, true] => (0.15 * nominal).powi(2),
                [false, false] => number(&found["covariance_rad2_per_n2m2"][row][column]),
                _ => 0.0,
            };
            let size = (covariance[(row, row)] * covariance[(column, column)]).sqrt();
            let off = (covariance[(row, column)] - expected) / size;
            assert!(off.abs() < 1e-6, "{row} {column}: {off}");
        }
    }
}

/// Writes a scenario whose earlier campaign found the load cell far from nominal: that is the mean of what is known.
fn write_far(place: &Workplace) {
    let mut found = place.parsed("first.json");
    let sources = found["uncertain"].as_array_mut().expect("a list");
    let scale = sources.iter_mut().find(|each| each["name"] == "load.scale");
    scale.expect("a scale")["value"] = serde_json::json!(0.03);
    place.write("far.json", found.to_string());
    let far = with_prior(&place.read("first.toml"), "far.json");
    place.write("far.toml", far);
}

/// Where the load cell is kept, its error is one unknown of all campaigns: a second and a third one predict what all together determine,
/// and runs err by as much. One that was replaced is another unknown.
#[test]
fn a_source_of_several_campaigns_is_one_unknown() {
    let place = Workplace::new();
    let sources = "\n[[uncertainty]]\nkind = \"load_scale\"\nstd_relative = 0.01\n\n[[uncertainty]]\nkind = \"tool_position\"\nstd_mm = 3\n";
    let study = format!(
        "\n[study]\nexperiments = 4\n[[study.plan]]\nname = \"four\"\nkind = \"file\"\nfile = \"{}\"\n",
        table4(4)
    );
    let linear = linear();
    let (text, _) = linear.split_once("\n[study]").expect("a study");
    let first = text.to_owned() + sources + &study;
    place.write("first.toml", &first);
    place.write("second.toml", with_prior(&first, "first.json"));
    place.write("third.toml", with_prior(&first, "second.json"));
    for (number, name) in ["first", "second", "third"].iter().enumerate() {
        let arguments = format!(
            "measure first.toml --plan {} --campaign {number} --measurements-out m.csv",
            table4(if number == 0 { 6 } else { 4 })
        );
        place.done(&arguments);
        identified(
            &place,
            &format!("{name}.toml"),
            "m.csv",
            &format!("{name}.json"),
        );
    }
    let load = |name: &str| place.scenario(&format!("{name}.toml")).task;
    let first = load("first");
    let extended = &first.belief.uncertain;
    let sizes = first.belief.sizes();
    let kept: Vec<bool> = (extended.set().parameters().iter())
        .map(|each| each.kind.is_kept_between_campaigns())
        .collect();
    let own: Vec<f64> = (sizes.iter().enumerate())
        .map(|(place, size)| extended.own_precision(place) * size * size)
        .collect();
    let sizes = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(sizes));
    let rows = |plan: u32| whitened(&first.belief, &support::table4(plan), &sizes);
    let evaluate = |name: &str| format!("evaluate {name}.toml --plan {} --no-proof", table4(4));
    for (name, campaigns) in [
        ("second", vec![rows(6), rows(4)]),
        ("third", vec![rows(6), rows(4), rows(4)]),
    ] {
        let covariance = in_one(&campaigns, &kept, &own);
        let at_work = weighted_rows(&first.test_poses, kept.len(), &|pose| {
            test_pose_rows(&first.belief, pose)
        }) * &sizes;
        let expected_mm = (&at_work * covariance * at_work.transpose()).trace().sqrt() * 1e3;
        let said = place.record(&evaluate(name));
        let found_mm = number(&said["rho0_mm"]);
        assert_alike_in(&name, found_mm, expected_mm, 0.01);
        let text = place.run(&evaluate(name));
        let remark = "earlier identification includes load_scale: one value in both campaigns";
        text.prints(remark);
    }
    let scenario = place.read("second.toml");
    let other = scenario.replace("std_relative = 0.01", "std_relative = 0.03");
    place.write("other.toml", other);
    let text = place.run(&evaluate("other"));
    let remark = "not the size that is listed here (load.scale: 0.01 there, 0.03 here)";
    text.prints(remark);
    let replaced = scenario.replace(
        "std_relative = 0.01",
        "std_relative = 0.01\nreplaced = true",
    );
    place.write("replaced.toml", replaced);
    let [one, other] = ["second", "replaced"].map(|name| {
        let said = place.record(&evaluate(name));
        number(&said["rho0_mm"])
    });
    assert!(other < 0.95 * one, "{other}, {one}");
    write_far(&place);
    errors_are_predicted(&place, ("model", 20_000), &["second", "replaced", "far"]);
    errors_are_predicted(&place, ("robot", 2000), &["second", "replaced"]);
    place.write(
        "alone.toml",
        place.read("first.toml").replace(
            "std_relative = 0.01",
            "std_relative = 0.01\nreplaced = true",
        ),
    );
    let outcome = place.refused("check alone.toml");
    outcome.says("uncertainty[0].replaced: there is no earlier campaign");
}

#[test]
fn a_prior_that_cannot_be_one_is_refused() {
    let place = Workplace::with("s.toml", linear());
    place.done(&format!(
        "measure s.toml --plan {} --measurements-out m.csv",
        table4(3)
    ));
    identified(&place, "s.toml", "m.csv", "i.json");
    let good = place.read("i.json");
    place.write("p.toml", with_prior(&linear(), "i.json"));
    place.done("check p.toml");
    // As editors on Windows save it.
    place.write("i.json", format!("\u{feff}{good}"));
    place.done("check p.toml");
    let hash = "\"robot_sha256\": \"";
    for (from, to, expected) in [
        (hash, "\"robot_sha256\": \"0", "another robot"),
        ("\"joint_2\"", "\"joint_9\"", "the robot's joints are"),
        ("elastocal.identify", "elastocal.plan", "schema.name"),
        ("{", "", "is not JSON"),
    ] {
        place.write("i.json", good.replacen(from, to, 1));
        let outcome = place.refused("check p.toml");
        outcome.says("p.toml: robot.prior: i.json: ");
        outcome.says(expected);
    }
    place.write("i.json", &good);
    let outcome = place.refused("identify p.toml --measurements m.csv --sigma-from-residuals");
    outcome.says("robot.prior");
    place.write("p.toml", with_prior(&linear(), "nothing.json"));
    place.refused("check p.toml").says("nothing.json");
}

/// A prior that does not say which error sources are in its estimates is a condition of what rests on it.
#[test]
fn a_prior_of_unknown_error_sources_is_a_condition() {
    let place = Workplace::with("s.toml", linear());
    let plan = table4(3);
    place.done(&format!(
        "measure s.toml --plan {plan} --measurements-out m.csv"
    ));
    identified(&place, "s.toml", "m.csv", "i.json");
    place.write("p.toml", with_prior(&linear(), "i.json"));
    let evaluate = format!("evaluate p.toml --plan {plan} --quiet");
    assert!(!place.run(&evaluate).stderr.contains("C0308"));
    let mut json = place.parsed("i.json");
    let keys = json.as_object_mut().expect("an object");
    keys.remove("error_sources").expect("a key");
    keys.remove("reading_digests").expect("a key");
    place.write("i.json", json.to_string());
    for command in [&evaluate, "identify p.toml --measurements m.csv --quiet"] {
        let said = place.doubted(command);
        said.says("condition C0308: i.json does not say with which robot and error sources");
    }
}

/// What an earlier campaign found is a quantity, whatever is nominal in the next one.
#[test]
fn a_prior_is_of_quantities() {
    let place = Workplace::new();
    let linear = linear();
    let (text, _) = linear.split_once("\n[study]").expect("a study");
    let sheet =
        "\n[[uncertainty]]\nkind = \"compliance\"\nstd_relative = 0.1\njoints = [\"joint_1\"]\n";
    let first = text.to_owned() + sheet;
    place.write("first.toml", &first);
    measured(&place, "first.toml", 3, "a.csv");
    identified(&place, "first.toml", "a.csv", "first.json");
    let joint_1 = |file: &str| {
        let task = place.scenario(file).task;
        let (set, arm) = (task.belief.uncertain.set(), task.belief.uncertain.arm());
        let place = set.index_of(ParameterKind::JointCompliance { joint: 0 });
        let place = place.expect("is uncertain");
        let value = set.prior().mean[place];
        let nominal = arm.compliance_rad_per_nm[0];
        (set.parameters()[place].quantity(arm, value), nominal)
    };
    place.write("second.toml", with_prior(&first, "first.json"));
    let (found, nominal) = joint_1("second.toml");
    let compliances = "\ncompliance_rad_per_nm = [0.52e-6, 0.302e-6, 0.406e-6, 3.002e-6, 3.303e-6, 2.365e-6]\nparameters = ";
    let other = place
        .read("second.toml")
        .replace("\nparameters = ", compliances);
    place.write("other.toml", other);
    let (again, doubled) = joint_1("other.toml");
    assert_near(doubled / nominal, 2.0, 1e-9);
    assert!((again / found - 1.0).abs() < 1e-12, "{again} {found}");
}
