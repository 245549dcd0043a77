//! Heights of a target above a surface table, as a height gauge reads them.

use elastocal::experiment::read_candidates;
use elastocal::measurement::{MeasuredFile, read_measured};
use elastocal::observation::LengthKind;
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::scenario::Scenario;

use crate::absolute_campaigns::fits_alike;
use crate::absolute_trials::holds;
use crate::support::{Workplace, list, number, numbers, project, scenario, scenario_text};

const HEIGHTS: &str = "ur10_height_gauge";

/// A workplace with the scenario and its plan.
fn workplace() -> Workplace {
    let place = Workplace::with("s.toml", scenario_text(HEIGHTS));
    let plan = project(&format!("scenarios/plans/{HEIGHTS}.csv"));
    place.write("plan.csv", std::fs::read(plan).expect("read"));
    place
}

/// Of a table's frame heights show how high it is and how it is tilted: nothing that moves the robot along it is an unknown.
#[test]
fn a_table_has_three_coordinates() {
    let scenario: Scenario = scenario(HEIGHTS);
    let plan = project(&format!("scenarios/plans/{HEIGHTS}.csv"));
    let rows = read_candidates(&plan, scenario.task.belief.commands()).expect("a plan");
    let planning = AbsolutePlanning::new(&scenario.task, &[], &rows).expect("a plan");
    let parameters = planning.set().parameters();
    let names: Vec<&str> = parameters.iter().map(|each| each.name.as_str()).collect();
    let table = names.iter().filter(|name| name.starts_with("base"));
    let table: Vec<&&str> = table.collect();
    assert_eq!(table, [&"base.z", &"base.rx", &"base.ry"], "{names:?}");
    let posterior = planning.prediction(&planning.whole()).posterior;
    for name in ["base.z", "base.rx", "base.ry"] {
        let index = names.iter().position(|each| *each == name).expect("one");
        assert!(posterior.standard_error(index).is_some(), "{name}");
    }
}

/// Configurations are sampled within the gauge's range, without and with a load, and the plan of them is one.
#[test]
fn configurations_are_sampled_within_the_range() {
    let place = workplace();
    let planned = place.json("plan s.toml --draw 12 --experiments 16 --plan-out drawn.csv");
    assert_eq!(planned["experiments"], 16);
    for each in list(&planned["plan"]) {
        let height_mm = number(&each["height_mm"]);
        assert!((20.0..=600.0).contains(&height_mm), "{height_mm}");
    }
    let bound = number(&planned["lower_bound_rho0_mm"]);
    let evaluated = place.json("evaluate s.toml --plan drawn.csv");
    let [one, other] = [&planned, &evaluated].map(|json| number(&json["rho0_mm"]));
    assert!((one / other - 1.0).abs() < 1e-6, "{one} {other}");
    assert!(bound > 0.0 && bound <= one, "{bound} {one}");
    let sources = evaluated["uncertainty_budget"]["sources"].as_array();
    assert!(!sources.expect("a list").is_empty());
}

/// The whole way through files: what `measure` writes is identified, and compensated with.
#[test]
fn files_of_heights_are_read_as_they_are_written() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    assert!(place.read("read.csv").contains("station,height_mm,s_mm"));
    let scenario = scenario(HEIGHTS);
    let read = read_measured(&place.path("read.csv"), &scenario.task.belief).expect("read");
    let MeasuredFile::Absolute(readings) = read else {
        panic!("heights are absolute readings");
    };
    for each in &readings {
        let read = each.length.expect("a height");
        assert_eq!(read.kind, LengthKind::Height);
        let steps = read.length_m / 1e-6;
        assert!((steps - steps.round()).abs() < 1e-4, "{steps}");
    }
    let json = place.json("identify s.toml --measurements read.csv --identified-out robot.json");
    assert_eq!(json["numbers"], 24);
    let station = &json["stations"][0];
    // A millimetre and a milliradian off, and along the table where it is believed to be.
    let found = numbers(&station["position_mm"]);
    assert!(
        [found[0], found[1]].map(f64::to_bits) == [600.0, 150.0].map(f64::to_bits)
            && (found[2] + 50.0).abs() < 5.0,
        "{station}"
    );
    let [w, x, y, z] = numbers(&station["quaternion"])[..] else {
        panic!("a table is tilted: {station}");
    };
    assert!(
        w > 0.999 && x.hypot(y) > 1e-6 && z.abs() < 1e-5,
        "{station}"
    );
    place.json("compensate s.toml --identified robot.json");
    place.write(
        "wrong.csv",
        place.read("read.csv").replace("height_mm", "distance_mm"),
    );
    place
        .refused("identify s.toml --measurements wrong.csv")
        .says("reading 1 is a distance from station \"table\"");
}

