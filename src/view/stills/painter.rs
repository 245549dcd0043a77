//! Surfaces to flat pictures: what is nearest at each pixel, shaded by the side that it turns to the viewer, as PNG.

use base64::{Engine, prelude::BASE64_STANDARD};
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use serde_json::{Value, json};

use crate::mujoco::Mesh;
use crate::numeric::tolerance::ends;

/// Shades between the darkest and the lightest side of a colour.
const SHADES: f64 = 7.0;
/// Samples of the picture to a pixel of the sheet, in each direction.
const SAMPLES: f64 = 2.0;

/// From where an orthographic picture is seen, and where it lies on the sheet.
#[derive(Debug, Clone)]
pub struct Camera {
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
    /// A camera that looks down from an azimuth (from x to y) and an elevation (rad), so that all of these points fit into a picture of
    /// this width (px).
    pub fn new(azimuth: f64, elevation: f64, points: &[Point3<f64>], width_px: f64) -> Self {
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let towards = Vector3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
        let right = Vector3::new(-sin_a, cos_a, 0.0);
        let up = towards.cross(&right);
        let rows = Matrix3::from_rows(&[right.transpose(), up.transpose(), towards.transpose()]);
        let axes = Rotation3::from_matrix_unchecked(rows);
        let [x, y] = [0, 1].map(|axis| ends(points.iter().map(|point| (axes * point)[axis])));
        let scale = width_px / (x[1] - x[0]).max(1e-3);
        Self {
            axes,
            corner_m: [x[0], y[1]],
            scale,
            size_px: [width_px, (y[1] - y[0]) * scale],
        }
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

    /// Where a point is seen, in tenths of a pixel.
    pub fn place(&self, point: &Point3<f64>) -> [f64; 2] {
        let [x, y, _] = self.see(point);
        [x, y].map(|value| (value * 10.0).round() / 10.0)
    }

    /// For drawings: the size (px), and how places on the floor (m) come to be seen, as SVG has transforms.
    pub fn shown(&self) -> Value {
        let [width, height] = self.size_px.map(|side| (side * 10.0).round() / 10.0);
        let places = [Vector3::zeros(), Vector3::x(), Vector3::y()];
        let [origin, x, y] = places.map(|place| self.see(&place.into()));
        let [to_x, to_y] = [x, y].map(|end| [end[0] - origin[0], end[1] - origin[1]]);
        let floor = [to_x, to_y, [origin[0], origin[1]]].concat();
        json!({ "width": width, "height": height, "floor": floor })
    }

    /// Whether a point is seen inside the picture.
    pub fn is_seen(&self, point: &Point3<f64>) -> bool {
        let [x, y, _] = self.see(point);
        (0.0..=self.size_px[0]).contains(&x) && (0.0..=self.size_px[1]).contains(&y)
    }
}

/// A picture with the depth of what is nearest so far at each sample.
pub(super) struct Painter<'a> {
    camera: &'a Camera,
    /// Samples to the right and down.
    size: [usize; 2],
    depth: Vec<f64>,
    /// Red, green, blue and opacity of each sample, row by row.
    pub pixels: Vec<u8>,
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "some hundred samples, and bytes"
)]
impl<'a> Painter<'a> {
    pub fn new(camera: &'a Camera) -> Self {
        let size = camera.size_px.map(|size| (size * SAMPLES).ceil() as usize);
        Self {
            camera,
            size,
            depth: vec![f64::NEG_INFINITY; size[0] * size[1]],
            pixels: vec![0; 4 * size[0] * size[1]],
        }
    }

    /// Adds a surface in world coordinates.
    pub fn add(&mut self, mesh: &Mesh, rgba: [f32; 4]) {
        // Light from the viewer's left shoulder.
        let light = Vector3::new(-0.45, 0.60, 0.66).normalize();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|corner| mesh.vertices[corner as usize]);
            let [a, b, c] = corners;
            let normal = (self.camera.axes * (b - a).cross(&(c - a))).try_normalize(0.0);
            let Some(normal) = normal.filter(|normal| normal.z > 1e-6) else {
                continue;
            };
            let lit = (0.5 + 0.5 * normal.dot(&light)).clamp(0.0, 1.0);
            let brightness = 0.40 + 0.68 * (lit * SHADES).round() / SHADES;
            let channel =
                |share: f32| (f64::from(share) * brightness * 255.0).round().min(255.0) as u8;
            let [red, green, blue, _] = rgba.map(channel);
            self.paint(corners, [red, green, blue, 255]);
        }
    }

    /// Paints a triangle where it is nearest.
    fn paint(&mut self, corners: [Point3<f64>; 3], colour: [u8; 4]) {
        let [a, b, c] = corners.map(|corner| {
            let [x, y, near] = self.camera.see(&corner);
            [x * SAMPLES - 0.5, y * SAMPLES - 0.5, near]
        });
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area.abs() < 1e-9 {
            return;
        }
        let range = |axis: usize| {
            let [low, high] = ends([a, b, c].map(|corner| corner[axis]).into_iter());
            low.ceil().max(0.0) as usize
                ..((high.floor() + 1.0).max(0.0) as usize).min(self.size[axis])
        };
        for row in range(1) {
            for column in range(0) {
                let (x, y) = (column as f64 - a[0], row as f64 - a[1]);
                let towards_b = (x * (c[1] - a[1]) - y * (c[0] - a[0])) / area;
                let towards_c = (y * (b[0] - a[0]) - x * (b[1] - a[1])) / area;
                let near = a[2] + towards_b * (b[2] - a[2]) + towards_c * (c[2] - a[2]);
                let place = row * self.size[0] + column;
                let is_inside =
                    towards_b >= 0.0 && towards_c >= 0.0 && towards_b + towards_c <= 1.0;
                if is_inside && near > self.depth[place] {
                    self.depth[place] = near;
                    self.pixels[4 * place..][..4].copy_from_slice(&colour);
                }
            }
        }
    }

    /// The picture as PNG in base 64; what is behind shows through where nothing is.
    pub fn png(&self) -> String {
        let mut png = Vec::new();
        let [width, height] = self.size.map(|side| side as u32);
        let mut encoder = png::Encoder::new(&mut png, width, height);
        encoder.set_color(png::ColorType::Rgba);
        // Areas of few colours: filters, which are for photographs, would make it larger.
        encoder.set_filter(png::Filter::NoFilter);
        encoder.set_deflate_compression(png::DeflateCompression::Level(9));
        let written = encoder.write_header();
        // A picture in memory always takes its samples.
        let written = written.and_then(|mut writer| writer.write_image_data(&self.pixels));
        debug_assert!(written.is_ok());
        BASE64_STANDARD.encode(png)
    }
}
