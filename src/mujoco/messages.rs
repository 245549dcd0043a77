//! MuJoCo's own messages: warnings go to stderr (by itself it would write them to a file in the working
//! folder), and what it says of a model that it refuses is kept whole.

use std::ffi::{CStr, CString, c_char, c_int};
use std::path::Path;
use std::ptr::null;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use mujoco_rs::logging::set_log_handler;
use mujoco_rs::mujoco_c::{mj_deleteModel, mj_loadXML};
use mujoco_rs::wrappers::mj_logging::{MjLogMessage, MjtLogLevel};

use crate::text::diagnostics::say;

static WARNINGS: AtomicBool = AtomicBool::new(true);
static COUNT: AtomicUsize = AtomicUsize::new(0);

/// Whether MuJoCo's warnings are printed on stderr; they are if this is never called. Its errors
/// always are: they end the program.
pub fn print_warnings(print: bool) {
    WARNINGS.store(print, Ordering::Relaxed);
}

/// Takes MuJoCo's messages over. Every use of MuJoCo begins with a model, whose loading calls this.
pub(super) fn take_over() {
    static ONCE: Once = Once::new();
    // SAFETY: other threads that load a first model wait here, and none has one yet.
    #[expect(unsafe_code, reason = "the wrapper has no safe setter")]
    ONCE.call_once(|| unsafe { set_log_handler(print) });
}

/// How many warnings there were, whether they were printed or not.
pub(super) fn warnings() -> usize {
    COUNT.load(Ordering::Relaxed)
}

fn print(message: &MjLogMessage) {
    let level = message.level();
    if level == MjtLogLevel::mjLOG_WARNING {
        COUNT.fetch_add(1, Ordering::Relaxed);
    }
    let word = match level {
        MjtLogLevel::mjLOG_ERROR => "error",
        MjtLogLevel::mjLOG_WARNING if WARNINGS.load(Ordering::Relaxed) => "warning",
        _ => return,
    };
    let body = message.body().unwrap_or_default();
    say(&format!(
        "{word}: MuJoCo: {}",
        one_line(&[message.subject(), body])
    ));
}

/// What MuJoCo says of a file that it refuses, whole; the wrapper keeps 99 characters of it.
pub(super) fn refusal(path: &Path, shortened: &str) -> String {
    const ROOM: usize = 8192;
    let mut buffer: [c_char; ROOM] = [0; ROOM];
    let name = path.to_str().and_then(|name| CString::new(name).ok());
    if let (Some(name), Ok(room)) = (name, c_int::try_from(ROOM)) {
        // SAFETY: the name ends in a zero, the room is the buffer's, no virtual file system is given,
        // and a model that is loaded after all is freed.
        #[expect(unsafe_code, reason = "the wrapper has no room for the message")]
        let model = unsafe { mj_loadXML(name.as_ptr(), null(), buffer.as_mut_ptr(), room) };
        if model.is_null() {
            // SAFETY: MuJoCo ends the text in the buffer with a zero.
            #[expect(unsafe_code, reason = "as above")]
            let message = unsafe { CStr::from_ptr(buffer.as_ptr()) }.to_string_lossy();
            if !message.trim().is_empty() {
                return one_line(&[&message]);
            }
        } else {
            // SAFETY: it was made above, and nothing else has it.
            #[expect(unsafe_code, reason = "as above")]
            unsafe {
                mj_deleteModel(model);
            }
        }
    }
    one_line(&[shortened])
}

/// Several lines as one.
pub(super) fn one_line(parts: &[&str]) -> String {
    let lines = parts.iter().flat_map(|part| part.lines()).map(str::trim);
    lines
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join("; ")
}
