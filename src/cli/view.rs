//! `view`: opens a recording in the rerun viewer.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use clap::Args;
use elastocal::files::FileError;
use elastocal::text::diagnostics::say;

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
                    .hint("`elastocal run` and `elastocal study` write one, or name a file")
            })?,
        };
        check(&file)?;
        let program = find_viewer()?;
        say(&format!(
            "opening {} with {}",
            file.display(),
            program.display()
        ));
        let status = Command::new(&program)
            .arg(&file)
            .status()
            .map_err(|error| FileError::new(&program, format!("does not start: {error}")))?;
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

/// The rerun program: the one that `ELASTOCAL_RERUN` names, the one on the PATH, or the one that the
/// tests installed in this folder.
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
        .map(|folder| folder.join("rerun"))
        .chain([PathBuf::from(".rerun/rerun")])
        .find(|program| program.is_file())
        .ok_or_else(|| {
            FileError::new(Path::new("rerun"), "the viewer is not installed")
                .hint("pip install rerun-sdk==0.36.3, or name the program in ELASTOCAL_RERUN")
        })
}
