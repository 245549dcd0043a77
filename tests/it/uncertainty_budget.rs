//! Uncertainty budgets: squares of contributions add up to the predicted accuracy, whatever the sources; each is named with its
//! type, level, standard uncertainty and sensitivity.

use elastocal::parameter::SourceLevel::{
    self, Campaign, Configuration, Instrument, Reading, Robot, Task, Visit,
};
use elastocal::plan::absolute::AbsolutePlanning;
use elastocal::plan::{Assessment, Evaluation, UncertaintyBudget};
use elastocal::study::account::Account;

use crate::absolute_predictions::rows;
use crate::support::{
    Workplace, absolute_scenario_text, assert_alike_in, assert_near_in, list, number,
    scenario_text, shipped, table4,
};
use crate::uncertainties::{entry, everything, loaded, with};

/// A kind of source with a size, and what a budget says of it: level, u(x) and unit.
type Listed = (
    (&'static str, &'static str),
    SourceLevel,
    Option<(f64, &'static str)>,
);

/// Every kind; JOINT stands for a joint of the arm.
const KINDS: [Listed; 22] = [
    (
        ("joint_repeatability", "std_mrad = 0.05"),
        Visit,
        Some((0.05, "mrad")),
    ),
    (
        ("load_direction", "std_mrad = 2"),
        Visit,
        Some((2.0, "mrad")),
    ),
    (("load_point", "std_mm = 5"), Visit, Some((5.0, "mm"))),
    (
        ("tracker_range", "std_um_per_m = 3"),
        Reading,
        Some((3.0, "um/m")),
    ),
    (
        ("tracker_range", "std_um_per_m = 3\nalong_um_per_m = 1"),
        Reading,
        None,
    ),
    (
        (
            "transmission_error",
            "joints = [\"JOINT\"]\nstd_mrad = 0.03",
        ),
        Configuration,
        Some((0.03, "mrad")),
    ),
    (
        ("discrepancy", "std_mm = 0.02"),
        Configuration,
        Some((0.02, "mm")),
    ),
    (
        ("transmission_error", "std_mrad = 0.05\nharmonics = [1]"),
        Robot,
        Some((0.05, "mrad")),
    ),
    (
        ("compliance", "joints = [\"JOINT\"]\nstd_relative = 0.1"),
        Robot,
        Some((0.1, "1")),
    ),
    (("joint_zero", "std_mrad = 0.5"), Robot, Some((0.5, "mrad"))),
    (("link_position", "std_mm = 0.3"), Robot, Some((0.3, "mm"))),
    (
        ("link_rotation", "std_mrad = 0.2"),
        Robot,
        Some((0.2, "mrad")),
    ),
    (
        ("link_mass", "std_relative = 0.05"),
        Robot,
        Some((0.05, "1")),
    ),
    (("link_centre", "std_mm = 10"), Robot, Some((10.0, "mm"))),
    (
        ("backlash", "std_arcsec = 90"),
        Robot,
        Some((90.0 / 3600.0 * 1e3 * RADIAN, "mrad")),
    ),
    (
        ("stiffening", "std_relative = 0.01\nat_nm = 8000"),
        Robot,
        Some((0.01, "1")),
    ),
    (
        ("tool_position", "std_mm = 0.5"),
        Campaign,
        Some((0.5, "mm")),
    ),
    (
        ("base_rotation", "std_mrad = 0.5"),
        Campaign,
        Some((0.5, "mrad")),
    ),
    (
        ("load_scale", "std_relative = 0.01"),
        Instrument,
        Some((0.01, "1")),
    ),
    (("load_offset", "std_n = 5"), Instrument, Some((5.0, "N"))),
    (("task_force", "std_n = 10"), Task, Some((10.0, "N"))),
    (("task_force", "std_relative = 0.1\nstd_n = 10"), Task, None),
];
/// A degree (rad).
const RADIAN: f64 = std::f64::consts::PI / 180.0;

/// Each kind alone, then all with names of their own.
fn lists(joint: &str) -> Vec<(String, Vec<Listed>)> {
    let of = |index: usize, (source, ..): Listed| {
        entry(source, &format!("name = \"source {index}\"")).replace("JOINT", joint)
    };
    let alone = KINDS.map(|each| (of(0, each), vec![each]));
    // The last is another size of the one before.
    let all = &KINDS[..KINDS.len() - 1];
    let together = all.iter().enumerate().map(|(index, &each)| of(index, each));
    (alone
        .into_iter()
        .chain([(together.collect(), all.to_vec())]))
    .collect()
}

/// Squares add up, and each line holds u, c and their product.
fn assert_adds_up(budget: &UncertaintyBudget, rho0_m: f64, listed: &[Listed]) {
    let combined_um = budget.combined_standard_uncertainty_um;
    let about = format!("{listed:?}: {budget:?}");
    assert_near_in(&about, combined_um * 1e-6 / rho0_m, 1.0, 1e-6);
    let squares: f64 = budget
        .sources
        .iter()
        .map(|each| each.contribution_um.powi(2))
        .sum();
    assert_alike_in(&about, squares.sqrt(), combined_um, 1e-12);
    let shares: f64 = budget
        .sources
        .iter()
        .map(|each| each.variance_share_percent)
        .sum();
    assert!((shares - 100.0).abs() < 1e-9, "{about}");
    let factor = budget.coverage_factor.expect("determined");
    assert!((1.61..1.961).contains(&factor), "{about}");
    let expanded_um = budget.expanded_uncertainty_um.expect("determined");
    assert!((expanded_um - factor * combined_um).abs() < 1e-9 * expanded_um);
    for each in &budget.sources {
        if let (Some(input), Some(sensitivity)) = (each.standard_uncertainty, each.sensitivity) {
            let product = input * sensitivity;
            assert!(
                (product - each.contribution_um).abs() <= 1e-9 * combined_um,
                "{each:?}"
            );
        }
    }
    assert_eq!(budget.sources.len(), 1 + listed.len());
    let mut found: Vec<_> = (budget.sources[1..].iter())
        .map(|each| {
            (
                each.source.clone(),
                each.level,
                each.standard_uncertainty,
                each.unit.clone(),
            )
        })
        .collect();
    found.sort_by_key(|(name, ..)| name[7..].parse::<usize>().expect("a number"));
    for ((_, level, value, unit), (kind, expected, input)) in found.iter().zip(listed) {
        assert_eq!(level, expected, "{kind:?}");
        assert_eq!(unit.as_deref(), input.map(|(_, unit)| unit), "{kind:?}");
        let off = value.unwrap_or(0.0) - input.map_or(0.0, |(value, _)| value);
        assert!(off.abs() < 1e-9, "{kind:?}: {value:?}");
    }
}

#[test]
fn contributions_to_deflections_add_up() {
    for (list, listed) in lists("joint_1") {
        let text =
            with(&list, "model", 64).replace("sigma_of", "tracker_site = \"tracker\"\nsigma_of");
        let scenario = loaded(&text);
        let assessment = Assessment::new(&scenario.task, &table4(4), None);
        let budget = assessment.uncertainty_budget.expect("determined");
        assert_adds_up(&budget, assessment.rho0_m.expect("determined"), &listed);
    }
}

#[test]
fn contributions_to_absolute_places_add_up() {
    let place = Workplace::new();
    for (list, listed) in lists("wrist_1") {
        place.write("s.toml", absolute_scenario_text("ur10") + &list);
        let scenario = place.scenario("s.toml");
        let rows = rows(&scenario, 16, None);
        let planning = AbsolutePlanning::new(&scenario.task, &[], &rows).expect("candidates");
        let plan = planning.whole();
        let prediction = planning.prediction(&plan);
        let budget = planning
            .uncertainty_budget(&plan, &prediction)
            .expect("determined");
        assert_adds_up(&budget, prediction.rho0_m().expect("determined"), &listed);
    }
}

/// The account of a truth that hides nothing is the budget.
#[test]
fn an_account_that_hides_nothing_is_the_budget() {
    let scenario = loaded(&with(&everything(), "model", 64));
    let assessment = Assessment::new(&scenario.task, &table4(4), None);
    let budget = assessment.uncertainty_budget.expect("determined");
    let account = Account::new(&scenario.task, &scenario.truth, &table4(4)).expect("determined");
    let combined_m = budget.combined_standard_uncertainty_um * 1e-6;
    assert!((account.predicted_m / combined_m - 1.0).abs() < 1e-9);
    for part in &account.parts {
        let source = budget
            .sources
            .iter()
            .find(|each| each.source == part.source);
        let apart_um = part.contribution_um.expect("computed")
            - source.expect("the same names").contribution_um;
        assert!(apart_um.abs() < 1e-3 * combined_m, "{part:?}");
    }
}

/// Along a line U is 1.96 standard uncertainties.
#[test]
fn the_coverage_factor_along_a_line_is_that_of_a_normal_number() {
    let text = scenario_text("klimchik2012")
        .replace("[[test_pose]]", "[[test_pose]]\ndirection = [0, 0, 1]");
    let assessment = Assessment::new(&loaded(&text).task, &table4(4), None);
    let budget = assessment.uncertainty_budget.expect("determined");
    // Nothing is shared, and nothing is no less than that.
    assert_eq!(budget.shared_m().to_bits(), 0);
    let factor = budget.coverage_factor.expect("determined");
    assert!((factor - 1.959_963_984_540_054).abs() < 1e-6, "{factor}");
}

/// An earlier identification is of type A, with the degrees of freedom of what was estimated from residuals; and what a file has is
/// what JSON has.
#[test]
fn an_earlier_identification_is_of_type_a() {
    let place = Workplace::with("first.toml", scenario_text("klimchik2012"));
    let plan = shipped("scenarios/plans/klimchik2012_m4.csv");
    place.done(&format!(
        "measure first.toml --plan {plan} --measurements-out m.csv"
    ));
    place.done("identify first.toml --measurements m.csv --identified-out known.json");
    let mut file = place.parsed("known.json");
    let taken_up: f64 = list(&file["residuals"])
        .iter()
        .map(|each| number(&each["leverage"]))
        .sum();
    let second =
        scenario_text("klimchik2012").replace("[robot]", "[robot]\nprior = \"known.json\"");
    place.write("second.toml", second);
    for (discrepancy_mm, freedom) in [(None, None), (Some(0.02), Some(12.0 - taken_up))] {
        file["discrepancy_mm"] = discrepancy_mm.into();
        place.write("known.json", file.to_string());
        let json = place.json(&format!(
            "evaluate second.toml --plan {plan} --no-proof --budget-out budget.csv"
        ));
        let budget: UncertaintyBudget =
            serde_json::from_value(json["uncertainty_budget"].clone()).expect("a budget");
        let earlier = &budget.sources[1];
        assert_eq!(
            (&*earlier.source, earlier.evaluation),
            ("earlier identification", Evaluation::A)
        );
        assert_eq!(earlier.standard_uncertainty, None);
        match (earlier.degrees_of_freedom, freedom) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-9, "{found}"),
            (found, expected) => assert_eq!(found, expected),
        }
        let text = place.read("budget.csv");
        let last = text.lines().last().expect("a row");
        let (contribution, share) = (earlier.contribution_um, earlier.variance_share_percent);
        let freedom = freedom.map_or_else(
            || "inf".to_owned(),
            |_| earlier.degrees_of_freedom.expect("one").to_string(),
        );
        assert_eq!(
            last,
            format!("earlier identification,normal,A,robot,,,,,{contribution},{share},{freedom}")
        );
    }
}
