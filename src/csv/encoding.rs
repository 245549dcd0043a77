//! From bytes to lines of text.

use std::path::Path;

use super::wrong_table;
use crate::files::{FileError, read_bytes, utf8};

/// Reads a text file in UTF-8 or UTF-16, as its byte order mark says or, where UTF-16 has none, the
/// zeros of its first signs. Every line then ends with a line feed.
///
/// # Errors
/// The file cannot be read, or is in neither encoding.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let text = decode(path, read_bytes(path)?)?;
    // A carriage return alone ends lines in files of old Macintoshes.
    Ok(if text.contains('\r') {
        text.replace("\r\n", "\n").replace('\r', "\n")
    } else {
        text
    })
}

fn decode(path: &Path, bytes: Vec<u8>) -> Result<String, FileError> {
    match bytes.as_slice() {
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(path, rest.to_vec()),
        [0xFF, 0xFE, 0, 0, ..] | [0, 0, 0xFE, 0xFF, ..] => Err(wrong_table(
            path,
            "is UTF-32 text; UTF-8 and UTF-16 are read",
        )
        .hint("save the file as UTF-8")),
        [0xFF, 0xFE, rest @ ..] => utf16(path, rest, u16::from_le_bytes),
        [0xFE, 0xFF, rest @ ..] => utf16(path, rest, u16::from_be_bytes),
        [1..=u8::MAX, 0, 1..=u8::MAX, 0, ..] => utf16(path, &bytes, u16::from_le_bytes),
        [0, 1..=u8::MAX, 0, 1..=u8::MAX, ..] => utf16(path, &bytes, u16::from_be_bytes),
        _ => utf8(path, bytes),
    }
}

fn utf16(path: &Path, bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, FileError> {
    let (pairs, rest) = bytes.as_chunks();
    let mut text = String::with_capacity(pairs.len());
    for sign in char::decode_utf16(pairs.iter().map(|&pair| unit(pair))) {
        let Ok(sign) = sign else {
            return Err(broken(path, &text));
        };
        text.push(sign);
    }
    if rest.is_empty() {
        Ok(text)
    } else {
        Err(broken(path, &text))
    }
}

fn broken(path: &Path, before: &str) -> FileError {
    let line = 1 + before.matches('\n').count();
    wrong_table(path, "is not whole UTF-16 text, with which it begins")
        .at(format!("line {line}"))
        .hint("save the file as UTF-8")
}
