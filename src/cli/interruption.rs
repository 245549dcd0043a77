//! What ctrl-C, SIGTERM and the terminal's end do.
//!
//! A thread of its own waits for these signals and ends the program at once, whatever it is doing:
//! no unfinished file stays, and one line says what was kept. Only commands that can make something
//! of what they have so far are asked first.

use std::fmt::{Display, Formatter};
use std::mem::MaybeUninit;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use elastocal::files::output::abandon_unfinished;
use elastocal::text::diagnostics::say;

/// How long work may take to end by itself.
const GRACE: Duration = Duration::from_millis(600);

/// Whether the work is asked to end. Work that has nothing to make of a part is not asked by the program, which ends it
/// instead; where a command runs within another program, it looks here all the same.
pub static STOP: AtomicBool = AtomicBool::new(false);

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
    /// A search, which takes the time that it needs for a plan.
    Search,
    /// Work that has little time to save what is done.
    Work,
}

/// The command was interrupted and has ended by itself.
#[derive(Debug)]
pub struct Interrupted;

impl Display for Interrupted {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("interrupted")
    }
}

impl std::error::Error for Interrupted {}

fn state() -> MutexGuard<'static, Interruption> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to wait for signals, before there is any other thread. `end` ends the process.
pub fn listen(end: fn() -> !) {
    let mut signals = MaybeUninit::uninit();
    // SAFETY: the set is initialised before it is used, and every pointer is valid or null.
    #[expect(unsafe_code, reason = "signals have no safe interface")]
    let signals = unsafe {
        // A file that grows beyond `ulimit -f` is an error of writing, as is a reader that is gone.
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        libc::sigemptyset(signals.as_mut_ptr());
        for signal in [libc::SIGINT, libc::SIGTERM] {
            libc::signal(signal, libc::SIG_DFL);
            libc::sigaddset(signals.as_mut_ptr(), signal);
        }
        // `nohup` has the program outlive its terminal.
        let before = libc::signal(libc::SIGHUP, libc::SIG_DFL);
        if before == libc::SIG_IGN {
            libc::signal(libc::SIGHUP, libc::SIG_IGN);
        } else {
            libc::sigaddset(signals.as_mut_ptr(), libc::SIGHUP);
        }
        let signals = signals.assume_init();
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const signals, std::ptr::null_mut());
        signals
    };
    thread::spawn(move || {
        loop {
            let mut signal = 0;
            // SAFETY: both are valid.
            #[expect(unsafe_code, reason = "signals have no safe interface")]
            let failed = unsafe { libc::sigwait(&raw const signals, &raw mut signal) } != 0;
            if !failed {
                interrupt(end);
            }
        }
    });
}

fn interrupt(end: fn() -> !) {
    let asks = state().asks;
    // Who comes to ask while the program ends shall not be told to stop, and leave half a result.
    let is_first = asks != Asks::Nobody && !STOP.swap(true, Ordering::Relaxed);
    match asks {
        Asks::Search if is_first => {
            say("\nstopping: keeping the best plan found so far; once more to end at once");
        }
        Asks::Work if is_first => {
            thread::sleep(GRACE);
            finish(end);
        }
        _ => finish(end),
    }
}

/// Ends the program after an interruption: removes what is unfinished, and says what was kept.
pub fn finish(end: fn() -> !) -> ! {
    let finished = abandon_unfinished();
    // Who comes second waits here for the end.
    let state = state();
    let text = state.kept.clone().unwrap_or_else(|| describe(&finished));
    say(&format!("interrupted: {text}"));
    end()
}

fn describe(finished: &[PathBuf]) -> String {
    if finished.is_empty() {
        return "nothing was kept; the same command begins anew".to_owned();
    }
    let files: Vec<String> = (finished.iter())
        .map(|file| file.display().to_string())
        .collect();
    format!(
        "of the results, only {} {} written; the same command begins anew",
        files.join(", "),
        if files.len() == 1 { "was" } else { "were" }
    )
}

/// Ends work that was asked to end, before it makes a result of a part.
///
/// # Errors
/// It was asked.
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

/// From now on, the first signal gives work a moment to save what is done.
pub fn ask_work() -> &'static AtomicBool {
    state().asks = Asks::Work;
    &STOP
}

/// Notes what is kept if the program is interrupted now, and how to go on.
pub fn keeps(what: String) {
    state().kept = Some(what);
}
