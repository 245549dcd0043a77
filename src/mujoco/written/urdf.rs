//! The description that a model was read from with other numbers: what is not changed keeps every byte, comments too.

use std::ops::Range;
use std::path::Path;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::{ModelCalibration, WrittenModel, folder_of, mjcf, way};
use crate::files::FileError;
use crate::mujoco::urdf::{escaped, number, parsed};
use crate::mujoco::{KEPT, Model, loading::prepare};

/// What no URDF tells.
const ELASTICITY: &str = "stiffnesses of joints, and springs: URDF has none";

/// The text of a model, calibrated, for a folder.
pub(super) fn written(
    model: &Model,
    calibration: &ModelCalibration,
    folder: &Path,
) -> Result<WrittenModel, FileError> {
    let path = model.path();
    let wrong = |problem: &str| model.not_written(problem);
    let text = prepare(path)?.ok_or_else(|| {
        wrong("its model is no URDF, of which alone one is written: end the file in .xml")
    })?;
    // What an entity stands for has no place of its own in the text.
    if text.contains("<!ENTITY") {
        return Err(wrong(
            "it declares XML entities: write out what they stand for",
        ));
    }
    let text = text.trim_start_matches('\u{feff}');
    let document = parsed(text).map_err(|error| wrong(&format!("XML: {error}")))?;
    let mut editor = UrdfEditor {
        plain: &Model::load(path)?,
        calibrated: &mjcf::Calibrated::new(model, calibration)?.model,
        root: document.root_element(),
        text,
        changes: Vec::new(),
    };
    (editor.links()).map_err(|problem| wrong(&problem))?;
    editor
        .mounted(calibration)
        .map_err(|problem| wrong(&problem))?;
    editor.files(&folder_of(path), folder);
    for (name, text) in &calibration.texts {
        // Two hyphens would end a comment.
        let text = text.replace("--", "- -");
        editor.append(editor.root, &format!("<!-- {name}: {text} -->"));
    }
    Ok(WrittenModel {
        text: editor.apply(),
        not_expressed: vec![ELASTICITY.to_owned()],
    })
}

struct UrdfEditor<'d, 't> {
    plain: &'d Model,
    calibrated: &'d Model,
    root: Node<'d, 't>,
    text: &'t str,
    /// Where in the text, and what stands there then.
    changes: Vec<(Range<usize>, String)>,
}

/// A child of an element.
fn child<'d, 't>(node: Node<'d, 't>, tag: &str) -> Option<Node<'d, 't>> {
    node.children().find(|each| each.has_tag_name(tag))
}

impl<'d, 't> UrdfEditor<'d, 't> {
    /// Frames and masses that differ.
    fn links(&mut self) -> Result<(), String> {
        for body in 1..self.plain.bodies() {
            let name = self.plain.body_name(body);
            let unclear = || format!("link {name:?} cannot be found or read in the description");
            let other = self.calibrated.body(&name).ok_or_else(unclear)?;
            let frame = self.calibrated.parent_from_body(other);
            if frame != self.plain.parent_from_body(body) {
                let joint = self.elements("joint").find(|joint| {
                    child(*joint, "child").and_then(|link| link.attribute("link"))
                        == Some(name.as_str())
                });
                self.place(joint.ok_or_else(unclear)?, &frame);
            }
            let [own, new] = [self.plain.mass(body), self.calibrated.mass(other)];
            if own == new {
                continue;
            }
            let mut links = self.elements("link");
            let link = links.find(|link| link.attribute("name") == Some(name.as_str()));
            let Some(inertial) = child(link.ok_or_else(unclear)?, "inertial") else {
                continue;
            };
            self.weigh(inertial, new.0 / own.0, new.1 - own.1)
                .ok_or_else(unclear)?;
        }
        Ok(())
    }

    fn elements(&self, tag: &'static str) -> impl Iterator<Item = Node<'d, 't>> + use<'d, 't> {
        self.root
            .children()
            .filter(move |node| node.has_tag_name(tag))
    }

