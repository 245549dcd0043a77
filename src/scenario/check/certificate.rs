//! Maximum permissible errors become the standard deviations in whose place they are given.

use super::Checker;
use crate::files::FileError;
use crate::parameter::SourceLevel;
use crate::scenario::certificate::CertifiedError;
use crate::scenario::file::UncertaintyTable;
use crate::scenario::permissible::Permissible;

impl Checker<'_> {
    /// The tables with standard deviations alone.
    pub(super) fn with_standard_deviations(
        &self,
        tables: &[UncertaintyTable],
    ) -> Result<Vec<UncertaintyTable>, FileError> {
        let one = |(index, table): (usize, &UncertaintyTable)| {
            let mut table = table.clone();
            let certificate = table.certificate();
            let source = format!("a {}", table.kind.name());
            let sizes = table.kind.sizes();
            self.convert_permissible(
                &format!("uncertainty[{index}]"),
                &source,
                &certificate,
                (sizes, &mut table.permissible()),
            )?;
            Ok(table)
        };
        tables.iter().enumerate().map(one).collect()
    }

    /// Checks the level that a table gives for its maximum permissible errors, if it has any; they are of a source of that `level`.
    pub(super) fn check_level(
        &self,
        key: &str,
        source: &str,
        certificate: &CertifiedError,
        level: SourceLevel,
    ) -> Result<(), FileError> {
        if certificate.given().is_none() {
            return Ok(());
        }
        certificate.check_level(source, level).map_err(|wrong| {
            let own = format!("{key}.{}", wrong.key);
            self.wrong(&own, wrong.problem).hint(wrong.hint)
        })
    }

    /// Writes the standard deviations of what is given by maximum permissible errors of a table. `source` is what they are of; it
    /// has these sizes.
    pub(super) fn convert_permissible(
        &self,
        key: &str,
        source: &str,
        certificate: &CertifiedError,
        (sizes, errors): (&[&str], &mut [Permissible<'_>]),
    ) -> Result<(), FileError> {
        let is_given = |each: &&mut Permissible<'_>| each.value.is_some();
        let mut given = errors.iter_mut().filter(is_given).peekable();
        if given.peek().is_none() {
            return match certificate.given() {
                None => Ok(()),
                Some(word) => {
                    let problem = "is of a maximum permissible error, and none is given";
                    let wrong = self.wrong(&format!("{key}.{word}"), problem);
                    Err(wrong
                        .hint("leave it out, or give mpe_... in place of the standard deviation"))
                }
            };
        }
        for each in given {
            let own = format!("{key}.{}", each.key);
            if !sizes.contains(&each.standard_key) {
                let problem = format!("{source} has no such size; it has {}", sizes.join(" or "));
                return Err(self.wrong(&own, problem));
            }
            if each.standard.is_some() {
                let problem = format!("{} is given, too", each.standard_key);
                return Err(self.wrong(&own, problem).hint("leave out one of the two"));
            }
            let value = each.value.unwrap_or_default();
            if value.is_nan() || value <= 0.0 {
                let problem = format!(
                    "found {value}; a positive number is allowed: half of the width between the bounds"
                );
                return Err(self.wrong(&own, problem));
            }
            let divisor = certificate.divisor().map_err(|wrong| {
                let own = format!("{key}.{}", wrong.key);
                self.wrong(&own, wrong.problem).hint(wrong.hint)
            })?;
            *each.standard = Some(value * each.unit / divisor);
        }
        Ok(())
    }
}
