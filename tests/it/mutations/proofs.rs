//! Mutated proofs, judged by the checker in one Python process.

use std::process::Command;

use serde_json::{Value, json};

use crate::proofs::python;
use crate::support::{Workplace, list, project, shipped};

/// How many are tried in the suite; `ELASTOCAL_MUTATIONS` asks for so many times a hundredth of its number.
const PROOFS: usize = 400;

/// Whatever is done to a proof, the checker ends with one of its three words, and no proof holds that bounds plans above a plan
/// that there is.
#[test]
fn mutated_proofs_are_refused_in_words() {
    let Some(python) = python() else {
        eprintln!("skipped: no Python with NumPy (pip install numpy, or PYTHON=...)");
        return;
    };
    let place = Workplace::new();
    let mut proofs = Vec::new();
    for name in ["planar_3r", "spatial_3r"] {
        let scenario = shipped(&format!("scenarios/{name}.toml"));
        let arguments = format!(
            "plan {scenario} --experiments 3 --prove 30% --proof-out {name}.json --quiet --json"
        );
        let found = place.done(&arguments).json();
        let rho0_m = found["rho0_mm"].as_f64().expect("a number") * 1e-3;
        proofs.push(format!("{name}.json={}", json!({ "3": rho0_m })));
    }
    let asked = std::env::var("ELASTOCAL_MUTATIONS").ok();
    let count = asked.map_or(PROOFS, |count| {
        count.parse::<usize>().expect("a number of inputs") / 100
    });
    let seed = std::env::var("ELASTOCAL_MUTATION_SEED").unwrap_or_else(|_| "1".to_owned());
    let output = Command::new(python)
        .arg(project("tests/it/mutations/proofs.py"))
        .arg(project("tools/check_proof.py"))
        .args([seed, count.to_string()])
        .args(proofs)
        .arg(project("tests/corpus/proof"))
        // Small matrices: threads would only wait for each other.
        .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
        .current_dir(place.path(""))
        .output()
        .expect("Python starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let found: Value = serde_json::from_slice(&output.stdout).expect("it prints JSON");
    let counts = &found["counts"];
    println!("mutated proofs: {counts}");
    let failures = list(&found["failures"]);
    let folder = project("target/mutations");
    for failure in failures {
        let name = format!("proof-{}.json", failure["name"].as_str().unwrap_or("?"));
        std::fs::create_dir_all(&folder).expect("a folder");
        let content = failure["content"].as_str().unwrap_or_default();
        std::fs::write(folder.join(name), content).expect("can be written");
    }
    let problems: Vec<&Value> = failures.iter().map(|failure| &failure["problem"]).collect();
    assert!(problems.is_empty(), "{problems:#?}");
    let number = |key: &str| counts[key].as_u64().expect("a count");
    let tried = number("holds") + number("refused") + number("cannot be checked");
    assert!(10 * number("well_formed") >= 3 * tried, "{counts}");
}
