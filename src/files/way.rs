//! How files are named: from the root, or from a folder.

use std::path::{Path, PathBuf};

/// How a file is named from a folder: relative to it where both hang on the same root.
pub fn way(folder: &Path, file: &Path) -> PathBuf {
    let (folder, file) = (absolute(folder), absolute(file));
    let same = (folder.components().zip(file.components()))
        .take_while(|(one, other)| one == other)
        .count();
    let mut way: PathBuf = folder.components().skip(same).map(|_| "..").collect();
    way.extend(file.components().skip(same));
    way
}

/// The whole way to a file or folder.
pub fn absolute(path: &Path) -> PathBuf {
    let is_here = path.as_os_str().is_empty();
    let path = if is_here { Path::new(".") } else { path };
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    path.canonicalize().unwrap_or(path)
}
