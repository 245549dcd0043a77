//! Where an output goes: a regular file that is replaced as a whole, or something else that is
//! written into.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{Error, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// So many links may lead to one another.
const LINKS: usize = 40;
/// How long a FIFO's reader may take to come.
const READER: Duration = Duration::from_secs(1);
/// How often a FIFO is looked at.
const GLANCE: Duration = Duration::from_millis(10);
/// The write permissions of a mode.
const WRITABLE: u32 = 0o222;

/// FIFOs that were opened before the work; who reads them would take a closed one for the end.
static OPENED: Mutex<Vec<([u64; 2], File)>> = Mutex::new(Vec::new());

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
    /// A device, a FIFO or a socket, or what stdout and stderr go to: it is written into.
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
            Self::Stream(path, found) if found.file_type().is_fifo() => {
                let fifo = open_stream(path, found)?;
                if let (Some(fifo), Ok(mut opened)) = (fifo, OPENED.lock()) {
                    opened.push((identity(found), fifo));
                }
                Ok(())
            }
            Self::Stream(path, found) => open_stream(path, found).map(drop),
        }
    }
}

/// What is said of a file without any permission to write.
pub(super) const READ_ONLY: &str = "the file is read-only";

/// Writes into what is no regular file.
pub(super) fn write_stream(path: &Path, found: &Metadata, content: &[u8]) -> Result<(), Error> {
    if found.file_type().is_socket() && !is_standard(found) {
        return UnixStream::connect(path)?.write_all(content);
    }
    match open_stream(path, found)? {
        Some(mut stream) => write_patiently(&mut stream, content),
        None if identity_of(std::io::stdout()) != Some(identity(found)) => {
            std::io::stderr().write_all(content)
        }
        None => {
            let mut stdout = std::io::stdout().lock();
            let written = stdout.write_all(content).and_then(|()| stdout.flush());
            // A reader of stdout that has seen enough is no error.
            written.or_else(|error| match error.kind() {
                ErrorKind::BrokenPipe => Ok(()),
                _ => Err(error),
            })
        }
    }
}

/// Opens a device or FIFO; `None` is stdout or stderr, which are open.
fn open_stream(path: &Path, found: &Metadata) -> Result<Option<File>, Error> {
    if is_standard(found) {
        return Ok(None);
    }
    if found.file_type().is_socket() {
        return UnixStream::connect(path).map(|_| None);
    }
    if let Ok(mut opened) = OPENED.lock()
        && let Some(index) = (opened.iter()).position(|(known, _)| *known == identity(found))
    {
        return Ok(Some(opened.swap_remove(index).1));
    }
    let start = Instant::now();
    loop {
        // A FIFO that nobody reads would not open before somebody does.
        let stream = OpenOptions::new()
            .write(true)
            .custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY)
            .open(path);
        match stream {
            Err(error) if error.raw_os_error() == Some(libc::ENXIO) => {
                if !found.file_type().is_fifo() {
                    return Err(error);
                }
                if start.elapsed() > READER {
                    return Err(Error::new(
                        ErrorKind::NotConnected,
                        "nobody reads this FIFO",
                    ));
                }
                std::thread::sleep(GLANCE);
            }
            other => return other.map(Some),
        }
    }
}

/// Writes all to a stream that may not take it at once.
fn write_patiently(stream: &mut File, mut content: &[u8]) -> Result<(), Error> {
    while !content.is_empty() {
        match stream.write(content) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => content = &content[count..],
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(GLANCE),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
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
