//! The pages: complete, in agreement with the records, safe, and good to look at.

use elastocal::text::wording::{micrometres, number as worded};
use elastocal::view::markup::escaped;
use serde_json::Value;

use crate::browser::looks_well;
use crate::support::{Workplace, list, number, numbers, scenario_text};

/// The sections of a run's report.
const SECTIONS: [&str; 8] = [
    "distances",
    "accuracy",
    "criteria",
    "configurations",
    "compliances",
    "residuals",
    "plans",
    "provenance",
];
/// Its figures: one in each of four sections, and a still of each configuration.
fn looks_well_with_stills(workplace: &Workplace, page: &str, results: &Value) {
    let stills = page.matches("class=\"still\"").count();
    assert_eq!(Some(stills), results["plan"].as_array().map(Vec::len));
    looks_well(&workplace.path("out/s/report.html"), 4 + stills);
}

/// Runs a scenario under the name `s`, and gives the page and results.json.
fn run(workplace: &Workplace, text: &str, code: i32) -> (String, Value) {
    workplace.write("s.toml", text);
    workplace.run("run s.toml --quiet").ends_with(code);
    let results = serde_json::from_str(&workplace.read("out/s/results.json")).expect("JSON");
    (workplace.read("out/s/report.html"), results)
}

/// The page without the data of the view that turns, and the program's own script, which draws it.
fn without_own_script(page: &str) -> String {
    let script = include_str!("../../src/view/stills/turning.js");
    assert!(!script.contains("http") && !script.contains("fetch"));
    let page = page.replace(&format!("<script>\n{script}</script>"), "");
    let Some((before, rest)) = page.split_once("<script type=\"application/json\">") else {
        return page;
    };
    let (data, after) = rest.split_once("</script>").expect("it ends");
    let data: Value = serde_json::from_str(data).expect("JSON");
    assert!(
        data["parts"]
            .as_array()
            .is_some_and(|parts| !parts.is_empty())
    );
    format!("{before}{after}")
}

/// Nothing in the page makes a browser fetch or run anything, but for the view that turns.
pub fn assert_self_contained(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    let page = without_own_script(page);
    for forbidden in [
        "<script",
        "src=",
        "@import",
        "url(http",
        "<iframe",
        "javascript:",
    ] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    for reference in page.split("href=\"").skip(1) {
        let is_inside = reference.starts_with("data:") || reference.starts_with('#');
        assert!(is_inside, "{}", &reference[..40]);
    }
}

/// The page holds these texts.
fn assert_has(page: &str, texts: &[String]) {
    for text in texts {
        assert!(page.contains(text.as_str()), "no {text:?}");
    }
}

/// The numbers that a reader looks for are those of results.json.
fn assert_agrees(page: &str, results: &Value) {
    let micro = |value: &Value| micrometres(value.as_f64());
    let three = |value: &Value| format!("<td>{:.3}</td>", value.as_f64().expect("a number") * 1e3);
    let percent =
        |value: &Value| format!("{:.1}\u{a0}%", value.as_f64().expect("a number") * 100.0);
    let mut texts = vec![
        format!("<strong>{} rms</strong>", micro(&results["rho0_mm"])),
        micro(&results["lower_bound_rho0_mm"]),
        percent(&results["efficiency"]),
        micro(&results["random_median_rho0_mm"]),
        micro(&results["uncompensated_mm"]),
        "between the loaded tool and its place, predicted ".to_owned(),
        results["provenance"]["scenario_sha256"]
            .as_str()
            .expect("text")
            .to_owned(),
        results["provenance"]["commit"]
            .as_str()
            .expect("text")
            .to_owned(),
    ];
    for value in numbers(&results["compliance_rad_per_nm"]) {
        texts.push(format!("<td>{}</td>", worded(Some(value * 1e6), 4)));
    }
    for interval in list(&results["compliance_ci95_rad_per_nm"]) {
        let [low, high] = numbers(interval)[..] else {
            panic!("two ends")
        };
        let [low, high] = [low, high].map(|end| worded(Some(end * 1e6), 4));
        texts.push(format!(
            "<td><span class=\"unit\">{low} to {high}</span></td>"
        ));
    }
    for plan in list(&results["study"]) {
        texts.extend([three(&plan["mean_mm"]), three(&plan["rms_mm"])]);
        texts.push(format!("mean {}", micro(&plan["mean_mm"])));
    }
    for plan in list(&results["criteria_compared"]) {
        texts.push(micro(&plan["rho0_mm"]));
    }
    if let Some(boxes) = results["proof"]["boxes"].as_u64() {
        texts.push(format!("{boxes} boxes"));
        if results["bound_kind"] == "evidence" {
            let proved = micro(&results["proved_lower_bound_rho0_mm"]);
            texts.push(format!("none can be below {proved}"));
        }
    }
    for section in SECTIONS {
        texts.push(format!("<section id=\"{section}\">"));
    }
    assert_has(page, &texts);
}

