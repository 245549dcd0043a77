//! The table `[gate]`: how much worse results may get before a comparison fails; and decisions about tolerances with a guard band
//! (JCGM 106).

use nalgebra::{DMatrix, Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::VariantArray;

use crate::numeric::tolerance::length_quantile;
use crate::quantities::plausible::TOLERANCE;

/// What a value says of a tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Decision {
    /// The value and its guard band are within.
    Accept,
    /// The tolerance lies within the guard band about the value.
    Inconclusive,
    /// The value is beyond, its guard band taken off.
    Reject,
}

impl Decision {
    /// That of a value, in the unit of the tolerance.
    pub fn of(value: f64, guard_band: f64, tolerance: f64) -> Self {
        if value + guard_band <= tolerance {
            Self::Accept
        } else if value - guard_band > tolerance {
            Self::Reject
        } else {
            Self::Inconclusive
        }
    }
}

/// A distance that a robot may be off by, and the guard band as so many times the expanded uncertainty of what is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistanceTolerance {
    /// The largest distance (m).
    pub tolerance_m: f64,
    /// Times U.
    pub guard_band: f64,
}

/// A measured distance that is judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JudgedDistance {
    /// The distance (m).
    pub distance_m: f64,
    /// U, the radius that holds 95 % of the reading's errors (m).
    pub expanded_uncertainty_m: f64,
    /// What it says.
    pub decision: Decision,
}

impl DistanceTolerance {
    /// Judges a difference (m) whose reading has this covariance (m^2): the true distance is nearer than U to the measured one.
    pub fn judge(&self, difference_m: &Vector3<f64>, reading_m2: &Matrix3<f64>) -> JudgedDistance {
        let covariance = DMatrix::from_column_slice(3, 3, reading_m2.as_slice());
        let expanded_uncertainty_m = length_quantile(&covariance, 0.95).unwrap_or(f64::INFINITY);
        let distance_m = difference_m.norm();
        let guard_m = self.guard_band * expanded_uncertainty_m;
        JudgedDistance {
            distance_m,
            expanded_uncertainty_m,
            decision: Decision::of(distance_m, guard_m, self.tolerance_m),
        }
    }
}

/// What comparisons of results look at.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Deserialize,
    JsonSchema,
    Serialize,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The rms distance that a plan predicts at the test poses, eq. 20.
    Rho0,
    /// The bound that no plan can beat, over rho0.
    Efficiency,
    /// The standard error that a plan predicts for a compliance.
    StandardError,
    /// The distance that compensation left at a test pose in the one run on the virtual robot.
    RealisedError,
    /// The mean distance that compensation leaves in a study.
    MeanError,
    /// The number of bounds that a plan does not keep.
    Violations,
    /// The number of runs of a study that failed.
    FailedRuns,
}

/// Which changes a gate objects to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Those for the worse.
    #[default]
    Worse,
    /// All.
    Both,
    /// None: the quantity is only shown.
    None,
}

/// How far a quantity may change: by the larger of the two.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema, Serialize)]
pub struct Tolerance {
    /// As a part of the value before.
    pub relative: f64,
    /// In the unit of the quantity.
    pub absolute: f64,
    /// Which changes count.
    pub direction: Direction,
    /// The guard band, as so many times the expanded uncertainty of the change.
    pub guard_band: f64,
}

/// A tolerance as it is written. Each quantity has one key for the absolute tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
struct ToleranceTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    relative: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    absolute: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    absolute_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    absolute_rad_per_nm: Option<f64>,
    #[serde(default)]
    direction: Direction,
    #[serde(skip_serializing_if = "Option::is_none")]
    guard_band: Option<f64>,
}

/// The table as it is written; results carry it to where they are compared.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    #[serde(skip_serializing_if = "Option::is_none")]
    rho0: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    efficiency: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    standard_error: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    realised_error: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_error: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    violations: Option<ToleranceTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    failed_runs: Option<ToleranceTable>,
}

