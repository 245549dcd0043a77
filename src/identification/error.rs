//! What can go wrong in identification.

use std::path::Path;

use thiserror::Error;

use crate::codes::ErrorCode;
use crate::files::FileError;
use crate::numeric::posterior::NotDetermined;
use crate::parameter::ParameterError;
use crate::robot::EquilibriumError;

/// Values that no prior has: a fit is not to go there.
pub(super) const OFF_PRIOR: IdentificationError = IdentificationError::NotConverged {
    step: f64::INFINITY,
};

/// Why nothing can be identified, or predicted. Measurements and readings count from 1.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum IdentificationError {
    /// There are no measurements.
    #[error("there are no measurements")]
    NoMeasurements,
    /// No measurement depends on any of the parameters: no load has a torque on a joint, for example.
    #[error("the measurements determine none of the parameters")]
    NothingObserved,
    /// Sigma cannot be estimated from as many equations as unknowns.
    #[error(
        "sigma cannot be estimated from residuals: {equations} equations determine {rank} unknowns: there are no degrees of freedom"
    )]
    NoResiduals {
        /// The number of scalar measurements.
        equations: usize,
        /// The number of determined combinations.
        rank: usize,
    },
    /// The model has no equilibrium where one was measured.
    #[error("measurement {measurement}: with the parameters that fit so far, {source}")]
    Equilibrium {
        /// The measurement.
        measurement: usize,
        /// What is wrong.
        source: EquilibriumError,
    },
    /// The fit did not converge.
    #[error("the fit did not converge: the last step was {step:.1e} standard errors")]
    NotConverged {
        /// The length of the last step.
        step: f64,
    },
    /// What is measured depends on what was not identified.
    #[error("measurement {measurement}: what is predicted depends on compliances: {source}")]
    NotDetermined {
        /// The measurement.
        measurement: usize,
        /// Which.
        source: NotDetermined,
    },
    /// There is no covariance to judge by.
    #[error("the covariance of what was identified is none")]
    Singular,
    /// A target that the model does not have.
    #[error("reading {reading}: target: {source}")]
    Target {
        /// The first reading of it.
        reading: usize,
        /// What is wrong.
        source: Box<FileError>,
    },
    /// A target beyond the link that carries the load.
    #[error(
        "reading {reading}: the target {target:?} is carried by a joint beyond the calibration tool's, at which loads act"
    )]
    BeyondLoad {
        /// The reading.
        reading: usize,
        /// Its target.
        target: String,
    },
    /// Poses, and nobody says how precise their orientations are.
    #[error("nothing says how precise the orientations are")]
    NoRotationSigma,
    /// Positions that the robot cannot reach, or angles that it does not have.
    #[error(
        "half of the positions lie more than {found} mm apart, and the robot's own, at the commanded angles, {expected} mm"
    )]
    Units {
        /// What the readings say (mm).
        found: String,
        /// What the robot does (mm).
        expected: String,
    },
    /// Frames that readings of this robot can determine, and these do not.
    #[error("the readings do not determine {what}: {}", sentences.join("; "))]
    Frames {
        /// Stations and targets, in words.
        what: String,
        /// What cannot be separated.
        sentences: Vec<String>,
    },
    /// Fewer numbers than the frames alone have unknowns.
    #[error(
        "{rows} numbers were read, and the frames of stations and targets alone have {unknowns} unknowns"
    )]
    TooFew {
        /// Numbers read.
        rows: usize,
        /// Unknowns of the frames.
        unknowns: usize,
    },
    /// Too few configurations to leave blocks of them out.
    #[error(
        "models and series are compared by leaving out blocks of joint space, for which {needed} different configurations are \
         needed: {different} were read"
    )]
    TooFewConfigurations {
        /// How many there are.
        different: usize,
        /// The fewest.
        needed: usize,
    },
    /// Readings and robot have nothing to do with each other.
    #[error(
        "no frames bring the robot's positions nearer than {left} mm (rms) to those that were read, which lie {spread} mm about \
         their mean"
    )]
    Unlike {
        /// What is left (mm).
        left: String,
        /// How far the positions reach (mm).
        spread: String,
    },
    /// An input error that explains why there is nothing.
    #[error("{source}")]
    Mistaken {
        /// What is wrong.
        source: Box<Self>,
        /// The input error, in words.
        likely: String,
    },
    /// Readings of another kind than the scenario's instrument has, and nobody says how precise they are.
    #[error("nothing says how precise the {0}s are: instrument.reads is of another kind")]
    NoSigma(&'static str),
    /// Lengths of a kind from where nobody knows.
    #[error("{0}s are read from {1}, and the scenario has no such [[station]]")]
    NoPlace(&'static str, String),
    /// A length where positions are read, or the other way round.
    #[error(
        "reading {reading} is a {is} from station {station:?}, where the scenario reads another kind"
    )]
    OtherKind {
        /// Its number.
        reading: usize,
        /// What it is, in words.
        is: &'static str,
        /// The station's name.
        station: String,
    },
    /// A choice of all that there is.
    #[error("holds {offered}, of which {size} leave none to validate on")]
    NothingLeft {
        /// Of what is chosen, in words.
        offered: String,
        /// The size of the choice.
        size: u32,
    },
    /// A parameter that the robot cannot have.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

