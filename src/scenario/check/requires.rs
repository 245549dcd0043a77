//! The key `requires`: which versions of the program a scenario is written for.

use semver::{Version, VersionReq};
use serde::Deserialize;

use super::Checker;
use crate::files::FileError;
use crate::files::typed::from_toml;

/// What is read of a file that a later version may have written: keys that this one does not know come second.
#[derive(Deserialize)]
struct Required {
    requires: Option<String>,
}

impl Checker<'_> {
    /// Refuses a scenario for other versions, before any of its keys is unknown.
    pub(super) fn check_version(&self, text: &str) -> Result<(), FileError> {
        let required: Required = from_toml(self.path, text)?;
        let Some(wanted) = required.requires else {
            return Ok(());
        };
        let own = crate::VERSION;
        let wrong =
            |problem: String| self.wrong("requires", format!("found {wanted:?}; {problem}"));
        match (VersionReq::parse(&wanted), Version::parse(own)) {
            (Ok(wanted), Ok(version)) if wanted.matches(&version) => Ok(()),
            (Ok(_), Ok(_)) => Err(wrong(format!("this is elastocal {own}"))
                .hint("install a version of elastocal that meets it")),
            _ => Err(wrong(
                "versions such as \">=0.1\" or \">=0.1, <0.3\" are allowed".to_owned(),
            )),
        }
    }
}
