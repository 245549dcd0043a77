//! The program where it is installed: scenarios that come with it.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::support::{Workplace, project};

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder can be made");
    for entry in fs::read_dir(from).expect("the folder is there") {
        let entry = entry.expect("it can be listed");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).expect("it can be copied");
        }
    }
}

/// The default scenario, and others by the names that the documentation gives them, from any folder.
#[test]
fn shipped_scenarios_are_found_outside_of_a_clone() {
    let place = Workplace::new();
    for folder in ["installed/bin", "elsewhere"] {
        fs::create_dir_all(place.path(folder)).expect("a folder can be made");
    }
    let program = place.path("installed/bin/elastocal");
    fs::copy(env!("CARGO_BIN_EXE_elastocal"), &program).expect("the program can be copied");
    for folder in ["scenarios", "models"] {
        let shared = place.path("installed/share/elastocal").join(folder);
        copy_folder(&project(folder), &shared);
    }
    let run = |words: &[&str]| {
        let mut command = Command::new(&program);
        let output = command
            .args(words)
            .current_dir(place.path("elsewhere"))
            .output();
        let output = output.expect("the program can be started");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), stderr)
    };
    assert_eq!(run(&["check"]).0, Some(0));
    assert_eq!(run(&["check", "scenarios/planar_3r.toml"]).0, Some(0));
    let (code, stderr) = run(&["check", "scenarios/no_such.toml"]);
    assert_eq!(code, Some(1));
    assert!(
        stderr.starts_with("error E0601: scenarios/no_such.toml: "),
        "{stderr}"
    );
    // A file of one's own goes before the shipped one.
    fs::create_dir(place.path("elsewhere/scenarios")).expect("a folder can be made");
    place.write("elsewhere/scenarios/kr270.toml", "seed = 1");
    let (code, stderr) = run(&["check"]);
    assert_eq!(code, Some(1));
    assert!(
        stderr.starts_with("error E0101: scenarios/kr270.toml: "),
        "{stderr}"
    );
}
