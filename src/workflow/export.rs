//! The calibrated robot as a model's file (MJCF).
//!
//! Nothing is written that does not come back: the text is read again by MuJoCo, and the robot in it stands where the
//! identified one stands, and bends as it does.

use std::path::Path;

use nalgebra::{DVector, Isometry3, UnitQuaternion};
use serde_json::json;

use super::calibrated::CalibratedRobot;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::mujoco::{KEPT, Model, ModelCalibration, WrittenModel};
use crate::parameter::ElasticArm;
use crate::quantities::units::{degrees, thousandths};
use crate::record::messages::ProvenanceMessage;
use crate::robot::{EquilibriumSolver, Load, SerialChain, rotation_vector};
use crate::scenario::Scenario;

/// So many configurations are looked at.
const CONFIGURATIONS: usize = 100;
/// What is written may differ from what was identified by so much (m, rad).
const SAME: f64 = 1e-9;

/// A model that was written, and what is to be known about it.
#[derive(Debug, Clone)]
pub struct ExportedModel {
    /// Its text.
    pub text: String,
    /// What was identified or is in the scenario and the file has no words for.
    pub not_expressed: Vec<String>,
    /// The largest differences between the robot as MuJoCo reads it from the text and the identified one, over
    /// [`Self::configurations`]: of a tool's place (m) and orientation (rad), unloaded, with rigid joints.
    pub place_difference_m: f64,
    /// See [`Self::place_difference_m`].
    pub rotation_difference_rad: f64,
    /// The same of the deflection under gravity and a load (m).
    pub deflection_difference_m: f64,
    /// How many configurations were looked at.
    pub configurations: usize,
    /// What a scenario that takes the file for its model must no longer say.
    pub to_leave_out: Vec<String>,
}

/// Writes the robot of a scenario as it was identified, for a file.
///
/// # Errors
/// The model's file cannot say it, or would not be read as the same robot.
pub fn export(
    scenario: &Scenario,
    robot: &CalibratedRobot,
    provenance: &ProvenanceMessage,
    path: &Path,
) -> Result<ExportedModel, FileError> {
    check_ending(path)?;
    let arm = &robot.arm;
    let mut calibration = calibration(&robot.nominal, arm);
    calibration.additions = scenario.mounted.clone();
    let model = &scenario.task.belief.nominal.model;
    let failed = |error: FileError| {
        let wrong = FileError::new(&scenario.path, error.to_string()).at("robot.model");
        FileError {
            hint: error.hint,
            ..wrong.code(error.code)
        }
    };
    let write = |folder: &Path| model.calibrated_mjcf(&calibration, folder);
    let (not_expressed, [place_m, rotation_rad, deflection_m]) =
        differences(scenario, arm, &write).map_err(failed)?;
    if ![place_m, rotation_rad, deflection_m]
        .iter()
        .all(|difference| *difference <= SAME)
    {
        let problem = format!(
            "cannot be written exactly: read again, the robot's places differ by up to {:.2e} mm and {rotation_rad:.2e} rad and its deflections by up to {:.2e} mm",
            place_m * 1e3,
            deflection_m * 1e3
        );
        return Err(FileError::new(model.path(), problem)
            .hint("please report the model; nothing was written")
            .code(ErrorCode::ModelNotWritten));
    }
    let mut not_expressed = [robot.apart.clone(), not_expressed].concat();
    let locked = model.locked().iter();
    not_expressed.extend(locked.map(|&(joint, value)| in_words(model, joint, value)));
    calibration.texts = kept(robot, provenance, &not_expressed);
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(ExportedModel {
        text: model
            .calibrated_mjcf(&calibration, folder)
            .map_err(failed)?
            .text,
        not_expressed,
        place_difference_m: place_m,
        rotation_difference_rad: rotation_rad,
        deflection_difference_m: deflection_m,
        configurations: CONFIGURATIONS,
        to_leave_out: to_leave_out(scenario),
    })
}

/// The ending of a file says that it is MJCF.
fn check_ending(path: &Path) -> Result<(), FileError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    if ["xml", "mjcf"].contains(&ending.to_lowercase().as_str()) {
        return Ok(());
    }
    let wrong = FileError::new(path, "its ending is not that of a model that is written");
    let hint = "end it in .xml: MJCF is written, since URDF has no stiffnesses";
    Err(wrong.hint(hint).code(ErrorCode::ModelNotWritten))
}

/// What is different about an arm.
pub fn calibration(nominal: &ElasticArm, arm: &ElasticArm) -> ModelCalibration {
    let between = |one: &Isometry3<f64>, other: &Isometry3<f64>| {
        if one == other {
            Isometry3::identity()
        } else {
            one.inverse() * other
        }
    };
    let joints = nominal.chain.joints.iter().zip(&arm.chain.joints);
    let links = joints
        .clone()
        .zip(&arm.zero_rad)
        .map(|((from, to), &zero)| {
            let by = between(&from.previous_from_link, &to.previous_from_link);
            if zero == 0.0 {
                by
            } else if to.drive.slides {
                by * Isometry3::from_parts(
                    (to.axis.into_inner() * zero).into(),
                    UnitQuaternion::identity(),
                )
            } else {
                by * UnitQuaternion::from_axis_angle(&to.axis, zero)
            }
        });
    let factor = |from: f64, to: f64| {
        let is_same = from.to_bits() == to.to_bits();
        if is_same { 1.0 } else { to / from }
    };
    ModelCalibration {
        links: links.collect(),
        zero: arm.zero_rad.clone(),
        compliance: arm.compliance_rad_per_nm.clone(),
        mass_factor: joints
            .clone()
            .map(|(from, to)| factor(from.mass_kg, to.mass_kg))
            .collect(),
        centre_shift_m: joints
            .map(|(from, to)| to.centre_of_mass_m - from.centre_of_mass_m)
            .collect(),
        sites: (nominal.tools.iter().zip(&arm.tools))
            .map(|(from, to)| {
                (
                    to.name.clone(),
                    between(&from.link_from_tool, &to.link_from_tool),
                )
            })
            .collect(),
        springs: (arm.chain.elements.springs.iter())
            .map(|spring| (spring.name.clone(), spring.stiffness_n_per_m, spring.rest_m))
            .collect(),
        ..ModelCalibration::default()
    }
}

