//! The only way in which results get into files.
//!
//! A regular file is replaced as a whole when all is written, or stays as it was: what is unfinished
//! has another name beside it. Links are followed, a file that is there keeps its mode, and one that
//! is read-only is refused. What is no regular file, such as a device or a FIFO, is written into.

use std::fs::File;
use std::io::{Error, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::destination::{Destination, READ_ONLY, write_stream};
use super::temporary::Temporary;
use super::{FileError, folder_of};
use crate::codes::ErrorCode;

pub use super::temporary::abandon_unfinished;

/// A file that is being written. Without [`Output::publish`] nothing of it stays.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    destination: Destination,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// It takes the place of the file.
    Beside(Temporary),
    /// It has no name, and is copied to where it belongs.
    Apart(File),
}

impl Output {
    /// Begins a file.
    ///
    /// # Errors
    /// The folder does not exist or cannot be written, or the path is a folder.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let begin = || {
            let destination = Destination::of(path)?;
            let content = match &destination {
                Destination::Regular { file, .. } => {
                    Content::Beside(Temporary::new_in(folder_of(file))?)
                }
                Destination::Stream(..) => Content::Apart(tempfile::tempfile()?),
            };
            Ok((destination, content))
        };
        let (destination, content) = begin().map_err(|error| cannot_write(path, &error))?;
        Ok(Self {
            path: path.to_owned(),
            destination,
            content,
        })
    }

    /// The file to write to, in which one may go back and forth.
    pub fn file(&mut self) -> &mut File {
        match &mut self.content {
            Content::Beside(temporary) => temporary.file(),
            Content::Apart(file) => file,
        }
    }

    /// What is wrong with writing the file.
    pub fn error(&self, error: &Error) -> FileError {
        cannot_write(&self.path, error)
    }

    /// Puts the finished file where it belongs.
    pub fn publish(self) -> Result<(), FileError> {
        let published = match (self.content, &self.destination) {
            (Content::Beside(temporary), Destination::Regular { file, old }) => {
                temporary.publish(file, old.as_ref())
            }
            (Content::Apart(mut file), Destination::Stream(path, found)) => {
                let mut content = Vec::new();
                file.rewind()
                    .and_then(|()| file.read_to_end(&mut content))
                    .and_then(|_| write_stream(path, found, &content))
            }
            _ => Ok(()),
        };
        published.map_err(|error| cannot_write(&self.path, &error))
    }
}

/// Writes a whole file or nothing.
///
/// # Errors
/// The folder does not exist or cannot be written, the disk is full, or the path is a folder.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), FileError> {
    let mut output = Output::create(path)?;
    let written = output.file().write_all(content);
    written.map_err(|error| output.error(&error))?;
    output.publish()
}

/// Finds out before the work is done whether its result can be written.
///
/// # Errors
/// The folder does not exist or cannot be written, the file is read-only, or the path is a folder.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    Destination::of(path)
        .and_then(|destination| {
            destination.check()?;
            match &destination {
                Destination::Regular { file, .. } => Temporary::new_in(folder_of(file)).map(drop),
                Destination::Stream(..) => Ok(()),
            }
        })
        .map_err(|error| cannot_write(path, &error))
}

fn cannot_write(path: &Path, error: &Error) -> FileError {
    // The temporary file, which is named behind what the system says, is nothing to users.
    let text = error.to_string();
    let cause = text.split(" at path ").next().unwrap_or_default();
    let wrong = FileError::new(path, format!("cannot be written: {cause}"));
    wrong.code(ErrorCode::NotWritable).hint(match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "make room, or give another place with --out or the option that names the file"
        }
        ErrorKind::FileTooLarge => "raise the limit on the size of files (ulimit -f)",
        _ if cause == READ_ONLY => "give another file, or make it writable (chmod u+w)",
        _ => "give a place where you may write, with --out or the option that names the file",
    })
}
