//! The key `requires`: which versions of the program a scenario is written for.

use serde::Deserialize;

use super::Checker;
use crate::files::FileError;
use crate::files::typed::from_toml;

/// What is read of a file that a later version may have written: keys that this one does not know come second.
#[derive(Deserialize)]
struct Required {
    requires: Option<String>,
}

/// Major, minor and patch number.
type VersionNumbers = [u64; 3];

impl Checker<'_> {
    /// Refuses a scenario for other versions, before any of its keys is unknown.
    pub(super) fn check_version(&self, text: &str) -> Result<(), FileError> {
        let required: Required = from_toml(self.path, text)?;
        let Some(wanted) = required.requires else {
            return Ok(());
        };
        let wrong = |problem| self.wrong("requires", problem);
        match is_met(&wanted, crate::VERSION) {
            Some(true) => Ok(()),
            Some(false) => Err(wrong(format!(
                "found {wanted:?}; this is elastocal {}",
                crate::VERSION
            ))
            .hint("install a version of elastocal that meets it")),
            None => Err(wrong(format!(
                "found {wanted:?}; versions such as \">=0.1\" or \">=0.1, <0.3\" are allowed"
            ))),
        }
    }
}

/// Whether a version meets all of the bounds; none where one of them is no bound.
fn is_met(bounds: &str, version: &str) -> Option<bool> {
    let version = parsed(version)?;
    let mut all = true;
    for bound in bounds.split(',').map(str::trim) {
        let number = bound.trim_start_matches(['<', '>', '=']);
        let (sign, number) = (&bound[..bound.len() - number.len()], parsed(number.trim())?);
        all &= match sign {
            ">=" => version >= number,
            ">" => version > number,
            "<=" => version <= number,
            "<" => version < number,
            "=" | "==" => version == number,
            _ => return None,
        };
    }
    Some(all)
}

/// One to three numbers; those that are left out are zero.
fn parsed(text: &str) -> Option<VersionNumbers> {
    let mut version = [0; 3];
    for (place, part) in text.split('.').enumerate() {
        let is_number = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        *version.get_mut(place)? = part.parse().ok().filter(|_| is_number)?;
    }
    Some(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_met_by_numbers_and_not_by_letters() {
        for (bounds, met) in [
            (">=0.1", Some(true)),
            (">= 0.9, < 0.11", Some(true)),
            (">=0.10.1", Some(false)),
            ("<0.10", Some(false)),
            ("<=0.10.0", Some(true)),
            (">0.9,<1", Some(true)),
            ("==0.10", Some(true)),
            ("=1", Some(false)),
            ("0.1", None),
            ("", None),
            (">=", None),
            (">=0.1,", None),
            (">=0.1.2.3", None),
            (">=+1", None),
            ("=>0.1", None),
            (">=99999999999999999999", None),
        ] {
            assert_eq!(is_met(bounds, "0.10.0"), met, "{bounds}");
        }
    }
}
