//! Progress bars on stderr.

use std::sync::{Mutex, PoisonError};

use crate::plan::search::Watch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::Common;
use super::interruption::{ask_search, searched};

/// What was said last and the bar that was made since, for who calls commands as functions and shows progress otherwise.
pub static LATEST: Mutex<(String, Option<ProgressBar>)> = Mutex::new((String::new(), None));

/// Notes what is done now.
pub fn note(what: &str, bar: Option<&ProgressBar>) {
    let mut latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    *latest = (what.to_owned(), bar.cloned());
}

/// Shows on a bar how much of all is done.
pub fn show(bar: &ProgressBar, done: usize, all: usize) {
    bar.set_length(all as u64);
    bar.set_position(done as u64);
}

/// A bar of known length; shown on a terminal only.
pub fn bar(quiet: bool, what: &str) -> ProgressBar {
    let target = if quiet {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    };
    let bar = ProgressBar::with_draw_target(None, target);
    if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {eta} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(what.to_owned());
    note(what, Some(&bar));
    bar
}

/// Says what is searched and searches with a bar, as long as the search is not asked to end with what it has: from the
/// moment that it is said.
pub fn search<T>(common: &Common, says: &str, work: impl FnOnce(Watch<'_>) -> T) -> T {
    let stop = ask_search();
    common.say(says);
    let bar = bar(common.quiet, "searching");
    let found = work(Watch {
        stop,
        progress: &|done, all, _| show(&bar, done, all),
    });
    bar.finish_and_clear();
    searched();
    found
}
