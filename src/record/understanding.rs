//! The record of a robot as it was understood: what `check` prints.

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::understanding::{
    Bent, Understanding, UnderstoodJoint, UnderstoodPose, UnderstoodTruth, Unknowns,
};

/// What was understood of a scenario: lengths in mm, angles in deg, stiffnesses in N m/rad (N/m of joints that slide).
pub fn understanding_json(understanding: &Understanding) -> Value {
    let joints = understanding.joints.iter().map(joint);
    let poses = (understanding.poses.iter()).map(|each| pose(understanding, each));
    let mut json = json!({
        "robot": {
            "joints": joints.collect::<Vec<_>>(),
            "reach_mm": understanding.reach_m * 1e3,
            "gravity_m_s2": understanding.gravity_m_s2.norm(),
        },
        "test_poses": poses.collect::<Vec<_>>(),
        "warnings": understanding.warnings,
    });
    if let Some(truth) = &understanding.truth {
        json["true_robot"] = true_robot(truth);
    }
    json
}

/// A virtual robot that is more than a chain: what its equality constraints tie gives way by mm, deg, or both in a weld.
fn true_robot(truth: &UnderstoodTruth) -> Value {
    let gives_way = truth.gives_way.iter().map(|each| {
        let mut json = json!({ "element": each.element });
        if !each.is_angle {
            json["distance_mm"] = (each.distance * 1e3).into();
        }
        if let Some(angle) = each.is_angle.then_some(each.distance).or(each.weld_rad) {
            json["angle_deg"] = angle.to_degrees().into();
        }
        json
    });
    json!({
        "reason": truth.reason,
        "beyond_belief": truth.beyond_belief,
        "gives_way": gives_way.collect::<Vec<_>>(),
    })
}

fn joint(joint: &UnderstoodJoint) -> Value {
    let stiffness = joint.compliance_rad_per_nm.recip();
    let mut json = json!({
        "name": joint.name,
        "range_deg": joint.range_rad.map(|value| joint.drive.shown(value).0),
        "stiffness_nm_per_rad": Some(stiffness).filter(|stiffness| stiffness.is_finite()),
        "compliance_rad_per_nm": joint.compliance_rad_per_nm,
        "identified": joint.is_parameter,
        "moving_mass_kg": joint.moving_mass_kg,
    });
    for (key, holds) in [
        ("slides", joint.drive.slides),
        ("passive", joint.drive.passive_at.is_some()),
    ] {
        if holds {
            json[key] = true.into();
        }
    }
    json
}

/// The robot at a test pose; what bends is null where nothing holds it.
fn pose(understanding: &Understanding, pose: &UnderstoodPose) -> Value {
    let millimetres = |position_m: Vector3<f64>| <[f64; 3]>::from(position_m * 1e3);
    let turn = |(joint, moved): (usize, f64)| {
        let slides = understanding.joints[joint].drive.slides;
        (!slides).then(|| moved.to_degrees())
    };
    let bent = pose.bent.as_ref().ok();
    let moved = |motion: fn(&Bent) -> Vector3<f64>| bent.map(motion).map(millimetres);
    json!({
        "name": pose.name,
        "calibration_tool_mm": millimetres(pose.calibration_tool_m),
        "machining_tool_mm": millimetres(pose.machining_tool_m),
        "direction": pose.direction.map(<[f64; 3]>::from),
        "own_weight_mm": moved(|bent| bent.own_weight_m),
        "own_weight_deg": bent.and_then(|bent| turn(bent.own_weight_joint)),
        "task_load_mm": moved(|bent| bent.task_load_m),
        "task_load_deg": bent.and_then(|bent| turn(bent.task_load_joint)),
    })
}

/// What one kind of reading at the calibration tool can tell of a robot, if all of it were unknown: a largest set of
/// parameters that can be determined together, and why the others can be left out.
pub fn unknowns_json(unknowns: &Unknowns) -> Value {
    let redundant = unknowns.freedoms.iter().map(|each| {
        json!({
            "parameter": unknowns.names[each.redundant],
            "structural": each.is_structural,
            "reason": each.sentence,
        })
    });
    json!({
        "reading": unknowns.reading.name(),
        "parameters": unknowns.names.len(),
        "minimal_set": unknowns.minimal(),
        "redundant": redundant.collect::<Vec<_>>(),
    })
}