/// What stands beside the plan is as good as the plan's own prediction says.
fn assert_evidence_holds(results: &Value) {
    let rho0 = number(&results["rho0_mm"]);
    let criteria = list(&results["criteria_compared"]);
    assert_eq!(criteria.len(), 3);
    assert_eq!(criteria[0]["criteria"], serde_json::json!(["test_pose"]));
    assert_eq!(criteria[0]["rho0_mm"], rho0);
    for other in criteria {
        assert!(
            other["rho0_mm"].as_f64() >= Some(rho0 * 0.999),
            "{}",
            other["criteria"]
        );
    }
    let accuracy = list(&results["accuracy"]);
    let own = (accuracy.iter()).find(|point| point["experiments"] == results["experiments"]);
    assert_eq!(own.expect("the plan itself")["rho0_mm"], rho0);
    let bounds = numbers(&results["lower_bounds_rho0_mm"]);
    for point in accuracy {
        let m = usize::try_from(point["experiments"].as_u64().expect("a count")).expect("small");
        let bound = number(&point["lower_bound_rho0_mm"]);
        assert!((bounds[m - 1] / bound - 1.0).abs() < 1e-12);
        assert!(
            point["rho0_mm"].as_f64() >= Some(bound * (1.0 - 1e-9)),
            "{point}"
        );
    }
    assert!(
        accuracy.len() >= 3 && accuracy.is_sorted_by_key(|point| point["experiments"].as_u64())
    );
}

#[test]
fn a_planar_arm_has_a_report_that_looks_well() {
    let workplace = Workplace::new();
    let (page, results) = run(&workplace, &scenario_text("planar_3r"), 0);
    assert_self_contained(&page);
    assert_agrees(&page, &results);
    assert_evidence_holds(&results);
    assert_has(
        &page,
        &[
            "all hold".to_owned(),
            "elastocal run s.toml --quiet".to_owned(),
        ],
    );
    looks_well_with_stills(&workplace, &page, &results);
}

/// The published plan keeps not all bounds, and is not the one that the page is about.
#[test]
fn what_a_plan_beside_violates_is_said_where_all_hold() {
    let text = scenario_text("klimchik2012");
    let (page, results) = run(&Workplace::new(), &text, 0);
    let violations = &results["plans"][1]["assessment"]["violations"];
    assert_eq!(violations.as_array().map(Vec::len), Some(1));
    let said = "Of the plans beside it, klimchik2012_m3 keep not all of them.";
    assert_has(
        &page,
        &["all hold for this plan".to_owned(), said.to_owned()],
    );
}

#[test]
fn a_single_measurement_has_a_report_that_looks_well() {
    let workplace = Workplace::new();
    let (page, results) = run(&workplace, &scenario_text("klimchik2012_joint1"), 0);
    assert_self_contained(&page);
    assert_agrees(&page, &results);
    assert_evidence_holds(&results);
    looks_well_with_stills(&workplace, &page, &results);
}

#[test]
fn six_compliances_under_several_loads_have_a_report() {
    // Without obstacles, which take time.
    let text = scenario_text("kr270_all_joints")
        .replace("collision_clearance_mm = 20", "")
        .replace("line_of_sight = true", "");
    let (page, results) = run(&Workplace::new(), &text, 0);
    assert_self_contained(&page);
    assert_agrees(&page, &results);
    assert_evidence_holds(&results);
}

