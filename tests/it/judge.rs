//! The judge: MuJoCo's own simulation in time of a file as it is, by nothing but MuJoCo.

use std::path::Path;

use mujoco_rs::prelude::{MjData, MjModel};
use mujoco_rs::wrappers::mj_model::{MjtDisableBit, MjtObjBase, MjtTrn};
use nalgebra::Vector3;

/// A robot rests where nothing has moved by more than this (rad, m) in a quarter of a second ...
const STILL: f64 = 2e-12;
/// ... or than this where constraints, which MuJoCo solves to a tolerance, make it tremble.
const TREMBLING: f64 = 5e-11;
/// Simulated time after which it will not rest (s).
const LONGEST_S: f64 = 20.0;

/// What is asked of a judge.
pub struct Question<'a> {
    /// The tool's site.
    pub site: &'a str,
    /// The joints that are commanded, each by the first actuator that acts on it.
    pub joints: &'a [String],
    /// What they are commanded (rad, m).
    pub commanded: &'a [f64],
    /// The force at the site (N), after the robot was driven to its commands.
    pub force_n: Vector3<f64>,
}

/// Where the tool rests (m), or `None` if it does not. A robot with closed loops starts where the file
/// draws it, any other at its commands.
pub fn judge(path: &Path, question: &Question<'_>) -> Option<Vector3<f64>> {
    let mut model = MjModel::from_xml(path).expect("MuJoCo reads it");
    model.opt_mut().disableflags |=
        MjtDisableBit::mjDSBL_CONTACT as i32 | MjtDisableBit::mjDSBL_LIMIT as i32;
    let id = |kind, name: &str| model.name_to_id(kind, name).expect("there is");
    let site = id(MjtObjBase::mjOBJ_SITE, question.site);
    let body = model.site_bodyid()[site].unsigned_abs() as usize;
    let mut data = MjData::new(&model);
    let controls: Vec<(usize, f64, usize)> = (question.joints.iter())
        .map(|joint| {
            let joint = id(MjtObjBase::mjOBJ_JOINT, joint);
            let acts = |servo: &usize| {
                model.actuator_trntype()[*servo] == MjtTrn::mjTRN_JOINT
                    && usize::try_from(model.actuator_trnid()[*servo][0]) == Ok(joint)
            };
            let mut servos = 0..model.actuator_trntype().len();
            let servo = servos.find(acts).expect("an actuator");
            let coordinate = model.jnt_qposadr()[joint].unsigned_abs() as usize;
            (servo, model.actuator_gear()[servo][0], coordinate)
        })
        .collect();
    let from: Vec<f64> = controls.iter().map(|each| model.qpos0()[each.2]).collect();
    let step_s = model.opt().timestep;
    let loops = model.eq_active0().iter().any(|&active| active);
    let mut driven_s = 0.0;
    if loops {
        let way = (from.iter().zip(question.commanded)).map(|(from, to)| (to - from).abs());
        driven_s = way.fold(0.0, f64::max);
    } else {
        for (&(_, _, coordinate), &value) in controls.iter().zip(question.commanded) {
            data.qpos_mut()[coordinate] = value;
        }
    }
    let mut before = data.qpos().to_vec();
    let mut time_s = 0.0;
    let mut next_look_s = driven_s + 0.25;
    while time_s < driven_s + LONGEST_S {
        let share = if time_s < driven_s {
            time_s / driven_s
        } else {
            1.0
        };
        for (joint, &(servo, gear, _)) in controls.iter().enumerate() {
            let command = from[joint] + share * (question.commanded[joint] - from[joint]);
            data.ctrl_mut()[servo] = gear * command;
        }
        data.step1();
        let point = data.site_xpos()[site];
        let mut applied = vec![0.0; data.qvel().len()];
        if time_s >= driven_s {
            let force = question.force_n.into();
            data.apply_ft(&force, &[0.0; 3], &point, body, &mut applied)
                .expect("the body exists");
        }
        data.qfrc_applied_mut().copy_from_slice(&applied);
        data.step2();
        time_s += step_s;
        if time_s > next_look_s {
            next_look_s += 0.25;
            let moved = (data.qpos().iter().zip(&before)).map(|(q, before)| (q - before).abs());
            let moved = moved.fold(0.0, |most: f64, each| {
                if each.is_nan() {
                    f64::NAN
                } else {
                    most.max(each)
                }
            });
            if moved.is_nan() {
                return None;
            }
            if moved < if loops { TREMBLING } else { STILL } {
                data.kinematics();
                return Some(Vector3::from(data.site_xpos()[site]));
            }
            before = data.qpos().to_vec();
        }
    }
    None
}
