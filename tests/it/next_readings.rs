//! Which absolute readings to take next, beside those that are taken.

use serde_json::Value;

use crate::support::{Workplace, absolute_scenario_text, list, number, scenario_text};

const HEADER: &str =
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats,target\n";
/// What is taken: configurations, each without a load, and what is read there.
const TAKEN: [(&str, &str); 6] = [
    ("-10,-65,110,-160,120,-20", "reflector"),
    ("-140,-95,45,60,130,-20", "spindle"),
    ("-100,-85,100,50,150,50", "spindle"),
    ("90,-80,55,70,-70,-130", "reflector"),
    ("-40,-90,55,-70,10,30", "spindle"),
    ("70,-120,100,-150,-60,-50", "reflector"),
];
/// What else may be read.
const OTHERS: [&str; 7] = [
    "-50,-90,55,-70,30,30",
    "160,-80,100,-110,60,10",
    "-150,-55,40,-40,40,150",
    "90,-80,55,-120,-70,-130",
    "-10,-100,90,-60,60,80",
    "130,-70,60,-90,100,-40",
    "45,-80,70,-60,80,10",
];
/// Errors of a visit and of a configuration, which readings share.
const SHARED: &str = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.02\n\n\
    [[uncertainty]]\nkind = \"transmission_error\"\nstd_mrad = 0.05\n";

fn row(q: &str, is_loaded: bool, target: &str) -> String {
    let force = if is_loaded { -98 } else { 0 };
    format!("{q},0,0,{force},0,0,0,1,{target}\n")
}

fn taken() -> String {
    TAKEN
        .iter()
        .map(|(q, target)| row(q, false, target))
        .collect()
}

/// A workplace with what is taken, as it was read.
fn workplace() -> Workplace {
    let place = Workplace::with("s.toml", absolute_scenario_text("ur10") + SHARED);
    place.write("taken.csv", HEADER.to_owned() + &taken());
    place.json("measure s.toml --plan taken.csv --measurements-out read.csv");
    place
}

const NEXT: &str = "next s.toml --measurements read.csv --parameters frames --candidates c.csv --plan-out rest.csv";

/// rho0 (mm) of a plan of what is taken with these rows.
fn together(place: &Workplace, rows: &str) -> f64 {
    place.write("all.csv", HEADER.to_owned() + &taken() + rows);
    number(&place.json("evaluate s.toml --plan all.csv --parameters frames")["rho0_mm"])
}

/// The rest counts as one plan with what is taken, and what it shares with that counts: loaded readings in the configurations of
/// unloaded ones.
#[test]
fn the_rest_counts_with_what_is_taken() {
    let place = workplace();
    let loaded: String = TAKEN
        .iter()
        .map(|(q, _)| row(q, true, "reflector"))
        .collect();
    place.write("c.csv", HEADER.to_owned() + &loaded);
    let json = place.json(&format!("{NEXT} --experiments 9"));
    assert_eq!(
        (&json["measured"], &json["reached"]),
        (&6.into(), &true.into())
    );
    assert_eq!(list(&json["plan"]).len(), 3);
    let rest = place.read("rest.csv");
    let (header, rows) = rest.split_once('\n').expect("rows");
    assert_eq!(header, HEADER.trim_end());
    let [own, whole] = [number(&json["rho0_mm"]), together(&place, rows)];
    assert!((own / whole - 1.0).abs() < 1e-9, "{own} {whole}");
    let [so_far, before] = [number(&json["measured_rho0_mm"]), together(&place, "")];
    assert!((so_far / before - 1.0).abs() < 1e-9, "{so_far} {before}");
    assert!(own < so_far);
    assert!(json["lower_bound_rho0_mm"].is_null());
}

/// Of readings in other configurations the next one is the best of all, and the bound says so.
#[test]
fn the_next_reading_is_the_best() {
    let place = workplace();
    let rows = OTHERS.map(|q| row(q, false, "spindle"));
    place.write("c.csv", HEADER.to_owned() + &rows.concat());
    let json = place.json(&format!("{NEXT} --experiments 7"));
    let each = rows.iter().map(|row| together(&place, row));
    let best = each.fold(f64::INFINITY, f64::min);
    let found = number(&json["rho0_mm"]);
    assert!((found / best - 1.0).abs() < 1e-9, "{found} {best}");
    let bound = number(&json["lower_bound_rho0_mm"]);
    assert!(bound <= found && bound > 0.9 * found, "{bound} {found}");
    // As few as give an accuracy: more than one for a better one, none for what is reached.
    let wanted =
        |accuracy_mm: f64| place.json(&format!("{NEXT} --accuracy-um {}", accuracy_mm * 1e3));
    let few = wanted(found * (1.0 - 1e-6));
    let count = |json: &Value| list(&json["plan"]).len();
    assert_eq!(count(&few), 2);
    assert!(number(&few["rho0_mm"]) <= found);
    assert_eq!(count(&wanted(2.0 * number(&json["measured_rho0_mm"]))), 0);
    let beyond = place.json_with_conditions(&format!("{NEXT} --accuracy-um 0.1 --experiments 8"));
    assert_eq!(beyond["reached"], false);
}