/// Names and descriptions come from files that others wrote.
#[test]
fn what_a_scenario_says_is_text_on_the_page() {
    let hostile = "</title><script>alert(1)</script><img src=x onerror='alert(2)'> & \"so\"";
    let quoted = serde_json::to_string(hostile).expect("a string");
    let text = scenario_text("planar_3r")
        .replace(
            "description = \"A planar arm of three joints in a vertical plane, with a weight on its tool: its optima \
             can be derived by hand\"",
            &format!("description = {quoted}"),
        )
        .replace("name = \"milling\"", &format!("name = {quoted}"));
    assert_eq!(text.matches(&quoted).count(), 2);
    let workplace = Workplace::new();
    let (page, results) = run(&workplace, &text, 0);
    let rest = without_own_script(&page);
    assert!(!rest.contains("<script") && !rest.contains("<img"));
    // The lead and the accuracy.
    assert!(page.matches(&escaped(hostile)).count() >= 2);
    looks_well_with_stills(&workplace, &page, &results);

    let plan = format!("[[study.plan]]\nname = {quoted}\nkind = \"random\"\n");
    workplace.write("s.toml", text + "\n[study]\ntrials = 2000\n" + &plan);
    workplace.done("study s.toml --quiet");
    let page = workplace.read("out/s/study.html");
    assert!(!page.contains("<script") && !page.contains("<img"));
    assert!(page.contains(&escaped(hostile)));
}

/// With so much noise that a compliance comes out negative.
#[test]
fn problems_are_on_the_first_cards() {
    let text = scenario_text("planar_3r").replace("sigma_mm = 0.03", "sigma_mm = 3");
    let (page, results) = run(&Workplace::new(), &text, 3);
    assert_agrees(&page, &results);
    let joints = list(&results["parameters"]).iter();
    let values = list(&results["compliance_rad_per_nm"]);
    let negative: Vec<_> = (joints.zip(values))
        .filter(|(_, value)| value.as_f64() < Some(0.0))
        .map(|(joint, _)| joint.as_str().expect("a name"))
        .collect();
    assert!(!negative.is_empty());
    for joint in negative {
        assert!(page.contains(&format!("the compliance of {joint} is negative")));
    }
    assert!(!page.contains("all hold"));
}

#[test]
fn a_study_has_a_page_with_its_numbers() {
    let workplace = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let arguments = "study s.toml --trials 4000 --json --quiet";
    let json = workplace.done(arguments).json();
    let page = workplace.read("out/s/study.html");
    assert_self_contained(&page);
    for plan in list(&json["plans"]) {
        let mean = number(&plan["mean_mm"]) * 1e3;
        assert_has(&page, &[format!("<td>{mean:.3}</td>")]);
    }
    let optimal = (list(&json["plans"]))
        .iter()
        .find(|plan| plan["name"] == "optimal");
    let mean = optimal.expect("there is one")["mean_mm"].as_f64();
    assert_has(
        &page,
        &[format!("<strong>optimal: {}</strong>", micrometres(mean))],
    );
    looks_well(&workplace.path("out/s/study.html"), 3);
}

/// Two runs know a mean to within more than itself: its interval ends at zero, which a logarithmic axis does not have.
#[test]
fn a_study_of_two_runs_has_a_page() {
    let workplace = Workplace::with("s.toml", scenario_text("ur10"));
    let reaches_zero = (9..15).filter(|seed| {
        let run = workplace.run(&format!(
            "study s.toml --trials 2 --level model --seed {seed} --json --quiet"
        ));
        let json = run.json();
        let plans = list(&json["plans"]);
        let lows = plans.iter().map(|plan| numbers(&plan["mean_ci95_mm"])[0]);
        let lows: Vec<f64> = lows.collect();
        assert!(lows.iter().all(|low| *low >= 0.0), "{lows:?}");
        assert_self_contained(&workplace.read("out/s/study.html"));
        lows.contains(&0.0)
    });
    assert!(reaches_zero.count() > 0);
    looks_well(&workplace.path("out/s/study.html"), 3);
}