/// What a fit gives, if anything.
pub type FitResult<T> = Result<T, IdentificationError>;

impl From<(usize, EquilibriumError)> for IdentificationError {
    /// Of a measurement that counts from 0.
    fn from((index, source): (usize, EquilibriumError)) -> Self {
        Self::Equilibrium {
            measurement: index + 1,
            source,
        }
    }
}

impl IdentificationError {
    /// Its kind.
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::NoMeasurements
            | Self::NothingObserved
            | Self::NoResiduals { .. }
            | Self::NotDetermined { .. } => ErrorCode::NothingIdentified,
            Self::Equilibrium { .. } => ErrorCode::NoEquilibrium,
            Self::NotConverged { .. } => ErrorCode::NotConverged,
            Self::Frames { .. } | Self::TooFew { .. } => ErrorCode::Frames,
            Self::NothingLeft { .. } => ErrorCode::Measurements,
            Self::Mistaken { source, .. } => source.code(),
            _ => ErrorCode::AbsoluteFit,
        }
    }

    /// The same of a file that holds the readings, or says what they are of.
    pub fn in_file(&self, path: &Path) -> FileError {
        let wrong = FileError::new(path, self.to_string()).code(self.code());
        wrong.hinted(self.hint())
    }

    /// What to do about it.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Mistaken { likely, .. } => Some(likely),
            Self::Units { .. } => Some(
                "metres or inches in a column of millimetres, or radians in one of degrees? `elastocal import` converts",
            ),
            Self::NotDetermined { .. } => Some(
                "say what is known of them, as [[uncertainty]] of kind = \"compliance\", and identify again",
            ),
            Self::Unlike { .. } => Some(
                "check the order, signs and units of the joint angles, and whether station and target name the right rows",
            ),
            Self::Frames { .. } | Self::TooFew { .. } => Some(
                "read more configurations in which all joints differ, from each station and of each target",
            ),
            Self::TooFewConfigurations { .. } => {
                Some("read more configurations, or name what to fit with --parameters")
            }
            Self::NoRotationSigma => Some(
                "give columns srx_mrad,sry_mrad,srz_mrad, or instrument.rotation_sigma_mrad in the scenario",
            ),
            Self::Target { .. } => Some(
                "add the target to the scenario as a [[robot.tool]], or to the model as a site",
            ),
            Self::NoSigma(_) => Some(
                "give instrument.reads for lengths of one kind alone, a table as [instrument.distance] for those beside positions, or columns \
                 of standard deviations",
            ),
            Self::NoPlace(..) => Some(
                "give the column station, and a [[station]] with position_mm for each place that lengths are read from",
            ),
            Self::OtherKind { .. } => Some(
                "[[station]] says what is read from each: reads = \"position\", or as \"distance\" with [instrument.distance]",
            ),
            Self::NothingLeft { .. } => Some("give smaller --sizes"),
            _ => None,
        }
    }
}
