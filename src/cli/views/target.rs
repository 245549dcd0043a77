//! `--rerun`: results on their way to a rerun viewer.

use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::files::FileError;
use crate::view::rerun_file::viewer::{Address, DEFAULT_PORT, DEFAULT_URL, Viewer, address, probe};

use crate::cli::written::warn;

/// Where results are shown or written, besides the usual files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerTarget {
    /// A viewer on this machine, started if none is there.
    Spawn,
    /// A viewer that is there.
    Connect(Address),
    /// A file.
    Save(PathBuf),
}

impl std::str::FromStr for ViewerTarget {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text
            .split_once('=')
            .map_or((text, None), |(how, what)| (how, Some(what)))
        {
            ("spawn", None) => Ok(Self::Spawn),
            ("connect", url) => Ok(Self::Connect(address(url.unwrap_or(DEFAULT_URL))?)),
            ("save", Some(path)) if !path.is_empty() => Ok(Self::Save(path.into())),
            _ => Err(format!(
                "spawn starts a viewer, connect or connect={DEFAULT_URL} sends to one, save=FILE writes a file"
            )),
        }
    }
}

impl ViewerTarget {
    /// The file to write, if it is one.
    pub fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Save(path) => Some(path),
            Self::Spawn | Self::Connect(_) => None,
        }
    }

    /// Connects to the viewer. That there is none is said, and no reason to give up the work.
    pub fn open(&self) -> Option<Viewer> {
        let opened = match self {
            Self::Save(_) => return None,
            Self::Spawn => spawn(),
            Self::Connect(address) => match probe(address) {
                Ok(()) => connect(address),
                Err(error) => Err((
                    format!("there is no rerun viewer at {address}: {error}"),
                    "start `rerun` first, or use --rerun spawn".to_owned(),
                )),
            },
        };
        opened
            .inspect_err(|(problem, hint)| warn(problem, Some(hint)))
            .ok()
    }
}

fn connect(address: &Address) -> Result<Viewer, (String, String)> {
    Viewer::connect(address).map_err(|error| (error.to_string(), String::new()))
}

/// A viewer that may be there already, or is started and outlives this program.
fn spawn() -> Result<Viewer, (String, String)> {
    let found = find_viewer().map_err(|error| {
        let hint = error.hint.clone().unwrap_or_default();
        (error.to_string(), hint)
    })?;
    let here = address(DEFAULT_URL).map_err(|problem| (problem, String::new()))?;
    if probe(&here).is_err() {
        // Its own streams, so that nobody who reads this program's waits for the viewer to end; its
        // own group, so that ctrl-C does not end it.
        Command::new(&found)
            .args(["--bind=127.0.0.1", &format!("--port={DEFAULT_PORT}")])
            .arg("--expect-data-soon")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .map_err(|error| {
                let problem = format!("{} does not start: {error}", found.display());
                (problem, "start it by hand to see why".to_owned())
            })?;
    }
    connect(&here)
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
fn find_viewer() -> Result<PathBuf, FileError> {
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
