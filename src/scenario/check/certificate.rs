//! Maximum permissible errors as certificates and data sheets print them become the standard deviations in whose place they are given.
//!
//! A certificate bounds an error by +-a, or has an expanded uncertainty U = k u. The standard uncertainty follows from the
//! distribution that is assumed within the bounds (GUM 4.3.7, 4.3.9; JCGM 101, 6.4):
//!
//! ```text
//! uniform u = a / sqrt(3)   triangular u = a / sqrt(6)   arcsine u = a / sqrt(2)   normal u = a / k
//! ```
//!
//! Such an error is mostly systematic, which its size does not say: the level has to be given, and has to be that which the error
//! source has in the model.

use super::Checker;
use crate::files::FileError;
use crate::parameter::{ErrorDistribution, SourceLevel};
use crate::quantities::plausible::COVERAGE;
use crate::scenario::file::UncertaintyTable;
use crate::scenario::permissible::{Certificate, Permissible};

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
            let key = format!("uncertainty[{index}]");
            self.convert_permissible(&key, (&source, sizes), &certificate, table.permissible())?;
            Ok(table)
        };
        tables.iter().enumerate().map(one).collect()
    }

    /// Writes the standard deviations of what is given by maximum permissible errors of a table. `source` is what they are of; it
    /// has these sizes.
    pub(super) fn convert_permissible<'a>(
        &self,
        key: &str,
        (source, sizes): (&str, &[&str]),
        certificate: &Certificate,
        errors: impl IntoIterator<Item = Permissible<'a>>,
    ) -> Result<(), FileError> {
        let mut is_given = false;
        for ((name, value), (standard_key, standard), unit) in errors {
            let Some(value) = value else { continue };
            is_given = true;
            let own = format!("{key}.{name}");
            if !sizes.contains(&standard_key) {
                let problem = format!("{source} has no such size; it has {}", sizes.join(" or "));
                return Err(self.wrong(&own, problem));
            }
            if standard.is_some() {
                let problem = format!("{standard_key} is given, too");
                return Err(self.wrong(&own, problem).hint("leave out one of the two"));
            }
            if value.is_nan() || value <= 0.0 {
                let problem = format!(
                    "found {value}; a positive number is allowed: half of the width between the bounds"
                );
                return Err(self.wrong(&own, problem));
            }
            *standard = Some(value * unit / self.divisor(key, certificate)?);
        }
        match first_given(certificate) {
            Some(word) if !is_given => {
                let problem = "is of a maximum permissible error, and none is given";
                let wrong = self.wrong(&format!("{key}.{word}"), problem);
                Err(wrong.hint("leave it out, or give mpe_... in place of the standard deviation"))
            }
            _ => Ok(()),
        }
    }

    /// How many standard uncertainties a maximum permissible error is.
    fn divisor(&self, key: &str, certificate: &Certificate) -> Result<f64, FileError> {
        let factor_key = format!("{key}.coverage_factor");
        let square = certificate.distribution.and_then(bounds_square);
        match (square, certificate.coverage_factor) {
            (Some(square), None) => Ok(square.sqrt()),
            (Some(_), Some(_)) => {
                let problem = "is given beside a distribution with bounds";
                Err(self.wrong(&factor_key, problem).hint(
                    "leave out one of the two: bounds and a distribution, or U = k u with a coverage factor",
                ))
            }
            (None, Some(factor)) => (self.number(&factor_key, factor, &COVERAGE))
                .map_err(|wrong| wrong.hint("k of U = k u is usually 2")),
            (None, None) if certificate.distribution.is_none() => {
                let problem = "is missing, and so is coverage_factor";
                let wrong = self.wrong(&format!("{key}.distribution"), problem);
                Err(wrong.hint(
                    "give one of the two: \"uniform\" where only bounds are known, or the certificate's factor k",
                ))
            }
            (None, None) => {
                let problem = "is missing: a normal distribution has no bounds";
                let hint = "give the factor k of U = k u: 2 for about 95 %, 3 for 99.7 %";
                Err(self.wrong(&factor_key, problem).hint(hint))
            }
        }
    }

    /// Checks the level that a table gives for its maximum permissible errors, if it has any; they are of a source of that `level`.
    pub(super) fn check_level(
        &self,
        key: &str,
        source: &str,
        certificate: &Certificate,
        level: SourceLevel,
    ) -> Result<(), FileError> {
        let name = level.name();
        let problem = match certificate.level {
            _ if first_given(certificate).is_none() => return Ok(()),
            Some(given) if given == level => return Ok(()),
            Some(given) => format!(
                "found {:?}; the level of {source} is {name:?}, and no other is modelled",
                given.name()
            ),
            None => {
                format!("is missing: it says what averages the error; that of {source} is {name:?}")
            }
        };
        Err(self.wrong(&format!("{key}.level"), problem).hint(
            "a maximum permissible error is mostly systematic: what is alike in all readings is another error source, such \
             as load_scale, base_position or tool_position",
        ))
    }
}

/// The first key that is given.
fn first_given(certificate: &Certificate) -> Option<&'static str> {
    let distribution = certificate.distribution.map(|_| "distribution");
    let factor = certificate.coverage_factor.map(|_| "coverage_factor");
    distribution
        .or(factor)
        .or(certificate.level.map(|_| "level"))
}

/// The square of half of the width between the bounds of a distribution over its standard deviation; none where it has no bounds.
const fn bounds_square(distribution: ErrorDistribution) -> Option<f64> {
    match distribution {
        ErrorDistribution::Uniform => Some(3.0),
        ErrorDistribution::Triangular => Some(6.0),
        ErrorDistribution::Arcsine => Some(2.0),
        ErrorDistribution::Normal => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variance of each distribution on -1 to 1, by its density.
    #[test]
    fn divisors_are_the_inverse_standard_deviations() {
        use ErrorDistribution::{Arcsine, Normal, Triangular, Uniform};
        let variance = |density: &dyn Fn(f64) -> f64| {
            let count = 2_000_000;
            let width = 2.0 / f64::from(count);
            let middles = (0..count).map(|index| (f64::from(index) + 0.5) * width - 1.0);
            middles.map(|x| x * x * density(x) * width).sum::<f64>()
        };
        let of_arcsine = |x: f64| (1.0 - x * x).sqrt().recip() / std::f64::consts::PI;
        for (distribution, expected) in [
            (Uniform, variance(&|_| 0.5)),
            (Triangular, variance(&|x| 1.0 - x.abs())),
            (Arcsine, variance(&of_arcsine)),
        ] {
            let found = bounds_square(distribution).expect("bounds").recip();
            assert!((found / expected - 1.0).abs() < 1e-3, "{distribution:?}");
        }
        assert_eq!(bounds_square(Normal), None);
    }
}
