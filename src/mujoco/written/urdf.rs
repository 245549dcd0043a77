//! URDF with what was identified: the description that a model was read from with other numbers, or one that is
//! generated from MJCF.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::edits::{Edits, numbers, parse};
use super::paths::{folder_of, way};
use super::pose::{roll_pitch_yaw, values};
use super::{ModelCalibration, WrittenModel};
use crate::mujoco::urdf::{escaped, number};
use crate::mujoco::{Model, ModelError, loading::prepare};

/// The text of a model, calibrated, for a folder.
pub(super) fn written(
    model: &Model,
    calibration: &ModelCalibration,
    folder: &Path,
) -> Result<WrittenModel, ModelError> {
    let path = model.path();
    if prepare(path)?.is_none() {
        return generated(model, calibration);
    }
    let wrong = |problem: String| model.not_written(problem);
    let plain = Model::load(path)?;
    let text = std::fs::read_to_string(path).map_err(|source| ModelError::Read {
        path: path.to_owned(),
        source,
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let document = parse(text).map_err(wrong)?;
    let mut editor = UrdfEditor {
        plain: &plain,
        calibration,
        joints: model.chain_joints(),
        root: document.root_element(),
        edits: Edits::new(text),
    };
    let mut edit = || {
        editor.joints()?;
        editor.masses()?;
        editor.mounted()?;
        Ok(())
    };
    edit().map_err(wrong)?;
    editor.files(&folder_of(path), folder);
    editor.kept();
    Ok(WrittenModel {
        text: editor.edits.apply(),
        not_expressed: vec![ELASTICITY.to_owned()],
    })
}

/// What no URDF tells.
const ELASTICITY: &str = "stiffnesses of joints, and springs: URDF has none";

struct UrdfEditor<'d, 't> {
    plain: &'d Model,
    calibration: &'d ModelCalibration,
    joints: Vec<usize>,
    root: Node<'d, 't>,
    edits: Edits<'t>,
}

impl<'d, 't> UrdfEditor<'d, 't> {
    fn element(&self, tag: &str, name: &str) -> Result<Node<'d, 't>, String> {
        let mut all = self.root.children().filter(|node| node.has_tag_name(tag));
        let found = all.find(|node| node.attribute("name") == Some(name));
        found.ok_or_else(|| format!("the description has no <{tag}> named {name:?}"))
    }

    fn origin(&mut self, node: Node<'d, 't>, frame: &Isometry3<f64>) {
        match node.children().find(|child| child.has_tag_name("origin")) {
            Some(origin) => {
                let rpy = roll_pitch_yaw(&frame.rotation);
                (self.edits).set_numbers(origin, "xyz", frame.translation.vector.as_slice());
                self.edits.set_numbers(origin, "rpy", &rpy);
            }
            None => self.edits.append(node, origin(frame)),
        }
    }

    fn joints(&mut self) -> Result<(), String> {
        for (index, &joint) in self.joints.clone().iter().enumerate() {
            let by = self.calibration.links[index];
            if by == Isometry3::identity() {
                continue;
            }
            let node = self.element("joint", &self.plain.joint_name(joint))?;
            let body = (1..self.plain.bodies())
                .find(|&body| self.plain.joints_of(body).any(|each| each == joint));
            let body = body.ok_or_else(|| "a joint moves no link".to_owned())?;
            self.origin(node, &(self.plain.parent_from_body(body) * by));
        }
        Ok(())
    }

    fn masses(&mut self) -> Result<(), String> {
        let joints: Vec<Option<usize>> = self.joints.iter().copied().map(Some).collect();
        for link in 0..joints.len() {
            let (factor, shift) = (
                self.calibration.mass_factor[link],
                self.calibration.centre_shift_m[link],
            );
            if factor.to_bits() == 1.0_f64.to_bits() && shift.norm() == 0.0 {
                continue;
            }
            for (body, turn) in self.plain.bodies_of_link(&joints, link) {
                let node = self.element("link", &self.plain.body_name(body))?;
                let Some(inertial) = node.children().find(|each| each.has_tag_name("inertial"))
                else {
                    continue;
                };
                let child = |tag| inertial.children().find(|each| each.has_tag_name(tag));
                let unclear = || {
                    format!(
                        "the inertia of link {:?} cannot be read",
                        self.plain.body_name(body)
                    )
                };
                let mass = child("mass").ok_or_else(unclear)?;
                let given = number(mass, "value").ok_or_else(unclear)?;
                self.edits.set_numbers(mass, "value", &[given * factor]);
                if let Some(inertia) = child("inertia") {
                    for name in ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"] {
                        if let Some(given) = number(inertia, name) {
                            self.edits.set_numbers(inertia, name, &[given * factor]);
                        }
                    }
                }
                let moved = turn * shift;
                match child("origin") {
                    Some(origin) => {
                        let own = origin.attribute("xyz").map_or(Some(vec![0.0; 3]), values);
                        let own = own.filter(|own| own.len() == 3).ok_or_else(unclear)?;
                        let sum: Vec<f64> =
                            own.iter().zip(&moved).map(|(own, by)| own + by).collect();
                        self.edits.set_numbers(origin, "xyz", &sum);
                    }
                    None => self.edits.append(inertial, origin(&moved.into())),
                }
            }
        }
        Ok(())
    }

    /// What a scenario mounts, as links that are fixed.
    fn mounted(&mut self) -> Result<(), String> {
        let additions = &self.calibration.additions;
        for tool in &additions.tools {
            let (body, frame) = self.calibration.placed_tool(self.plain, tool)?;
            let link = format!("<link name=\"{}\"/>", escaped(&tool.name));
            self.edits.append(self.root, link);
            let on = self.plain.body_name(body);
            self.edits.append(self.root, fixed(&on, &tool.name, &frame));
        }
        for (payload, number) in additions.payloads.iter().zip(1..) {
            let placed = (self.calibration).placed_payload(self.plain, &self.joints, payload)?;
            let mass = placed.mass_kg;
            let name = format!("{}payload_{number}", crate::mujoco::KEPT);
            let inertial = inertial(mass, &Isometry3::identity(), &Vector3::repeat(mass * 1e-2));
            self.edits.append(
                self.root,
                format!("<link name=\"{name}\">{inertial}</link>"),
            );
            let on = self.plain.body_name(placed.body);
            self.edits
                .append(self.root, fixed(&on, &name, &placed.centre_m.into()));
        }
        Ok(())
    }

    /// Meshes are where they were, also as seen from another folder.
    fn files(&mut self, own: &Path, folder: &Path) {
        if way(folder, own).as_os_str().is_empty() {
            return;
        }
        for node in self.root.descendants() {
            let Some(name) = node.attribute("filename") else {
                continue;
            };
            if !name.contains("://") && own.join(name).is_file() {
                let there = way(folder, &own.join(name));
                (self.edits).set(node, "filename", &there.to_string_lossy());
            }
        }
    }

    fn kept(&mut self) {
        for comment in comments(self.calibration) {
            self.edits.append(self.root, comment);
        }
    }
}

/// Texts that a calibrated model keeps, as comments.
fn comments(calibration: &ModelCalibration) -> Vec<String> {
    let texts = calibration.texts.iter();
    // Two hyphens would end a comment.
    let comment =
        |(name, text): &(String, String)| format!("<!-- {name}: {} -->", text.replace("--", "- -"));
    texts.map(comment).collect()
}

fn origin(frame: &Isometry3<f64>) -> String {
    format!(
        "<origin xyz=\"{}\" rpy=\"{}\"/>",
        numbers(frame.translation.vector.as_slice()),
        numbers(&roll_pitch_yaw(&frame.rotation))
    )
}

/// A link that does not move against another.
fn fixed(on: &str, link: &str, frame: &Isometry3<f64>) -> String {
    let (on, link) = (escaped(on), escaped(link));
    format!(
        "<joint name=\"{link}_fixed\" type=\"fixed\">{}<parent link=\"{on}\"/><child link=\"{link}\"/></joint>",
        origin(frame)
    )
}

/// A mass with its principal moments of inertia.
fn inertial(mass: f64, frame: &Isometry3<f64>, moments: &Vector3<f64>) -> String {
    let tensor = Matrix3::from_diagonal(moments);
    format!(
        "<inertial>{}<mass value=\"{mass}\"/><inertia ixx=\"{}\" ixy=\"0\" ixz=\"0\" iyy=\"{}\" iyz=\"0\" izz=\"{}\"/></inertial>",
        origin(frame),
        tensor[(0, 0)],
        tensor[(1, 1)],
        tensor[(2, 2)]
    )
}

/// A description of what an MJCF file says, calibrated.
fn generated(model: &Model, calibration: &ModelCalibration) -> Result<WrittenModel, ModelError> {
    let failed = |error: std::io::Error| model.not_written(error.to_string());
    // As MuJoCo reads it again, with all that was identified in it.
    let folder = tempfile::tempdir().map_err(failed)?;
    let mjcf = super::mjcf::written(model, calibration, folder.path())?;
    let file = folder.path().join("calibrated.xml");
    std::fs::write(&file, &mjcf.text).map_err(failed)?;
    let calibrated = Model::load(&file)?;
    let locked: Vec<(String, f64)> = (model.locked().iter())
        .map(|&(joint, value)| (model.joint_name(joint), value))
        .collect();
    let calibrated = calibrated.with_locked(&locked)?;
    let mut generator = UrdfGenerator {
        model: &calibrated,
        text: String::new(),
        names: vec!["world".to_owned()],
        not_expressed: vec![ELASTICITY.to_owned()],
    };
    generator.bodies();
    generator.sites();
    let mut not_expressed = std::mem::take(&mut generator.not_expressed);
    if calibrated.geometries() > 0 {
        not_expressed.push(
            "shapes: take visual and collision elements from the maker's description".to_owned(),
        );
    }
    for comment in comments(calibration) {
        generator.line(&comment);
    }
    let name = model.path().file_stem().unwrap_or("robot".as_ref());
    let text = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"world\"/>\n{}</robot>\n",
        escaped(&name.to_string_lossy()),
        generator.text,
    );
    Ok(WrittenModel {
        text,
        not_expressed,
    })
}

