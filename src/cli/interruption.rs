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
use std::time::{Duration, Instant};

use elastocal::files::output::abandon_unfinished;
use elastocal::text::diagnostics::say;

/// How long work may take to end by itself.
const GRACE: Duration = Duration::from_millis(600);

/// Whether the work is asked to end. Work that has nothing to make of a part is not asked by the program, which ends it
/// instead; where a command runs within another program, it looks here all the same.
pub static STOP: AtomicBool = AtomicBool::new(false);

/// So long a search may take until it ends with a plan ...
const SEARCH_GRACE: Duration = Duration::from_millis(900);
/// ... of which the processor worked so long: on a busy machine it takes longer ...
const SEARCH_WORK: Duration = Duration::from_millis(850);
/// ... but never more than this.
const SEARCH_MOST: Duration = Duration::from_secs(3);

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

/// Whether there was no stdout when the program began. The standard library opens `/dev/null` in its place before `main`, to which
/// all can be written.
static IS_STDOUT_CLOSED: AtomicBool = AtomicBool::new(false);

/// Whether nobody can ever read what is printed.
pub fn is_stdout_closed() -> bool {
    IS_STDOUT_CLOSED.load(Ordering::Relaxed)
}

extern "C" fn look_at_stdout() {
    // SAFETY: it takes numbers and touches no memory.
    #[expect(unsafe_code, reason = "descriptors have no safe interface")]
    let flags = unsafe { libc::fcntl(libc::STDOUT_FILENO, libc::F_GETFD) };
    IS_STDOUT_CLOSED.store(flags < 0, Ordering::Relaxed);
}

/// What the loader calls before the standard library begins.
// SAFETY: the section holds pointers to functions of this kind, and this one needs nothing of the standard library.
#[expect(unsafe_code, reason = "nothing else runs so early")]
#[used]
#[unsafe(link_section = ".init_array")]
static LOOK_AT_STDOUT: extern "C" fn() = look_at_stdout;

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
        Asks::Search | Asks::Found if is_first => {
            say("\nstopping: keeping the best plan found so far; once more to end at once");
            thread::spawn(move || end_search(end));
        }
        Asks::Work if is_first => {
            thread::sleep(GRACE);
            finish(end);
        }
        _ => finish(end),
    }
}

/// Ends a search that does not end by itself: there is no plan yet, or a step of it takes long.
fn end_search(end: fn() -> !) {
    let (start, before) = (Instant::now(), worked());
    while state().asks == Asks::Search {
        let (waited, worked) = (start.elapsed(), worked().saturating_sub(before));
        if (waited >= SEARCH_GRACE && worked >= SEARCH_WORK) || waited >= SEARCH_MOST {
            finish(end);
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// How long processors worked for this process.
fn worked() -> Duration {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: the pointer is valid.
    #[expect(unsafe_code, reason = "clocks of processes have no safe interface")]
    let failed = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut time) } != 0;
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    let rest = u32::try_from(time.tv_nsec).unwrap_or_default();
    if failed {
        Duration::MAX
    } else {
        Duration::new(seconds, rest)
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
