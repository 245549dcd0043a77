//! A compiled MJCF model and the look-ups that the rest of the program needs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mujoco_rs::prelude::{MjModel, MjtJoint};
use mujoco_rs::wrappers::mj_model::MjtDisableBit;
use mujoco_rs::wrappers::mj_model::{MjtGeomBase, MjtObjBase};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use super::messages;
use super::rehearsal::rehearse;
use super::scan::scan;
use super::statics::{Servo, command_range, disabled};
use super::urdf::UrdfText;
use crate::files::source;
use crate::text::is_unseen;

/// Why an MJCF file cannot serve.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file is missing or cannot be read.
    #[error("{path}: cannot be read: {source}")]
    Read {
        /// The model file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// MuJoCo's compiler refuses the file.
    #[error("{path}: MuJoCo refuses the model: {message}")]
    Compile {
        /// The model file.
        path: PathBuf,
        /// MuJoCo's own words.
        message: String,
    },
    /// The file is written in another language than MJCF, or names files as others do.
    #[error("{path}: {problem}")]
    Foreign {
        /// The model file.
        path: PathBuf,
        /// What it is.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// MuJoCo cannot be left alone with the file.
    #[error("{path}: {problem}")]
    Untrusted {
        /// The model file.
        path: PathBuf,
        /// Why.
        problem: String,
        /// What to do about it.
        hint: Option<String>,
    },
    /// The model has nothing of that name.
    #[error("{path}: the model has no {kind} named {name:?}; it has: {known}")]
    Unknown {
        /// The model file.
        path: PathBuf,
        /// What was looked for, such as "site".
        kind: &'static str,
        /// The name that was given.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// The model has an element that can move the arm's rest and that the statics do not know.
    #[error("{path}: {element}: {problem}")]
    Statics {
        /// The model file.
        path: PathBuf,
        /// The element, such as `joint "joint_2"`.
        element: String,
        /// What it says and what that would do.
        problem: String,
        /// What to do about it.
        hint: String,
    },
    /// MuJoCo cannot apply a load.
    #[error("{path}: MuJoCo cannot apply the load: {message}")]
    Load {
        /// The model file.
        path: PathBuf,
        /// MuJoCo's own words.
        message: String,
    },
    /// The model is not a serial arm of hinges and slides.
    #[error("{path}: not a serial arm of hinges and slides: {reason}")]
    NotSerial {
        /// The model file.
        path: PathBuf,
        /// What is in the way.
        reason: String,
    },
}

/// What a list of names says that has none.
const NONE: &str = "none";

impl ModelError {
    /// What to do about it, where that can be told.
    #[must_use]
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Statics { hint, .. } | Self::Foreign { hint, .. } => Some(hint),
            Self::Untrusted { hint, .. } => hint.as_deref(),
            Self::Unknown {
                kind: "site",
                known,
                ..
            } if known == NONE => Some(
                "mark each tool's tip with <site name=\"...\" pos=\"x y z\"/> inside the body that carries it, or mount the tool in the scenario ([[robot.tool]]); the scenario names these sites",
            ),
            _ => None,
        }
    }
}

/// The shape of a geometry, sizes in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// The half space below the local xy plane.
    Plane,
    /// A ball of this radius.
    Sphere(f64),
    /// Radius, and half length of the cylindrical part along z.
    Capsule(f64, f64),
    /// Radius and half length along z.
    Cylinder(f64, f64),
    /// The three semi-axes.
    Ellipsoid(Vector3<f64>),
    /// The three half sizes.
    Box(Vector3<f64>),
    /// Vertices and triangles (indices into the vertices).
    Mesh(Vec<[f32; 3]>, Vec<[u32; 3]>),
}

