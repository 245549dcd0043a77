//! What a build without the feature `view` says of recordings, pages and pictures.

use crate::support::{Workplace, scenario_text};

const MISSING: &str = "was built without recordings, pages and pictures";

#[test]
fn options_for_views_say_what_is_missing() {
    let workplace = Workplace::new();
    workplace.write("s.toml", scenario_text("planar_3r"));
    for (arguments, code) in [
        ("run s.toml --rerun save=s.rrd", 2),
        ("study s.toml --rerun spawn", 2),
        ("plan s.toml --stills-out s.svg", 1),
        ("budget s.toml --plot-out s.svg", 1),
        (
            "identify s.toml --measurements m.csv --ladder --plot-out s.svg",
            1,
        ),
    ] {
        let outcome = workplace.run(arguments).ends_with(code);
        let stderr = &outcome.stderr;
        assert!(stderr.contains(MISSING), "{arguments}: {stderr}");
        assert!(stderr.contains("feature `view`"), "{arguments}: {stderr}");
    }
    assert!(!workplace.path("s.svg").exists());
}

#[test]
fn results_are_there_without_views() {
    let workplace = Workplace::new();
    workplace.write("s.toml", scenario_text("planar_3r"));
    let outcome = workplace
        .run("study s.toml --trials 100 --out out")
        .ends_with(0);
    assert!(outcome.stderr.contains(MISSING), "{}", outcome.stderr);
    for (name, is_there) in [
        ("study.json", true),
        ("study.csv", true),
        ("study.html", false),
        ("study.mcap", false),
        ("study.rrd", false),
    ] {
        let path = workplace.path(&format!("out/s/{name}"));
        assert_eq!(path.exists(), is_there, "{name}");
    }
}
