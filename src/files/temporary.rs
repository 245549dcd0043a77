//! Unfinished files, of which none is left when the program is ended.

use std::fs::{File, Metadata, Permissions};
use std::io::Error;
use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, TempPath};

/// The mode of a new file, of which the umask takes its part.
const NEW: u32 = 0o666;

/// What must not be left, and what is finished.
static FILES: Mutex<Files> = Mutex::new(Files {
    unfinished: Vec::new(),
    finished: Vec::new(),
});

struct Files {
    unfinished: Vec<PathBuf>,
    finished: Vec<PathBuf>,
}

fn files() -> MutexGuard<'static, Files> {
    FILES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that has a name of its own until it is finished, in the folder where it is to be.
#[derive(Debug)]
pub(super) struct Temporary {
    file: File,
    path: Option<TempPath>,
}

impl Temporary {
    /// Makes it in a folder.
    pub fn new_in(folder: &Path) -> Result<Self, Error> {
        // Nobody may end the program between these two.
        let mut files = files();
        let made = Builder::new()
            .permissions(Permissions::from_mode(NEW))
            .tempfile_in(folder)?;
        let (file, path) = made.into_parts();
        files.unfinished.push(path.to_path_buf());
        Ok(Self {
            file,
            path: Some(path),
        })
    }

    /// The file, to write to.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Puts it in the place of a file, whose mode and owner it takes over.
    pub fn publish(mut self, place: &Path, old: Option<&Metadata>) -> Result<(), Error> {
        if let Some(old) = old {
            let own = self.file.metadata()?;
            if (own.uid(), own.gid()) != (old.uid(), old.gid()) {
                // Who may not give files away keeps them.
                let _ = fchown(&self.file, Some(old.uid()), Some(old.gid()));
            }
            let mode = Permissions::from_mode(old.mode() & 0o7777);
            self.file.set_permissions(mode)?;
        }
        let Some(path) = self.path.take() else {
            return Ok(());
        };
        let mut files = files();
        let known = path.to_path_buf();
        let published = path.persist(place).map_err(|error| {
            // The file goes with the error, while nobody can end the program.
            let cause = Error::new(error.error.kind(), error.error.to_string());
            drop(error);
            cause
        });
        files.unfinished.retain(|each| *each != known);
        published?;
        if !files.finished.iter().any(|each| each == place) {
            files.finished.push(place.to_owned());
        }
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = self.path.take() {
            let mut files = files();
            let known = path.to_path_buf();
            drop(path);
            files.unfinished.retain(|each| *each != known);
        }
    }
}

/// Removes all unfinished files, and keeps others from being made or finished: the program is about
/// to end. Returns the files that were finished.
pub fn abandon_unfinished() -> Vec<PathBuf> {
    let mut files = files();
    for path in files.unfinished.drain(..) {
        // What cannot be removed stays.
        let _ = std::fs::remove_file(path);
    }
    let finished = std::mem::take(&mut files.finished);
    std::mem::forget(files);
    finished
}
