//! A robot's model as a file again, with what was identified: MJCF as MuJoCo itself writes it, one file, in radians and quaternions,
//! without comments.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use mujoco_rs::error::MjEditError;
use mujoco_rs::mujoco_c::mj_copyBack;
use mujoco_rs::prelude::{MjModel, MjSpec, MjtJoint};
use mujoco_rs::wrappers::mj_editing::{
    MjtInertiaFromGeom, MjtLimited, PositionConfig, SpecElement, SpecItem,
};
use mujoco_rs::wrappers::mj_model::MjtTrn;
use nalgebra::{Isometry3, Vector3};

use super::{
    Additions, KEPT, Model, ModelChange, beside::delete, fixed::fix, loading::specification,
    variants::IDLE,
};
use crate::codes::ErrorCode;
use crate::files::{FileError, absolute, way};

/// So many digits give a number back.
const DIGITS: i32 = 17;

/// What a written model says that the file does not. Joints are counted as in the chain of the model, without
/// those that are locked.
#[derive(Debug, Clone, Default)]
pub struct ModelCalibration {
    /// How the frame of each joint's link is displaced, along its own axes, the joint's zero included.
    pub links: Vec<Isometry3<f64>>,
    /// What is added to each joint's commanded coordinate (rad, m); it is in `links` already.
    pub zero: Vec<f64>,
    /// The compliance of each joint (rad/(N m), m/N).
    pub compliance: Vec<f64>,
    /// What each link weighs with all that is fixed to it, over what it weighs in the file.
    pub mass_factor: Vec<f64>,
    /// How far the centre of that mass lies from where it is in the file (m, link's frame).
    pub centre_shift_m: Vec<Vector3<f64>>,
    /// Sites that stand elsewhere: displacements along their own axes.
    pub sites: Vec<(String, Isometry3<f64>)>,
    /// Springs of tendons by name: stiffness (N/m) and lengths at which they are relaxed (m).
    pub springs: Vec<(String, f64, [f64; 2])>,
    /// What a scenario mounts: it stands in the written model. Obstacles do not.
    pub additions: Additions,
    /// Texts to keep with the model, by name.
    pub texts: Vec<(String, String)>,
}

/// The stiffness of a joint that is held to be rigid (N m/rad, N/m).
pub const RIGID: f64 = 1e14;

/// A written model.
#[derive(Debug, Clone)]
pub struct WrittenModel {
    /// Its text.
    pub text: String,
    /// What of the calibration or of the model the format has no words for.
    pub not_expressed: Vec<String>,
}

impl Model {
    /// The model's file as MJCF, calibrated, for a folder. This model has been read from that file, and may have additions, and locked
    /// joints, whose bodies are fixed in it.
    ///
    /// # Errors
    /// Something of it cannot be changed in the file, by name.
    pub fn calibrated_mjcf(
        &self,
        calibration: &ModelCalibration,
        folder: &Path,
    ) -> Result<WrittenModel, FileError> {
        let failed = |error: MjEditError| self.not_written(error.to_string());
        let (mut spec, mut not_expressed) = self.elements(calibration)?;
        let whole = Self {
            without_actuators: self.ignores_actuators(),
            ..Self::new(spec.compile().map_err(failed)?, self.path())?
        };
        let joints = self.chain_joints();
        let stiff = stiff(&whole, &joints, calibration, &mut not_expressed)?;
        let chain: Vec<Option<usize>> = joints.iter().copied().map(Some).collect();
        let changed = whole.with_changes(&chain, &changes(calibration))?;
        let changed = changed.with_joint_compliance(&joints, &stiff)?;
        let mut numbers = (*changed.inner).clone();
        for (&joint, zero) in joints.iter().zip(&calibration.zero) {
            if whole.is_actuated(joint) && whole.joint_spring(joint).is_some() {
                // The spring beside the drive feels the joint's own angle.
                numbers.qpos_spring_mut()[whole.coordinate_of_joint(joint)] -= zero;
            }
        }
        for (name, stiffness, rest) in &calibration.springs {
            let tendon = whole.tendon(name)?;
            numbers.tendon_stiffness_mut()[tendon] = *stiffness;
            numbers.tendon_lengthspring_mut()[tendon] = *rest;
        }
        spec.compiler_mut().set_saveinertial(true);
        // What weighs is said then, whatever its geometries are.
        (spec.compiler_mut()).set_inertiafromgeom(MjtInertiaFromGeom::mjINERTIAFROMGEOM_AUTO);
        let compiler = spec.compiler_mut();
        let assets = [compiler.meshdir(), compiler.texturedir()].map(str::to_owned);
        let own = folder_of(self.path());
        if !self.locked().is_empty() {
            set_assets(&mut spec, &absolute(&own), &assets);
            // Frames and orientations of all kinds are positions and quaternions in its text.
            let drawn = text(&mut spec, &numbers).map_err(failed)?;
            spec = MjSpec::from_xml_string(&drawn).map_err(failed)?;
            let lost = fix(&mut spec, &self.locked_by_name(), &self.tendons_of_locked());
            not_expressed.extend(lost.map_err(|problem| self.not_written(problem))?);
            numbers = spec.compile().map_err(failed)?;
            spec.compiler_mut().set_saveinertial(true);
        }
        set_assets(&mut spec, &way(folder, &own), &assets);
        let written = text(&mut spec, &numbers).map_err(failed)?;
        Ok(WrittenModel {
            text: written,
            not_expressed,
        })
    }

