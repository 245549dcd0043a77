//! Compiled models that took long are kept for the next command, as MuJoCo's binary files in the user's cache folder, by a hash of
//! all that they are made of.

use std::fs::{self, DirEntry};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use mujoco_rs::prelude::MjModel;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Additions, sources};
use crate::files::output::write_whole;
use crate::files::{hexadecimal, make_folder, sha256_of};

/// Names another folder than the user's cache; empty for none.
const FOLDER: &str = "ELASTOCAL_CACHE";
/// Models that compile faster are not kept.
pub(super) const LONG: Duration = Duration::from_millis(300);
/// How large all that are kept may be (bytes); the latest one may be larger.
const MOST: u64 = 1 << 30;
const ENDING: &str = "mjb";

/// Where a compiled model is kept.
pub(super) struct KeptModel {
    binary: PathBuf,
    about: PathBuf,
}

/// What stands beside it; it is written last.
#[derive(Serialize, Deserialize)]
struct About {
    length: usize,
    left_out: Vec<String>,
}

impl KeptModel {
    /// Of a file with additions; `None` where there is no folder, or a file that the model is made of cannot be read.
    pub fn of(path: &Path, additions: &Additions) -> Option<Self> {
        let folder = folder()?;
        let made_by = (crate::VERSION, crate::COMMIT, path, additions);
        let mut hash = Sha256::new_with_prefix(format!("{made_by:?}"));
        for source in sources(path).ok()? {
            hash.update(sha256_of(&source).ok()?);
        }
        let place = folder.join(hexadecimal(&hash.finalize()));
        Some(Self {
            binary: place.with_extension(ENDING),
            about: place.with_extension("json"),
        })
    }

    /// The model, and what was left out of its file, in words; `None` where it is not there whole.
    pub fn read(&self) -> Option<(MjModel, Vec<String>)> {
        let about: About = serde_json::from_slice(&fs::read(&self.about).ok()?).ok()?;
        let bytes = fs::read(&self.binary).ok()?;
        let is_whole = bytes.len() == about.length;
        let model = is_whole.then(|| MjModel::from_buffer(&bytes).ok())?;
        Some((model?, about.left_out))
    }

    /// Keeps a model; where it cannot be written, the next command compiles it again.
    pub fn write(&self, model: &MjModel, left_out: &[String]) {
        let mut bytes = vec![0; model.size()];
        let about = About {
            length: bytes.len(),
            left_out: left_out.to_vec(),
        };
        let (Ok(()), Ok(about)) = (model.save_to_buffer(&mut bytes), serde_json::to_vec(&about))
        else {
            return;
        };
        let is_kept = (self.binary.parent()).is_some_and(|folder| make_folder(folder).is_ok())
            && write_whole(&self.binary, &bytes).is_ok()
            && write_whole(&self.about, &about).is_ok();
        if is_kept {
            self.forget_oldest();
        }
    }

    /// Removes the oldest models beyond what is kept.
    fn forget_oldest(&self) {
        let Some(Ok(entries)) = self.binary.parent().map(fs::read_dir) else {
            return;
        };
        let model = |entry: DirEntry| {
            let about = entry.metadata().ok()?;
            let is_one = entry.path().extension().is_some_and(|end| end == ENDING);
            is_one.then(|| Some((about.modified().ok()?, about.len(), entry.path())))?
        };
        let mut models: Vec<(SystemTime, u64, PathBuf)> =
            entries.flatten().filter_map(model).collect();
        models.sort();
        let mut length = 0;
        for (_, own, path) in models.iter().rev() {
            length += own;
            if length > MOST && *path != self.binary {
                // What another command has removed meanwhile is gone all the same.
                let _ = fs::remove_file(path.with_extension("json"));
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// The folder of compiled models.
fn folder() -> Option<PathBuf> {
    let named = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let cache = match named(FOLDER) {
        Some(folder) if folder.as_os_str().is_empty() => return None,
        Some(folder) => return Some(folder),
        None => named("XDG_CACHE_HOME").or_else(|| Some(named("HOME")?.join(".cache")))?,
    };
    cache.is_absolute().then(|| cache.join("elastocal/models"))
}
