//! Surfaces to flat pictures: which faces are seen, in which order to paint them, as SVG paths.
//!
//! Faces of one shape with about the same shade become one path. A depth image then tells which paths
//! are seen at all and, wherever two overlap, which has to be painted after which. Shapes that
//! penetrate each other have no order that is right everywhere; the one that is wrong on the smallest
//! area is taken.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;

use nalgebra::{Point3, Rotation3, Vector3};

use crate::view::mesh::Mesh;

/// Shades between the darkest and the lightest side of a colour.
const SHADES: f64 = 7.0;
/// Samples of the depth image to a pixel, in each direction.
const SAMPLES: f64 = 2.0;
/// Paths that are seen on fewer samples are left out.
const FEWEST_SAMPLES: usize = 6;
/// Faces nearer to each other than this are held to touch (m).
const TOUCHING_M: f64 = 1e-3;
/// Corners of a path that are nearer to the line between their neighbours are left out (px).
const STRAIGHT_PX: f64 = 0.25;

/// From where an orthographic picture is seen, and where it lies on the sheet.
#[derive(Debug, Clone)]
pub(super) struct Camera {
    /// Rows: to the right, up, and towards the viewer.
    axes: Rotation3<f64>,
    /// What is seen at the picture's left upper corner (m, in the camera's axes).
    corner_m: [f64; 2],
    /// Pixels to a metre.
    scale: f64,
    /// The picture's width and height (px).
    pub size_px: [f64; 2],
}

impl Camera {
    /// A camera that looks down from an azimuth (from x to y) and an elevation (rad), without a place.
    pub fn new(azimuth: f64, elevation: f64) -> Self {
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let towards = Vector3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = Vector3::new(-sin_a, cos_a, 0.0);
        let up = towards.cross(&right);
        let rows =
            nalgebra::Matrix3::from_rows(&[right.transpose(), up.transpose(), towards.transpose()]);
        Self {
            axes: Rotation3::from_matrix_unchecked(rows),
            corner_m: [0.0; 2],
            scale: 1.0,
            size_px: [1.0; 2],
        }
    }

    /// The same camera, so that all of these points fit into a picture of this width (px).
    pub fn framing(mut self, points: &[Point3<f64>], width_px: f64) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in points {
            let seen = self.axes * point;
            for axis in 0..2 {
                low[axis] = low[axis].min(seen[axis]);
                high[axis] = high[axis].max(seen[axis]);
            }
        }
        self.scale = width_px / (high[0] - low[0]).max(1e-3);
        self.corner_m = [low[0], high[1]];
        self.size_px = [width_px, (high[1] - low[1]) * self.scale];
        self
    }

    /// Where a point is seen (px, to the right and down), and how near it is (m).
    pub fn see(&self, point: &Point3<f64>) -> [f64; 3] {
        let seen = self.axes * point;
        [
            (seen.x - self.corner_m[0]) * self.scale,
            (self.corner_m[1] - seen.y) * self.scale,
            seen.z,
        ]
    }

    /// Whether a point is seen inside the picture.
    pub fn is_seen(&self, point: &Point3<f64>) -> bool {
        let [x, y, _] = self.see(point);
        (0.0..=self.size_px[0]).contains(&x) && (0.0..=self.size_px[1]).contains(&y)
    }
}

/// Faces of one shape in one colour.
struct Patch {
    colour: [u8; 3],
    /// Corners as seen, three to a triangle.
    triangles: Vec<[[f64; 3]; 3]>,
    /// The outlines (px); a hole goes round the other way.
    outlines: Vec<Vec<[f64; 2]>>,
}

/// A picture that is painted from back to front.
pub(super) struct Painter<'a> {
    camera: &'a Camera,
    patches: Vec<Patch>,
}

impl<'a> Painter<'a> {
    pub fn new(camera: &'a Camera) -> Self {
        Self {
            camera,
            patches: Vec::new(),
        }
    }

