//! An MJCF file with all that it includes, as one text.

use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::edits::{Edits, parse};
use crate::files::source;

/// What names files of assets.
const ASSETS: [&str; 4] = ["mesh", "hfield", "texture", "skin"];

/// The text of a model with all that it includes in the places where it is included.
///
/// # Errors
/// What is in the way, in words.
pub(super) fn whole(model: &Path) -> Result<String, String> {
    let mut folders = Folders {
        model: folder_of(model),
        asset: None,
    };
    file(model, &mut folders)
}

/// Where files are looked for.
struct Folders {
    /// The folder of the model's file.
    model: PathBuf,
    /// What its compilers add to it for meshes.
    asset: Option<String>,
}

fn file(path: &Path, folders: &mut Folders) -> Result<String, String> {
    let bytes = source::read(path).map_err(|problem| format!("{}: {problem}", path.display()))?;
    let text = String::from_utf8(bytes).map_err(|_| format!("{} is not UTF-8", path.display()))?;
    let text = text.trim_start_matches('\u{feff}');
    let document = parse(text).map_err(|problem| format!("{}: {problem}", path.display()))?;
    let mut edits = Edits::new(text);
    for node in document.descendants().filter(Node::is_element) {
        let tag = node.tag_name().name();
        let directory = node.attribute("meshdir").or(node.attribute("assetdir"));
        if tag == "compiler"
            && let Some(directory) = directory
        {
            folders.asset = Some(directory.to_owned());
        }
        let Some(name) = node.attribute("file") else {
            continue;
        };
        let beside = folder_of(path);
        if tag == "include" {
            let candidates = [folders.model.join(name), beside.join(name)];
            let found = candidates.iter().find(|path| path.is_file());
            let found = found.ok_or_else(|| format!("{name} cannot be found"))?;
            let included = file(found, folders)?;
            edits.replace(node, inside(&included)?);
        } else if ASSETS.contains(&tag) && beside != folders.model {
            // MuJoCo looks beside the included file, too.
            let asset = folders.asset.clone().unwrap_or_default();
            if folders.model.join(&asset).join(name).is_file() {
                continue;
            }
            let found = [beside.join(&asset).join(name), beside.join(name)];
            if let Some(found) = found.iter().find(|path| path.is_file()) {
                let from = folders.model.join(&asset);
                edits.set(node, "file", &way(&from, found).to_string_lossy());
            }
        }
    }
    Ok(edits.apply())
}

/// What stands inside the outermost element.
fn inside(text: &str) -> Result<String, String> {
    let document = parse(text)?;
    let children: Vec<_> = document.root_element().children().collect();
    let range = |node: &Node<'_, '_>| node.range();
    Ok(match (children.first(), children.last()) {
        (Some(first), Some(last)) => text[range(first).start..range(last).end].trim().to_owned(),
        _ => String::new(),
    })
}

/// How a file is named from a folder: relative to it where both hang on the same root.
pub(super) fn way(folder: &Path, file: &Path) -> PathBuf {
    let absolute = |path: &Path| {
        let is_here = path.as_os_str().is_empty();
        let path = if is_here { Path::new(".") } else { path };
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        path.canonicalize().unwrap_or(path)
    };
    let (folder, file) = (absolute(folder), absolute(file));
    let same = (folder.components().zip(file.components()))
        .take_while(|(one, other)| one == other)
        .count();
    let mut way: PathBuf = folder.components().skip(same).map(|_| "..").collect();
    way.extend(file.components().skip(same));
    way
}

pub(super) fn folder_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}
