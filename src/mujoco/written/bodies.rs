//! Which element of an MJCF file says what MuJoCo makes a body, a joint, a site or an actuator of.

use nalgebra::Isometry3;
use roxmltree::{Document, Node};

use super::pose::FileAngles;
use crate::mujoco::Model;

/// What makes several elements of one, or takes them from elsewhere.
const MAKERS: [&str; 4] = ["replicate", "attach", "composite", "flexcomp"];

/// The elements of a model's file.
pub(super) struct Tree<'d, 't> {
    model: &'d Model,
    document: &'d Document<'t>,
    /// How the file writes angles.
    pub angles: FileAngles,
    /// The bodies in the order of the file.
    bodies: Vec<Node<'d, 't>>,
}

impl<'d, 't> Tree<'d, 't> {
    pub fn new(model: &'d Model, document: &'d Document<'t>) -> Self {
        let is_body = |node: &Node<'_, '_>| {
            node.has_tag_name("body") && !has_ancestor(*node, &["default", "contact"])
        };
        Self {
            model,
            document,
            angles: FileAngles::of(document),
            bodies: document.descendants().filter(is_body).collect(),
        }
    }

    /// A body's element.
    pub fn body(&self, body: usize) -> Result<Node<'d, 't>, String> {
        let shown = self.model.body_name(body);
        let unclear = |why: &str| Err(format!("body {shown:?} {why}"));
        let found = if let Some(name) = self.model.named_body(body) {
            let named = |node: &&Node<'d, 't>| node.attribute("name") == Some(&name);
            self.bodies.iter().find(named)
        } else if self.bodies.len() + 1 == self.model.bodies() {
            self.bodies.get(body - 1)
        } else {
            None
        };
        match found {
            Some(node) if has_ancestor(*node, &MAKERS) => {
                unclear("stands in a <replicate>: write its copies out")
            }
            Some(node) => Ok(*node),
            None => unclear(
                "has no element of its own in the file: give it a name, or write out what makes it (<attach>, <replicate>)",
            ),
        }
    }

    /// A joint's element.
    pub fn joint(&self, joint: usize) -> Result<Node<'d, 't>, String> {
        let mut bodies = 1..self.model.bodies();
        let owner = bodies.find_map(|body| {
            let place = self.model.joints_of(body).position(|each| each == joint)?;
            Some((body, place))
        });
        let (body, place) = owner.ok_or_else(|| "the joint has no body".to_owned())?;
        let own = self.body(body)?;
        let is_joint = |node: &Node<'_, '_>| {
            (node.has_tag_name("joint") || node.has_tag_name("freejoint"))
                && body_of(*node) == Some(own)
        };
        let found = own.descendants().filter(is_joint).nth(place);
        found.ok_or_else(|| {
            format!(
                "joint {:?} has no element in the file",
                self.model.joint_name(joint)
            )
        })
    }

    /// A site's element.
    pub fn site(&self, name: &str) -> Result<Node<'d, 't>, String> {
        let is_it = |node: &Node<'_, '_>| {
            node.has_tag_name("site")
                && node.attribute("name") == Some(name)
                && !has_ancestor(*node, &MAKERS)
                && (body_of(*node).is_some() || has_ancestor(*node, &["worldbody"]))
        };
        let found = self.document.descendants().find(is_it);
        found.ok_or_else(|| format!("site {name:?} has no element of its own in the file"))
    }

    /// The element of the section's n-th entry, such as of an actuator.
    pub fn entry(&self, section: &str, index: usize, count: usize) -> Result<Node<'d, 't>, String> {
        let all = self.entries(section);
        match all.get(index) {
            Some(node) if all.len() == count => Ok(*node),
            _ => Err(format!(
                "<{section}> has other entries than the file says: write out what <attach> or <replicate> makes"
            )),
        }
    }

    /// All entries of the sections of this name.
    pub fn entries(&self, section: &str) -> Vec<Node<'d, 't>> {
        let sections = self.document.root_element().children();
        let sections = sections.filter(|node| node.has_tag_name(section));
        sections
            .flat_map(|section| section.children().filter(Node::is_element))
            .collect()
    }

    /// What the frames between an element and its body add up to.
    pub fn frames(&self, node: Node<'_, '_>) -> Result<Isometry3<f64>, String> {
        let mut all = Isometry3::identity();
        for parent in node.ancestors().skip(1) {
            if parent.has_tag_name("body") || parent.has_tag_name("worldbody") {
                break;
            }
            if parent.has_tag_name("frame") {
                let own = self.angles.pose(parent);
                let unclear = || "a <frame> has a pose that cannot be read".to_owned();
                all = own.ok_or_else(unclear)? * all;
            }
        }
        Ok(all)
    }
}

/// The body that an element belongs to.
fn body_of<'d, 't>(node: Node<'d, 't>) -> Option<Node<'d, 't>> {
    node.ancestors()
        .skip(1)
        .find(|each| each.has_tag_name("body"))
}

fn has_ancestor(node: Node<'_, '_>, tags: &[&str]) -> bool {
    let mut ancestors = node.ancestors().skip(1);
    ancestors.any(|each| tags.contains(&each.tag_name().name()))
}
