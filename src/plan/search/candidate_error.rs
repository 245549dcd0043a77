//! Why candidates are left out, and why no plan can be chosen from them.

use thiserror::Error;

use crate::quantities::limits::MOST_CANDIDATES;

/// Candidates that are not possible for one reason.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct LeftOutCandidates {
    /// What is violated.
    pub what: String,
    /// How many.
    pub count: usize,
    /// The line of the first in its file.
    pub line: usize,
    /// What is wrong with that.
    pub first: String,
}

/// Why no plan can be chosen from candidates.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum CandidateError {
    /// Rows without a load, where there may be forces of any direction.
    #[error("the candidates have no loads, and load.kind = \"any\" does not say which")]
    NoLoad,
    /// A target or a station, where deflections are read.
    #[error(
        "line {line}: {column}: found {found:?}, and deflections are read of the calibration tool, whatever the station"
    )]
    Place {
        /// The line.
        line: usize,
        /// The column.
        column: &'static str,
        /// What it says.
        found: String,
    },
    /// Too many, each row under each load, or from each station.
    #[error(
        "there are {found} candidates, each row {} each {of} of the scenario; at most {MOST_CANDIDATES} are allowed",
        if *of == "load" { "under" } else { "from" }
    )]
    TooMany {
        /// How many.
        found: usize,
        /// What there are several of: `load` or `station`.
        of: &'static str,
    },
    /// None is possible.
    #[error("none of {offered} candidates is possible: {}", reasons.join("; "))]
    AllLeftOut {
        /// How many there were.
        offered: usize,
        /// The reasons, with how many each leaves out.
        reasons: Vec<String>,
    },
    /// All together do not determine what is asked for.
    #[error("the candidates do not determine what is asked for, whichever are measured")]
    Undetermined,
    /// They may not be measured so often.
    #[error("the candidates allow {allowed} measurements, and {wanted} are wanted")]
    TooFew {
        /// How many measurements there can be.
        allowed: u64,
        /// How many are wanted.
        wanted: u32,
    },
    /// So few measurements determine nothing.
    #[error("{measurements} of the candidates cannot determine {unknowns} unknowns")]
    Singular {
        /// The number of measurements.
        measurements: u32,
        /// The number of unknowns.
        unknowns: usize,
    },
}

impl CandidateError {
    /// What to do about it.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NoLoad => Some("give the columns fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm"),
            Self::Place { .. } => Some("leave the column out"),
            Self::TooMany { of: "load", .. } => Some("give fewer rows, or the load of each"),
            Self::TooMany { .. } => Some("give fewer rows, or the station of each"),
            Self::AllLeftOut { .. } => {
                Some("check the units of the angles, and the scenario's [region] and [load]")
            }
            Self::Undetermined | Self::TooFew { .. } | Self::Singular { .. } => None,
        }
    }
}

impl std::fmt::Display for LeftOutCandidates {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            what,
            count,
            line,
            first,
        } = self;
        write!(
            formatter,
            "{count} for {what} (the first in line {line}: {first})"
        )
    }
}
