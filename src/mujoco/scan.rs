//! What an MJCF file asks for, looked through before MuJoCo's compiler sees it: files that have no end
//! or include themselves, and elements by the million.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use super::urdf::parsed;
use crate::files::source;
use crate::quantities::limits::{MOST_ELEMENTS, MOST_PARTS};
use crate::text::wording::shortened;

/// Looks through a model's file with all that it includes and attaches.
///
/// # Errors
/// What MuJoCo cannot be left alone with, in words.
pub(super) fn scan(model: &Path) -> Result<(), String> {
    let mut scan = Scan {
        model,
        ancestors: Vec::new(),
        elements: 0.0,
        parts: 0,
    };
    scan.file(model, 1.0)
}

/// Elements whose attributes are texts.
const WORDS: [&str; 3] = ["text", "tuple", "numeric"];
/// Of a text so many characters are shown.
const MOST_SHOWN: usize = 100;

/// Whether a list of numbers has one that is none.
fn is_no_number(text: &str) -> bool {
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    let mut is_none = false;
    let mut count = 0;
    let all = numbers.all(|number| {
        count += 1;
        is_none |= number.as_ref().is_ok_and(|number| number.is_nan());
        number.is_ok()
    });
    all && is_none && count > 1
}

struct Scan<'a> {
    model: &'a Path,
    /// The files that are being looked through, each named by the one before.
    ancestors: Vec<PathBuf>,
    /// Elements, replicas counted.
    elements: f64,
    /// Files.
    parts: usize,
}

impl Scan<'_> {
    /// A file that is a part of the model so many times.
    fn file(&mut self, path: &Path, times: f64) -> Result<(), String> {
        let bytes = source::read(path).map_err(|problem| name(path, &problem))?;
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(name(path, "is not UTF-8 text"));
        };
        // What MuJoCo takes for XML and this reader does not, MuJoCo judges.
        let Ok(document) = parsed(&text) else {
            return Ok(());
        };
        self.parts += 1;
        if self.parts > MOST_PARTS {
            return Err(format!("it is made of more than {MOST_PARTS} files"));
        }
        self.ancestors.push(canonical(path));
        let folders = self.folders(path, &document);
        self.element(document.root_element(), times, &folders)?;
        self.ancestors.pop();
        Ok(())
    }

    fn element(
        &mut self,
        node: Node<'_, '_>,
        times: f64,
        folders: &[PathBuf],
    ) -> Result<(), String> {
        let tag = node.tag_name().name();
        let mut inside = times;
        if ["replicate", "composite", "flexcomp"].contains(&tag) {
            inside *= count(node);
            if inside > MOST_ELEMENTS {
                return Err(format!(
                    "<{tag}> makes {inside} copies; at most {MOST_ELEMENTS} elements are allowed"
                ));
            }
        }
        self.elements += inside;
        if self.elements > MOST_ELEMENTS {
            return Err(format!(
                "it has more than {MOST_ELEMENTS} elements, copies counted"
            ));
        }
        for attribute in node.attributes() {
            if !WORDS.contains(&tag) && is_no_number(attribute.value()) {
                let (key, value) = (attribute.name(), shortened(attribute.value(), MOST_SHOWN));
                let name = match node.attribute("name") {
                    Some(name) => format!("<{tag}> {:?}", shortened(name, MOST_SHOWN)),
                    None => format!("<{tag}>"),
                };
                return Err(format!(
                    "{name} has {key}={value:?}, which is not a number; MuJoCo would take it as not given"
                ));
            }
            if attribute.name().starts_with("file") {
                for folder in folders {
                    self.named(tag, &folder.join(attribute.value()), times)?;
                }
            }
        }
        node.children()
            .filter(Node::is_element)
            .try_for_each(|child| self.element(child, inside, folders))
    }

    /// A file that the model names, if it is there.
    fn named(&mut self, tag: &str, path: &Path, times: f64) -> Result<(), String> {
        let Ok(metadata) = std::fs::metadata(path) else {
            return Ok(());
        };
        if let Some(problem) = source::unreadable(&metadata) {
            // A folder is MuJoCo's to refuse: it may look for the file elsewhere.
            return if metadata.is_dir() {
                Ok(())
            } else {
                Err(name(path, problem))
            };
        }
        if !["include", "model"].contains(&tag) {
            return Ok(());
        }
        if self.ancestors.contains(&canonical(path)) {
            return Err(name(path, &format!("includes itself by <{tag}>")));
        }
        self.file(path, times)
    }

    /// Where files that this file names may lie: MuJoCo looks beside the model and, for a model that is
    /// attached, beside that.
    fn folders(&self, path: &Path, document: &Document<'_>) -> Vec<PathBuf> {
        let mut folders = Vec::new();
        for own in [self.model, path].map(|file| file.parent().unwrap_or(Path::new(""))) {
            folders.push(own.to_owned());
            for node in document.descendants() {
                for attribute in ["meshdir", "texturedir", "assetdir"] {
                    folders.extend(node.attribute(attribute).map(|folder| own.join(folder)));
                }
            }
        }
        folders.sort();
        folders.dedup();
        folders
    }
}

/// How many of itself an element makes.
fn count(node: Node<'_, '_>) -> f64 {
    let counts = node.attribute("count").unwrap_or("1").split_whitespace();
    let numbers = counts.filter_map(|count| count.parse::<f64>().ok());
    numbers.map(|count| count.abs().max(1.0)).product()
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn name(path: &Path, problem: &str) -> String {
    format!("{} {problem}", path.display())
}
