//! What is said to people on stderr while something is done.

use std::io::Write;

use crate::text::plain;

/// Says a line on stderr. Where nobody listens, or the disk that it goes to is full, the work goes on
/// all the same. What would not be seen on a terminal is escaped.
pub fn say(line: &str) {
    let _ = std::io::stderr().write_all(format!("{}\n", plain(line)).as_bytes());
}
