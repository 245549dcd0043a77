//! Why there is no plan of absolute readings.

use std::borrow::Cow;

use thiserror::Error;

use crate::files::FileError;
use crate::identification::AbsoluteError;
use crate::plan::search::{CandidateError, FiniteError};
use crate::quantities::limits::MOST_CANDIDATES;

/// So many names are told one by one.
const NAMED: usize = 6;

/// Some names, and how many more there are.
fn some_of(names: &[String]) -> String {
    let (some, rest) = names.split_at(names.len().min(NAMED));
    let some = some.join(", ");
    if rest.is_empty() {
        some
    } else {
        format!("{some} and {} more unknowns", rest.len())
    }
}

/// Why there is no plan of absolute readings.
#[derive(Debug, Error)]
pub enum AbsolutePlanError {
    /// The candidates.
    #[error(transparent)]
    Candidates(#[from] CandidateError),
    /// A target that the model does not have.
    #[error("line {line}: target: {source}")]
    Target {
        /// The line of the first candidate of it.
        line: usize,
        /// What is wrong.
        source: FileError,
    },
    /// A target beyond the link that carries the load.
    #[error(
        "line {line}: the target {target:?} is carried by a joint beyond the calibration tool's, at which loads act"
    )]
    BeyondLoad {
        /// The line of the candidate.
        line: usize,
        /// Its target.
        target: String,
    },
    /// A station that the scenario does not have.
    #[error(
        "line {line}: station: found {found:?}; the scenario has {}",
        some_of(known)
    )]
    Station {
        /// The line.
        line: usize,
        /// What it says.
        found: String,
        /// What was likely meant.
        likely: Option<String>,
        /// What there is.
        known: Vec<String>,
    },
    /// A reading of a plan that does not say where the instrument stands.
    #[error(
        "line {line}: station: is missing; the scenario has {}",
        some_of(known)
    )]
    NoStation {
        /// The line.
        line: usize,
        /// What there is.
        known: Vec<String>,
    },
    /// A plan has readings that are not possible.
    #[error("readings that are not possible: {0}")]
    NotPossible(String),
    /// No random plan tells the tool's place.
    #[error(
        "of {tries} sampled plans of {readings} readings, none determines the tool's place at the test poses"
    )]
    NoRandom {
        /// How many readings each has.
        readings: u32,
        /// How many plans there were.
        tries: usize,
    },
    /// No candidates could be drawn.
    #[error("no candidates could be sampled: {0}")]
    Drawn(String),
    /// Too many, each row from each station.
    #[error(
        "there are {found} candidates, each row from each station of the scenario; at most {MOST_CANDIDATES} are allowed"
    )]
    TooMany {
        /// How many.
        found: usize,
    },
    /// What can be read.
    #[error(transparent)]
    Readings(AbsoluteError),
    /// Experiments that every plan must contain.
    #[error("design.mandatory: plans of absolute readings have no mandatory experiments")]
    Mandatory,
    /// The place of the tool depends on what the candidates do not show.
    #[error(
        "the tool's place at the test poses depends on {}, which the candidates do not separate{}",
        some_of(names),
        unread.as_ref().map_or_else(String::new, |target| format!("; none of them reads {target}"))
    )]
    Undetermined {
        /// The unknowns.
        names: Vec<String>,
        /// The machining tool, where no candidate reads it.
        unread: Option<String>,
    },
    /// So few readings do not tell the tool's place.
    #[error(
        "no {readings} readings of the candidates were found that determine the tool's place at the test poses: it depends on {} besides",
        some_of(names)
    )]
    TooFew {
        /// How many.
        readings: u32,
        /// The unknowns.
        names: Vec<String>,
    },
    /// There is no such choice.
    #[error("{0}")]
    Choice(#[from] FiniteError),
}

impl AbsolutePlanError {
    /// What is wrong with candidates in these lines.
    pub(super) fn of_lines(error: AbsoluteError, lines: &[usize]) -> Self {
        let line = |reading: usize| lines.get(reading.wrapping_sub(1)).copied().unwrap_or(0);
        match error {
            AbsoluteError::Target { reading, source } => Self::Target {
                line: line(reading),
                source,
            },
            AbsoluteError::BeyondLoad { reading, target } => Self::BeyondLoad {
                line: line(reading),
                target,
            },
            other => Self::Readings(other),
        }
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<Cow<'static, str>> {
        if let Self::Station { likely, .. } = self {
            let likely = likely.as_ref();
            return Some(likely.map_or(
                Cow::Borrowed("a scenario with [[station]] has each station that candidates name"),
                |likely| Cow::Owned(format!("did you mean {likely:?}?")),
            ));
        }
        self.fixed_hint().map(Cow::Borrowed)
    }

    const fn fixed_hint(&self) -> Option<&'static str> {
        match self {
            Self::NoStation { .. } => Some("give the column station"),
            Self::TooMany { .. } => Some("give fewer rows, or the station of each"),
            Self::Candidates(error) => Some(error.hint()),
            Self::Target { .. } => Some(
                "add the target to the scenario as a [[robot.tool]], or to the model as a site",
            ),
            Self::Readings(error) => error.hint(),
            Self::Mandatory => Some(
                "leave it out, and name readings that there are to be among the candidates of `evaluate`",
            ),
            Self::Undetermined { .. } => Some(
                "give candidates in which all joints differ and whose target is the machining site, or say with [[uncertainty]] \
                 how well joints and links are known",
            ),
            Self::TooFew { .. } => Some("give more --experiments, or more candidates"),
            Self::NoRandom { .. } => Some("give more readings (study.experiments)"),
            Self::NotPossible(_)
            | Self::Drawn(_)
            | Self::Station { .. }
            | Self::BeyondLoad { .. }
            | Self::Choice(_) => None,
        }
    }
}
