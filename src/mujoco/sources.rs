//! The files that a model is made of.

use super::error::refused;
use crate::files::{FileError, read_text};
use std::path::{Path, PathBuf};

use super::urdf::{Urdf, parsed};

/// What only pictures show.
const PICTURES: [&str; 2] = ["texture", "skin"];

/// The model file, the files that it includes, and those of its meshes, height fields and attached
/// models, each once and in the order in which they are first named. What only pictures show is left
/// out. MuJoCo looks for them in the folder of the model file, or in those that its `compiler` names.
///
/// # Errors
/// A file cannot be read, or is not XML.
pub fn sources(model: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut found = vec![model.to_owned()];
    let mut folders = vec![folder_of(model)];
    let mut next = 0;
    while next < found.len() {
        let file = found[next].clone();
        next += 1;
        let is_xml = next == 1 || (file.extension()).is_some_and(is_xml_ending);
        if !is_xml {
            continue;
        }
        let text = read_text(&file)?;
        if let Some(urdf) = Urdf::read(&file, &text, true) {
            for mesh in urdf.meshes {
                push_new(&mut found, mesh);
            }
            continue;
        }
        let document = parsed(&text).map_err(|error| refused(&file, format!("XML: {error}")))?;
        push_new(&mut folders, folder_of(&file));
        let elements = || document.descendants().filter(roxmltree::Node::is_element);
        for compiler in elements().filter(|each| each.has_tag_name("compiler")) {
            for key in ["meshdir", "assetdir"] {
                if let Some(folder) = compiler.attribute(key) {
                    push_new(&mut folders, folder_of(model).join(folder));
                    push_new(&mut folders, folder_of(&file).join(folder));
                }
            }
        }
        for element in elements() {
            if PICTURES.contains(&element.tag_name().name()) {
                continue;
            }
            let named = ["file", "filename"].map(|key| element.attribute(key));
            for name in named.into_iter().flatten() {
                for path in called(name, &folders) {
                    push_new(&mut found, path);
                }
            }
        }
    }
    Ok(found)
}

fn is_xml_ending(ending: &std::ffi::OsStr) -> bool {
    ["xml", "mjcf", "urdf"]
        .iter()
        .any(|known| ending.eq_ignore_ascii_case(known))
}

/// All files of that name in the folders, or of its last part, since MuJoCo may leave the path out: which of them it takes is its own
/// matter.
fn called(name: &str, folders: &[PathBuf]) -> Vec<PathBuf> {
    let last = Path::new(name).file_name().map(Path::new);
    let names = [Some(Path::new(name)), last].into_iter().flatten();
    let paths = names.flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    paths.filter(|path| path.is_file()).collect()
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}

fn push_new(list: &mut Vec<PathBuf>, path: PathBuf) {
    if !list.contains(&path) {
        list.push(path);
    }
}
