//! The static compliance of the tool at the test poses, in JSON and for a person.

use crate::compensation::{KnownArm, StaticCompliance};
use crate::robot::EquilibriumError;
use crate::task::TestPose;

use super::command_prelude::*;

const AXES: [usize; 3] = [0, 1, 2];

/// Adds the static compliance of an arm at the test poses to a report.
pub fn add_static_compliance(
    report: &mut Report,
    known: &KnownArm<'_>,
    poses: &[TestPose],
) -> Result<(), EquilibriumError> {
    let exact = known.exact_compliances();
    let mut records = Vec::new();
    for pose in poses {
        let compliance = known.static_compliance(&pose.configuration_rad)?;
        records.push(record(&pose.name, &compliance));
        report.text += &describe(&pose.name, &compliance);
    }
    report.text += &naming(&exact, "  assumed exact: the compliances of {}\n");
    report.json["static_compliance"] = json!({ "assumed_exact": exact, "test_poses": records });
    Ok(())
}

/// The ends of an entry's 95 % interval (mm/N); none where it depends on what is not determined.
fn interval_mm(compliance: &StaticCompliance, row: usize, column: usize) -> Option<[f64; 2]> {
    let interval = compliance.interval95_m_per_n(row, column);
    interval.map(|ends| ends.map(|end| end * 1e3))
}

/// Rows are displacements, columns forces, along x, y and z of the base.
fn record(name: &str, compliance: &StaticCompliance) -> Value {
    let uncertainty = compliance.standard_uncertainty_m_per_n;
    json!({
        "name": name,
        "mm_per_n": AXES.map(|row| AXES.map(|column| compliance.m_per_n[(row, column)] * 1e3)),
        "standard_uncertainty_mm_per_n": uncertainty.map(|row| row.map(|each| each.map(|each| each * 1e3))),
        "interval95_mm_per_n": AXES.map(|row| AXES.map(|column| interval_mm(compliance, row, column))),
    })
}

fn describe(name: &str, compliance: &StaticCompliance) -> String {
    let entry = |row: usize, column: usize| {
        let interval = interval_mm(compliance, row, column).map_or_else(
            || "not determined".to_owned(),
            |[low, high]| format!("{low:.6} to {high:.6}"),
        );
        let value = compliance.m_per_n[(row, column)] * 1e3;
        format!("{value:.6} ({interval})")
    };
    let rows = AXES.map(|row| {
        let name = format!("moves along {}", ["x", "y", "z"][row]);
        [vec![name], AXES.map(|column| entry(row, column)).to_vec()].concat()
    });
    format!(
        "\nstatic compliance at {name} [mm/N], with 95 % intervals\n{}",
        table(" | by a force along x | along y | along z", rows)
    )
}
