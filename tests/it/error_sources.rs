//! Pictures of where the error comes from, and what became of the prediction, in pages and recordings.

use crate::recordings::{rerun, rows};
use crate::support::Workplace;
use crate::uncertainties::{entry, with};

const TITLE: &str = "Uncertainty budget";

/// The page and the recording of a study have a line for each source, what was predicted, and the verdict; without a list of
/// what is uncertain there is nothing to draw.
#[test]
fn studies_show_where_the_error_comes_from() {
    let place = Workplace::new();
    let list = entry(("load_scale", "std_relative = 0.01"), "hidden = true")
        + &entry(("joint_repeatability", "std_mrad = 0.03"), "");
    place.write("laboratory.toml", with(&list, "model", 4000));
    place.write("certain.toml", with("", "model", 4000));
    place.done("study laboratory.toml --quiet --out out");
    place.done("study certain.toml --quiet --out out");
    let page = place.read("out/laboratory/study.html");
    for part in [
        TITLE,
        "load_scale (hidden)",
        "the prediction exceeded: ",
        "numerical tolerance",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!place.read("out/certain/study.html").contains(TITLE));
    let recorded = |name: &str| {
        let listed = rerun(&["rrd", "print"], &place.path(name));
        rows(&listed).contains_key("/text/sources")
    };
    assert!(recorded("out/laboratory/study.rrd"));
    assert!(!recorded("out/certain/study.rrd"));
}

/// The report of a run shows what its prediction is made of.
#[test]
fn reports_show_what_a_prediction_is_made_of() {
    let place = Workplace::new();
    let list = entry(("load_scale", "std_relative = 0.01"), "");
    place.write("laboratory.toml", with(&list, "model", 64));
    place.done("run laboratory.toml --no-proof --quiet --out out");
    let page = place.read("out/laboratory/report.html");
    for part in [
        TITLE,
        "load_scale",
        "predicted with the whole uncertainty budget",
        "; 95 % stay below ",
    ] {
        assert!(page.contains(part), "{part}");
    }
}
