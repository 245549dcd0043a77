//! MuJoCo's own messages go to stderr; by itself it would write them to a file in the working folder.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use mujoco_rs::logging::set_log_handler;
use mujoco_rs::wrappers::mj_logging::{MjLogMessage, MjtLogLevel};

static WARNINGS: AtomicBool = AtomicBool::new(true);

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

fn print(message: &MjLogMessage) {
    let level = message.level();
    let word = match level {
        MjtLogLevel::mjLOG_ERROR => "error",
        MjtLogLevel::mjLOG_WARNING if WARNINGS.load(Ordering::Relaxed) => "warning",
        _ => return,
    };
    eprintln!("{word}: MuJoCo: {}", message.subject().trim());
}
