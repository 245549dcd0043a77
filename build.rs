//! Gives every binary the folder of MuJoCo's shared library as rpath, so that none of them needs
//! `LD_LIBRARY_PATH`, and records the commit for the provenance of outputs.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    if let Ok(directory) = std::env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{directory}");
    }

    // A file that does not exist would count as changed in each build.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name])
            && Path::new(&path).exists()
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let commit =
        git(&["describe", "--always", "--abbrev=12"]).unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=ELASTOCAL_COMMIT={commit}{}", dirty_mark());
}

/// "-dirty" where what the program is made of is not as it was committed.
fn dirty_mark() -> &'static str {
    let sources = ["build.rs", "Cargo.lock", "Cargo.toml", "src"];
    let mut status = vec!["--no-optional-locks", "status", "--porcelain", "--"];
    for source in sources {
        println!("cargo::rerun-if-changed={source}");
        status.push(source);
    }
    match git(&status) {
        Some(changes) if !changes.is_empty() => "-dirty",
        _ => "",
    }
}

/// What git answers, if there is a git, a repository and an answer.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
