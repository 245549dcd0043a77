//! What a command reads and what it writes. No output overwrites an input or another output.

use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use super::destination::{end_of_links, identity};
use super::{FileError, folder_of};
use crate::codes::ErrorCode;

/// The files of one command.
#[derive(Debug, Default)]
pub struct Roles {
    inputs: Vec<(String, PathBuf)>,
    outputs: Vec<(String, PathBuf)>,
    folders: Vec<PathBuf>,
}

/// What makes two names those of one file.
#[derive(Debug, PartialEq, Eq)]
enum Identity {
    /// Device and number of what is there.
    There([u64; 2]),
    /// The path of what is not there, without links.
    Path(PathBuf),
}

impl Roles {
    /// A file that is read; `what` says as what: "the scenario".
    pub fn reads(&mut self, what: &str, path: &Path) -> &mut Self {
        self.inputs.push((what.to_owned(), path.to_owned()));
        self
    }

    /// A file that is written; `what` says as what: "--plan-out".
    pub fn writes(&mut self, what: &str, path: &Path) -> &mut Self {
        self.outputs.push((what.to_owned(), path.to_owned()));
        self
    }

    /// Files of these names that are written to a folder.
    pub fn writes_to(&mut self, folder: &Path, names: &[&str]) -> &mut Self {
        for name in names {
            self.writes("the results", &folder.join(name));
        }
        self.folders.push(folder.to_owned());
        self
    }

    /// Finds out before any work whether a file would be lost.
    ///
    /// # Errors
    /// An output is an input too, or two outputs are one file.
    pub fn check(&self) -> Result<(), FileError> {
        for (index, (role, path)) in self.outputs.iter().enumerate() {
            // A device takes all.
            let found = path.metadata().ok();
            if found.is_some_and(|found| found.file_type().is_char_device()) {
                continue;
            }
            let own = identity_of(path);
            let same = |(_, other): &&(String, PathBuf)| identity_of(other) == own;
            if let Some((input, other)) = self.inputs.iter().find(same) {
                let problem = format!(
                    "is {input}{}, which {role} would overwrite",
                    also(path, other)
                );
                return Err(overwrites(path, problem));
            }
            if let Some((output, other)) = self.outputs[..index].iter().find(same) {
                let problem = format!(
                    "is the file for {output}{} and for {role}",
                    also(path, other)
                );
                return Err(overwrites(path, problem));
            }
            if self.folders.iter().any(|each| identity_of(each) == own) {
                let problem = format!("is the file for {role} and the folder for the results");
                return Err(overwrites(path, problem));
            }
        }
        Ok(())
    }
}

fn overwrites(path: &Path, problem: String) -> FileError {
    let wrong = FileError::new(path, problem).code(ErrorCode::Overwrites);
    wrong.hint("give another file, or another folder with --out")
}

/// The other name of the same file.
fn also(path: &Path, other: &Path) -> String {
    if path == other {
        return String::new();
    }
    format!(" ({})", other.display())
}

fn identity_of(path: &Path) -> Identity {
    if let Ok(found) = path.metadata() {
        return Identity::There(identity(&found));
    }
    // Without links, as far as its folder is there.
    let path = end_of_links(path).unwrap_or_else(|_| path.to_owned());
    let folder = folder_of(&path).canonicalize();
    let named = folder.ok().zip(path.file_name());
    let absolute = || std::path::absolute(&path).unwrap_or_else(|_| path.clone());
    Identity::Path(named.map_or_else(absolute, |(folder, name)| folder.join(name)))
}
