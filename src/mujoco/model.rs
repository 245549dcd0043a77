//! A compiled MJCF model and the look-ups that the rest of the program needs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mujoco_rs::prelude::MjModel;
use mujoco_rs::wrappers::mj_model::MjtDisableBit;
use mujoco_rs::wrappers::mj_model::MjtObjBase;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::error::{NONE, unsuitable};
use super::servo::disabled;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::text::is_unseen;

/// A compiled MJCF model, shared between threads.
#[derive(Debug, Clone)]
pub struct Model {
    pub(super) inner: Arc<MjModel>,
    pub(super) path: PathBuf,
    /// Joints that a scenario locks, each with its coordinate (rad or m).
    pub(super) locked: Arc<Vec<(usize, f64)>>,
    /// Whether its actuators do not count.
    pub(super) without_actuators: bool,
    /// What was left out when the file was read, in words.
    pub(super) left_out: Arc<Vec<String>>,
}

impl Model {
    pub(super) fn new(inner: MjModel, path: &Path) -> Result<Self, FileError> {
        // All names of the model, one after the other, each with a zero behind.
        let names: Vec<u8> = inner
            .names()
            .iter()
            .map(|each| each.cast_unsigned())
            .collect();
        for name in names.split(|&byte| byte == 0) {
            match std::str::from_utf8(name) {
                Ok(name) if !name.contains(is_unseen) => {}
                _ => {
                    let name = String::from_utf8_lossy(name);
                    let problem = format!("the name {name:?} is not plain text of one line");
                    return Err(unsuitable(path, problem));
                }
            }
        }
        let model = Self {
            inner: Arc::new(inner),
            path: path.to_owned(),
            locked: Arc::default(),
            without_actuators: false,
            left_out: Arc::default(),
        };
        model.check_numbers()?;
        Ok(model)
    }

    /// The file that the model was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The acceleration of gravity in the world frame, m/s^2; zero where the model switches it off.
    pub fn gravity(&self) -> Vector3<f64> {
        if disabled(&self.inner, MjtDisableBit::mjDSBL_GRAVITY) {
            return Vector3::zeros();
        }
        Vector3::from(self.inner.opt().gravity)
    }

    /// The number of bodies, the world (0) included.
    pub fn bodies(&self) -> usize {
        self.inner.body_mass().len()
    }

    /// The body that the given one is fixed to or moves against; the world is its own parent.
    pub fn parent(&self, body: usize) -> usize {
        self.inner.body_parentid()[body].unsigned_abs() as usize
    }

    /// The body's frame in its parent's at the model's zero configuration.
    pub fn parent_from_body(&self, body: usize) -> Isometry3<f64> {
        isometry(&self.inner.body_pos()[body], &self.inner.body_quat()[body])
    }

    /// Mass (kg) and centre of mass (m, body frame) of one body.
    pub fn mass(&self, body: usize) -> (f64, Vector3<f64>) {
        (
            self.inner.body_mass()[body],
            Vector3::from(self.inner.body_ipos()[body]),
        )
    }

    /// The number of tendons.
    pub(super) fn tendons(&self) -> usize {
        self.inner.tendon_stiffness().len()
    }

    /// A tendon by its name, or `tendon <id>`.
    pub(super) fn tendon(&self, name: &str) -> Result<usize, FileError> {
        let known = |&tendon: &usize| self.name(MjtObjBase::mjOBJ_TENDON, "tendon", tendon) == name;
        let count = self.tendons();
        (0..count).find(known).ok_or_else(|| {
            self.unknown("tendon", name, &self.names(MjtObjBase::mjOBJ_TENDON, count))
        })
    }

    /// The share of a body's mass that weighs on the arm: what the model does not compensate. MuJoCo
    /// compensates nothing where springs and dampers are both switched off.
    pub fn weighing_share(&self, body: usize) -> f64 {
        let off = [MjtDisableBit::mjDSBL_SPRING, MjtDisableBit::mjDSBL_DAMPER];
        if off.into_iter().all(|bit| disabled(&self.inner, bit)) {
            return 1.0;
        }
        1.0 - self.inner.body_gravcomp()[body]
    }

    /// The sites that springs of tendons go through, one spring after the other.
    pub fn spring_sites(&self) -> Vec<usize> {
        let springs = self.tendon_springs().into_iter();
        springs.flat_map(|spring| spring.sites).collect()
    }

