//! What ctrl-C, SIGTERM and the terminal's end do.
//!
//! A thread of its own waits for these signals and ends the program at once, whatever it is doing:
//! no unfinished file stays, and one line says what was kept. Only commands that can make something
//! of what they have so far are asked first.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::files::output::abandon_unfinished;
use crate::text::diagnostics::say;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;
use signal_hook::low_level;
use thiserror::Error;

use super::written::list;

/// How long work may take to end by itself.
const GRACE: Duration = Duration::from_millis(600);

/// Whether the work is asked to end. Work that has nothing to make of a part is not asked by the program, which ends it
/// instead; where a command runs within another program, it looks here all the same.
pub static STOP: AtomicBool = AtomicBool::new(false);

/// So long a search may take until it ends with a plan.
const SEARCH_GRACE: Duration = Duration::from_secs(3);

static STATE: Mutex<Interruption> = Mutex::new(Interruption {
    asks: Asks::Nobody,
    kept: None,
});

struct Interruption {
    asks: Asks,
    /// What is kept, and how to go on.
    kept: Option<String>,
}

/// Who is asked to end before the program is ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Asks {
    Nobody,
    /// A search, which has little time to end with the best plan.
    Search,
    /// What comes after a search: it takes the time that it needs.
    Found,
    /// Work that has little time to save what is done.
    Work,
}

/// The command was interrupted and has ended by itself.
#[derive(Debug, Error)]
#[error("interrupted")]
pub struct Interrupted;

fn state() -> MutexGuard<'static, Interruption> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to wait for signals, before there is any other thread.
pub fn listen() {
    // A file that grows beyond `ulimit -f` is an error of writing.
    let mut watched = vec![SIGINT, SIGTERM, SIGXFSZ];
    // SAFETY: it takes numbers and touches no memory.
    #[expect(unsafe_code, reason = "what a signal does has no safe interface")]
    let before = unsafe { libc::signal(SIGHUP, libc::SIG_IGN) };
    // `nohup` has the program outlive its terminal.
    if before != libc::SIG_IGN {
        watched.push(SIGHUP);
    }
    let Ok(mut signals) = Signals::new(watched) else {
        return;
    };
    thread::spawn(move || {
        for signal in &mut signals {
            if signal != SIGXFSZ {
                interrupt();
            }
        }
    });
}

fn interrupt() {
    let asks = state().asks;
    // Who comes to ask while the program ends shall not be told to stop, and leave half a result.
    let is_first = asks != Asks::Nobody && !STOP.swap(true, Ordering::Relaxed);
    match asks {
        Asks::Search | Asks::Found if is_first => {
            say(
                "\nstopping: keeping the best plan if one is found by now; once more to end at once",
            );
            thread::spawn(end_search);
        }
        Asks::Work if is_first => {
            thread::sleep(GRACE);
            finish();
        }
        _ => finish(),
    }
}

/// Ends a search that does not end by itself: there is no plan yet, or a step of it takes long.
fn end_search() {
    let start = Instant::now();
    while state().asks == Asks::Search {
        if start.elapsed() >= SEARCH_GRACE {
            finish();
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// Ends the program after an interruption: removes what is unfinished, and says what was kept.
pub fn finish() -> ! {
    let finished = abandon_unfinished();
    // Who comes second waits here for the end.
    let state = state();
    let text = state.kept.clone().unwrap_or_else(|| describe(&finished));
    say(&format!("interrupted: {text}"));
    // Other threads are still at work, and must not see the process taken apart.
    low_level::exit(130)
}

/// The program has ended by itself: who comes to interrupt it now says nothing more. Where somebody has said so already, waits for
/// that end.
pub fn end() {
    std::mem::forget(state());
}

fn describe(finished: &[PathBuf]) -> String {
    if finished.is_empty() {
        return "nothing was kept; the same command begins anew".to_owned();
    }
    format!(
        "of the results, only {} {} written; the same command begins anew",
        list(finished),
        if finished.len() == 1 { "was" } else { "were" }
    )
}

/// Ends work that was asked to end, before it makes a result of a part.
pub fn proceed() -> Result<(), Interrupted> {
    if STOP.load(Ordering::Relaxed) {
        return Err(Interrupted);
    }
    Ok(())
}

/// From now on, the first signal asks a search to end with the best plan that it has.
pub fn ask_search() -> &'static AtomicBool {
    state().asks = Asks::Search;
    &STOP
}

/// The search has its plan: what is left to do with it is done whole.
pub fn searched() {
    let mut state = state();
    if state.asks == Asks::Search {
        state.asks = Asks::Found;
    }
}

/// From now on, the first signal gives work a moment to save what is done.
pub fn ask_work() -> &'static AtomicBool {
    state().asks = Asks::Work;
    &STOP
}

/// Notes what is kept if the program is interrupted now, and how to go on.
pub fn keeps(what: String) {
    state().kept = Some(what);
}
