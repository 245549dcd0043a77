//! What a model draws and collides with.

use mujoco_rs::wrappers::mj_model::{MjtGeomBase, MjtObjBase};
use nalgebra::Vector3;

use super::Model;

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

impl Shape {
    /// Whether a point (m, in the shape's own frame) is inside; of a mesh nobody looks.
    pub fn has_inside(&self, point_m: &Vector3<f64>) -> bool {
        let [x, y, z] = (*point_m).into();
        let beside = x.hypot(y);
        match self {
            Self::Plane => z < 0.0,
            Self::Sphere(radius) => point_m.norm() < *radius,
            Self::Capsule(radius, half) => beside.hypot((z.abs() - half).max(0.0)) < *radius,
            Self::Cylinder(radius, half) => beside < *radius && z.abs() < *half,
            Self::Ellipsoid(axes) => point_m.component_div(axes).norm() < 1.0,
            Self::Box(half) => (half - point_m.abs()).min() > 0.0,
            Self::Mesh(..) => false,
        }
    }
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

impl Model {
    /// The number of geometries.
    pub fn geometries(&self) -> usize {
        self.inner.geom_type().len()
    }

    /// The body that carries a geometry.
    pub fn geometry_body(&self, geometry: usize) -> usize {
        self.inner.geom_bodyid()[geometry].unsigned_abs() as usize
    }

    /// The geometry's name, or that of the body that it is a part of.
    pub fn geometry_name(&self, geometry: usize) -> String {
        self.inner
            .id_to_name(MjtObjBase::mjOBJ_GEOM, geometry)
            .map_or_else(
                || format!("a part of {}", self.body_name(self.geometry_body(geometry))),
                str::to_owned,
            )
    }

    /// Everything there is to draw or to collide with, in MuJoCo's order.
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
}
