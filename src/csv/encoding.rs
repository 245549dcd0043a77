//! From bytes to lines of text.

use std::path::Path;

use super::wrong_table;
use crate::files::{FileError, read_bytes, utf8};

/// How files of spreadsheet programs begin: of today's and of old ones.
const SPREADSHEETS: [&[u8]; 2] = [b"PK\x03\x04", b"\xD0\xCF\x11\xE0"];

/// Reads a text file in UTF-8, or in UTF-16 where it begins with a byte order mark. Every line then ends with a line feed.
///
/// # Errors
/// The file cannot be read, or is in neither encoding.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let bytes = read_bytes(path)?;
    if SPREADSHEETS.iter().any(|begins| bytes.starts_with(begins)) {
        return Err(wrong_table(path, "is a spreadsheet and no text").hint("export it as CSV"));
    }
    let text = match bytes.as_slice() {
        [0xFF, 0xFE, rest @ ..] => utf16(path, rest, u16::from_le_bytes)?,
        [0xFE, 0xFF, rest @ ..] => utf16(path, rest, u16::from_be_bytes)?,
        _ => utf8(path, bytes)?,
    };
    if text.contains('\0') {
        return Err(other(
            path,
            "is neither UTF-8 text nor UTF-16 with a byte order mark",
        ));
    }
    // A carriage return alone ends lines in files of old Macintoshes.
    Ok(if text.contains('\r') {
        text.replace("\r\n", "\n").replace('\r', "\n")
    } else {
        text
    })
}

fn utf16(path: &Path, bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, FileError> {
    let (pairs, rest) = bytes.as_chunks();
    let units: Vec<u16> = pairs.iter().map(|&pair| unit(pair)).collect();
    let text = String::from_utf16(&units).ok().filter(|_| rest.is_empty());
    text.ok_or_else(|| other(path, "is not whole UTF-16 text, with which it begins"))
}

fn other(path: &Path, problem: &str) -> FileError {
    wrong_table(path, problem).hint("save the file as UTF-8")
}
