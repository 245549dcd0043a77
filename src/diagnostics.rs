//! What is said to people on stderr while something is done.

use std::io::Write;

/// Says a line on stderr. Where nobody listens, or the disk that it goes to is full, the work goes on
/// all the same.
pub fn say(line: &str) {
    let _ = std::io::stderr().write_all(format!("{line}\n").as_bytes());
}
