//! Maximum permissible errors as certificates and data sheets print them, and their standard uncertainties.
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

use crate::parameter::{ErrorDistribution, SourceLevel};
use crate::quantities::plausible::COVERAGE;

/// What a table says of its maximum permissible errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CertifiedError {
    pub distribution: Option<ErrorDistribution>,
    pub coverage_factor: Option<f64>,
    pub level: Option<SourceLevel>,
}

/// What is wrong with it: at which key, and what to do.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct WrongCertificate {
    pub key: &'static str,
    pub problem: String,
    pub hint: &'static str,
}

impl CertifiedError {
    /// The first key that is given.
    pub fn given(&self) -> Option<&'static str> {
        let distribution = self.distribution.map(|_| "distribution");
        let factor = self.coverage_factor.map(|_| "coverage_factor");
        distribution.or(factor).or(self.level.map(|_| "level"))
    }

    /// How many standard uncertainties a maximum permissible error is.
    pub fn divisor(&self) -> Result<f64, WrongCertificate> {
        let wrong = |key, problem: &str, hint| WrongCertificate {
            key,
            problem: problem.to_owned(),
            hint,
        };
        let bounded = |square: f64| match self.coverage_factor {
            None => Ok(square.sqrt()),
            Some(_) => Err(wrong(
                "coverage_factor",
                "is given beside a distribution with bounds",
                "leave out one of the two: bounds and a distribution, or U = k u with a coverage factor",
            )),
        };
        match self.distribution {
            Some(ErrorDistribution::Uniform) => bounded(3.0),
            Some(ErrorDistribution::Triangular) => bounded(6.0),
            Some(ErrorDistribution::Arcsine) => bounded(2.0),
            None | Some(ErrorDistribution::Normal) => {
                let factor = self.coverage_factor.ok_or_else(|| match self.distribution {
                    None => wrong(
                        "distribution",
                        "is missing, and so is coverage_factor",
                        "give one of the two: \"uniform\" where only bounds are known, or the certificate's factor k",
                    ),
                    Some(_) => wrong(
                        "coverage_factor",
                        "is missing: a normal distribution has no bounds",
                        "give the factor k of U = k u: 2 for about 95 %, 3 for 99.7 %",
                    ),
                })?;
                COVERAGE.check(factor).map_err(|problem| WrongCertificate {
                    key: "coverage_factor",
                    problem,
                    hint: "k of U = k u is usually 2",
                })
            }
        }
    }

    /// Checks the level that is given for an error of `source`, which takes new values at level `possible`.
    pub fn check_level(&self, source: &str, possible: SourceLevel) -> Result<(), WrongCertificate> {
        let name = possible.name();
        let problem = match self.level {
            Some(level) if level == possible => return Ok(()),
            Some(level) => format!(
                "found {:?}; the level of {source} is {name:?}, and no other is modelled",
                level.name()
            ),
            None => {
                format!("is missing: it says what averages the error; that of {source} is {name:?}")
            }
        };
        Err(WrongCertificate {
            key: "level",
            problem,
            hint: "a maximum permissible error is mostly systematic: what is alike in all readings is another error source, such \
                   as load_scale, base_position or tool_position",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certificate(
        distribution: Option<ErrorDistribution>,
        coverage_factor: Option<f64>,
    ) -> CertifiedError {
        CertifiedError {
            distribution,
            coverage_factor,
            level: Some(SourceLevel::Reading),
        }
    }

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
            let divisor = certificate(Some(distribution), None).divisor();
            let found = divisor.expect("a divisor").powi(-2);
            assert!((found / expected - 1.0).abs() < 1e-3, "{distribution:?}");
        }
        for distribution in [None, Some(Normal)] {
            let divisor = certificate(distribution, Some(2.0)).divisor();
            assert_eq!(divisor, Ok(2.0));
        }
    }
}