    /// A body by its name.
    pub fn body(&self, name: &str) -> Option<usize> {
        (1..self.bodies()).find(|&body| self.body_name(body) == name)
    }

    /// The body's name, or `body <id>`.
    pub fn body_name(&self, body: usize) -> String {
        self.name(MjtObjBase::mjOBJ_BODY, "body", body)
    }

    /// The body's name, if it has one.
    pub fn named_body(&self, body: usize) -> Option<String> {
        let name = self.inner.id_to_name(MjtObjBase::mjOBJ_BODY, body)?;
        Some(name.to_owned())
    }

    /// The identifier of a site.
    pub fn site(&self, name: &str) -> Result<usize, FileError> {
        // The bindings' strings end at a zero.
        (!name.contains('\0'))
            .then(|| self.inner.name_to_id(MjtObjBase::mjOBJ_SITE, name))
            .flatten()
            .ok_or_else(|| {
                self.unknown(
                    "site",
                    name,
                    &self.names(MjtObjBase::mjOBJ_SITE, self.sites()),
                )
            })
    }

    /// The body that carries a site, and the site's frame in that body's.
    pub fn site_body(&self, site: usize) -> (usize, Isometry3<f64>) {
        (
            self.inner.site_bodyid()[site].unsigned_abs() as usize,
            isometry(&self.inner.site_pos()[site], &self.inner.site_quat()[site]),
        )
    }

    /// The sites that have a name, each with the body that carries it.
    pub fn named_sites(&self) -> Vec<(String, usize)> {
        let named = |site: usize| {
            let name = self.inner.id_to_name(MjtObjBase::mjOBJ_SITE, site)?;
            Some((name.to_owned(), self.site_body(site).0))
        };
        (0..self.sites()).filter_map(named).collect()
    }

    /// The number of actuators.
    pub fn actuators(&self) -> usize {
        self.inner.actuator_trntype().len()
    }

    pub(super) fn sites(&self) -> usize {
        self.inner.site_bodyid().len()
    }

    pub(super) fn name(&self, kind: MjtObjBase, word: &str, id: usize) -> String {
        self.inner
            .id_to_name(kind, id)
            .map_or_else(|| format!("{word} {id}"), str::to_owned)
    }

    /// The names of objects of a kind that have one.
    pub(super) fn names(&self, object: MjtObjBase, count: usize) -> Vec<String> {
        let name = |id| self.inner.id_to_name(object, id).map(str::to_owned);
        (0..count).filter_map(name).collect()
    }
}

fn isometry(position: &[f64; 3], quaternion: &[f64; 4]) -> Isometry3<f64> {
    let [w, x, y, z] = *quaternion;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(*position)),
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    )
}

/// What is wrong with a model, as of every file.
impl Model {
    /// The error for a model that is not a serial arm of hinges and slides.
    pub fn not_serial(&self, reason: impl std::fmt::Display) -> FileError {
        let problem = format!("not a serial arm of hinges and slides: {reason}");
        FileError::new(&self.path, problem).code(ErrorCode::NotSerial)
    }

    /// The error for an element that can move the arm's rest and that the statics do not know: the element as the file has
    /// it, such as `joint "joint_2"`, what it says and what that would do, and what to do about it.
    pub(super) fn not_static(
        &self,
        element: impl std::fmt::Display,
        problem: impl std::fmt::Display,
        hint: impl Into<String>,
    ) -> FileError {
        let wrong = FileError::new(&self.path, format!("{element}: {problem}"));
        wrong.hint(hint).code(ErrorCode::ModelStatics)
    }

    /// The error where MuJoCo cannot apply a load.
    pub(super) fn not_loaded(&self, message: impl std::fmt::Display) -> FileError {
        let problem = format!("MuJoCo cannot apply the load: {message}");
        FileError::new(&self.path, problem).code(ErrorCode::Model)
    }

    /// The error for an object that the model does not have.
    pub(super) fn unknown(&self, kind: &str, name: &str, known: &[String]) -> FileError {
        let known = match known {
            [] => NONE.to_owned(),
            known => known.join(", "),
        };
        let problem = format!("the model has no {kind} named {name:?}; it has: {known}");
        let wrong = FileError::new(&self.path, problem).code(ErrorCode::ModelName);
        if kind == "site" && known == NONE {
            return wrong.hint(
                "mark each tool's tip with <site name=\"...\" pos=\"x y z\"/> inside the body that carries it, or mount the tool in the scenario ([[robot.tool]]); the scenario names these sites",
            );
        }
        wrong
    }
}