/// One geometry of the model, fixed to a body.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Its name, or that of the body that it is a part of.
    pub name: String,
    /// MuJoCo's identifier, the index into [`super::State::geometry_pose`].
    pub id: usize,
    /// Its shape.
    pub shape: Shape,
    /// Red, green, blue and opacity in 0 to 1.
    pub rgba: [f32; 4],
    /// MuJoCo's visibility group; 0 to 2 are shown by default.
    pub group: i32,
    /// Whether it takes part in collisions.
    pub collides: bool,
}

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
    /// Compiles the MJCF file with MuJoCo.
    ///
    /// # Errors
    /// The file cannot be read, or MuJoCo refuses it.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        let Some(read) = prepare(path)? else {
            let inner = MjModel::from_xml(path)
                .map_err(|error| refused(path, messages::refusal(path, &error.to_string())))?;
            return Self::new(inner, path);
        };
        let (mut spec, left_out) = read.spec(path)?;
        let inner = (spec.compile()).map_err(|error| refused(path, error.to_string()))?;
        Ok(Self {
            left_out: Arc::new(left_out),
            ..Self::new(inner, path)?
        })
    }

    pub(super) fn new(inner: MjModel, path: &Path) -> Result<Self, ModelError> {
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
                    return Err(refused(path, problem));
                }
            }
        }
        Ok(Self {
            inner: Arc::new(inner),
            path: path.to_owned(),
            locked: Arc::default(),
            without_actuators: false,
            left_out: Arc::default(),
        })
    }

    /// The same model in which other numbers stand.
    pub(super) fn changed(&self, model: MjModel) -> Self {
        Self {
            inner: Arc::new(model),
            ..self.clone()
        }
    }

    /// The file that the model was read from.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The same model without contacts and joint limits.
    #[must_use]
    pub fn without_contacts_and_limits(&self) -> Self {
        let mut model = (*self.inner).clone();
        model.opt_mut().disableflags |=
            MjtDisableBit::mjDSBL_CONTACT as i32 | MjtDisableBit::mjDSBL_LIMIT as i32;
        self.changed(model)
    }

    /// The same model in which each body has the mass that weighs on the arm: without the share that
    /// the model compensates (`gravcomp`). For statics alone.
    #[must_use]
    pub fn with_weighing_masses(&self) -> Self {
        let compensation = self.inner.body_gravcomp();
        if compensation.iter().all(|&share| share == 0.0) {
            return self.clone();
        }
        let mut model = (*self.inner).clone();
        for (body, mass) in model.body_mass_mut().iter_mut().enumerate() {
            *mass *= self.weighing_share(body);
        }
        self.add_up_masses(&mut model);
        self.changed(model)
    }

    /// Sums up what hangs on each body, in a model with other masses.
    pub(super) fn add_up_masses(&self, model: &mut MjModel) {
        let masses = model.body_mass().to_vec();
        let subtrees = model.body_subtreemass_mut();
        subtrees.copy_from_slice(&masses);
        for body in (1..masses.len()).rev() {
            subtrees[self.parent(body)] += subtrees[body];
        }
    }

    /// The same model in which geometries that collide come into contact at this distance (m).
    #[must_use]
    pub fn with_clearance(&self, clearance_m: f64) -> Self {
        let mut model = (*self.inner).clone();
        model.geom_margin_mut().fill(clearance_m);
        model.body_margin_mut().fill(clearance_m);
        self.changed(model)
    }

    /// The same model in which some joints have other compliances (rad/(N m)); their commands mean the
    /// same. A compliance of zero changes nothing.
    ///
    /// # Errors
    /// [`ModelError::Statics`] for a joint that no position actuator holds.
    pub fn with_joint_compliance(
        &self,
        joints: &[usize],
        compliance: &[f64],
    ) -> Result<Self, ModelError> {
        let mut model = (*self.inner).clone();
        for (&joint, value) in joints.iter().zip(compliance) {
            if *value == 0.0 {
                continue;
            }
            let Some(servo) = self.position(joint) else {
                self.joint_spring(joint)
                    .ok_or_else(|| self.not_held(joint))?;
                model.jnt_stiffness_mut()[joint] = value.recip();
                continue;
            };
            let gain = value.recip() / (servo.gear * servo.gear);
            let command = self.inner.actuator_gainprm()[servo.actuator][0];
            let spring = -self.inner.actuator_biasprm()[servo.actuator][1];
            // SAFETY: gains and biases are plain numbers; no index or size depends on them.
            #[expect(unsafe_code, reason = "the wrapper has no safe setter")]
            unsafe {
                model.actuator_gainprm_mut()[servo.actuator][0] = gain * (command / spring);
                model.actuator_biasprm_mut()[servo.actuator][1] = -gain;
            }
        }
        Ok(self.changed(model))
    }

    /// The position actuator that holds a joint.
    fn position(&self, joint: usize) -> Option<Servo> {
        Servo::of(&self.inner, joint).find(|servo| servo.is_position(&self.inner))
    }

    /// The time step of simulations (s).
    #[must_use]
    pub fn time_step_s(&self) -> f64 {
        self.inner.opt().timestep
    }

    /// The acceleration of gravity in the world frame, m/s^2; zero where the model switches it off.
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        if disabled(&self.inner, MjtDisableBit::mjDSBL_GRAVITY) {
            return Vector3::zeros();
        }
        Vector3::from(self.inner.opt().gravity)
    }

    /// The number of bodies, the world (0) included.
    #[must_use]
    pub fn bodies(&self) -> usize {
        self.inner.body_mass().len()
    }

    /// The body that the given one is fixed to or moves against; the world is its own parent.
    #[must_use]
    pub fn parent(&self, body: usize) -> usize {
        self.inner.body_parentid()[body].unsigned_abs() as usize
    }

    /// The body's frame in its parent's at the model's zero configuration.
    #[must_use]
    pub fn parent_from_body(&self, body: usize) -> Isometry3<f64> {
        isometry(&self.inner.body_pos()[body], &self.inner.body_quat()[body])
    }

    /// Mass (kg) and centre of mass (m, body frame) of one body.
    #[must_use]
    pub fn mass(&self, body: usize) -> (f64, Vector3<f64>) {
        (
            self.inner.body_mass()[body],
            Vector3::from(self.inner.body_ipos()[body]),
        )
    }

    /// The share of a body's mass that weighs on the arm: what the model does not compensate. MuJoCo
    /// compensates nothing where springs and dampers are both switched off.
    #[must_use]
    pub fn weighing_share(&self, body: usize) -> f64 {
        let off = [MjtDisableBit::mjDSBL_SPRING, MjtDisableBit::mjDSBL_DAMPER];
        if off.into_iter().all(|bit| disabled(&self.inner, bit)) {
            return 1.0;
        }
        1.0 - self.inner.body_gravcomp()[body]
    }

    /// The joints of a body in the order in which they act.
    pub fn joints_of(&self, body: usize) -> impl Iterator<Item = usize> + use<> {
        let count = self.inner.body_jntnum()[body].unsigned_abs() as usize;
        let first = self.inner.body_jntadr()[body].max(0).unsigned_abs() as usize;
        first..first + count
    }

    /// Whether the joint slides along its axis.
    #[must_use]
    pub fn is_slide(&self, joint: usize) -> bool {
        self.inner.jnt_type()[joint] == MjtJoint::mjJNT_SLIDE
    }

    /// How many joints that are not locked, from the base, move a body of a serial arm.
    #[must_use]
    pub fn joints_that_move(&self, mut body: usize) -> usize {
        let mut count = 0;
        while body != 0 {
            let joints = self.joints_of(body);
            count += joints
                .filter(|&joint| self.locked_at(joint).is_none())
                .count();
            body = self.parent(body);
        }
        count
    }

    /// The sites that springs of tendons go through, one spring after the other.
    #[must_use]
    pub fn spring_sites(&self) -> Vec<usize> {
        let springs = self.tendon_springs().into_iter();
        springs.flat_map(|spring| spring.sites).collect()
    }

    /// The number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.inner.jnt_type().len()
    }

    /// Whether the joint is a hinge.
    #[must_use]
    pub fn is_hinge(&self, joint: usize) -> bool {
        self.inner.jnt_type()[joint] == MjtJoint::mjJNT_HINGE
    }

    /// Axis (unit vector) and anchor (m) of a joint in its body's frame.
    #[must_use]
    pub fn joint_axis_and_anchor(&self, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
        (
            Vector3::from(self.inner.jnt_axis()[joint]),
            Vector3::from(self.inner.jnt_pos()[joint]),
        )
    }

    /// The range of a joint's commanded angle (rad), whether or not MuJoCo enforces it on the
    /// elastic joint; where the joint has none, that of its actuator's commands; else one turn each way.
    #[must_use]
    pub fn joint_range(&self, joint: usize) -> [f64; 2] {
        let [low, high] = self.inner.jnt_range()[joint];
        if low < high {
            return [low, high];
        }
        Servo::of(&self.inner, joint)
            .find_map(|servo| command_range(&self.inner, &servo))
            .unwrap_or([-std::f64::consts::TAU, std::f64::consts::TAU])
    }

    /// The joint coordinate at which the bodies stand as the file draws them (rad).
    #[must_use]
    pub fn joint_reference(&self, joint: usize) -> f64 {
        self.inner.qpos0()[joint]
    }

    /// The compliance of a joint (rad/(N m), m/N): one over the stiffness of the position actuator that
    /// holds it at its command or, where it is passive, of its spring; `None` if there is neither.
    #[must_use]
    pub fn joint_compliance(&self, joint: usize) -> Option<f64> {
        match self.position(joint) {
            Some(servo) => {
                let spring = -self.inner.actuator_biasprm()[servo.actuator][1];
                Some((spring * servo.gear * servo.gear).recip())
            }
            None => self
                .joint_spring(joint)
                .map(|[stiffness, _]| stiffness.recip()),
        }
    }

    /// Whether a position actuator holds the joint.
    #[must_use]
    pub fn is_actuated(&self, joint: usize) -> bool {
        self.position(joint).is_some()
    }

    /// The linear stiffness of the spring in a joint (N m/rad, N/m) and where it is relaxed (rad, m), if
    /// there is one that acts.
    #[must_use]
    pub fn joint_spring(&self, joint: usize) -> Option<[f64; 2]> {
        let stiffness = self.inner.jnt_stiffness()[joint];
        let acts = stiffness != 0.0 && !disabled(&self.inner, MjtDisableBit::mjDSBL_SPRING);
        let coordinate = self.coordinate_of_joint(joint);
        acts.then(|| [stiffness, self.inner.qpos_spring()[coordinate]])
    }

    /// The constant force on a joint (N m, N) of the actuator that holds it.
    #[must_use]
    pub fn joint_offset(&self, joint: usize) -> f64 {
        self.position(joint).map_or(0.0, |servo| {
            servo.gear * self.inner.actuator_biasprm()[servo.actuator][0]
        })
    }

    /// The joint's name, or `joint <id>`.
    #[must_use]
    pub fn joint_name(&self, joint: usize) -> String {
        self.name(MjtObjBase::mjOBJ_JOINT, "joint", joint)
    }

    /// The body's name, or `body <id>`.
    #[must_use]
    pub fn body_name(&self, body: usize) -> String {
        self.name(MjtObjBase::mjOBJ_BODY, "body", body)
    }

    /// The body's name, if it has one.
    #[must_use]
    pub fn named_body(&self, body: usize) -> Option<String> {
        let name = self.inner.id_to_name(MjtObjBase::mjOBJ_BODY, body)?;
        Some(name.to_owned())
    }

    /// The identifier of a joint.
    ///
    /// # Errors
    /// There is no such joint.
    pub fn joint(&self, name: &str) -> Result<usize, ModelError> {
        (0..self.joints())
            .find(|&joint| self.joint_name(joint) == name)
            .ok_or_else(|| self.unknown("joint", MjtObjBase::mjOBJ_JOINT, name, self.joints()))
    }

    /// The identifier of a site.
    ///
    /// # Errors
    /// There is no such site.
    pub fn site(&self, name: &str) -> Result<usize, ModelError> {
        // The bindings' strings end at a zero.
        (!name.contains('\0'))
            .then(|| self.inner.name_to_id(MjtObjBase::mjOBJ_SITE, name))
            .flatten()
            .ok_or_else(|| self.unknown("site", MjtObjBase::mjOBJ_SITE, name, self.sites()))
    }

    /// The body that carries a site, and the site's frame in that body's.
    #[must_use]
    pub fn site_body(&self, site: usize) -> (usize, Isometry3<f64>) {
        (
            self.inner.site_bodyid()[site].unsigned_abs() as usize,
            isometry(&self.inner.site_pos()[site], &self.inner.site_quat()[site]),
        )
    }

    /// The number of geometries.
    #[must_use]
    pub fn geometries(&self) -> usize {
        self.inner.geom_type().len()
    }

    /// The body that carries a geometry.
    #[must_use]
    pub fn geometry_body(&self, geometry: usize) -> usize {
        self.inner.geom_bodyid()[geometry].unsigned_abs() as usize
    }

    /// The geometry's name, or that of the body that it is a part of.
    #[must_use]
    pub fn geometry_name(&self, geometry: usize) -> String {
        self.inner
            .id_to_name(MjtObjBase::mjOBJ_GEOM, geometry)
            .map_or_else(
                || format!("a part of {}", self.body_name(self.geometry_body(geometry))),
                str::to_owned,
            )
    }

    /// Everything there is to draw or to collide with, in MuJoCo's order.
    #[must_use]
    pub fn scenery(&self) -> Vec<Geometry> {
        (0..self.geometries())
            .filter_map(|id| {
                Some(Geometry {
                    name: self.geometry_name(id),
                    id,
                    shape: self.shape(id)?,
                    rgba: self.colour(id),
                    group: self.inner.geom_group()[id],
                    collides: self.inner.geom_contype()[id] != 0
                        || self.inner.geom_conaffinity()[id] != 0,
                })
            })
            .collect()
    }

    fn shape(&self, geometry: usize) -> Option<Shape> {
        let [x, y, z] = self.inner.geom_size()[geometry];
        Some(match self.inner.geom_type()[geometry] {
            MjtGeomBase::mjGEOM_PLANE => Shape::Plane,
            MjtGeomBase::mjGEOM_SPHERE => Shape::Sphere(x),
            MjtGeomBase::mjGEOM_CAPSULE => Shape::Capsule(x, y),
            MjtGeomBase::mjGEOM_CYLINDER => Shape::Cylinder(x, y),
            MjtGeomBase::mjGEOM_ELLIPSOID => Shape::Ellipsoid(Vector3::new(x, y, z)),
            MjtGeomBase::mjGEOM_BOX => Shape::Box(Vector3::new(x, y, z)),
            MjtGeomBase::mjGEOM_MESH => self.mesh(geometry)?,
            _ => return None,
        })
    }

    fn mesh(&self, geometry: usize) -> Option<Shape> {
        let mesh = usize::try_from(self.inner.geom_dataid()[geometry]).ok()?;
        let range = |first: &[i32], count: &[i32]| {
            let first = first[mesh].unsigned_abs() as usize;
            first..first + count[mesh].unsigned_abs() as usize
        };
        let vertices = range(self.inner.mesh_vertadr(), self.inner.mesh_vertnum());
        let faces = range(self.inner.mesh_faceadr(), self.inner.mesh_facenum());
        Some(Shape::Mesh(
            self.inner.mesh_vert()[vertices].to_vec(),
            self.inner.mesh_face()[faces]
                .iter()
                .map(|face| face.map(i32::unsigned_abs))
                .collect(),
        ))
    }

    fn colour(&self, geometry: usize) -> [f32; 4] {
        usize::try_from(self.inner.geom_matid()[geometry]).map_or_else(
            |_| self.inner.geom_rgba()[geometry],
            |material| self.inner.mat_rgba()[material],
        )
    }

    /// The sites that have a name, each with the body that carries it.
    #[must_use]
    pub fn named_sites(&self) -> Vec<(String, usize)> {
        let named = |site: usize| {
            let name = self.inner.id_to_name(MjtObjBase::mjOBJ_SITE, site)?;
            Some((name.to_owned(), self.site_body(site).0))
        };
        (0..self.sites()).filter_map(named).collect()
    }

    /// The number of actuators.
    #[must_use]
    pub fn actuators(&self) -> usize {
        self.inner.actuator_trntype().len()
    }

    pub(super) fn sites(&self) -> usize {
        self.inner.site_bodyid().len()
    }

    fn name(&self, kind: MjtObjBase, word: &str, id: usize) -> String {
        self.inner
            .id_to_name(kind, id)
            .map_or_else(|| format!("{word} {id}"), str::to_owned)
    }

    fn unknown(
        &self,
        kind: &'static str,
        object: MjtObjBase,
        name: &str,
        count: usize,
    ) -> ModelError {
        let known: Vec<_> = (0..count)
            .filter_map(|id| self.inner.id_to_name(object, id))
            .collect();
        ModelError::Unknown {
            path: self.path.clone(),
            kind,
            name: name.to_owned(),
            known: if known.is_empty() {
                NONE.to_owned()
            } else {
                known.join(", ")
            },
        }
    }
}

