//! The model's shapes as triangles, which recordings and stills draw.

use std::f64::consts::{FRAC_PI_2, SQRT_2, TAU};

use nalgebra::{Isometry3, Point3, Vector3};

use super::Shape;

/// Facets around a shape, and the direction of the first edge between them (facets).
type Facets = (u32, f64);
/// Of round shapes, and of a box, whose edges are in the directions of its corners.
const ROUND: Facets = (32, 0.0);
const SQUARE: Facets = (4, 0.5);
/// Half the side of the square that stands for a plane (m).
const PLANE_HALF_M: f64 = 5.0;
/// Faces that meet at less than this angle are shaded as one smooth surface (rad).
const CREASE_RAD: f64 = 0.5;

/// A surface of triangles that share their vertices; seen from outside, a triangle's vertices go
/// round counter-clockwise.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// The vertices (m).
    pub vertices: Vec<Point3<f64>>,
    /// Indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// A surface with a normal for each vertex; vertices on sharp edges occur once for each side.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ShadedMesh {
    /// The vertices (m).
    pub vertices: Vec<Point3<f64>>,
    /// The normals (unit vectors), one for each vertex.
    pub normals: Vec<Vector3<f64>>,
    /// Indices into the vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The surface of a shape in its own frame: closed, but for a plane, which becomes a square.
    pub fn new(shape: &Shape) -> Self {
        let prism =
            |r: f64, facets| revolve(&[(0.0, -1.0), (r, -1.0), (r, 1.0), (0.0, 1.0)], facets);
        match shape {
            Shape::Plane => sheet(),
            Shape::Sphere(r) => revolve(&half_circle(*r, 0.0), ROUND),
            Shape::Capsule(r, half_length) => revolve(&half_circle(*r, *half_length), ROUND),
            Shape::Cylinder(r, half_length) => {
                scaled(prism(1.0, ROUND), &Vector3::new(*r, *r, *half_length))
            }
            Shape::Ellipsoid(axes) => scaled(revolve(&half_circle(1.0, 0.0), ROUND), axes),
            Shape::Box(half_sizes) => scaled(prism(SQRT_2, SQUARE), half_sizes),
            Shape::Mesh(vertices, triangles) => Self {
                vertices: (vertices.iter())
                    .map(|vertex| Point3::from(*vertex).cast())
                    .collect(),
                triangles: triangles.clone(),
            },
        }
    }

    /// The same surface seen from another frame.
    pub fn transformed(mut self, pose: &Isometry3<f64>) -> Self {
        for vertex in &mut self.vertices {
            *vertex = pose * *vertex;
        }
        self
    }

    /// The surface with normals: smooth where faces meet at a small angle, else sharp.
    pub fn shaded(&self) -> ShadedMesh {
        let normals: Vec<_> = (self.triangles.iter())
            .map(|each| self.normal(*each))
            .collect();
        let mut around = vec![Vec::new(); self.vertices.len()];
        for (triangle, corners) in self.triangles.iter().enumerate() {
            for (place, &corner) in corners.iter().enumerate() {
                around[corner as usize].push((triangle, self.angle(*corners, place)));
            }
        }
        let smooth = CREASE_RAD.cos();
        let mut shaded = ShadedMesh::default();
        // Of each corner: its normals so far, few, with the indices of their vertices.
        let mut known = vec![Vec::new(); self.vertices.len()];
        for (own, corners) in normals.iter().zip(&self.triangles) {
            let indices = corners.map(|corner| {
                // Weighted by the faces' angles at the corner, so that it does not matter how a
                // face is cut into triangles.
                let normal = (around[corner as usize].iter())
                    .map(|&(other, angle)| (normals[other], angle))
                    .filter(|(other, _)| other.dot(own) >= smooth)
                    .map(|(other, angle)| other * angle)
                    .sum::<Vector3<f64>>();
                let normal = direction(&normal);
                #[expect(clippy::cast_possible_truncation, reason = "a key; at most 1000")]
                let key = normal.map(|value| (value * 1e3).round() as i32);
                let known = &mut known[corner as usize];
                if let Some((_, index)) = known.iter().find(|(other, _)| *other == key) {
                    return *index;
                }
                let index = count(shaded.vertices.len());
                known.push((key, index));
                shaded.vertices.push(self.vertices[corner as usize]);
                shaded.normals.push(normal);
                index
            });
            shaded.triangles.push(indices);
        }
        shaded
    }

    /// The triangle's outward normal (unit vector).
    fn normal(&self, triangle: [u32; 3]) -> Vector3<f64> {
        let [a, b, c] = triangle.map(|corner| self.vertices[corner as usize]);
        direction(&(b - a).cross(&(c - a)))
    }

    /// The triangle's angle at one of its corners (rad).
    fn angle(&self, triangle: [u32; 3], place: usize) -> f64 {
        let corner = |step: usize| self.vertices[triangle[(place + step) % 3] as usize];
        (corner(1) - corner(0)).angle(&(corner(2) - corner(0)))
    }
}

