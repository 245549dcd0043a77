//! Standard deviations by their keys, given as such or as the maximum permissible errors of certificates and data sheets.
//!
//! A certificate bounds an error by +-a, or has an expanded uncertainty U = k u. The standard uncertainty follows from the
//! distribution that is assumed within the bounds (GUM 4.3.7, 4.3.9; JCGM 101, 6.4):
//!
//! ```text
//! uniform u = a / sqrt(3)   triangular u = a / sqrt(6)   arcsine u = a / sqrt(2)   normal u = a / k
//! ```

use std::collections::BTreeMap;
use std::f64::consts::{PI, SQRT_2};

use toml::{Table, Value};

use super::Checker;
use crate::files::FileError;
use crate::parameter::ErrorDistribution;
use crate::quantities::plausible::{
    COVERAGE, DEVIATION, FORCE_LIMIT, GAP_DEVIATION as GAP, Kind, PER_HOUR_DEVIATION as PER_HOUR,
    PER_METRE_DEVIATION as PER_METRE, RELATIVE_DEVIATION as RELATIVE,
    ROTATION_DEVIATION as ROTATION,
};

/// A standard deviation that a table may give.
pub(super) struct Size {
    /// Its key.
    pub key: &'static str,
    /// The key of the maximum permissible error in whose place it may be given, none if empty, ...
    pub mpe: &'static str,
    /// ... and that one's unit in its own. An instrument's error is of one reading, and two make a deflection.
    mpe_unit: f64,
    range: &'static Kind,
    /// Its unit in SI.
    unit: f64,
}

const fn size(
    [key, mpe]: [&'static str; 2],
    mpe_unit: f64,
    range: &'static Kind,
    unit: f64,
) -> Size {
    Size {
        key,
        mpe,
        mpe_unit,
        range,
        unit,
    }
}

/// An arc second (rad).
const ARCSEC: f64 = 1.0 / 3600.0 * (PI / 180.0);

/// Of uncertainties.
pub(super) const SIZES: [Size; 9] = [
    size(["std_relative", "mpe_relative"], 1.0, &RELATIVE, 1.0),
    size(["std_mm", "mpe_um"], 1e-3, &DEVIATION, 1e-3),
    size(["std_mrad", "mpe_mrad"], 1.0, &ROTATION, 1e-3),
    size(["std_arcsec", "mpe_arcsec"], 1.0, &GAP, ARCSEC),
    size(["std_n", "mpe_n"], 1.0, &FORCE_LIMIT, 1.0),
    size(["std_um_per_m", "mpe_um_per_m"], SQRT_2, &PER_METRE, 1e-6),
    size(ALONG, SQRT_2, &PER_METRE, 1e-6),
    size(["std_um_per_h", "mpe_um_per_h"], 1.0, &PER_HOUR, 1e-6),
    size(["rp_mm", ""], 1.0, &DEVIATION, 1e-3),
];

const ALONG: [&str; 2] = ["along_um_per_m", "mpe_along_um_per_m"];

/// Of the instrument's noise.
pub(super) const NOISE: [Size; 2] = [
    size(["sigma_mm", "mpe_um"], 1e-3, &DEVIATION, 1e-3),
    size(OF_ROTATION, 1.0, &ROTATION, 1e-3),
];

const OF_ROTATION: [&str; 2] = ["rotation_sigma_mrad", "rotation_mpe_mrad"];

impl Checker<'_> {
    /// The standard deviations (SI) that a table gives under these keys, or as maximum permissible errors in their place.
    pub(super) fn deviations(
        &self,
        key: &str,
        table: &Table,
        sizes: &[Size],
    ) -> Result<BTreeMap<&'static str, f64>, FileError> {
        let given = |name: &str| table.get(name).and_then(Value::as_float);
        let mut words = ["distribution", "coverage_factor"].into_iter();
        let has_mpe = sizes.iter().any(|size| given(size.mpe).is_some());
        if let Some(word) = words.find(|word| !has_mpe && table.contains_key(*word)) {
            let problem = "is of a maximum permissible error, and none is given";
            let wrong = self.wrong(&format!("{key}.{word}"), problem);
            return Err(
                wrong.hint("leave it out, or give mpe_... in place of the standard deviation")
            );
        }
        let mut deviations = BTreeMap::new();
        for size in sizes {
            let own = format!("{key}.{}", size.mpe);
            let deviation = match (given(size.key), given(size.mpe)) {
                (None, None) => continue,
                (Some(deviation), None) => deviation,
                (Some(_), Some(_)) => {
                    let wrong = self.wrong(&own, format!("{} is given, too", size.key));
                    return Err(wrong.hint("leave out one of the two"));
                }
                (None, Some(error)) if error > 0.0 => {
                    error * size.mpe_unit / self.divisor(key, table)?
                }
                (None, Some(error)) => {
                    let problem = format!(
                        "found {error}; a positive number is allowed: half of the width between the bounds"
                    );
                    return Err(self.wrong(&own, problem));
                }
            };
            let key = format!("{key}.{}", size.key);
            deviations.insert(
                size.key,
                self.number(&key, deviation, size.range)? * size.unit,
            );
        }
        Ok(deviations)
    }

    /// How many standard uncertainties a maximum permissible error is.
    fn divisor(&self, key: &str, table: &Table) -> Result<f64, FileError> {
        let distribution = (table.get("distribution").cloned())
            .and_then(|distribution| distribution.try_into::<ErrorDistribution>().ok());
        let factor = table.get("coverage_factor").and_then(Value::as_float);
        let factor_key = format!("{key}.coverage_factor");
        match (distribution.and_then(bounds_square), factor) {
            (Some(square), None) => Ok(square.sqrt()),
            (Some(_), Some(_)) => {
                let problem = "is given beside a distribution with bounds";
                Err(self.wrong(&factor_key, problem).hint(
                    "leave out one of the two: bounds and a distribution, or U = k u with a coverage factor",
                ))
            }
            (None, Some(factor)) => (self.number(&factor_key, factor, &COVERAGE))
                .map_err(|wrong| wrong.hint("k of U = k u is usually 2")),
            (None, None) if distribution.is_none() => {
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
