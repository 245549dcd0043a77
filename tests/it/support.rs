//! What several tests need.

use std::path::PathBuf;

use elastocal::plan::{Plan, read_plan};
use elastocal::scenario::Scenario;

/// A path inside the project.
pub fn project(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A scenario that the project ships.
pub fn scenario(name: &str) -> Scenario {
    Scenario::load(&project(&format!("scenarios/{name}.toml"))).expect("the scenario is valid")
}

/// A plan of the paper's Table 4.
pub fn table4(experiments: u32) -> Plan {
    let path = project(&format!("scenarios/plans/klimchik2012_m{experiments}.csv"));
    read_plan(&path, 6).expect("the plan is valid")
}