impl Quantity {
    /// Its name in files, the unit of its values (empty for pure numbers), its key for an absolute tolerance, and the relative
    /// tolerance where the gate gives none; counts may not grow.
    const fn row(self) -> (&'static str, &'static str, &'static str, f64) {
        match self {
            Self::Rho0 => ("rho0", "um", "absolute_um", 0.01),
            Self::Efficiency => ("efficiency", "", "absolute", 0.01),
            Self::StandardError => ("standard_error", "rad/(N m)", "absolute_rad_per_nm", 0.05),
            Self::RealisedError => ("realised_error", "um", "absolute_um", 0.05),
            Self::MeanError => ("mean_error", "um", "absolute_um", 0.05),
            Self::Violations => ("violations", "", "absolute", 0.0),
            Self::FailedRuns => ("failed_runs", "", "absolute", 0.0),
        }
    }

    /// The name, as in files.
    pub const fn name(self) -> &'static str {
        self.row().0
    }

    /// The unit of its values; empty for pure numbers.
    pub const fn unit(self) -> &'static str {
        self.row().1
    }

    /// Whether a larger value is worse.
    pub const fn larger_is_worse(self) -> bool {
        !matches!(self, Self::Efficiency)
    }
}

impl ToleranceTable {
    /// Every key for an absolute tolerance with its value.
    const fn absolutes(&self) -> [(&'static str, Option<f64>); 3] {
        [
            ("absolute", self.absolute),
            ("absolute_um", self.absolute_um),
            ("absolute_rad_per_nm", self.absolute_rad_per_nm),
        ]
    }
}

impl Gate {
    const fn table(&self, quantity: Quantity) -> Option<ToleranceTable> {
        match quantity {
            Quantity::Rho0 => self.rho0,
            Quantity::Efficiency => self.efficiency,
            Quantity::StandardError => self.standard_error,
            Quantity::RealisedError => self.realised_error,
            Quantity::MeanError => self.mean_error,
            Quantity::Violations => self.violations,
            Quantity::FailedRuns => self.failed_runs,
        }
    }

    /// The tolerance of a quantity.
    pub fn tolerance(&self, quantity: Quantity) -> Tolerance {
        let table = self.table(quantity).unwrap_or_default();
        let absolute = table.absolutes().into_iter().find_map(|(_, value)| value);
        let default = absolute.map_or(quantity.row().3, |_| 0.0);
        Tolerance {
            relative: table.relative.unwrap_or(default),
            absolute: absolute.unwrap_or(0.0),
            direction: table.direction,
            guard_band: table.guard_band.unwrap_or(0.0),
        }
    }

    /// What is wrong with the table first: the key, and what was found.
    ///
    /// # Errors
    /// A tolerance is negative, not plausible, or in the wrong unit.
    pub fn check(&self) -> Result<(), (String, String)> {
        for &quantity in Quantity::VARIANTS {
            let Some(table) = self.table(quantity) else {
                continue;
            };
            let key = |key: &str| format!("{}.{key}", quantity.name());
            let right = quantity.row().2;
            for (name, value) in table.absolutes() {
                if value.is_some() && name != right {
                    let problem = format!(
                        "unknown field `{name}`, expected `relative`, `{right}` or `direction`"
                    );
                    return Err((key(name), problem));
                }
            }
            // The others are computed, not estimated.
            if table.guard_band.is_some() && quantity != Quantity::MeanError {
                let problem = "is not estimated and has no uncertainty; mean_error has";
                return Err((key("guard_band"), problem.to_owned()));
            }
            let others = [
                ("relative", table.relative),
                ("guard_band", table.guard_band),
            ];
            for (name, value) in table.absolutes().into_iter().chain(others) {
                if let Some(value) = value {
                    TOLERANCE
                        .check(value)
                        .map_err(|problem| (key(name), problem))?;
                }
            }
        }
        Ok(())
    }
}
