//! The scenarios that are installed with the program, for who has no clone of the project.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Where shipped files are, from the folder of the program.
const BESIDE_PROGRAM: &str = "../share/elastocal";

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Says in which folder the shipped `scenarios` and `models` are; beside the program if nothing is said.
pub fn set_folder(folder: PathBuf) {
    // The first one counts.
    let _ = FOLDER.set(folder);
}

/// The path, or where the shipped file of that name is: `scenarios/kr270.toml` is there outside of a clone, too.
pub fn found(path: &Path) -> Cow<'_, Path> {
    if path.is_absolute() || path.exists() {
        return Cow::Borrowed(path);
    }
    let beside = || Some(std::env::current_exe().ok()?.parent()?.join(BESIDE_PROGRAM));
    let shipped = FOLDER.get().cloned().or_else(beside);
    match shipped.map(|folder| folder.join(path)) {
        Some(shipped) if path.starts_with("scenarios") && shipped.is_file() => Cow::Owned(shipped),
        _ => Cow::Borrowed(path),
    }
}
