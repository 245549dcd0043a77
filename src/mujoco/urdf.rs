//! URDF: what a robot's description says of statics goes to MuJoCo's compiler, the rest is left out by name.
//!
//! A URDF's joints, frames and masses become a model without actuators: a scenario says how stiff the joints
//! are and where the tools are. Effort, velocity, friction and damping are a drive's or a
//! simulation's. Shapes that collide are kept as far as their meshes are found; what is only seen is not.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mujoco_rs::prelude::MjSpec;
use roxmltree::{Document, Node, ParsingOptions};

use super::error::refused;
use crate::files::FileError;

/// What MuJoCo's compiler is told: every link is a body, masses are those of the file alone.
const COMPILER: &str = r#"<mujoco><compiler angle="radian" fusestatic="false" strippath="false" discardvisual="false" balanceinertia="true" inertiafromgeom="false" boundmass="1e-9" boundinertia="1e-12"/></mujoco>"#;
/// Elements of the file that say nothing of statics.
const LEFT_OUT: [&str; 10] = [
    "visual",
    "material",
    "dynamics",
    "transmission",
    "gazebo",
    "ros2_control",
    "safety_controller",
    "calibration",
    "sensor",
    "mujoco",
];
/// The type of joint of what nothing holds: an arm's statics are those of a base that stands still.
const FLOATING: &str = "floating";
/// Endings of meshes that MuJoCo reads.
const MESHES: [&str; 3] = ["stl", "obj", "msh"];

/// A URDF as MuJoCo's compiler takes it.
pub(super) struct Urdf {
    /// The text.
    pub text: String,
    /// The meshes that it names.
    pub meshes: Vec<PathBuf>,
    /// What is left out and may matter, in words.
    pub left_out: Vec<String>,
    /// Pairs of a link that stands still and one that a joint on it moves. MuJoCo lets neighbours
    /// overlap, but not where one of them stands still.
    pub neighbours: Vec<[String; 2]>,
}

impl Urdf {
    /// A file's text, if it is a URDF; without any mesh where these are no good.
    pub fn read(path: &Path, text: &str, with_meshes: bool) -> Option<Self> {
        let document = parsed(text).ok()?;
        let root = document.root_element();
        if root.tag_name().name() != "robot" {
            return None;
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut writer = UrdfWriter {
            folder: std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()),
            with_meshes,
            text: String::new(),
            meshes: Vec::new(),
            missing: BTreeSet::new(),
        };
        writer.element(root);
        let missing = writer.missing.first().map(|first| {
            let count = writer.missing.len();
            format!(
                "{count} of its meshes cannot be had, such as {first}: collisions do not see them"
            )
        });
        Some(Self {
            text: writer.text,
            meshes: writer.meshes,
            left_out: missing.into_iter().chain(left_out(root)).collect(),
            neighbours: neighbours(root),
        })
    }
}

/// Reads a text as XML, as MuJoCo takes it: it may declare a document's type.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options)
}

/// The elements in another one that have a tag.
fn tagged<'d, 't: 'd>(node: Node<'d, 't>, tag: &'static str) -> impl Iterator<Item = Node<'d, 't>> {
    node.children().filter(move |each| each.has_tag_name(tag))
}

/// The joints of a description: whether it moves, its parent link and its child link.
fn joints<'a>(root: Node<'a, '_>) -> impl Iterator<Item = (bool, &'a str, &'a str)> {
    tagged(root, "joint").filter_map(|joint| {
        let link = |tag| tagged(joint, tag).next()?.attribute("link");
        let moves = !["fixed", FLOATING].contains(&joint.attribute("type")?);
        Some((moves, link("parent")?, link("child")?))
    })
}

/// What stands still beside what moves on it.
fn neighbours(root: Node<'_, '_>) -> Vec<[String; 2]> {
    let children: BTreeSet<&str> = joints(root).map(|joint| joint.2).collect();
    let mut links = tagged(root, "link").filter_map(|link| link.attribute("name"));
    let first = links.find(|name| !children.contains(name));
    let Some(first) = first else {
        return Vec::new();
    };
    let mut still = BTreeSet::from([first]);
    while let Some((_, _, child)) = joints(root)
        .find(|(moves, parent, child)| !moves && still.contains(parent) && !still.contains(child))
    {
        still.insert(child);
    }
    let mut pairs = Vec::new();
    for (_, _, child) in joints(root).filter(|joint| joint.0 && still.contains(joint.1)) {
        for &link in &still {
            pairs.push([link.to_owned(), child.to_owned()]);
        }
    }
    pairs
}

/// An attribute that is a number.
fn number(node: Node<'_, '_>, name: &str) -> Option<f64> {
    node.attribute(name)?.trim().parse().ok()
}

