//! The command line: `elastocal <command> [SCENARIO]`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(cli::process::run(
        std::env::args_os(),
        std::env::current_exe().ok(),
    ))
}