/// The table to fill in takes a height at each stop, and is read as it is.
#[test]
fn heights_go_to_the_laboratory() {
    let place = workplace();
    let json = place.json("lab s.toml --plan plan.csv");
    assert_eq!(json["readings"], 24);
    let empty = place.read("out/s/lab/measurements.csv");
    assert!(empty.contains("station,height_mm\n"), "{empty}");
    let sheet = place.read("out/s/lab/run_sheet.html");
    assert!(sheet.contains("height [mm]") && sheet.contains("above the plane"));
    assert_eq!(sheet.matches("<small>near ").count(), 24);
    fits_alike(&place, "s", "");
}

/// Beside a tracker they are readings of one campaign, and what does not fit is refused with the key.
#[test]
fn heights_stand_beside_a_tracker() {
    let place = workplace();
    let own =
        "reads = \"height\"\nsigma_mm = 0.004\nsigma_of = \"height\"\nresolution_mm = 0.001\n";
    let beside = "sigma_mm = 0.1\nsigma_of = \"position\"\n[instrument.height]\nsigma_mm = 0.004\n\
                  [[station]]\nname = \"tracker\"\nposition_mm = [2500, -1500, 900]\n";
    let text = scenario_text(HEIGHTS).replacen(own, beside, 1);
    let text = text.replacen(
        "name = \"table\"",
        "name = \"table\"\nreads = \"height\"",
        1,
    );
    place.write("both.toml", &text);
    // Half of the readings by the gauge, where the tracker reaches nothing.
    let tracker = "position_mm = [2500, -1500, 900]\n";
    let blind = text.replacen(tracker, &format!("{tracker}range_max_mm = 10\n"), 1);
    place.write("blind.toml", blind);
    let rows = ["both", "blind"].map(|name| {
        place.json(&format!(
            "plan {name}.toml --draw 10 --experiments 8 --plan-out {name}.csv"
        ));
        place.read(&format!("{name}.csv"))
    });
    let (_, of_gauge) = rows[1].split_once('\n').expect("a header");
    place.write("both.csv", rows[0].clone() + of_gauge);
    let evaluated = place.json("evaluate both.toml --plan both.csv --trials 600");
    let plan = list(&evaluated["plan"]);
    let heights = plan.iter().filter(|each| each["height_mm"].is_number());
    assert!((3..13).contains(&heights.count()), "{plan:?}");
    holds(&evaluated["trials"]);
    place.json("measure both.toml --plan both.csv --measurements-out read.csv");
    assert!(
        place
            .read("read.csv")
            .contains("x_mm,y_mm,z_mm,height_mm,sx_mm,sy_mm,sz_mm,s_mm")
    );
    let json = place.json("identify both.toml --measurements read.csv");
    assert_eq!(list(&json["stations"]).len(), 2);
    for (change, says) in [
        (["reads = \"height\"", ""], "instrument.height"),
        (["range_max_mm = 600\n", ""], "what reads heights reaches"),
        (["accuracy = \"absolute\"", ""], "instrument.height"),
    ] {
        place.write("wrong.toml", text.replacen(change[0], change[1], 1));
        place.refused("check wrong.toml").says(says);
    }
    let range = "\n[[uncertainty]]\nkind = \"tracker_range\"\nstd_um_per_m = 5\n";
    place.write("range.toml", scenario_text(HEIGHTS) + range);
    let said = place.refused("check range.toml");
    said.says("reads along a line of sight");
}

/// Readings of a table with a step of two thirds of their noise: repeats are equal by chance, whatever their number, and none is left out.
#[test]
fn honest_repeats_to_a_step_are_no_copies() {
    let place = workplace();
    let coarse = scenario_text(HEIGHTS)
        .replace("sigma_mm = 0.004", "sigma_mm = 0.0144")
        .replace("resolution_mm = 0.001", "resolution_mm = 0.01");
    place.write("s.toml", coarse);
    let twice = place.read("plan.csv").replace(",1,spindle,", ",2,spindle,");
    place.write("plan.csv", twice);
    for run in 0..6 {
        place.json(&format!(
            "measure s.toml --plan plan.csv --run {run} --measurements-out read.csv"
        ));
        let json = (place.run("identify s.toml --measurements read.csv --json --quiet")).json();
        let conditions = json["conditions"].to_string();
        assert!(
            !conditions.contains("C0208") && !conditions.contains("C0209"),
            "{run}: {conditions}"
        );
    }
}

/// The table of a validation names what was read.
#[test]
fn a_validation_speaks_of_heights() {
    let place = workplace();
    place.json("measure s.toml --plan plan.csv --measurements-out read.csv");
    place.json("identify s.toml --measurements read.csv --identified-out robot.json");
    place.json("measure s.toml --plan plan.csv --series 1 --measurements-out other.csv");
    let validate = "validate s.toml --identified robot.json --measurements other.csv";
    let text = place.run(validate).stdout;
    assert!(
        text.contains("identified: height [mm]") && !text.contains("distance [mm]"),
        "{text}"
    );
}
