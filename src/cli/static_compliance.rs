//! The static compliance of the tool at the test poses, in JSON and for a person.

use elastocal::compensation::KnownArm;
use elastocal::record::json::merge;
use elastocal::record::static_compliance::{PoseComplianceMessage, StaticComplianceMessage};
use elastocal::robot::EquilibriumError;
use elastocal::task::TestPose;
use serde_json::json;

use super::Report;
use super::table::table;

/// Adds the static compliance of an arm at the test poses to a report.
pub fn add_static_compliance(
    report: &mut Report,
    known: &KnownArm<'_>,
    poses: &[TestPose],
) -> Result<(), EquilibriumError> {
    let of_pose = |pose: &TestPose| {
        let compliance = known.static_compliance(&pose.configuration_rad)?;
        Ok(PoseComplianceMessage::new(&pose.name, &compliance))
    };
    let message = StaticComplianceMessage {
        assumed_exact: known.exact_compliances(),
        test_poses: poses.iter().map(of_pose).collect::<Result<_, _>>()?,
    };
    report.text += &describe(&message);
    merge(&mut report.json, json!({ "static_compliance": message }));
    Ok(())
}

/// An entry with its 95 % interval.
fn entry(value: f64, interval: Option<[f64; 2]>) -> String {
    let interval = interval.map_or_else(
        || "not determined".to_owned(),
        |[low, high]| format!("{low:.6} to {high:.6}"),
    );
    format!("{value:.6} ({interval})")
}

fn describe(message: &StaticComplianceMessage) -> String {
    let axes = ["x", "y", "z"];
    let mut text = String::new();
    for pose in &message.test_poses {
        let row = |(row, axis): (usize, &&str)| {
            let cell = |column: usize| {
                entry(
                    pose.mm_per_n[row][column],
                    pose.interval95_mm_per_n[row][column],
                )
            };
            let mut cells = vec![format!("moves along {axis}")];
            cells.extend([0, 1, 2].map(cell));
            cells
        };
        let rows = axes.iter().enumerate().map(row);
        text += &format!(
            "\nstatic compliance at {} [mm/N], with 95 % intervals\n{}",
            pose.name,
            table(" | by a force along x | along y | along z", rows)
        );
    }
    if !message.assumed_exact.is_empty() {
        text += &format!(
            "  assumed exact: the compliances of {}\n",
            message.assumed_exact.join(", ")
        );
    }
    text
}
