//! MJCF with what was identified.

use std::path::Path;

use mujoco_rs::mujoco_c::mjNBIAS;
use nalgebra::{Isometry3, Point3, UnitQuaternion};
use roxmltree::Node;

use super::bodies::Tree;
use super::described::as_mjcf;
use super::edits::{Edits, escaped, numbers, parse};
use super::mounted::link_of;
use super::pose::{TURNS, position_and_quaternion};
use super::whole::{folder_of, way, whole};
use super::{ModelCalibration, RIGID, WrittenModel};
use crate::mujoco::KEPT;
use crate::mujoco::loading::prepare;
use crate::mujoco::servo::Servo;
use crate::mujoco::{Model, ModelError};

/// The group of actuators that do not count.
const IDLE: &str = "30";

/// The text of a model, calibrated, for a folder.
pub(super) fn written(
    model: &Model,
    calibration: &ModelCalibration,
    folder: &Path,
) -> Result<WrittenModel, ModelError> {
    let path = model.path();
    let wrong = |problem: String| model.not_written(problem);
    let plain = Model::load(path)?;
    let urdf = prepare(path)?;
    let text = match &urdf {
        Some(urdf) => as_mjcf(path, urdf)?,
        None => whole(path).map_err(wrong)?,
    };
    let document = parse(&text).map_err(wrong)?;
    let acting = if model.ignores_actuators() {
        plain.without_actuators()
    } else {
        plain.clone()
    };
    let mut writer = MjcfEditor {
        plain: &plain,
        acting: &acting,
        calibration,
        joints: model.chain_joints(),
        tree: Tree::new(&plain, &document),
        edits: Edits::new(&text),
        not_expressed: Vec::new(),
    };
    let root = document.root_element();
    let mut write = || {
        if model.ignores_actuators() {
            writer.idle(root)?;
        }
        writer.links()?;
        writer.sites()?;
        writer.masses()?;
        writer.stiffness(root)?;
        writer.springs()?;
        writer.mounted()?;
        writer.kept(root);
        if urdf.is_none() {
            writer.folders(root, path, folder);
        }
        Ok(())
    };
    write().map_err(wrong)?;
    Ok(WrittenModel {
        text: writer.edits.apply(),
        not_expressed: writer.not_expressed,
    })
}

struct MjcfEditor<'d, 't> {
    /// What the file says alone.
    plain: &'d Model,
    /// The same without the actuators that do not count.
    acting: &'d Model,
    calibration: &'d ModelCalibration,
    /// The chain's joints, by MuJoCo's identifiers.
    joints: Vec<usize>,
    tree: Tree<'d, 't>,
    edits: Edits<'t>,
    not_expressed: Vec<String>,
}