fn direction(vector: &Vector3<f64>) -> Vector3<f64> {
    vector.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// A count of vertices; shapes here have some hundred.
fn count(length: usize) -> u32 {
    u32::try_from(length).unwrap_or(u32::MAX)
}

fn sheet() -> Mesh {
    let half = PLANE_HALF_M;
    Mesh {
        vertices: [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| Point3::new(x, y, 0.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

fn scaled(mut mesh: Mesh, axes: &Vector3<f64>) -> Mesh {
    for vertex in &mut mesh.vertices {
        vertex.coords.component_mul_assign(axes);
    }
    mesh
}

/// Radius and height along a half circle from the lower to the upper pole, with a straight part of
/// twice the half length between its two quarters.
fn half_circle(radius: f64, half_length: f64) -> Vec<(f64, f64)> {
    let steps = ROUND.0 / 4;
    let quarter = |step: u32| f64::from(step) / f64::from(steps) * FRAC_PI_2;
    let lower = (0..=steps).map(|step| {
        let (sin, cos) = quarter(step).sin_cos();
        (radius * sin, -radius * cos - half_length)
    });
    // A sphere has its equator once.
    let first = u32::from(half_length == 0.0);
    let upper = (first..=steps).map(|step| {
        let (sin, cos) = quarter(step).sin_cos();
        (radius * cos, radius * sin + half_length)
    });
    lower.chain(upper).collect()
}

/// Turns a profile of radius and height about the z axis; its first and last point lie on the axis
/// and it goes upwards.
fn revolve(profile: &[(f64, f64)], (facets, first): Facets) -> Mesh {
    let [(_, bottom), rings @ .., (_, top)] = profile else {
        return Mesh::default();
    };
    let mut vertices = vec![Point3::new(0.0, 0.0, *bottom), Point3::new(0.0, 0.0, *top)];
    for (radius, z) in rings {
        vertices.extend((0..facets).map(|facet| {
            let (sin, cos) = ((f64::from(facet) + first) / f64::from(facets) * TAU).sin_cos();
            Point3::new(radius * cos, radius * sin, *z)
        }));
    }
    let at = |ring: u32, facet: u32| 2 + ring * facets + facet % facets;
    let last = count(rings.len()) - 1;
    let mut triangles = Vec::new();
    for facet in 0..facets {
        let next = facet + 1;
        triangles.push([0, at(0, next), at(0, facet)]);
        for ring in 0..last {
            let [a, b] = [at(ring, facet), at(ring, next)];
            let [c, d] = [at(ring + 1, next), at(ring + 1, facet)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        triangles.push([1, at(last, facet), at(last, next)]);
    }
    Mesh {
        vertices,
        triangles,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::mujoco::Model;

    fn shapes() -> Vec<(Shape, Vector3<f64>, f64)> {
        let pi = std::f64::consts::PI;
        let (r, l) = (0.3, 0.5);
        vec![
            (
                Shape::Sphere(r),
                Vector3::repeat(r),
                4.0 / 3.0 * pi * r * r * r,
            ),
            (
                Shape::Capsule(r, l),
                Vector3::new(r, r, l + r),
                pi * r * r * (2.0 * l + 4.0 / 3.0 * r),
            ),
            (
                Shape::Cylinder(r, l),
                Vector3::new(r, r, l),
                pi * r * r * 2.0 * l,
            ),
            (
                Shape::Ellipsoid(Vector3::new(0.1, 0.2, 0.4)),
                Vector3::new(0.1, 0.2, 0.4),
                4.0 / 3.0 * pi * 0.1 * 0.2 * 0.4,
            ),
            (
                Shape::Box(Vector3::new(0.1, 0.2, 0.4)),
                Vector3::new(0.1, 0.2, 0.4),
                8.0 * 0.1 * 0.2 * 0.4,
            ),
        ]
    }

    /// The volume that a closed surface encloses; negative if its normals point inwards.
    fn volume(mesh: &Mesh) -> f64 {
        (mesh.triangles.iter())
            .map(|triangle| {
                let [a, b, c] = triangle.map(|corner| mesh.vertices[corner as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Every edge belongs to two triangles, which go along it in opposite directions.
    fn assert_closed(mesh: &Mesh) {
        let mut edges = HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for (&(a, b), &times) in &edges {
            assert_eq!(times, 1, "edge {a}-{b}");
            assert_eq!(edges.get(&(b, a)), Some(&1), "edge {a}-{b}");
        }
    }

    #[test]
    fn surfaces_are_closed_and_outward_and_of_the_right_size() {
        for (shape, half_sizes, exact) in shapes() {
            let mesh = Mesh::new(&shape);
            assert_closed(&mesh);
            let reach = (mesh.vertices.iter())
                .fold(Vector3::zeros(), |reach: Vector3<f64>, vertex| {
                    reach.sup(&vertex.coords.abs())
                });
            assert!((reach - half_sizes).amax() < 1e-12, "{shape:?}: {reach}");
            // Facets cut corners: 32 around a circle enclose 0.6 % less.
            let share = volume(&mesh) / exact;
            assert!(share > 0.98 && share < 1.0 + 1e-12, "{shape:?}: {share}");
        }
    }

    #[test]
    fn a_plane_is_a_sheet_that_faces_up() {
        let mesh = Mesh::new(&Shape::Plane);
        assert_eq!(mesh.shaded().normals, vec![Vector3::z(); 4]);
        assert!(mesh.vertices.iter().all(|vertex| vertex.z == 0.0));
    }

    #[test]
    fn the_castings_of_the_model_are_closed_and_outward() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/models/kr270.xml");
        let model = Model::load(std::path::Path::new(path)).expect("the model is valid");
        let castings: Vec<_> = model
            .scenery()
            .into_iter()
            .filter(|each| matches!(each.shape, Shape::Mesh(..)))
            .collect();
        assert!(castings.len() >= 8);
        for casting in castings {
            let mesh = Mesh::new(&casting.shape);
            assert_closed(&mesh);
            assert!(volume(&mesh) > 0.0, "{}", casting.name);
        }
    }

    #[test]
    fn shading_is_smooth_round_a_cylinder_and_sharp_at_its_rims() {
        let (radius, half_length) = (0.3, 0.5);
        let shaded = Mesh::new(&Shape::Cylinder(radius, half_length)).shaded();
        for (vertex, normal) in shaded.vertices.iter().zip(&shaded.normals) {
            assert!((normal.norm() - 1.0).abs() < 1e-12);
            let radial = Vector3::new(vertex.x, vertex.y, 0.0) / radius;
            let axial = Vector3::z() * vertex.z.signum();
            let apart = (normal - radial).amax().min((normal - axial).amax());
            assert!(apart < 1e-3, "{vertex}: {normal}");
        }
        let cuboid = Mesh::new(&Shape::Box(Vector3::repeat(1.0))).shaded();
        // Four corners on each of six sides, and the middles of two.
        assert_eq!(cuboid.vertices.len(), 26);
    }

    #[test]
    fn transformed_moves_every_vertex() {
        let pose = Isometry3::new(
            Vector3::new(1.0, 2.0, 3.0),
            Vector3::new(0.0, 0.0, FRAC_PI_2),
        );
        let mesh = Mesh::new(&Shape::Box(Vector3::new(0.1, 0.2, 0.4))).transformed(&pose);
        let centre = (mesh.vertices.iter())
            .map(|each| each.coords)
            .sum::<Vector3<f64>>()
            / mesh.vertices.len() as f64;
        assert!((centre - Vector3::new(1.0, 2.0, 3.0)).amax() < 1e-12);
        let high = (mesh.vertices.iter())
            .map(|vertex| vertex.x)
            .fold(f64::MIN, f64::max);
        assert!((high - 1.2).abs() < 1e-12);
    }
}