/// Of few configurations those that are taken count; one more may be read.
#[test]
fn the_next_readings_visit_as_few_configurations_as_the_campaign_may() {
    let place = workplace();
    let rows = OTHERS.map(|q| row(q, false, "spindle").replace(",1,", ",3,"));
    place.write("c.csv", HEADER.to_owned() + &rows.concat());
    for (most, more) in [(8, 2), (7, 1), (6, 1)] {
        let few = format!("experiments = 9\nconfigurations = {most}");
        let text = absolute_scenario_text("ur10") + SHARED;
        let text = text.replace("experiments = 4", &few);
        place.write("s.toml", text);
        let json = place.json(&format!("{NEXT} --experiments 9"));
        let plan = list(&json["plan"]);
        let repeats: f64 = plan.iter().map(|each| number(&each["repeats"])).sum();
        assert!(
            plan.len() <= more && (repeats - 3.0).abs() < 1e-9,
            "{most}: {plan:?}"
        );
    }
}

/// A table that is filled in to a part is taken as far as it is filled in.
#[test]
fn tables_are_taken_as_far_as_they_are_filled_in() {
    let place = workplace();
    place.json("lab s.toml --plan taken.csv");
    let empty = place.read("out/s/lab/measurements.csv");
    let filled = crate::absolute_campaigns::filled(&empty, &place.read("read.csv"));
    let lines: Vec<&str> = filled.lines().collect();
    let blank: Vec<&str> = empty.lines().collect();
    let half = [&lines[..lines.len() - 3], &blank[blank.len() - 3..]].concat();
    place.write("read.csv", half.join("\n") + "\n");
    place.write(
        "c.csv",
        HEADER.to_owned() + &OTHERS.map(|q| row(q, false, "spindle")).concat(),
    );
    let json = place.json(&format!("{NEXT} --experiments 8"));
    assert_eq!(json["measured"], 3);
    assert_eq!(list(&json["plan"]).len(), 5);
}

/// What is about the other accuracy is refused by name.
#[test]
fn what_is_of_the_other_accuracy_is_refused() {
    let place = workplace();
    place.write(
        "c.csv",
        HEADER.to_owned() + &row(OTHERS[0], false, "spindle"),
    );
    let refused = |arguments: &str, says: &str| {
        place.refused(arguments).says(says);
    };
    refused(
        &format!("{NEXT} --plan taken.csv"),
        "--plan is for plans of deflections",
    );
    place.write("relative.toml", scenario_text("ur10"));
    refused(
        &NEXT.replace("s.toml", "relative.toml"),
        "--parameters is for plans of absolute readings",
    );
    place.done("plan relative.toml --no-proof --plan-out p.csv --quiet");
    place.json("measure relative.toml --plan p.csv --measurements-out read.csv");
    refused(NEXT, "holds deflections");
}

/// Where configurations are sampled, more readings are never worse, none is left out, and no plan is below the bound beside it.
#[test]
fn budgets_of_sampled_configurations_fall() {
    let place = Workplace::new();
    let repeatability = "\n[[uncertainty]]\nkind = \"joint_repeatability\"\nstd_mrad = 0.05\n";
    let text = absolute_scenario_text("ur10") + repeatability;
    place.write("s.toml", text.replace("seed = 1", "seed = 5"));
    let json = place.json_with_conditions("budget s.toml --draw 4 --up-to 14 --parameters zeros");
    let points = list(&json["budget"]);
    let of = |key: &str| {
        points
            .iter()
            .map(|each| number(&each[key]))
            .collect::<Vec<_>>()
    };
    let (sizes, rho0, bounds) = (of("experiments"), of("rho0_mm"), of("lower_bound_rho0_mm"));
    assert_eq!(sizes, (5..=14).map(f64::from).collect::<Vec<_>>());
    for falling in [&rho0, &bounds] {
        assert!(
            falling.windows(2).all(|pair| pair[1] <= pair[0]),
            "{falling:?}"
        );
    }
    assert!(
        rho0.iter().zip(&bounds).all(|(rho0, bound)| rho0 >= bound),
        "{rho0:?} {bounds:?}"
    );
}
