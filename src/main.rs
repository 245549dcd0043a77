//! The command line: `elastocal <command> [SCENARIO]`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(elastocal::cli::process::run(
        std::env::args_os(),
        std::env::current_exe().ok(),
    ))
}
