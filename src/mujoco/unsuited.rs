//! What is wrong with a model's text before MuJoCo sees it: other languages, and numbers that MuJoCo would take as not given.

use std::path::Path;

use roxmltree::{Document, Error, Node};

use super::urdf::parsed;
use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::text::wording::{shell_path, shortened};

/// Elements whose attributes are texts.
const WORDS: [&str; 3] = ["text", "tuple", "numeric"];
/// Of a text so many characters are shown.
const MOST_SHOWN: usize = 100;

/// Refuses what is still to be generated, MJCF that names packages of ROS, and numbers that are none. What MuJoCo takes for XML
/// and this reader does not, MuJoCo judges.
pub(super) fn refuse(path: &Path, text: &str) -> Result<(), FileError> {
    let document = parsed(text);
    let is_of_xacro = |space: &str| space.contains("xacro");
    let is_xacro = match &document {
        Ok(document) => (document.descendants())
            .any(|node| node.tag_name().namespace().is_some_and(is_of_xacro)),
        Err(Error::UnknownNamespace(prefix, _)) => is_of_xacro(prefix),
        Err(_) => false,
    };
    if is_xacro || path.extension().is_some_and(|ending| ending == "xacro") {
        let name = path.file_stem().unwrap_or("robot".as_ref());
        let name = name.to_string_lossy();
        let urdf = format!("{}.urdf", name.trim_end_matches(".urdf"));
        let hint = format!(
            "run xacro first: xacro {} > {}",
            shell_path(path),
            shell_path(Path::new(&urdf))
        );
        let problem = "is a xacro file: a URDF still to be generated";
        return Err(FileError::new(path, problem)
            .hint(hint)
            .code(ErrorCode::ModelFormat));
    }
    let Ok(document) = document else {
        return Ok(());
    };
    document.descendants().try_for_each(|node| {
        check_numbers(node).map_err(|problem| FileError::new(path, problem).code(ErrorCode::Model))
    })?;
    match package(&document) {
        Some(line) if !document.root_element().has_tag_name("robot") => {
            let problem = format!(
                "line {line}: names a file by its ROS package (package://), which MuJoCo cannot find"
            );
            let hint = "replace package://... by the meshes' paths relative to the file";
            Err(FileError::new(path, problem)
                .hint(hint)
                .code(ErrorCode::ModelFormat))
        }
        _ => Ok(()),
    }
}

/// The line on which a file is named by its package.
fn package(document: &Document<'_>) -> Option<u32> {
    let mut all = document.descendants().flat_map(|node| node.attributes());
    let found = all.find(|each| each.value().contains("package://"))?;
    Some(document.text_pos_at(found.range().start).row)
}

/// Refuses a list of numbers of which one is none.
fn check_numbers(node: Node<'_, '_>) -> Result<(), String> {
    let tag = node.tag_name().name();
    let is_no_number = |text: &str| {
        let numbers = text.split_whitespace().map(str::parse::<f64>);
        let numbers: Result<Vec<f64>, _> = numbers.collect();
        numbers.is_ok_and(|all| all.len() > 1 && all.iter().any(|number| number.is_nan()))
    };
    let mut attributes = node.attributes().filter(|_| !WORDS.contains(&tag));
    attributes.find(|each| is_no_number(each.value())).map_or(Ok(()), |each| {
        let name = node.attribute("name").map_or_else(String::new, |name| {
            format!(" {:?}", shortened(name, MOST_SHOWN))
        });
        let (key, value) = (each.name(), shortened(each.value(), MOST_SHOWN));
        Err(format!(
            "<{tag}>{name} has {key}={value:?}, which is not a number; MuJoCo would take it as not given"
        ))
    })
}