    /// Adds a surface in world coordinates.
    pub fn add(&mut self, mesh: &Mesh, rgba: [f32; 4]) {
        // Light from the viewer's left shoulder.
        let light = Vector3::new(-0.45, 0.60, 0.66).normalize();
        let mut shades: BTreeMap<u8, Vec<[u32; 3]>> = BTreeMap::new();
        for &triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.vertices[corner as usize]);
            let normal = self.camera.axes * (b - a).cross(&(c - a));
            if let Some(normal) = normal.try_normalize(0.0)
                && normal.z > 1e-6
            {
                let lit = (0.5 + 0.5 * normal.dot(&light)).clamp(0.0, 1.0);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "0 to 7"
                )]
                let shade = (lit * SHADES).round() as u8;
                shades.entry(shade).or_default().push(triangle);
            }
        }
        for (shade, triangles) in shades {
            let brightness = 0.40 + 0.68 * f64::from(shade) / SHADES;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 255"
            )]
            let channel =
                |value: f32| (f64::from(value) * brightness * 255.0).round().min(255.0) as u8;
            let seen = |corner: u32| self.camera.see(&mesh.vertices[corner as usize]);
            self.patches.push(Patch {
                colour: [rgba[0], rgba[1], rgba[2]].map(channel),
                outlines: outlines(&triangles)
                    .iter()
                    .map(|outline| {
                        let corners = outline.iter().map(|&corner| seen(corner));
                        simplified(&corners.map(|[x, y, _]| [x, y]).collect::<Vec<_>>())
                    })
                    .collect(),
                triangles: (triangles.iter())
                    .map(|triangle| triangle.map(seen))
                    .collect(),
            });
        }
    }

    /// The picture as SVG paths in tenths of a pixel, each with its `color`.
    pub fn paint(&self) -> String {
        let mut svg = String::new();
        for index in self.order() {
            let Patch {
                colour: [red, green, blue],
                outlines,
                ..
            } = &self.patches[index];
            let mut path = String::new();
            for outline in outlines {
                write_outline(&mut path, outline);
            }
            if !path.is_empty() {
                let _ = write!(
                    svg,
                    "<path color=\"#{red:02x}{green:02x}{blue:02x}\" d=\"{path}\"/>"
                );
            }
        }
        svg
    }

    /// The patches that are seen, from back to front.
    fn order(&self) -> Vec<usize> {
        let image = DepthImage::new(self.camera, &self.patches);
        let mut seen = vec![0; self.patches.len()];
        for &nearest in image.nearest.iter().flatten() {
            seen[nearest] += 1;
        }
        let mut left: Vec<usize> = (0..seen.len())
            .filter(|&index| seen[index] >= FEWEST_SAMPLES)
            .collect();
        // On how many samples each patch must come after which other.
        let mut hides: Vec<HashMap<usize, usize>> = vec![HashMap::new(); self.patches.len()];
        for &index in &left {
            for (place, depth) in image.samples(&self.patches[index]) {
                if let Some(nearest) = image.nearest[place]
                    && nearest != index
                    && image.depth[place] > depth + TOUCHING_M
                {
                    *hides[nearest].entry(index).or_default() += 1;
                }
            }
        }
        // To be painted next: the patch that hides least of what is not yet painted.
        let mut waits: Vec<usize> = hides.iter().map(|hidden| hidden.values().sum()).collect();
        let mut order = Vec::with_capacity(left.len());
        while let Some(place) = (0..left.len()).min_by_key(|&place| (waits[left[place]], place)) {
            let next = left.remove(place);
            for &index in &left {
                waits[index] -= hides[index].get(&next).copied().unwrap_or(0);
            }
            order.push(next);
        }
        order
    }
}

/// What is nearest at each sample of the picture.
struct DepthImage {
    width: usize,
    height: usize,
    depth: Vec<f64>,
    nearest: Vec<Option<usize>>,
}

