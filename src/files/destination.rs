//! Where an output goes: a regular file that is replaced as a whole, or something else that is
//! written into.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

/// So many links may lead to one another.
const LINKS: usize = 40;
/// The write permissions of a mode.
const WRITABLE: u32 = 0o222;

/// Where an output goes.
#[derive(Debug)]
pub(super) enum Destination {
    /// A regular file, there or not: it is replaced as a whole.
    Regular {
        /// The file itself, with no link left to follow.
        file: PathBuf,
        /// What is there.
        old: Option<Metadata>,
    },
    /// A device or a FIFO, or what stdout and stderr go to: it is written into.
    Stream(PathBuf, Metadata),
}

impl Destination {
    /// Follows links. A link to nothing leads to what is to be made.
    pub fn of(path: &Path) -> Result<Self, Error> {
        if path.as_os_str().is_empty() {
            return Err(Error::new(ErrorKind::InvalidInput, "the name is empty"));
        }
        match path.metadata() {
            Ok(found) if found.is_dir() => Err(ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() || is_standard(&found) => {
                Ok(Self::Stream(path.to_owned(), found))
            }
            Ok(found) => Ok(Self::Regular {
                file: path.canonicalize()?,
                old: Some(found),
            }),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let file = end_of_links(path)?;
                // "folder/" names a folder although there is none.
                if file.as_os_str().as_encoded_bytes().ends_with(b"/") || file.file_name().is_none()
                {
                    return Err(ErrorKind::IsADirectory.into());
                }
                Ok(Self::Regular { file, old: None })
            }
            Err(error) => Err(error),
        }
    }

    /// Whether it may be written, as far as can be told before.
    pub fn check(&self) -> Result<(), Error> {
        match self {
            Self::Regular { old: None, .. } => Ok(()),
            Self::Regular {
                file,
                old: Some(old),
            } => {
                // The superuser may write what is marked as not to be written.
                if old.mode() & WRITABLE == 0 {
                    return Err(Error::new(ErrorKind::ReadOnlyFilesystem, READ_ONLY));
                }
                OpenOptions::new().write(true).open(file).map(drop)
            }
            // A FIFO that nobody reads would not open before somebody does.
            Self::Stream(_, found) if found.file_type().is_fifo() || is_standard(found) => Ok(()),
            Self::Stream(path, _) => OpenOptions::new().write(true).open(path).map(drop),
        }
    }
}

/// What is said of a file without any permission to write.
pub(super) const READ_ONLY: &str = "the file is read-only";

/// Writes into what is no regular file.
pub(super) fn write_stream(path: &Path, found: &Metadata, content: &[u8]) -> Result<(), Error> {
    if !is_standard(found) {
        let mut stream = OpenOptions::new().write(true).open(path)?;
        return stream.write_all(content);
    }
    if identity_of(std::io::stdout()) != Some(identity(found)) {
        return std::io::stderr().write_all(content);
    }
    let mut stdout = std::io::stdout().lock();
    let written = stdout.write_all(content).and_then(|()| stdout.flush());
    // A reader of stdout that has seen enough is no error.
    written.or_else(|error| match error.kind() {
        ErrorKind::BrokenPipe => Ok(()),
        _ => Err(error),
    })
}

/// Device and number: what two names for one file have in common.
pub(super) fn identity(found: &Metadata) -> [u64; 2] {
    [found.dev(), found.ino()]
}

/// Whether it is what stdout or stderr goes to. Replacing such a file would take it from under them.
fn is_standard(found: &Metadata) -> bool {
    let found = Some(identity(found));
    identity_of(std::io::stdout()) == found || identity_of(std::io::stderr()) == found
}

fn identity_of(stream: impl AsFd) -> Option<[u64; 2]> {
    let copy = stream.as_fd().try_clone_to_owned().ok()?;
    File::from(copy).metadata().ok().as_ref().map(identity)
}

/// Where links lead, although nothing is there.
pub(super) fn end_of_links(path: &Path) -> Result<PathBuf, Error> {
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        let Ok(target) = std::fs::read_link(&path) else {
            return Ok(path);
        };
        path = match path.parent() {
            Some(folder) => folder.join(target),
            None => target,
        };
    }
    Err(Error::other("too many links lead to one another"))
}