/// Looks at a file before MuJoCo does, and takes MuJoCo's messages over.
/// Looks at a file before MuJoCo does; a URDF comes back as MuJoCo's compiler takes it.
pub(super) fn prepare(path: &Path) -> Result<Option<UrdfText>, ModelError> {
    if path.to_str().is_none_or(|path| path.contains('\0')) {
        return Err(refused(path, "its path is not UTF-8 text"));
    }
    // MuJoCo's own message for a missing file does not say why; the system's does.
    std::fs::metadata(path).map_err(|source| ModelError::Read {
        path: path.to_owned(),
        source,
    })?;
    let untrusted = |problem, hint| ModelError::Untrusted {
        path: path.to_owned(),
        problem,
        hint,
    };
    let bytes = source::read(path).map_err(|problem| untrusted(problem, None))?;
    let text = String::from_utf8_lossy(&bytes).into_owned();
    super::foreign::refuse(path, &text)?;
    scan(path).map_err(|problem| untrusted(problem, None))?;
    rehearse(path).map_err(|refusal| untrusted(refusal.problem, refusal.hint))?;
    messages::take_over();
    Ok(UrdfText::of(path, text))
}

pub(super) fn refused(path: &Path, message: impl AsRef<str>) -> ModelError {
    ModelError::Compile {
        path: path.to_owned(),
        message: messages::one_line(&[message.as_ref()]),
    }
}

fn isometry(position: &[f64; 3], quaternion: &[f64; 4]) -> Isometry3<f64> {
    let [w, x, y, z] = *quaternion;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(*position)),
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    )
}