    /// The elements of the file with what a scenario mounts, and an actuator for each joint that needs one; and what the file has no
    /// words for.
    fn elements(&self, calibration: &ModelCalibration) -> Result<(MjSpec, Vec<String>), FileError> {
        let mut plain = Self::load(self.path())?;
        let (mut spec, mut not_expressed) = specification(self.path())?;
        plain.mount(&mut spec, &calibration.additions)?;
        if self.ignores_actuators() {
            idle(&mut spec);
            if plain.actuators() > 0 {
                not_expressed.push(format!(
                    "the file's actuators do not count: they stand in group {IDLE}, which is switched off"
                ));
            }
            plain = plain.without_actuators();
        }
        let mut is_any_loose = false;
        for (&joint, compliance) in self.chain_joints().iter().zip(&calibration.compliance) {
            let is_held = plain.is_actuated(joint) || plain.joint_spring(joint).is_some();
            if !is_held && plain.joint_compliance(joint) != Some(*compliance) {
                is_any_loose = true;
                let held = hold(&mut spec, &plain.joint_name(joint));
                held.map_err(|problem| self.not_written(problem))?;
            }
        }
        if is_any_loose && drop_controls(&mut spec) {
            not_expressed.push(
                "the controls of keyframes, which have no numbers for the new actuators".to_owned(),
            );
        }
        let kept = keep(&mut spec, &calibration.texts);
        kept.map_err(|error| self.not_written(error.to_string()))?;
        Ok((spec, not_expressed))
    }

    /// The error for a file that cannot be written again with other numbers.
    fn not_written(&self, problem: impl Into<String>) -> FileError {
        let problem = problem.into();
        let problem = format!("cannot be written with what was identified: {problem}");
        FileError::new(self.path(), problem).code(ErrorCode::ModelNotWritten)
    }
}

/// What of geometry and masses is different.
fn changes(calibration: &ModelCalibration) -> Vec<ModelChange> {
    let links = calibration.links.iter().enumerate();
    let sites = calibration.sites.iter();
    let masses = calibration.mass_factor.iter().enumerate();
    let centres = calibration.centre_shift_m.iter().enumerate();
    let moved = links.filter(|(_, by)| **by != Isometry3::identity());
    (moved.map(|(link, by)| ModelChange::Link(link, *by)))
        .chain(sites.map(|(name, by)| ModelChange::Site(name.clone(), *by)))
        .chain(masses.map(|(link, factor)| ModelChange::Mass(link, *factor)))
        .chain(centres.map(|(link, shift)| ModelChange::Centre(link, *shift)))
        .collect()
}

/// The compliances that joints are to have; zero stays as it is.
fn stiff(
    model: &Model,
    joints: &[usize],
    calibration: &ModelCalibration,
    not_expressed: &mut Vec<String>,
) -> Result<Vec<f64>, FileError> {
    let mut stiff = Vec::with_capacity(joints.len());
    for (&joint, &wanted) in joints.iter().zip(&calibration.compliance) {
        let (name, own) = (model.joint_name(joint), model.joint_compliance(joint));
        if wanted < 0.0 {
            return Err(model.not_written(format!(
                "the compliance of {name} is negative: no spring has that"
            )));
        }
        let is_rigid = wanted == 0.0 && own != Some(0.0);
        if is_rigid {
            not_expressed.push(format!(
                "{name} is held to be rigid: it has a stiffness of {RIGID:e}"
            ));
        }
        stiff.push(match own {
            Some(own) if own.to_bits() == wanted.to_bits() => 0.0,
            _ if is_rigid => RIGID.recip(),
            _ => wanted,
        });
    }
    Ok(stiff)
}

