//! `view`: opens a recording in the rerun viewer.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use clap::Args;
use elastocal::codes::ErrorCode;
use elastocal::files::FileError;
use elastocal::text::{diagnostics::say, wording::no_option};

use super::Report;

/// Arguments of `view`.
#[derive(Debug, Args)]
pub struct View {
    /// The recording (.rrd or .mcap); the newest of those in the folder for results if not given.
    file: Option<PathBuf>,
    /// The folder for results.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

/// How the files that the viewer can open begin.
const BEGINNINGS: [&[u8]; 2] = [b"RRF2", b"\x89MCAP"];

impl View {
    pub fn execute(&self) -> anyhow::Result<Report> {
        let file = match &self.file {
            Some(file) => file.clone(),
            None => newest(&self.out).ok_or_else(|| {
                FileError::new(&self.out, "there is no recording in it")
                    .code(ErrorCode::View)
                    .hint("`elastocal run` and `elastocal study` write one, or name a file")
            })?,
        };
        let coded = |wrong: FileError| wrong.or_code(ErrorCode::View);
        check(&file).map_err(coded)?;
        let program = find_viewer().map_err(coded)?;
        say(&format!(
            "opening {} with {}",
            file.display(),
            program.display()
        ));
        let status = viewer(&program)
            .arg(no_option(&file).as_os_str())
            .status()
            .map_err(|error| coded(FileError::new(&program, format!("does not start: {error}"))))?;
        anyhow::ensure!(status.success(), "{}: {status}", program.display());
        Ok(Report::default())
    }
}

/// The recording in a folder of the folder for results that was written last.
fn newest(out: &Path) -> Option<PathBuf> {
    let written = |path: &PathBuf| -> Option<SystemTime> { path.metadata().ok()?.modified().ok() };
    std::fs::read_dir(out)
        .ok()?
        .flatten()
        .flat_map(|folder| ["run.rrd", "study.rrd"].map(|name| folder.path().join(name)))
        .filter(|path| path.is_file())
        .max_by_key(|path| written(path))
}

/// Whether the viewer can open a file.
fn check(path: &Path) -> Result<(), FileError> {
    let mut beginning = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(8).read_to_end(&mut beginning))
        .map_err(|error| {
            FileError::new(path, format!("cannot be read: {error}"))
                .hint("`elastocal run` and `elastocal study` write recordings")
        })?;
    if BEGINNINGS.iter().any(|each| beginning.starts_with(each)) {
        return Ok(());
    }
    Err(FileError::new(path, "is no recording")
        .hint("give a .rrd or .mcap file that `elastocal run` or `elastocal study` wrote"))
}

/// Starts a viewer that listens to this machine alone.
pub fn viewer(program: &Path) -> Command {
    let mut command = Command::new(program);
    command.arg("--bind=127.0.0.1");
    command
}

/// The one that the tests installed beside the folder into which this program was built. In whatever folder a user stands is
/// no program of this one's.
fn own_viewer() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let built = program.ancestors().nth(2)?;
    let is_built = built.file_name().is_some_and(|name| name == "target");
    is_built.then(|| built.with_file_name(".rerun").join("rerun"))
}

/// The rerun program: the one that `ELASTOCAL_RERUN` names, the one on the PATH, or the one that the
/// tests installed.
pub fn find_viewer() -> Result<PathBuf, FileError> {
    let named = std::env::var_os("ELASTOCAL_RERUN").filter(|name| !name.is_empty());
    if let Some(named) = named {
        let program = PathBuf::from(named);
        return if program.is_file() {
            Ok(program)
        } else {
            Err(FileError::new(&program, "is no program")
                .hint("ELASTOCAL_RERUN must name a rerun program, or not be set"))
        };
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .filter(|folder| folder.is_absolute())
        .map(|folder| folder.join("rerun"))
        .chain(own_viewer())
        .find(|program| program.is_file())
        .ok_or_else(|| {
            FileError::new(Path::new("rerun"), "the viewer is not installed")
                .hint("pip install rerun-sdk==0.36.3, or name the program in ELASTOCAL_RERUN")
        })
}