/// A joint that a scenario locks, in words.
fn in_words(model: &Model, joint: usize, value: f64) -> String {
    let name = model.joint_name(joint);
    let at = if model.is_slide(joint) {
        format!("{} mm", thousandths(value))
    } else {
        format!("{} deg", degrees(value))
    };
    format!("{name} is no joint of it: its body is fixed at {at}")
}

/// Texts that stay with the model.
fn kept(
    robot: &CalibratedRobot,
    provenance: &ProvenanceMessage,
    not_expressed: &[String],
) -> Vec<(String, String)> {
    let rows = robot.covariance.row_iter();
    let covariance: Vec<Vec<f64>> = rows.map(|row| row.iter().copied().collect()).collect();
    let text = |what: &str, value: serde_json::Value| (format!("{KEPT}{what}"), value.to_string());
    vec![
        text("provenance", json!(provenance)),
        text("parameters", json!(robot.unknowns)),
        text("covariance", json!(covariance)),
        text("not_expressed", json!(not_expressed)),
    ]
}

/// What a scenario says that is in the file now.
fn to_leave_out(scenario: &Scenario) -> Vec<String> {
    let robot = &scenario.task.belief.nominal;
    let mut all = Vec::new();
    if !scenario.mounted.tools.is_empty() {
        all.push("[[robot.tool]]".to_owned());
    }
    if !scenario.mounted.payloads.is_empty() {
        all.push("[[robot.payload]]".to_owned());
    }
    for (key, is_slide) in [("robot.locked_deg", false), ("robot.locked_mm", true)] {
        let mut locked = robot.model.locked().iter();
        if locked.any(|&(joint, _)| robot.model.is_slide(joint) == is_slide) {
            all.push(key.to_owned());
        }
    }
    let own = (robot.chain.joints.iter()).map(|joint| joint.model_compliance_rad_per_nm);
    if own
        .zip(&robot.compliance_rad_per_nm)
        .any(|(own, &believed)| own != Some(believed))
    {
        all.push("robot.compliance_rad_per_nm".to_owned());
    }
    if robot.model.ignores_actuators() {
        all.push("robot.actuators".to_owned());
    }
    all
}

/// How the robot that is read again differs from an arm, at most, over configurations all over the joints' ranges: in a tool's
/// place (m) and orientation (rad), unloaded with rigid joints, and in its deflection under gravity and a load (m); with what the file
/// has no words for.
fn differences(
    scenario: &Scenario,
    arm: &ElasticArm,
    write: &dyn Fn(&Path) -> Result<WrittenModel, FileError>,
) -> Result<(Vec<String>, [f64; 3]), FileError> {
    let own = &scenario.task.belief.nominal.model;
    let failed = |error: std::io::Error| {
        FileError::new(own.path(), format!("cannot be written again: {error}"))
    };
    let folder = tempfile::tempdir().map_err(failed)?;
    let file = folder.path().join("model.xml");
    let written = write(folder.path())?;
    std::fs::write(&file, written.text).map_err(failed)?;
    let model = Model::load(&file)?;
    let again = SerialChain::from_model(&model)?;
    let own_chain = arm.loaded_chain();
    let compliance: Vec<f64> = (again.joints.iter())
        .map(|joint| joint.model_compliance_rad_per_nm.unwrap_or_default())
        .collect();
    let loads = scenario.task.test_poses.iter().map(|pose| pose.load);
    let load = loads.max_by(|one, other| one.wrench().norm().total_cmp(&other.wrench().norm()));
    let loads = [Load::NONE, load.unwrap_or(Load::NONE)];
    let mut solvers = [(); 2].map(|()| EquilibriumSolver::new(again.len()));
    let mut largest = [0.0_f64; 3];
    for tool in &arm.tools {
        let tool_again = SerialChain::tool(&model, &tool.name)?;
        let (mut ours, mut theirs) = (own_chain.at(tool), again.at(&tool_again));
        for number in 1..=CONFIGURATIONS {
            let commanded = own_chain.spread(number);
            let standing = &commanded + DVector::from_column_slice(&arm.zero_rad);
            let (q, others) = (standing.as_slice(), commanded.as_slice());
            let (one, other) = (ours.state(q), theirs.state(others));
            let turned = rotation_vector(&(one.tool_rotation.transpose() * other.tool_rotation));
            let apart_m = (one.tool_position - other.tool_position).norm();
            let mut found = [apart_m, turned.norm(), 0.0];
            for load in &loads {
                let [one, other] = &mut solvers;
                let solved = one.solve(&mut ours, &arm.compliance_rad_per_nm, q, load);
                let also = other.solve(&mut theirs, &compliance, others, load);
                found[2] = match (solved, also) {
                    (Ok(_), Ok(_)) => {
                        let apart = one.state().tool_position - other.state().tool_position;
                        apart.norm().max(found[2])
                    }
                    // Where the one has no rest, the other has none.
                    (Err(_), Err(_)) => continue,
                    _ => f64::INFINITY,
                };
            }
            for (largest, found) in largest.iter_mut().zip(found) {
                *largest = largest.max(found);
            }
        }
    }
    Ok((written.not_expressed, largest))
}