impl<'t> MjcfEditor<'_, 't> {
    /// Displaces an element's frame, which frames of the file may enclose, along its own axes.
    fn displace(
        &mut self,
        node: Node<'_, 't>,
        nominal: &Isometry3<f64>,
        by: &Isometry3<f64>,
    ) -> Result<(), String> {
        let own = self.tree.frames(node)?.inverse() * nominal * by;
        let (position, quaternion) = position_and_quaternion(&own);
        self.edits.set_numbers(node, "pos", &position);
        if by.rotation != UnitQuaternion::identity() {
            self.edits.set_numbers(node, "quat", &quaternion);
            self.edits.remove(node, &TURNS[1..]);
        }
        Ok(())
    }

    /// The frames of links: with D the displacement of the link of a body's last joint, in the body's axes, the body
    /// stands at B D, and the joints before it in the same body turn about what D^-1 makes of their axes.
    fn links(&mut self) -> Result<(), String> {
        for body in 1..self.plain.bodies() {
            let mut all = Isometry3::identity();
            let own: Vec<usize> = self.plain.joints_of(body).collect();
            for &joint in own.iter().rev() {
                if all != Isometry3::identity() {
                    let node = self.tree.joint(joint)?;
                    let (axis, anchor) = self.plain.joint_axis_and_anchor(joint);
                    let back = all.inverse();
                    let axis = back.rotation * axis;
                    let anchor = back * Point3::from(anchor);
                    self.edits.set_numbers(node, "axis", axis.as_slice());
                    self.edits
                        .set_numbers(node, "pos", anchor.coords.as_slice());
                }
                let index = self.joints.iter().position(|&each| each == joint);
                let Some(by) = index.and_then(|index| self.calibration.links.get(index)) else {
                    continue;
                };
                if *by != Isometry3::identity() {
                    let body_from_link = self.plain.body_from_link(joint);
                    all = body_from_link * by * body_from_link.inverse() * all;
                }
            }
            if all != Isometry3::identity() {
                let node = self.tree.body(body)?;
                self.displace(node, &self.plain.parent_from_body(body), &all)?;
            }
        }
        Ok(())
    }

    fn sites(&mut self) -> Result<(), String> {
        for (name, by) in &self.calibration.sites {
            let is_mounted =
                (self.calibration.additions.tools.iter()).any(|tool| tool.name == *name);
            if is_mounted || *by == Isometry3::identity() {
                continue;
            }
            let node = self.tree.site(name)?;
            if node.has_attribute("fromto") {
                return Err(format!(
                    "site {name:?} is drawn by its ends (fromto): give it pos and quat"
                ));
            }
            let site = self.plain.site(name).map_err(|error| error.to_string())?;
            let (_, body_from_site) = self.plain.site_body(site);
            self.displace(node, &body_from_site, by)?;
        }
        Ok(())
    }

    fn masses(&mut self) -> Result<(), String> {
        for body in 1..self.plain.bodies() {
            let Some((link, turn)) = link_of(self.plain, &self.joints, body) else {
                continue;
            };
            let (factor, shift) = (
                self.calibration.mass_factor[link],
                self.calibration.centre_shift_m[link],
            );
            let (mass, centre) = self.plain.mass(body);
            if mass == 0.0 || factor.to_bits() == 1.0_f64.to_bits() && shift.norm() == 0.0 {
                continue;
            }
            let (inertia, turned) = self.plain.inertia(body);
            let [x, y, z, w] = turned.coords.into();
            let text = format!(
                "<inertial pos=\"{}\" quat=\"{}\" mass=\"{}\" diaginertia=\"{}\"/>",
                numbers((centre + turn * shift).as_slice()),
                numbers(&[w, x, y, z]),
                mass * factor,
                numbers((inertia * factor).as_slice()),
            );
            let node = self.tree.body(body)?;
            match node.children().find(|child| child.has_tag_name("inertial")) {
                Some(own) => self.edits.replace(own, text),
                None => self.edits.append(node, text),
            }
        }
        Ok(())
    }

    /// No actuator of the file counts: they go to a group that is switched off.
    fn idle(&mut self, root: Node<'_, 't>) -> Result<(), String> {
        let all = self.tree.entries("actuator");
        for node in &all {
            self.edits.set(*node, "group", IDLE);
        }
        if !all.is_empty() {
            let option = format!("<option actuatorgroupdisable=\"{IDLE}\"/>");
            self.edits.append(root, option);
            self.not_expressed.push(format!(
                "the file's actuators do not count: they stand in group {IDLE}, which is switched off"
            ));
        }
        for joint in 0..self.plain.joints() {
            if !self.plain.is_hinge(joint) && !self.plain.is_slide(joint) {
                continue;
            }
            let [friction, limited] = self.plain.drive_limits(joint);
            if friction || limited {
                let node = self.tree.joint(joint)?;
                if friction {
                    self.edits.set(node, "frictionloss", "0");
                }
                if limited {
                    self.edits.set(node, "actuatorfrclimited", "false");
                }
            }
        }
        Ok(())
    }

    fn stiffness(&mut self, root: Node<'_, 't>) -> Result<(), String> {
        let mut new = Vec::new();
        for (index, joint) in self.joints.clone().into_iter().enumerate() {
            let wanted = self.calibration.compliance[index];
            let name = self.plain.joint_name(joint);
            let springs = self.acting.joint_spring(joint);
            let servo = self.acting.position(joint);
            if let (Some(_), Some([_, rest]), zero) = (servo, springs, self.calibration.zero[index])
                && zero != 0.0
            {
                // The spring beside the drive feels the joint's own angle.
                let rest = rest - zero;
                let written = if self.plain.is_slide(joint) {
                    rest
                } else {
                    self.tree.angles.written(rest)
                };
                let node = self.tree.joint(joint)?;
                self.edits.set_numbers(node, "springref", &[written]);
            }
            if self.acting.joint_compliance(joint) == Some(wanted) {
                continue;
            }
            if wanted < 0.0 {
                return Err(format!(
                    "the compliance of {name} is negative: no spring has that"
                ));
            }
            let stiffness = if wanted == 0.0 {
                (self.not_expressed).push(format!(
                    "{name} is held to be rigid: it has a stiffness of {RIGID:e}"
                ));
                RIGID
            } else {
                wanted.recip()
            };
            match (servo, springs) {
                (Some(servo), _) => self.gain(servo, stiffness)?,
                (None, Some(_)) => {
                    let node = self.tree.joint(joint)?;
                    self.edits.set_numbers(node, "stiffness", &[stiffness]);
                }
                (None, None) => {
                    let node = self.tree.joint(joint)?;
                    let named = node.attribute("name");
                    let named = named.ok_or_else(|| {
                        format!("{name} has no name that an actuator could be told")
                    })?;
                    new.push(format!(
                        "<position joint=\"{}\" kp=\"{stiffness}\" gear=\"1\" group=\"0\" ctrllimited=\"false\" forcelimited=\"false\" inheritrange=\"0\"/>",
                        escaped(named)
                    ));
                }
            }
        }
        if new.is_empty() {
            return Ok(());
        }
        self.edits
            .append(root, format!("<actuator>{}</actuator>", new.concat()));
        let keys = self.tree.entries("keyframe").into_iter();
        for key in keys.filter(|key| key.has_attribute("ctrl")) {
            self.edits.remove(key, &["ctrl"]);
            let what = "the controls of keyframes, which have no numbers for the new actuators";
            if !self.not_expressed.iter().any(|each| each == what) {
                self.not_expressed.push(what.to_owned());
            }
        }
        Ok(())
    }

    /// Makes the position actuator of a joint as stiff as this.
    fn gain(&mut self, servo: Servo, stiffness: f64) -> Result<(), String> {
        let node = (self.tree).entry("actuator", servo.actuator, self.plain.actuators())?;
        let gain = stiffness / (servo.gear * servo.gear);
        if node.has_tag_name("position") {
            self.edits.set_numbers(node, "kp", &[gain]);
            return Ok(());
        }
        let (command, mut bias) = self.plain.actuator_law(servo.actuator);
        self.edits
            .set_numbers(node, "gainprm", &[gain * (command / -bias[1])]);
        bias[1] = -gain;
        let used = bias.iter().rposition(|&value| value != 0.0).unwrap_or(0);
        let used = used.min(mjNBIAS as usize - 1);
        self.edits.set_numbers(node, "biasprm", &bias[..=used]);
        Ok(())
    }

    fn springs(&mut self) -> Result<(), String> {
        let own = self.plain.tendon_springs();
        // Without a word of the file's, MuJoCo takes the length in the pose that is drawn.
        let frames = self.calibration.links.iter();
        let frames = frames.chain(self.calibration.sites.iter().map(|(_, by)| by));
        let stands_as_drawn = frames.into_iter().all(|by| *by == Isometry3::identity());
        for (name, stiffness, rest) in &self.calibration.springs {
            let bits =
                |stiffness: f64, rest: [f64; 2]| [stiffness, rest[0], rest[1]].map(f64::to_bits);
            let unchanged = stands_as_drawn
                && own.iter().any(|spring| {
                    spring.name == *name
                        && bits(spring.stiffness_n_per_m, spring.rest_m) == bits(*stiffness, *rest)
                });
            if unchanged {
                continue;
            }
            let index = self.plain.tendon(name).map_err(|error| error.to_string())?;
            let node = (self.tree).entry("tendon", index, self.plain.tendons())?;
            self.edits.set_numbers(node, "stiffness", &[*stiffness]);
            self.edits.set_numbers(node, "springlength", rest);
        }
        Ok(())
    }

    /// What a scenario mounts.
    fn mounted(&mut self) -> Result<(), String> {
        let additions = &self.calibration.additions;
        for tool in &additions.tools {
            let (body, frame) = self.calibration.placed_tool(self.plain, tool)?;
            let (position, quaternion) = position_and_quaternion(&frame);
            let site = format!(
                "<site name=\"{}\" pos=\"{}\" quat=\"{}\" group=\"4\"/>",
                escaped(&tool.name),
                numbers(&position),
                numbers(&quaternion)
            );
            let node = self.tree.body(body)?;
            self.edits.append(node, site);
        }
        for (payload, number) in additions.payloads.iter().zip(1..) {
            let placed = (self.calibration).placed_payload(self.plain, &self.joints, payload)?;
            let mass = placed.mass_kg;
            let inertia = mass * 1e-2;
            let text = format!(
                "<body name=\"{KEPT}payload_{number}\" pos=\"{}\"><inertial pos=\"0 0 0\" mass=\"{mass}\" diaginertia=\"{}\"/></body>",
                numbers(placed.centre_m.as_slice()),
                numbers(&[inertia; 3])
            );
            let node = self.tree.body(placed.body)?;
            self.edits.append(node, text);
        }
        Ok(())
    }

    /// Texts that stay with the model; those of an earlier identification go.
    fn kept(&mut self, root: Node<'_, 't>) {
        for node in self.tree.entries("custom") {
            if node
                .attribute("name")
                .is_some_and(|name| name.starts_with(KEPT))
            {
                self.edits.delete(node);
            }
        }
        let texts = self.calibration.texts.iter().map(|(name, text)| {
            format!(
                "<text name=\"{}\" data=\"{}\"/>",
                escaped(name),
                escaped(text)
            )
        });
        let all: Vec<String> = texts.collect();
        if !all.is_empty() {
            let text = format!("<custom>\n    {}\n  </custom>", all.join("\n    "));
            self.edits.append(root, text);
        }
    }

    /// Meshes and the like are where they were, also as seen from another folder.
    fn folders(&mut self, root: Node<'_, 't>, path: &Path, folder: &Path) {
        let own = folder_of(path);
        let there = way(folder, &own);
        let named = ["mesh", "hfield", "texture", "skin", "model"];
        let has_files = root.descendants().any(|node| {
            named.contains(&node.tag_name().name())
                && node
                    .attributes()
                    .any(|each| each.name().starts_with("file"))
        });
        if there.as_os_str().is_empty() || !has_files {
            return;
        }
        let mut folders = [String::new(), String::new()];
        for compiler in root
            .descendants()
            .filter(|node| node.has_tag_name("compiler"))
        {
            if let Some(folder) = compiler.attribute("assetdir") {
                folders = [folder.to_owned(), folder.to_owned()];
            }
            for (folder, name) in folders.iter_mut().zip(["meshdir", "texturedir"]) {
                if let Some(own) = compiler.attribute(name) {
                    own.clone_into(folder);
                }
            }
        }
        let [meshes, textures] =
            folders.map(|folder| there.join(folder).to_string_lossy().into_owned());
        self.edits.append(
            root,
            format!(
                "<compiler meshdir=\"{}\" texturedir=\"{}\"/>",
                escaped(&meshes),
                escaped(&textures)
            ),
        );
    }
}
