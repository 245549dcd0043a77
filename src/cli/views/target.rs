//! `--rerun`: results on their way to a rerun viewer.

use std::path::PathBuf;

use elastocal::view::rerun_file::viewer::{Address, DEFAULT_URL, Viewer};

use crate::cli::written::warn;

/// Where results are shown or written, besides the usual files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewerTarget {
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
            ("connect", url) => Ok(Self::Connect(url.unwrap_or(DEFAULT_URL).parse()?)),
            ("save", Some(path)) if !path.is_empty() => Ok(Self::Save(path.into())),
            _ => Err(format!(
                "connect or connect={DEFAULT_URL} sends to a viewer, save=FILE writes a file"
            )),
        }
    }
}

impl ViewerTarget {
    /// The file to write, if it is one.
    pub fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Save(path) => Some(path),
            Self::Connect(_) => None,
        }
    }

    /// Connects to the viewer. That there is none is said, and no reason to give up the work.
    pub fn open(&self) -> Option<Viewer> {
        let Self::Connect(address) = self else {
            return None;
        };
        let opened = match address.probe() {
            Ok(()) => Viewer::connect(address).map_err(|error| error.to_string()),
            Err(error) => Err(format!("there is no rerun viewer at {address}: {error}")),
        };
        let hint = "start `rerun` first";
        opened.inspect_err(|problem| warn(problem, Some(hint))).ok()
    }
}
