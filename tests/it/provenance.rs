//! The hash of a scenario covers every file that results are computed from, and options that change the
//! question are recorded.

use crate::support::{Workplace, project, scenario_text};

/// A planar arm that is included, with a mesh, a plan file and a picture.
fn workplace() -> Workplace {
    let workplace = Workplace::new();
    for folder in ["meshes", "parts"] {
        std::fs::create_dir(workplace.path(folder)).expect("a folder can be made");
    }
    let model = std::fs::read_to_string(project("models/planar_3r.xml")).expect("can be read");
    let (_, content) = model
        .split_once("<mujoco model=\"planar_3r\">")
        .expect("a model");
    workplace.write("parts/arm.xml", format!("<mujoco>{content}"));
    workplace.write(
        "parts/shelf.xml",
        "<mujoco><asset><mesh name=\"wedge\" file=\"wedge.obj\"/></asset></mujoco>",
    );
    workplace.write("meshes/wedge.obj", WEDGE);
    let main = "<mujoco model=\"cell\"><compiler meshdir=\"meshes\"/><include file=\"parts/arm.xml\"/><include file=\"parts/shelf.xml\"/></mujoco>";
    workplace.write("cell.xml", main);
    workplace.write("plan.csv", PLAN);
    let scenario = scenario_text("planar_3r");
    let line = (scenario.lines())
        .find(|line| line.starts_with("model = "))
        .expect("a model");
    let scenario = scenario.replace(line, "model = \"cell.xml\"")
        + "\n[[plan]]\nname = \"mine\"\nfile = \"plan.csv\"\n";
    workplace.write("cell.toml", scenario);
    workplace
}

const WEDGE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
const PLAN: &str = "q1_deg,q2_deg,q3_deg,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,repeats\n0,10,20,0,0,-200,0,0,0,3\n-20,30,20,0,0,-200,0,0,0,3\n";

fn hash(workplace: &Workplace) -> String {
    let json = workplace.json("check cell.toml");
    let hash = json["provenance"]["scenario_sha256"].as_str();
    hash.expect("a hash").to_owned()
}

#[test]
fn the_hash_covers_every_file() {
    let workplace = workplace();
    let first = hash(&workplace);
    assert_eq!(hash(&workplace), first);
    for (file, from, to) in [
        ("parts/arm.xml", "mass=\"14\"", "mass=\"15\""),
        ("meshes/wedge.obj", "v 1 0 0", "v 2 0 0"),
        ("plan.csv", "0,10,20", "0,11,20"),
    ] {
        let before = workplace.read(file);
        assert!(before.contains(from), "{file}");
        workplace.write(file, before.replace(from, to));
        assert_ne!(hash(&workplace), first, "{file}");
        workplace.write(file, before);
    }
    // A tolerance is no other question.
    workplace.write(
        "cell.toml",
        workplace.read("cell.toml") + "[gate]\nrho0 = { relative = 0.1 }\n",
    );
    assert_eq!(hash(&workplace), first);
}

/// Where the files are does not matter.
#[test]
fn a_copy_has_the_same_hash() {
    assert_eq!(hash(&workplace()), hash(&workplace()));
}

#[test]
fn results_of_other_numbers_of_configurations_are_not_compared() {
    let workplace = Workplace::with("cell.toml", scenario_text("planar_3r"));
    for (file, options) in [("a.json", ""), ("b.json", " --configurations 2")] {
        let plan = workplace.done(&format!("plan cell.toml --json --quiet{options}"));
        workplace.write(file, plan.stdout);
    }
    let refused = workplace.refused("compare a.json b.json");
    refused.says("configurations (2, not 3)");
}

#[test]
fn a_replay_has_a_schema() {
    let workplace = Workplace::new();
    let mut text = scenario_text("planar_3r");
    text += "\n[study]\nexperiments = 3\n[[study.plan]]\nname = \"random\"\nkind = \"random\"\n";
    workplace.write("cell.toml", text);
    let json = workplace.json("replay cell.toml --run 0");
    assert_eq!(json["schema"]["name"], "elastocal.replay");
}

/// Results carry the hash of every file that was given beside the scenario.
#[test]
fn results_name_what_they_were_computed_from() {
    let place = Workplace::with("s.toml", scenario_text("klimchik2012"));
    let plan = std::fs::read(project("scenarios/plans/klimchik2012_m12.csv")).expect("a plan");
    place.write("p.csv", plan);
    for (command, name, file) in [
        ("evaluate s.toml --plan p.csv", "plan", "p.csv"),
        ("check s.toml --plan p.csv", "plan", "p.csv"),
        (
            "measure s.toml --plan p.csv --measurements-out m.csv",
            "plan",
            "p.csv",
        ),
        (
            "identify s.toml --measurements m.csv --identified-out i.json",
            "measurements",
            "m.csv",
        ),
        (
            "compensate s.toml --identified i.json",
            "identified",
            "i.json",
        ),
    ] {
        let json = place.record(command);
        let found = &json["provenance"]["inputs_sha256"][name];
        let sum = place.shell(&format!("sha256sum {file}")).stdout;
        let expected = sum.split(' ').next().expect("a hash");
        assert_eq!(found.as_str(), Some(expected), "{command}");
    }
}
