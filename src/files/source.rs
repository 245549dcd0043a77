//! What is read: regular files and pipes that hold something, up to a size that no text has.

use std::fs::{File, Metadata, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::quantities::limits::LARGEST_TEXT;

/// A pipe that nothing has come through for so long is given up.
const PATIENCE: Duration = Duration::from_secs(10);
/// So long a pipe may be without a writer before the first byte.
const FIRST_WRITER: Duration = Duration::from_secs(2);

/// Reads a regular file, or a pipe to its end.
///
/// # Errors
/// What is wrong, in words: it is missing, a folder, a device or a socket, too large, or a pipe that
/// nothing comes through.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let cannot = |error: std::io::Error| format!("cannot be read: {error}");
    let metadata = std::fs::metadata(path).map_err(cannot)?;
    if let Some(problem) = unreadable(&metadata) {
        return Err(problem.to_owned());
    }
    if metadata.is_file() {
        // What the system says of the size may be too little, as for the files in /proc.
        let too_large = metadata.len() > LARGEST_TEXT;
        let mut bytes = Vec::new();
        if !too_large {
            let file = File::open(path).map_err(cannot)?;
            let mut limited = file.take(LARGEST_TEXT + 1);
            limited.read_to_end(&mut bytes).map_err(cannot)?;
        }
        return within_limit(too_large, bytes);
    }
    read_pipe(&mut open_pipe(path).map_err(cannot)?)
}

/// Why something other than a regular file or a pipe is not read.
pub(crate) fn unreadable(metadata: &Metadata) -> Option<&'static str> {
    if metadata.is_dir() {
        return Some("is a folder; a file is needed");
    }
    let kind = metadata.file_type();
    if kind.is_char_device() || kind.is_block_device() {
        return Some("is a device; a file is needed");
    }
    kind.is_socket().then_some("is a socket; a file is needed")
}

fn within_limit(too_large: bool, bytes: Vec<u8>) -> Result<Vec<u8>, String> {
    if too_large || bytes.len() as u64 > LARGEST_TEXT {
        let limit = LARGEST_TEXT >> 20;
        Err(format!("is too large: at most {limit} MiB are allowed"))
    } else {
        Ok(bytes)
    }
}

/// Opens without waiting for a writer.
fn open_pipe(path: &Path) -> std::io::Result<File> {
    let mut options = OpenOptions::new();
    options.custom_flags(libc::O_NONBLOCK).read(true).open(path)
}

fn read_pipe(pipe: &mut File) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut buffer = [0; 1 << 13];
    let opened = Instant::now();
    let mut last = Instant::now();
    loop {
        match pipe.read(&mut buffer) {
            // Without a writer a pipe is at its end, before the first as after the last.
            Ok(0) if bytes.is_empty() && opened.elapsed() < FIRST_WRITER => {}
            Ok(0) if bytes.is_empty() => {
                return Err("is a pipe that nothing was written to".to_owned());
            }
            Ok(0) => return Ok(bytes),
            Ok(count) => {
                bytes.extend_from_slice(&buffer[..count]);
                if bytes.len() as u64 > LARGEST_TEXT {
                    return within_limit(true, bytes);
                }
                last = Instant::now();
                continue;
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                if last.elapsed() > PATIENCE {
                    let waited = PATIENCE.as_secs();
                    return Err(format!(
                        "is a pipe that nothing came through for {waited} s"
                    ));
                }
            }
            Err(error) => return Err(format!("cannot be read: {error}")),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_not_read() {
        for device in ["/dev/zero", "/dev/random", "/dev/null"] {
            let problem = read(Path::new(device)).expect_err("has no end");
            assert_eq!(problem, "is a device; a file is needed");
        }
    }

    #[test]
    fn what_the_system_makes_up_is_read() {
        let bytes = read(Path::new("/proc/self/status")).expect("is a file");
        assert!(bytes.starts_with(b"Name:"));
    }
}
