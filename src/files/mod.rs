//! Reading and writing whole files: one clear error for a wrong input, and never half an output.
//!
//! - [`output`]: the only way in which results get into files.
//! - [`roles`]: what a command reads and what it writes; no output overwrites an input.
//! - [`schema`]: which JSON files of its own this program reads.
//! - [`shipped`]: the scenarios that are installed with the program.
//! - [`source`]: what is read, up to a size that no text has.
//! - [`typed`]: what texts say, as types.
//! - `unique_keys`: JSON in which no key comes twice.
//! - `destination`: where an output goes: links, devices, a file's mode.
//! - `temporary`: unfinished files, and how none is left when the program is ended.

mod destination;
pub mod output;
pub mod roles;
pub mod schema;
pub mod shipped;
pub mod source;
mod temporary;
pub mod typed;
mod unique_keys;
mod way;

pub use way::{absolute, way};

use std::path::{Component, Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::codes::ErrorCode;
use crate::text::wording::shortened;

/// What files say may have any length: of a longer problem the middle is left out (characters).
const LONGEST_PROBLEM: usize = 2000;

/// What is wrong with an input file, or with writing an output file.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{}{}: {problem}", file.display(), place.as_ref().map_or_else(String::new, |place| format!(": {place}")))]
pub struct FileError {
    /// The file.
    pub file: PathBuf,
    /// The key ("robot.model") or line ("line 3") where it is.
    pub place: Option<String>,
    /// What was found and what is allowed.
    pub problem: String,
    /// What to do about it.
    pub hint: Option<String>,
    /// Its kind; [`ErrorCode::Content`] where nothing better is known.
    pub code: ErrorCode,
}

impl FileError {
    /// A problem with the file as a whole.
    pub fn new(file: &Path, problem: impl Into<String>) -> Self {
        Self {
            file: file.to_owned(),
            place: None,
            problem: shortened(&problem.into(), LONGEST_PROBLEM),
            hint: None,
            code: ErrorCode::Content,
        }
    }

    /// Says of which kind it is.
    pub fn code(self, code: ErrorCode) -> Self {
        Self { code, ..self }
    }

    /// The same where its origin does not say it.
    pub fn or_code(self, code: ErrorCode) -> Self {
        match self.code {
            ErrorCode::Content => self.code(code),
            _ => self,
        }
    }

    /// Adds the key or line.
    pub fn at(mut self, place: impl Into<String>) -> Self {
        self.place = Some(shortened(&place.into(), LONGEST_PROBLEM));
        self
    }

    /// Adds a hint, where there is one.
    pub fn hinted(self, hint: Option<impl Into<String>>) -> Self {
        match hint {
            Some(hint) => self.hint(hint),
            None => self,
        }
    }

    /// Adds a hint.
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(shortened(&hint.into(), LONGEST_PROBLEM));
        self
    }
}

/// Reads a text file.
///
/// # Errors
/// It is missing, neither a file nor a shell's pipe, not readable, too large, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    utf8(path, read_bytes(path)?)
}

/// Reads a file.
///
/// # Errors
/// It is missing, neither a file nor a shell's pipe, not readable or too large.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    source::read(path).map_err(|problem| FileError::new(path, problem).code(ErrorCode::Unreadable))
}

/// The text of a file's bytes, without a byte order mark.
pub fn utf8(path: &Path, mut bytes: Vec<u8>) -> Result<String, FileError> {
    if bytes.starts_with(b"\xEF\xBB\xBF") {
        bytes.drain(..3);
    }
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + valid.split(|&byte| byte == b'\n').skip(1).count();
        FileError::new(path, "is not UTF-8 text")
            .at(format!("line {line}"))
            .hint("save the file as UTF-8")
            .code(ErrorCode::NotText)
    })
}

/// Makes a folder with its parents.
///
/// # Errors
/// It cannot be made, or a file is in its place.
pub fn make_folder(path: &Path) -> Result<(), FileError> {
    std::fs::create_dir_all(path).map_err(|error| {
        FileError::new(path, format!("cannot be made a folder: {error}"))
            .hint("give a place where you may write with --out")
            .code(ErrorCode::NotWritable)
    })
}

/// The SHA-256 of a file's bytes.
pub fn sha256_of(path: &Path) -> Result<[u8; 32], FileError> {
    let bytes = std::fs::read(path).map_err(|error| {
        FileError::new(path, format!("cannot be read: {error}")).code(ErrorCode::Unreadable)
    })?;
    Ok(Sha256::digest(bytes).into())
}

/// Whether a text may name a file or a folder inside another: no path, nothing that has a meaning of
/// its own, no control characters.
pub fn is_plain_name(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == name)
        && !name.contains('\\')
        && !name.chars().any(char::is_control)
}

/// Bytes, such as a hash's, in hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = std::fmt::Write::write_fmt(&mut text, format_args!("{byte:02x}"));
        text
    })
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