/// No actuator counts, and no dry friction and limited force of a joint.
fn idle(spec: &mut MjSpec) {
    for actuator in spec.actuator_iter_mut() {
        actuator.set_group(IDLE);
    }
    spec.option_mut().disableactuator |= 1 << IDLE;
    for joint in spec.world_body_mut().joint_iter_mut(true) {
        if matches!(joint.type_(), MjtJoint::mjJNT_HINGE | MjtJoint::mjJNT_SLIDE) {
            joint.set_frictionloss(0.0);
            joint.set_actfrclimited(MjtLimited::mjLIMITED_FALSE);
        }
    }
}

/// A position actuator for a joint that nothing holds.
fn hold(spec: &mut MjSpec, joint: &str) -> Result<(), String> {
    if spec.joint(joint).is_none() {
        return Err(format!(
            "{joint} has no name that an actuator could be told"
        ));
    }
    let actuator = spec.add_actuator();
    actuator.set_trntype(MjtTrn::mjTRN_JOINT);
    actuator.set_target(joint);
    *actuator.gear_mut() = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    actuator.set_group(0);
    actuator.set_ctrllimited(MjtLimited::mjLIMITED_FALSE);
    actuator.set_forcelimited(MjtLimited::mjLIMITED_FALSE);
    (actuator.set_to_position(PositionConfig::default().with_kp(RIGID)))
        .map_err(|error| error.to_string())
}

/// Takes the controls out of keyframes; whether there were any.
fn drop_controls(spec: &mut MjSpec) -> bool {
    let mut had = false;
    for key in spec.key_iter_mut() {
        had |= !key.ctrl().is_empty();
        key.set_ctrl(&[]);
    }
    had
}

/// Texts that stay with the model; those of an earlier identification go.
fn keep(spec: &mut MjSpec, texts: &[(String, String)]) -> Result<(), MjEditError> {
    while let Some(text) = spec
        .text_iter_mut()
        .find(|text| text.name().starts_with(KEPT))
    {
        delete(text)?;
    }
    for (name, data) in texts {
        let text = spec.add_text();
        text.set_name(name)?;
        text.set_data(data);
    }
    Ok(())
}

/// Meshes and textures are in these folders of that of the model's file.
fn set_assets(spec: &mut MjSpec, there: &Path, own: &[String; 2]) {
    let compiler = spec.compiler_mut();
    let [meshes, textures] = own
        .each_ref()
        .map(|own| there.join(own).to_string_lossy().into_owned());
    compiler.set_meshdir(&meshes);
    compiler.set_texturedir(&textures);
}

/// The text of a specification with a compiled model's numbers, all digits of them.
fn text(spec: &mut MjSpec, numbers: &MjModel) -> Result<String, MjEditError> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    #[expect(
        unsafe_code,
        reason = "MuJoCo has no other way to more than six digits"
    )]
    unsafe extern "C" {
        safe fn _mjPRIVATE__get_xml_precision() -> i32;
        safe fn _mjPRIVATE__set_xml_precision(precision: i32);
    }
    // SAFETY: both live, and the model was compiled from this specification.
    #[expect(unsafe_code, reason = "the bindings have no safe function for it")]
    unsafe {
        mj_copyBack(spec.ffi_mut(), numbers.ffi())
    };
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let before = _mjPRIVATE__get_xml_precision();
    _mjPRIVATE__set_xml_precision(DIGITS);
    let mut room = 1 << 16;
    let written = loop {
        match spec.save_xml_string(room) {
            Err(MjEditError::XmlBufferTooSmall { required_size }) if required_size >= room => {
                room = required_size + 1;
            }
            other => break other,
        }
    };
    _mjPRIVATE__set_xml_precision(before);
    drop(guard);
    written
}

/// The folder of a file.
fn folder_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}