impl DepthImage {
    fn new(camera: &Camera, patches: &[Patch]) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "some hundred"
        )]
        let [width, height] = camera.size_px.map(|size| (size * SAMPLES).ceil() as usize);
        let mut image = Self {
            width,
            height,
            depth: vec![f64::NEG_INFINITY; width * height],
            nearest: vec![None; width * height],
        };
        for (index, patch) in patches.iter().enumerate() {
            for (place, near) in image.samples(patch) {
                if near > image.depth[place] {
                    image.depth[place] = near;
                    image.nearest[place] = Some(index);
                }
            }
        }
        image
    }

    /// Every sample that a patch covers, with its depth there.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some hundred"
    )]
    fn samples(&self, patch: &Patch) -> Vec<(usize, f64)> {
        let mut samples = Vec::new();
        for triangle in &patch.triangles {
            let [a, b, c] = triangle.map(|[x, y, z]| [x * SAMPLES - 0.5, y * SAMPLES - 0.5, z]);
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            if area.abs() < 1e-9 {
                continue;
            }
            let range = |axis: usize, end: usize| {
                let low = a[axis].min(b[axis]).min(c[axis]).ceil().max(0.0);
                let high = a[axis].max(b[axis]).max(c[axis]).floor();
                low as usize..((high + 1.0).max(0.0) as usize).min(end)
            };
            for row in range(1, self.height) {
                for column in range(0, self.width) {
                    let (x, y) = (column as f64 - a[0], row as f64 - a[1]);
                    let towards_b = (x * (c[1] - a[1]) - y * (c[0] - a[0])) / area;
                    let towards_c = (y * (b[0] - a[0]) - x * (b[1] - a[1])) / area;
                    if towards_b >= 0.0 && towards_c >= 0.0 && towards_b + towards_c <= 1.0 {
                        let depth = a[2] + towards_b * (b[2] - a[2]) + towards_c * (c[2] - a[2]);
                        samples.push((row * self.width + column, depth));
                    }
                }
            }
        }
        samples
    }
}

/// The closed outlines of a set of triangles that share their vertices.
fn outlines(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let edges_of = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
    let mut edges: BTreeSet<(u32, u32)> = triangles.iter().flat_map(edges_of).collect();
    // An edge inside belongs to two triangles, which go along it in opposite directions.
    let inside: Vec<_> = (edges.iter().copied())
        .filter(|&(from, to)| edges.contains(&(to, from)))
        .collect();
    for edge in inside {
        edges.remove(&edge);
    }
    let mut outlines = Vec::new();
    while let Some((start, mut at)) = edges.pop_first() {
        let mut outline = vec![start];
        while at != start {
            outline.push(at);
            let onwards = edges.range((at, 0)..=(at, u32::MAX)).next();
            let Some(&edge) = onwards else { break };
            edges.remove(&edge);
            at = edge.1;
        }
        outlines.push(outline);
    }
    outlines
}

/// A closed outline without the corners that hardly are.
fn simplified(outline: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (index, &corner) in outline.iter().enumerate() {
        let before = kept.last().copied().unwrap_or(outline[outline.len() - 1]);
        let after = outline[(index + 1) % outline.len()];
        let along = [after[0] - before[0], after[1] - before[1]];
        let from = [corner[0] - before[0], corner[1] - before[1]];
        let length = along[0].hypot(along[1]);
        let apart = if length > STRAIGHT_PX {
            (from[0] * along[1] - from[1] * along[0]).abs() / length
        } else {
            from[0].hypot(from[1])
        };
        if apart > STRAIGHT_PX {
            kept.push(corner);
        }
    }
    kept
}

/// Appends an outline in whole tenths of a pixel.
fn write_outline(path: &mut String, outline: &[[f64; 2]]) {
    #[expect(clippy::cast_possible_truncation, reason = "some thousand")]
    let tenths = |[x, y]: [f64; 2]| [x, y].map(|value| (value * 10.0).round() as i32);
    let mut corners: Vec<[i32; 2]> = outline.iter().copied().map(tenths).collect();
    corners.dedup();
    if corners.len() < 3 {
        return;
    }
    let _ = write!(path, "M{},{}l", corners[0][0], corners[0][1]);
    for pair in corners.windows(2) {
        let [x, y] = [0, 1].map(|axis| pair[1][axis] - pair[0][axis]);
        let _ = write!(path, "{x},{y} ");
    }
    path.pop();
    path.push('z');
}
