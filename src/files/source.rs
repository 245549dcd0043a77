//! What is read: regular files, and a shell's pipes, up to a size that no text has.

use std::fs::{File, Metadata};
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use crate::quantities::limits::LARGEST_TEXT;

/// Where the pipes of a shell are: `/dev/stdin`, `/dev/fd/63`, `/proc/self/fd/0`.
const PIPES: [&str; 2] = ["/dev", "/proc"];

/// Reads a regular file, or a pipe of a shell to its end.
///
/// # Errors
/// What is wrong, in words: it is missing, a folder, a device or a socket, or too large.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let cannot = |error: std::io::Error| format!("cannot be read: {error}");
    let metadata = std::fs::metadata(path).map_err(cannot)?;
    let is_of_shell = PIPES.iter().any(|folder| path.starts_with(folder));
    if let Some(problem) =
        unreadable(&metadata).filter(|_| !(is_of_shell && metadata.file_type().is_fifo()))
    {
        return Err(problem.to_owned());
    }
    // What the system says of the size may be too little, as for the files in /proc.
    let mut bytes = Vec::new();
    if metadata.len() <= LARGEST_TEXT {
        let file = File::open(path).map_err(cannot)?;
        let mut limited = file.take(LARGEST_TEXT + 1);
        limited.read_to_end(&mut bytes).map_err(cannot)?;
    }
    if metadata.len().max(bytes.len() as u64) > LARGEST_TEXT {
        let limit = LARGEST_TEXT >> 20;
        return Err(format!("is too large: at most {limit} MiB are allowed"));
    }
    Ok(bytes)
}

/// Why something other than a regular file is not read.
pub(crate) fn unreadable(metadata: &Metadata) -> Option<&'static str> {
    let kind = metadata.file_type();
    if kind.is_dir() {
        Some("is a folder; a file is needed")
    } else if kind.is_char_device() || kind.is_block_device() {
        Some("is a device; a file is needed")
    } else if kind.is_fifo() {
        Some("is a pipe; a file is needed")
    } else {
        kind.is_socket().then_some("is a socket; a file is needed")
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