/// Whether a tensor of inertia can be one: symmetric with positive eigenvalues.
fn is_inertia(node: Node<'_, '_>) -> bool {
    let entry = |name| number(node, name).unwrap_or(f64::NAN);
    let [xy, xz, yz] = ["ixy", "ixz", "iyz"].map(entry);
    let [xx, yy, zz] = ["ixx", "iyy", "izz"].map(entry);
    let tensor = nalgebra::Matrix3::from([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    tensor.iter().all(|each| each.is_finite()) && tensor.symmetric_eigenvalues().min() > 1e-15
}

/// Whether a text is a URDF.
pub(super) fn is_one(text: &str) -> bool {
    parsed(text).is_ok_and(|document| document.root_element().has_tag_name("robot"))
}

/// The elements of a URDF as MuJoCo reads them, and what is left out. Without meshes, where MuJoCo refuses these.
pub(super) fn specification(path: &Path, text: &str) -> Result<(MjSpec, Vec<String>), FileError> {
    let spec = |with_meshes: bool| {
        let urdf = Urdf::read(path, text, with_meshes).ok_or_else(|| "is no URDF".to_owned())?;
        let mut spec = MjSpec::from_xml_string(&urdf.text).map_err(|error| error.to_string())?;
        for [still, moving] in &urdf.neighbours {
            // MuJoCo makes the first link a body, or the world.
            let still = spec.body_mut(still).map_or("world", |_| still);
            spec.add_exclude()
                .with_bodyname1(still)
                .with_bodyname2(moving);
        }
        spec.compile().map_err(|error| error.to_string())?;
        Ok::<_, String>((spec, urdf.left_out))
    };
    let refusal = match spec(true) {
        Ok(read) => return Ok(read),
        Err(refusal) => refusal,
    };
    let (spec, mut left_out) = spec(false).map_err(|message| refused(path, message))?;
    left_out.push(format!("MuJoCo refuses its meshes: {refusal}"));
    Ok((spec, left_out))
}

/// What is left out of a description beside its meshes, in words: joints that nothing drives, and links that a joint moves and
/// that say nothing of their mass.
fn left_out(root: Node<'_, '_>) -> impl Iterator<Item = String> {
    let named = |tag: &'static str, is_meant: &dyn Fn(Node<'_, '_>) -> bool| -> Vec<String> {
        let all = tagged(root, tag).filter(|node| is_meant(*node));
        all.filter_map(|node| Some(node.attribute("name")?.to_owned()))
            .collect()
    };
    let moved: BTreeSet<&str> = joints(root)
        .filter(|joint| joint.0)
        .map(|joint| joint.2)
        .collect();
    let floats = |joint: Node<'_, '_>| joint.attribute("type") == Some(FLOATING);
    let is_weightless = |link: Node<'_, '_>| {
        let name = link.attribute("name");
        tagged(link, "inertial").next().is_none() && name.is_some_and(|name| moved.contains(name))
    };
    let all = [
        (
            "links without <inertial> are taken to weigh nothing",
            named("link", &is_weightless),
        ),
        (
            "floating joints are held where they are drawn",
            named("joint", &floats),
        ),
    ];
    let all = all.into_iter().filter(|(_, names)| !names.is_empty());
    all.map(|(what, names)| format!("{what}: {}", names.join(", ")))
}

struct UrdfWriter {
    folder: PathBuf,
    with_meshes: bool,
    text: String,
    meshes: Vec<PathBuf>,
    missing: BTreeSet<String>,
}

impl UrdfWriter {
    /// An element with all that counts in it.
    fn element(&mut self, node: Node<'_, '_>) {
        let tag = node.tag_name().name();
        if LEFT_OUT.contains(&tag) {
            return;
        }
        if tag == "inertia" && !is_inertia(node) {
            // No rest depends on it, and MuJoCo takes none that cannot be.
            self.text += r#"<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>"#;
            return;
        }
        let mesh = (tag == "collision")
            .then(|| node.descendants().find(|each| each.has_tag_name("mesh")))
            .flatten();
        let mut found = None;
        if let Some(mesh) = mesh {
            let name = mesh.attribute("filename").unwrap_or_default();
            found = self.mesh(name);
            if found.is_none() {
                self.missing.insert(name.to_owned());
                return;
            }
        }
        self.text += &format!("<{tag}");
        for attribute in node.attributes() {
            let (name, value) = (attribute.name(), attribute.value());
            let is_of_drive = tag == "limit" && ["effort", "velocity"].contains(&name);
            if !is_of_drive {
                let value = match name {
                    "type" if tag == "joint" && value == FLOATING => "fixed".to_owned(),
                    "filename" => self.mesh(value).map_or_else(
                        || value.to_owned(),
                        |path| path.to_string_lossy().into_owned(),
                    ),
                    _ => value.to_owned(),
                };
                self.text += &format!(" {name}=\"{}\"", escaped(&value));
            }
        }
        self.text.push('>');
        if tag == "robot" {
            self.text += COMPILER;
        }
        for child in node.children().filter(Node::is_element) {
            self.element(child);
        }
        self.text += &format!("</{tag}>");
        self.meshes.extend(found);
    }

    /// The file of a mesh: beside the description, or in the package or one of the folders around it.
    fn mesh(&self, name: &str) -> Option<PathBuf> {
        if !self.with_meshes {
            return None;
        }
        let ending = Path::new(name).extension()?.to_str()?.to_lowercase();
        if !MESHES.contains(&ending.as_str()) {
            return None;
        }
        let name = name.strip_prefix("file://").unwrap_or(name);
        let candidates: Vec<PathBuf> = match name.strip_prefix("package://") {
            None => vec![self.folder.join(name)],
            Some(rest) => {
                let inside = rest.split_once('/').map_or(rest, |(_, inside)| inside);
                let around = self.folder.ancestors();
                around
                    .flat_map(|folder| [folder.join(rest), folder.join(inside)])
                    .collect()
            }
        };
        candidates.into_iter().find(|path| path.is_file())
    }
}

/// A text as an attribute's value.
fn escaped(text: &str) -> String {
    (text.replace('&', "&amp;").replace('<', "&lt;"))
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&apos;")
        .replace('\n', "&#10;")
}
