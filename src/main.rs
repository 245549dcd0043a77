//! The command line: `elastocal <command> [SCENARIO]`.

mod cli;

use std::process::ExitCode;

use clap::Parser;
use elastocal::text::diagnostics::say;

use cli::interruption::{self, Interrupted};

/// The only place that maps outcomes to exit codes: 0 done, 1 failed, 2 wrong usage (by clap),
/// 3 done but a named condition did not hold, 130 interrupted.
fn main() -> ExitCode {
    interruption::listen(end_interrupted);
    let arguments = match cli::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(usage) => return explain_usage(&usage),
    };
    match arguments.execute() {
        Ok(conditions) if conditions.is_empty() => ExitCode::SUCCESS,
        Ok(conditions) => {
            for condition in conditions {
                say(&format!("condition: {condition}"));
            }
            ExitCode::from(3)
        }
        Err(error) if error.is::<Interrupted>() => interruption::finish(end_interrupted),
        Err(error) => {
            cli::explain(&error);
            ExitCode::FAILURE
        }
    }
}

/// What is wrong with the usage, for stderr, or the help that was asked for, for stdout.
fn explain_usage(usage: &clap::Error) -> ExitCode {
    let printed = usage.print();
    if usage.use_stderr() {
        return ExitCode::from(2);
    }
    match cli::unless_reader_is_gone(printed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            cli::explain(&error);
            ExitCode::FAILURE
        }
    }
}

/// Ends the process while other threads are still at work, which must not see it taken apart.
fn end_interrupted() -> ! {
    // SAFETY: it takes a number and does not return.
    #[expect(
        unsafe_code,
        reason = "the library's exit takes apart what other threads use"
    )]
    unsafe {
        libc::_exit(130)
    }
}
