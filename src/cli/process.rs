//! The command line as a process: signals, exit codes, and what is printed where.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::codes::ErrorCode;
use crate::text::diagnostics::say;
use clap::FromArgMatches;

use super::interruption::{self, Interrupted};
use super::printed_error::PrintedError;
use super::{Arguments, help, unless_reader_is_gone};

/// Does what the arguments say, the program's name first, and returns the exit code. It is the only place that maps
/// outcomes to exit codes: 0 done, 1 failed, 2 wrong usage (by clap), 3 done with a condition that was not accepted, 130
/// interrupted. `itself` as in [`Arguments::execute`].
pub fn run(arguments: impl IntoIterator<Item = OsString>, itself: Option<PathBuf>) -> u8 {
    interruption::listen();
    let is_whole_process = itself.is_some();
    let code = outcome(arguments, itself);
    if is_whole_process {
        interruption::end();
    }
    code
}

fn outcome(arguments: impl IntoIterator<Item = OsString>, itself: Option<PathBuf>) -> u8 {
    let words: Vec<OsString> = arguments.into_iter().collect();
    let parsed = help::program(&words).try_get_matches_from(words);
    let arguments = match parsed.and_then(|found| Arguments::from_arg_matches(&found)) {
        Ok(arguments) => arguments,
        Err(usage) => return explain_usage(&usage),
    };
    match arguments.execute(itself) {
        Ok(conditions) => {
            for condition in &conditions {
                say(&format!("condition {condition}"));
            }
            if conditions.iter().all(|each| each.allowed) {
                0
            } else {
                3
            }
        }
        Err(error) if error.is::<Interrupted>() => interruption::finish(),
        Err(error) => {
            PrintedError::of(&error).say();
            1
        }
    }
}

/// What is wrong with the usage, for stderr, or the help that was asked for, for stdout.
fn explain_usage(usage: &clap::Error) -> u8 {
    if usage.use_stderr() {
        let text = usage.render().to_string();
        let coded = format!("error {}:", ErrorCode::Usage);
        say(text.replacen("error:", &coded, 1).trim_end());
        return 2;
    }
    match unless_reader_is_gone(usage.print()) {
        Ok(()) => 0,
        Err(error) => {
            PrintedError::of(&error).say();
            1
        }
    }
}
