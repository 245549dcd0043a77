//! The command line: `elastocal <command> [SCENARIO]`.

mod cli;

use std::process::ExitCode;

use clap::Parser;

/// The only place that maps outcomes to exit codes: 0 done, 1 failed, 2 wrong usage (by clap),
/// 3 done but a named condition did not hold.
fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    match arguments.execute() {
        Ok(conditions) if conditions.is_empty() => ExitCode::SUCCESS,
        Ok(conditions) => {
            for condition in conditions {
                eprintln!("condition: {condition}");
            }
            ExitCode::from(3)
        }
        Err(error) => {
            cli::explain(&error);
            ExitCode::FAILURE
        }
    }
}
