//! Models are compiled in a child process first, where MuJoCo may end the process, run out of stack or
//! memory, or never come to an end.
//!
//! A program that can load a model in a process of its own says so with [`rehearse_with`]; in any other
//! the first compilation is the only one.

use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::codes::ErrorCode;
use crate::files::FileError;

/// A model that takes longer is given up.
const PATIENCE: Duration = Duration::from_mins(1);
/// The same in time of the processor (s).
const PROCESSOR_S: libc::rlim_t = 30;
/// The memory that compiling a model may take (bytes).
const MEMORY: libc::rlim_t = 4 << 30;

static STAGE: Mutex<Rehearsals> = Mutex::new(Rehearsals {
    program: None,
    rehearsed: Vec::new(),
});

struct Rehearsals {
    program: Option<(PathBuf, &'static str)>,
    /// The models that are known to load.
    rehearsed: Vec<PathBuf>,
}

/// Has models compiled by a program first, which is called with the command and the model's path, and
/// ends with code 0 if the model can be loaded, and else says what is wrong on stderr.
pub fn rehearse_with(program: PathBuf, command: &'static str) {
    stage(|stage| stage.program = Some((program, command)));
}

fn stage<T>(use_it: impl FnOnce(&mut Rehearsals) -> T) -> T {
    use_it(&mut STAGE.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Limits this process, the child, to the time and memory that a model may take.
pub fn limit_process() {
    for (resource, most) in [
        (libc::RLIMIT_CPU, PROCESSOR_S),
        (libc::RLIMIT_AS, MEMORY),
        (libc::RLIMIT_CORE, 0),
    ] {
        let limit = libc::rlimit {
            rlim_cur: most,
            rlim_max: most,
        };
        // SAFETY: it reads the structure and keeps nothing of it. Where it fails, there is no limit.
        #[expect(unsafe_code, reason = "the standard library has no limits")]
        unsafe {
            libc::setrlimit(resource, &raw const limit);
        }
    }
}

/// Compiles a model in a child process.
///
/// # Errors
/// What the child came to, in words.
pub(super) fn rehearse(model: &Path) -> Result<(), FileError> {
    let Some((program, command)) = stage(|stage| {
        let is_new = !stage.rehearsed.iter().any(|known| known == model);
        stage.program.clone().filter(|_| is_new)
    }) else {
        return Ok(());
    };
    let child = Command::new(program)
        .arg(command)
        .arg("--")
        .arg(model)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn();
    // Where no process can be made, there is none to save.
    let Ok(mut child) = child else { return Ok(()) };
    let said = last_words(&mut child);
    let end = wait(&mut child);
    let said = said.and_then(|said| said.join().ok()).unwrap_or_default();
    match end {
        Some(status) if status.success() || is_stopped(status) => {
            stage(|stage| stage.rehearsed.push(model.to_owned()));
            Ok(())
        }
        Some(status) => Err(refusal(model, status, &said)),
        None => {
            let waited = PATIENCE.as_secs();
            let problem = format!("MuJoCo has not loaded the model after {waited} s");
            Err(FileError::new(model, problem).code(ErrorCode::Model))
        }
    }
}

/// Whether the user ended the child, and this process too.
fn is_stopped(status: ExitStatus) -> bool {
    [libc::SIGINT, libc::SIGTERM, libc::SIGHUP]
        .map(Some)
        .contains(&status.signal())
        || status.code() == Some(130)
}

/// What the child says is wrong with the model, or else how it ended.
fn refusal(model: &Path, status: ExitStatus, said: &str) -> FileError {
    let lines = || said.lines().map(str::trim).filter(|line| !line.is_empty());
    let about_model = format!(": {}: ", model.display());
    let mut errors = lines().filter(|line| line.starts_with("error "));
    let problem = errors.find_map(|line| Some(line.split_once(&about_model)?.1));
    let hint = lines().find_map(|line| line.strip_prefix("hint: "));
    let broken = || match lines().next() {
        Some(line) => format!("MuJoCo breaks down on the model ({status}): {line}"),
        None => format!("MuJoCo breaks down on the model ({status})"),
    };
    let problem = problem.map_or_else(broken, str::to_owned);
    FileError {
        hint: hint.map(str::to_owned),
        ..FileError::new(model, problem).code(ErrorCode::Model)
    }
}

/// What the child says on stderr, read in a thread so that it never waits.
fn last_words(child: &mut Child) -> Option<std::thread::JoinHandle<String>> {
    let mut stderr = child.stderr.take()?;
    Some(std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = stderr.by_ref().take(1 << 16).read_to_end(&mut bytes);
        let _ = std::io::copy(&mut stderr, &mut std::io::sink());
        String::from_utf8_lossy(&bytes).into_owned()
    }))
}

/// Waits for the end of the child; `None` if it has to be ended.
fn wait(child: &mut Child) -> Option<ExitStatus> {
    let start = Instant::now();
    let mut pause = Duration::from_millis(1);
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if start.elapsed() < PATIENCE => {}
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
        }
        std::thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}
