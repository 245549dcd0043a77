//! The command line's commands, called with its arguments.

use std::any::TypeId;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use clap::{Arg, ArgAction, CommandFactory, Parser};
use elastocal::files::shipped;
use pyo3::prelude::*;
use serde_json::{Value, json};

use elastocal::cli::interruption::STOP;
use elastocal::cli::printed_error::PrintedError;
use elastocal::cli::progress::LATEST;
use elastocal::cli::{Arguments, Report, process, useful};

/// How often Python is asked whether somebody pressed ctrl-C.
const PATIENCE: Duration = Duration::from_millis(50);
/// One command at a time: a search is asked to stop by a flag that all of them look at.
static BUSY: Mutex<()> = Mutex::new(());

/// Does what a command says, with the command line's arguments, on so many threads. Returns JSON: `results`, `text`
/// and `conditions`, or `error` with `hint`, `is_usage` and, but for usage, `code`. What is done meanwhile goes to `progress`:
/// its name, how much is done, of how much (none where that is not known), and a message.
///
/// # Errors
/// Python's, such as KeyboardInterrupt: the work then ends soon, and nothing is made of a part of it.
#[pyfunction]
#[pyo3(signature = (arguments, threads=None, progress=None))]
pub fn command(
    py: Python<'_>,
    arguments: Vec<String>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (said, mut hears) = channel();
    py.detach(|| {
        std::thread::spawn(move || {
            let _turn = BUSY.lock().unwrap_or_else(PoisonError::into_inner);
            STOP.store(false, Ordering::Relaxed);
            *LATEST.lock().unwrap_or_else(PoisonError::into_inner) = (String::new(), None);
            let answer = catch_unwind(AssertUnwindSafe(|| answer(&arguments, threads)));
            let _ = said.send(answer.unwrap_or_else(|_| {
                json!({ "error": "elastocal broke down; please report it", "hint": null, "is_usage": false })
            }));
        });
    });
    let mut interrupted = None;
    let mut shown = Doing::default();
    loop {
        let (heard, back) = py.detach(move || (hears.recv_timeout(PATIENCE), hears));
        hears = back;
        match heard {
            Ok(answer) => {
                return match interrupted {
                    Some(error) => Err(error),
                    None => Ok(answer.to_string()),
                };
            }
            Err(RecvTimeoutError::Timeout) => {
                let listener = progress.as_ref().filter(|_| interrupted.is_none());
                let doing = doing();
                let told = match listener {
                    Some(listener) if doing != shown => listener.call1(py, doing.clone()).map(drop),
                    _ => Ok(()),
                };
                shown = doing;
                if let Err(error) = told.and_then(|()| py.check_signals()) {
                    STOP.store(true, Ordering::Relaxed);
                    interrupted = Some(error);
                }
            }
            Err(RecvTimeoutError::Disconnected) => return Ok(Value::Null.to_string()),
        }
    }
}

/// What is done, how much of it is done, of how much, and a message.
type Doing = (String, u64, Option<u64>, String);

/// What is done now.
fn doing() -> Doing {
    let latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    let (what, bar) = &*latest;
    match bar.as_ref().filter(|bar| !bar.is_finished()) {
        Some(bar) => (what.clone(), bar.position(), bar.length(), bar.message()),
        None => (what.clone(), 0, None, String::new()),
    }
}

fn answer(arguments: &[String], threads: Option<usize>) -> Value {
    let program = std::iter::once("elastocal");
    let words = program.chain(arguments.iter().map(String::as_str));
    let parsed = match Arguments::try_parse_from(words) {
        Ok(parsed) => parsed,
        Err(usage) => {
            return json!({ "error": usage.to_string(), "hint": null, "is_usage": true });
        }
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.map_or(0, useful));
    let done = match pool.build() {
        Ok(pool) => pool.install(|| parsed.report()),
        Err(error) => Err(error.into()),
    };
    match done {
        Ok(Report {
            json,
            text,
            conditions,
            ..
        }) => json!({ "results": json, "text": text, "conditions": conditions }),
        Err(error) => failed(&error),
    }
}

/// The message that the command line prints, its code and its hint.
fn failed(error: &anyhow::Error) -> Value {
    let PrintedError { code, text, hint } = PrintedError::of(error);
    json!({ "error": text, "code": code, "hint": hint, "is_usage": false })
}

/// The program itself, for a process that does nothing else: takes the arguments after its name, and returns the exit code.
/// Signals are its own from then on.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let words = std::iter::once("elastocal".into()).chain(arguments);
    // The process is Python's, which cannot load a model apart.
    py.detach(|| process::run(words, None))
}

/// Says where the shipped scenarios and models are.
#[pyfunction]
pub fn set_shared(folder: PathBuf) {
    shipped::set_folder(folder);
}

/// The command line's commands with their arguments, as JSON: for each command a list of `name`, `long`,
/// `takes_value`, `is_positional`, `is_hidden`, `is_list`, `type`, `choices` and `help`.
#[pyfunction]
pub fn options() -> String {
    let program = Arguments::command();
    let commands = program
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    let listed = commands.map(|command| {
        let options: Vec<Value> = command
            .get_arguments()
            .map(|option| {
                json!({
                    "name": option.get_id().as_str(),
                    "long": option.get_long(),
                    "takes_value": option.get_action().takes_values(),
                    "is_positional": option.is_positional(),
                    "is_hidden": option.is_hide_set(),
                    "is_list": is_list(option),
                    "type": kind(option),
                    "choices": choices(option),
                    "help": option.get_help().map(ToString::to_string),
                })
            })
            .collect();
        (command.get_name().to_owned(), Value::Array(options))
    });
    Value::Object(listed.collect()).to_string()
}

fn is_list(option: &Arg) -> bool {
    let many = option
        .get_num_args()
        .is_some_and(|range| range.max_values() > 1);
    many || option.get_value_delimiter().is_some()
        || matches!(option.get_action(), ArgAction::Append)
}

/// What Python calls the type of an option's value.
fn kind(option: &Arg) -> &'static str {
    let id = option.get_value_parser().type_id();
    let is = |types: &[TypeId]| types.iter().any(|each| id == *each);
    if !option.get_action().takes_values() {
        "bool"
    } else if is(&[TypeId::of::<PathBuf>()]) {
        "path"
    } else if is(&[TypeId::of::<f64>()]) {
        "float"
    } else if is(&[
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
    ]) {
        "int"
    } else {
        "str"
    }
}

fn choices(option: &Arg) -> Vec<String> {
    let choices = option.get_value_parser().possible_values();
    let names = choices.into_iter().flatten();
    names.map(|each| each.get_name().to_owned()).collect()
}