    /// Has an element weigh so many times as much, with its centre so far from where it was (m); nothing where it has no mass.
    fn weigh(&mut self, inertial: Node<'d, 't>, factor: f64, moved: Vector3<f64>) -> Option<()> {
        let mass = child(inertial, "mass")?;
        self.set(mass, "value", &numbers(&[number(mass, "value")? * factor]));
        if let Some(inertia) = child(inertial, "inertia") {
            for name in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
                if let Some(given) = number(inertia, name) {
                    self.set(inertia, name, &numbers(&[given * factor]));
                }
            }
        }
        let Some(origin) = child(inertial, "origin") else {
            self.append(inertial, &origin_of(&moved.into()));
            return Some(());
        };
        let own = origin
            .attribute("xyz")
            .unwrap_or("0 0 0")
            .split_whitespace();
        let own: Vec<f64> = own.map(str::parse).collect::<Result<_, _>>().ok()?;
        let [x, y, z] = own[..].try_into().ok()?;
        let sum = Vector3::new(x, y, z) + moved;
        self.set(origin, "xyz", &numbers(sum.as_slice()));
        Some(())
    }

    /// Gives an element this origin.
    fn place(&mut self, node: Node<'d, 't>, frame: &Isometry3<f64>) {
        match child(node, "origin") {
            Some(origin) => {
                self.set(origin, "xyz", &numbers(frame.translation.vector.as_slice()));
                self.set(origin, "rpy", &numbers(&roll_pitch_yaw(&frame.rotation)));
            }
            None => self.append(node, &origin_of(frame)),
        }
    }

    /// What a scenario mounts, as links that are fixed.
    fn mounted(&mut self, calibration: &ModelCalibration) -> Result<(), String> {
        let model = self.calibrated;
        let mut all = Vec::new();
        for tool in &calibration.additions.tools {
            let site = model.site(&tool.name).map_err(|error| error.to_string())?;
            let (body, frame) = model.site_body(site);
            all.push((tool.name.clone(), String::new(), body, frame));
        }
        for number in 1..=calibration.additions.payloads.len() {
            let name = format!("{KEPT}payload_{number}");
            let body = model.body(&name).ok_or("a payload is no body")?;
            let (mass, centre) = model.mass(body);
            let frame = model.parent_from_body(body) * nalgebra::Translation3::from(centre);
            let moment = mass * 1e-2;
            let inertial = format!(
                "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"/></inertial>"
            );
            all.push((name, inertial, model.parent(body), frame));
        }
        for (name, inertial, on, frame) in all {
            let (on, link) = (escaped(&model.body_name(on)), escaped(&name));
            let (root, origin) = (self.root, origin_of(&frame));
            self.append(root, &format!("<link name=\"{link}\">{inertial}</link>"));
            self.append(root, &format!(
                "<joint name=\"{link}_fixed\" type=\"fixed\">{origin}<parent link=\"{on}\"/><child link=\"{link}\"/></joint>"
            ));
        }
        Ok(())
    }

    /// Meshes are where they were, also as seen from another folder.
    fn files(&mut self, own: &Path, folder: &Path) {
        if way(folder, own).as_os_str().is_empty() {
            return;
        }
        for node in self.root.descendants() {
            let name = node
                .attribute("filename")
                .filter(|name| !name.contains("://"));
            if let Some(file) = name
                .map(|name| own.join(name))
                .filter(|file| file.is_file())
            {
                self.set(node, "filename", &way(folder, &file).to_string_lossy());
            }
        }
    }

    /// Gives an element's attribute this value.
    fn set(&mut self, node: Node<'d, 't>, name: &str, value: &str) {
        let value = escaped(value);
        let change = if let Some(attribute) = node.attribute_node(name) {
            (attribute.range_value(), value)
        } else {
            let last = node.attributes().next_back();
            let behind_tag = node.range().start + 1 + node.tag_name().name().len();
            let place = last.map_or(behind_tag, |last| last.range().end);
            (place..place, format!(" {name}=\"{value}\""))
        };
        self.changes.push(change);
    }

    /// Adds a child behind those that an element has.
    fn append(&mut self, node: Node<'d, 't>, child: &str) {
        let range = node.range();
        let end = self.text[range.clone()].rfind("</");
        let place = range.start + end.unwrap_or(range.len());
        self.changes.push((place..place, format!("  {child}\n")));
    }

    /// The changed text.
    fn apply(mut self) -> String {
        self.changes.sort_by_key(|(range, _)| range.start);
        let (mut text, mut from) = (String::with_capacity(self.text.len()), 0);
        for (range, new) in &self.changes {
            text += &self.text[from..range.start];
            text += new;
            from = range.end;
        }
        text + &self.text[from..]
    }
}

fn origin_of(frame: &Isometry3<f64>) -> String {
    let xyz = numbers(frame.translation.vector.as_slice());
    let rpy = numbers(&roll_pitch_yaw(&frame.rotation));
    format!("<origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>")
}

/// Numbers as attributes have them, in as many digits as it takes to read the same again.
fn numbers(values: &[f64]) -> String {
    let written = |&value: &f64| {
        if value != 0.0 && !(1e-4..1e15).contains(&value.abs()) {
            format!("{value:e}")
        } else {
            value.to_string()
        }
    };
    values.iter().map(written).collect::<Vec<_>>().join(" ")
}

/// Roll, pitch and yaw about the fixed x, then y, then z axis. Near a pitch of 90 deg they are not the only ones, but
/// give the rotation back to the last digits all the same.
fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let matrix = rotation.to_rotation_matrix().into_inner();
    let roll = matrix[(2, 1)].atan2(matrix[(2, 2)]);
    let (sine, cosine) = roll.sin_cos();
    let pitch = (-matrix[(2, 0)]).atan2(sine * matrix[(2, 1)] + cosine * matrix[(2, 2)]);
    let yaw = (sine * matrix[(0, 2)] - cosine * matrix[(0, 1)])
        .atan2(cosine * matrix[(1, 1)] - sine * matrix[(1, 2)]);
    [roll, pitch, yaw]
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::roll_pitch_yaw;

    #[test]
    fn angles_give_the_rotation_back_near_the_lock_too() {
        use std::f64::consts::FRAC_PI_2;
        for pitch in [0.3, FRAC_PI_2 - 1e-7, FRAC_PI_2, 1e-11 - FRAC_PI_2, -2.9] {
            let turn = UnitQuaternion::from_euler_angles(0.7, pitch, -2.2)
                * UnitQuaternion::from_scaled_axis(Vector3::new(1e-9, -2e-9, 1e-10));
            let [roll, pitch, yaw] = roll_pitch_yaw(&turn);
            let back = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            assert!(
                back.angle_to(&turn) < 1e-14,
                "{pitch}: {}",
                back.angle_to(&turn)
            );
        }
    }
}