struct UrdfGenerator<'m> {
    model: &'m Model,
    text: String,
    /// The names of links.
    names: Vec<String>,
    not_expressed: Vec<String>,
}

impl UrdfGenerator<'_> {
    fn line(&mut self, text: &str) {
        self.text += &format!("  {text}\n");
    }

    /// A link of a name that no other has.
    fn link(&mut self, wanted: &str, content: &str) -> String {
        let mut name = wanted.to_owned();
        while self.names.contains(&name) {
            name += "_";
        }
        self.names.push(name.clone());
        let shown = escaped(&name);
        if content.is_empty() {
            self.line(&format!("<link name=\"{shown}\"/>"));
        } else {
            self.line(&format!("<link name=\"{shown}\">{content}</link>"));
        }
        name
    }

    /// Every body as a link whose frame is the body's, moved to the anchor of its last joint.
    fn bodies(&mut self) {
        let mut links = vec![("world".to_owned(), Isometry3::identity())];
        for body in 1..self.model.bodies() {
            let (mut parent, link_from_parent) = links[self.model.parent(body)].clone();
            let mut frame = link_from_parent * self.model.parent_from_body(body);
            let joints: Vec<usize> = self.model.joints_of(body).collect();
            let mut link_from_body = Isometry3::identity();
            for (place, &joint) in joints.iter().enumerate() {
                let (_, anchor) = self.model.joint_axis_and_anchor(joint);
                frame *= self.model.body_from_link(joint);
                link_from_body = Translation3::from(-anchor).into();
                let is_last = place + 1 == joints.len();
                let name = self.model.joint_name(joint);
                let link = if is_last {
                    self.body(body, &link_from_body)
                } else {
                    self.link(&format!("{}_{name}", self.model.body_name(body)), "")
                };
                self.joint(joint, &name, &parent, &link, frame);
                parent = link;
                frame = link_from_body;
            }
            if joints.is_empty() {
                let link = self.body(body, &Isometry3::identity());
                self.line(&fixed(&parent, &link, &frame));
                parent = link;
            }
            links.push((parent, link_from_body));
        }
    }

    fn body(&mut self, body: usize, link_from_body: &Isometry3<f64>) -> String {
        let (mass, centre) = self.model.mass(body);
        let (moments, turned) = self.model.inertia(body);
        let name = self.model.body_name(body);
        let share = self.model.weighing_share(body);
        if share.to_bits() != 1.0_f64.to_bits() {
            (self.not_expressed).push(format!(
                "the share of {name:?}'s weight that is compensated (gravcomp)"
            ));
        }
        let content = if mass > 0.0 {
            let frame = Isometry3::from_parts(Translation3::from(centre), turned);
            inertial(mass, &(link_from_body * frame), &moments)
        } else {
            String::new()
        };
        self.link(&name, &content)
    }

    fn joint(&mut self, joint: usize, name: &str, parent: &str, link: &str, frame: Isometry3<f64>) {
        let (axis, _) = self.model.joint_axis_and_anchor(joint);
        let slides = self.model.is_slide(joint);
        let held = match (self.model.locked_at(joint), self.model.is_actuated(joint)) {
            (Some(locked), _) => {
                (self.not_expressed).push(format!("joint {name:?} is locked: it is fixed"));
                Some(locked)
            }
            (None, false) => self.model.joint_spring(joint).map(|[_, rest]| {
                (self.not_expressed).push(format!(
                    "the spring of the passive joint {name:?}, which is fixed where it is relaxed"
                ));
                rest
            }),
            (None, true) => None,
        };
        let (parent, link, name) = (escaped(parent), escaped(link), escaped(name));
        let ends = format!("<parent link=\"{parent}\"/><child link=\"{link}\"/>");
        if let Some(at) = held {
            let axis = nalgebra::Unit::new_normalize(axis);
            let by = if slides {
                Isometry3::from_parts((axis.into_inner() * at).into(), UnitQuaternion::identity())
            } else {
                Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_axis_angle(&axis, at),
                )
            };
            self.line(&format!(
                "<joint name=\"{name}\" type=\"fixed\">{}{ends}</joint>",
                origin(&(frame * by))
            ));
            return;
        }
        let [low, high] = self.model.joint_range(joint);
        let kind = if slides { "prismatic" } else { "revolute" };
        self.line(&format!(
            "<joint name=\"{name}\" type=\"{kind}\">{}{ends}<axis xyz=\"{}\"/><limit lower=\"{low}\" upper=\"{high}\" effort=\"0\" velocity=\"0\"/></joint>",
            origin(&frame),
            numbers(axis.as_slice())
        ));
    }

    /// Every site that has a name as a link without mass.
    fn sites(&mut self) {
        for (name, body) in self.model.named_sites() {
            let Ok(site) = self.model.site(&name) else {
                continue;
            };
            let (_, body_from_site) = self.model.site_body(site);
            let (on, link_from_body) = self.carrier(body);
            let link = self.link(&name, "");
            self.line(&fixed(&on, &link, &(link_from_body * body_from_site)));
        }
    }

    /// The link that stands for a body, and the body's frame in the link's.
    fn carrier(&self, body: usize) -> (String, Isometry3<f64>) {
        let last = self.model.joints_of(body).last();
        let anchor = last.map_or_else(Vector3::zeros, |joint| {
            self.model.joint_axis_and_anchor(joint).1
        });
        let name = if body == 0 {
            "world".to_owned()
        } else {
            self.model.body_name(body)
        };
        (name, Translation3::from(-anchor).into())
    }
}
