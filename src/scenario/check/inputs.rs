//! What a scenario is made of, for its hash and so that no result overwrites it.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::files::{FileError, hexadecimal, sha256_of};

/// The files that a scenario names, and those that these name, with their hashes, each once and in the
/// order in which they were read.
#[derive(Debug, Default)]
pub(super) struct Inputs {
    files: Vec<(PathBuf, [u8; 32])>,
}

impl Inputs {
    /// Adds a file.
    pub fn add(&mut self, path: &Path) -> Result<(), FileError> {
        if self.files.iter().any(|(known, _)| known == path) {
            return Ok(());
        }
        self.files.push((path.to_owned(), sha256_of(path)?));
        Ok(())
    }

    /// The files.
    pub fn files(&self) -> Vec<PathBuf> {
        self.files.iter().map(|(path, _)| path.clone()).collect()
    }

    /// The hash of all files' bytes and of the rest that results depend on, in hexadecimal. Where the
    /// files are does not matter.
    pub fn sha256(&self, rest: &str) -> String {
        let mut hash = Sha256::new_with_prefix(Sha256::digest(rest));
        for (_, file) in &self.files {
            hash.update(file);
        }
        hexadecimal(&hash.finalize())
    }
}
