//! One thread's simulation of a model.

use std::collections::BTreeSet;

use mujoco_rs::prelude::MjData;
use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::Model;
use super::torque_law::LawAtWork;

/// Two geometries nearer to each other than their margins allow.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// The names of the two geometries.
    pub between: [String; 2],
    /// The signed distance (m); negative is penetration.
    pub distance_m: f64,
}

/// One thread's simulation: joint coordinates and all that follows from them.
pub struct State {
    pub(super) model: Model,
    pub(super) data: MjData<std::sync::Arc<mujoco_rs::prelude::MjModel>>,
    /// Where the joints that are not locked have their (first) coordinate.
    coordinates: Vec<usize>,
    /// The joints that are no springs.
    pub(super) laws: Vec<LawAtWork>,
}

impl std::fmt::Debug for State {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("State")
            .field("model", &self.model.path())
            .finish_non_exhaustive()
    }
}

impl State {
    /// A new simulation that stands as the file draws it, but for locked joints.
    pub fn new(model: &Model) -> Self {
        let free = model.chain_joints().into_iter();
        let mut state = Self {
            data: MjData::new(model.inner.clone()),
            coordinates: free.map(|joint| model.coordinate_of_joint(joint)).collect(),
            model: model.clone(),
            laws: Vec::new(),
        };
        state.set_coordinates(&model.start_coordinates());
        state
    }

    /// The model that is simulated.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Runs MuJoCo's kinematics at the coordinates `q` of the joints that are not locked (rad, m): poses of bodies, geometries and
    /// sites, joint axes and centres of mass; no collisions.
    pub fn move_to(&mut self, q: &[f64]) {
        self.stand_at(q);
        self.data.kinematics();
        self.data.com_pos();
    }

    /// Sets these coordinates, and no pose by them yet.
    pub fn stand_at(&mut self, q: &[f64]) {
        let all = self.data.qpos_mut();
        for (&coordinate, &value) in self.coordinates.iter().zip(q) {
            all[coordinate] = value;
        }
    }

    /// The joint's anchor (m) and axis (unit vector) in the world frame.
    pub fn joint(&self, joint: usize) -> (Vector3<f64>, Vector3<f64>) {
        (
            Vector3::from(self.data.xanchor()[joint]),
            Vector3::from(self.data.xaxis()[joint]),
        )
    }

    /// The mass (kg) of a body with all that hangs on it, and its centre in the world frame (m).
    pub fn subtree(&self, body: usize) -> (f64, Vector3<f64>) {
        (
            self.model.inner.body_subtreemass()[body],
            Vector3::from(self.data.subtree_com()[body]),
        )
    }

    /// The position (m) and orientation of a site in the world frame.
    pub fn site(&self, site: usize) -> (Vector3<f64>, Matrix3<f64>) {
        (
            Vector3::from(self.data.site_xpos()[site]),
            Matrix3::from_row_slice(&self.data.site_xmat()[site]),
        )
    }

    /// MuJoCo's own Jacobian of a site: position rows, then rotation rows, row-major, each row as
    /// long as there are joints.
    pub fn site_jacobian(&self, site: usize) -> (Vec<f64>, Vec<f64>) {
        self.data.jac_site(true, true, site)
    }

    /// The pose of a body in the world frame.
    pub fn body_pose(&self, body: usize) -> Isometry3<f64> {
        let [w, x, y, z] = self.data.xquat()[body];
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.data.xpos()[body])),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        )
    }

    /// The pose of a geometry in the world frame.
    pub fn geometry_pose(&self, geometry: usize) -> Isometry3<f64> {
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(
            &self.data.geom_xmat()[geometry],
        ));
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.data.geom_xpos()[geometry])),
            UnitQuaternion::from_rotation_matrix(&rotation),
        )
    }

    /// Follows a ray from a point along a vector, both in the world frame, and returns the first
    /// shown geometry (groups 0 to 2) that it meets with the distance in lengths of the vector;
    /// geometries of the body `transparent`, where there is one, do not stop it.
    pub fn ray(
        &mut self,
        from: &Vector3<f64>,
        along: &Vector3<f64>,
        transparent: Option<usize>,
    ) -> Option<(usize, f64)> {
        const SHOWN: [u8; 6] = [1, 1, 1, 0, 0, 0];
        let (hit, distance) = self.data.ray(
            &(*from).into(),
            &(*along).into(),
            Some(&SHOWN),
            true,
            transparent,
            None,
        );
        hit.map(|geometry| (geometry, distance))
    }

    /// The joint coordinates (rad) and velocities (rad/s).
    pub fn coordinates(&self) -> (&[f64], &[f64]) {
        (self.data.qpos(), self.data.qvel())
    }

    /// The nearest pair of geometries that may collide, if it is nearer than `clearance_m`, as
    /// MuJoCo's collision detection finds it; the model must have at least that clearance, see
    /// [`Model::with_clearance`].
    pub fn nearest_contact(&mut self, clearance_m: f64) -> Option<Contact> {
        self.data.collision();
        let nearest = self
            .data
            .contact()
            .iter()
            .min_by(|one, other| one.dist.total_cmp(&other.dist))?;
        (nearest.dist < clearance_m).then(|| Contact {
            between: nearest.geom.map(|id| self.geometry_name(id)),
            distance_m: nearest.dist,
        })
    }

    /// The names of all pairs of geometries that are nearer than `clearance_m`, each once.
    pub fn contacts(&mut self, clearance_m: f64) -> BTreeSet<[String; 2]> {
        self.data.collision();
        let near = (self.data.contact().iter()).filter(|contact| contact.dist < clearance_m);
        near.map(|contact| contact.geom.map(|id| self.geometry_name(id)))
            .collect()
    }

    fn geometry_name(&self, id: i32) -> String {
        self.model.geometry_name(id.unsigned_abs() as usize)
    }
}
