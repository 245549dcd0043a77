//! Error sources besides the instrument's noise, by their level.
//!
//! Levels average differently: what is new in each reading belongs to the reading's covariance; what is new at each visit to that of
//! all readings of the visit; what is shared by one configuration to that of all its visits, so that repeats do not average it; what
//! is shared by the whole plan is a parameter with a prior, and no number of readings averages it. A deflection is a visit by itself.

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ParameterKind, SourceLevel};
use crate::numeric::markov::Kernel;
use crate::robot::{Load, SerialChain};

/// The distribution from which a standard uncertainty was evaluated (GUM 4.3). Errors are sampled from normal ones of that
/// standard uncertainty.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorDistribution {
    /// All values within bounds alike; `rectangular`, as the GUM says, is another word for it.
    #[serde(alias = "rectangular")]
    Uniform,
    /// Values at the middle of the bounds most often.
    Triangular,
    /// Values at the bounds most often.
    Arcsine,
    /// Without bounds: a standard deviation, or a coverage factor that says what of it is meant.
    #[default]
    Normal,
}

impl ErrorDistribution {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Triangular => "triangular",
            Self::Arcsine => "arcsine",
            Self::Normal => "normal",
        }
    }
}

/// Something uncertain, as a scenario lists it.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Its unique name, which results bear.
    pub name: String,
    /// Whether the belief does not know of it: the planner is then wrong.
    pub is_hidden: bool,
    /// Whether it has another value than in the campaign of `robot.prior`: what errs was replaced since.
    pub is_replaced: bool,
    /// From which its standard uncertainty was evaluated.
    pub distribution: ErrorDistribution,
    /// What is uncertain, and by how much.
    pub source: Source,
}

/// What is uncertain, by the class in which it averages.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// Shared by the whole plan: parameters, each with its standard deviation in its own unit; positive
    /// ones in their logarithm.
    Plan(Vec<(ParameterKind, f64)>),
    /// New in each reading, at each visit, or in each configuration.
    Reading(ReadingSource),
}

/// What is new in each reading, at each visit or in each configuration; sizes are those of a deflection.
#[derive(Debug, Clone, PartialEq)]
pub enum ReadingSource {
    /// Each joint comes back to its command only within a standard deviation (rad; m where it slides)
    /// between the unloaded and the loaded reading: hysteresis, repeatability. One for each joint.
    JointRepeatability(Vec<f64>),
    /// The load acts in another direction: the standard deviation (rad) of each coordinate of a small rotation
    /// vector.
    LoadDirection(f64),
    /// The load acts at another point: the standard deviation (m) of each coordinate.
    LoadPoint(f64),
    /// The instrument's noise grows with the distance from where it stands.
    Range(RangeNoise),
    /// Each joint stands where it stands with an error of its gear, loaded and unloaded the same, under all loads and in all repeats.
    TransmissionError(TransmissionError),
    /// What no parameter explains is another error in each configuration, the same under all loads and in all repeats.
    Discrepancy(UnexplainedError),
    /// A gauge is set along another direction each time: the standard deviation (rad) of each coordinate of a small rotation vector.
    GaugeDirection(f64),
}

/// What no parameter explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnexplainedError {
    /// The standard deviation (m) of each coordinate.
    pub deviation_m: f64,
    /// Of what; where nothing says it, of deflections and of single readings alike.
    pub of: Option<DiscrepancyOf>,
}

impl UnexplainedError {
    /// The same in a single reading under a load.
    pub fn in_reading_m(self, load: &Load) -> f64 {
        if self.of == Some(DiscrepancyOf::Elastic) && *load == Load::NONE {
            0.0
        } else {
            self.deviation_m
        }
    }

    /// The same in a deflection, of two readings of one configuration.
    pub fn in_deflection_m(self) -> f64 {
        if self.of == Some(DiscrepancyOf::Pose) {
            0.0
        } else {
            self.deviation_m
        }
    }
}

/// Of what a discrepancy is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DiscrepancyOf {
    /// Of the unloaded robot's pose: loaded or not, readings have it, and it cancels in deflections.
    Pose,
    /// Of how loads bend the robot: loaded readings have it alone.
    Elastic,
}

/// What gears are off by.
#[derive(Debug, Clone, PartialEq)]
pub struct TransmissionError {
    /// A standard deviation for each joint (rad; m where it slides).
    pub deviations: Vec<f64>,
    /// How a joint's error is correlated over the joint's own angle (rad; m where it slides): then it is a random function of that angle, which the robot
    /// keeps. Without this it is independent between configurations, as of deflections it may be taken in any case.
    pub kernel: Option<Kernel>,
}

/// A joint's error as a random function of its own angle, which the robot keeps: cov(e(q), e(q')) = s^2 k(|q - q'|).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointFunction {
    /// The joint.
    pub joint: usize,
    /// The standard deviation s (rad; m where it slides, as all below).
    pub deviation_rad: f64,
    /// Its correlation k (of angles in rad).
    pub kernel: Kernel,
    /// How well the joint returns: the standard deviation of what is new at each visit (rad).
    pub repeatability_rad: f64,
}

impl JointFunction {
    /// Its correlation on an arm, from turn to turn where the joint has several.
    pub fn kernel_on(&self, chain: &SerialChain) -> Kernel {
        self.kernel.again(chain.joints[self.joint].period())
    }
}

impl TransmissionError {
    /// The joints' errors as functions, where they are any.
    pub fn functions(&self) -> impl Iterator<Item = JointFunction> {
        let joints = self.deviations.iter().enumerate();
        let uncertain = joints.filter(|(_, deviation)| **deviation > 0.0);
        uncertain.filter_map(|(joint, &deviation_rad)| {
            Some(JointFunction {
                joint,
                deviation_rad,
                kernel: self.kernel?,
                repeatability_rad: 0.0,
            })
        })
    }
}

/// Noise of an instrument that grows with the distance of what it reads. A laser tracker tells distances by its beam's
/// length, and what is across the beam by its angles, far less well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeNoise {
    /// Where the instrument stands, in the world frame (m).
    pub from_m: Vector3<f64>,
    /// The standard deviation of each coordinate of a deflection across the line of sight, per metre of distance.
    pub per_metre: f64,
    /// That of the coordinate along it.
    pub along_per_metre: f64,
}

impl RangeNoise {
    /// So many times the noise.
    pub fn scaled(self, by: f64) -> Self {
        Self {
            per_metre: self.per_metre * by,
            along_per_metre: self.along_per_metre * by,
            ..self
        }
    }

    /// By how much its variance along the line of sight is more than across it, per square metre of distance.
    fn more_along(&self) -> f64 {
        self.along_per_metre * self.along_per_metre - self.per_metre * self.per_metre
    }

    /// The derivative of sum(B * covariance) with respect to where a deflection is read, so far apart from the instrument (m), for a
    /// symmetric B.
    pub fn adjoint(&self, apart_m: &Vector3<f64>, of_covariance: &Matrix3<f64>) -> Vector3<f64> {
        let alike = apart_m * (2.0 * of_covariance.trace() * self.per_metre * self.per_metre);
        match self.more_along() {
            0.0 => alike,
            more => alike + of_covariance * apart_m * (2.0 * more),
        }
    }

    /// The noise of a deflection (m), or of a reading by itself, that is so far apart: of three standard normal numbers.
    pub fn drawn(&self, normals: &Vector3<f64>, apart_m: &Vector3<f64>) -> Vector3<f64> {
        let distance = apart_m.norm();
        let alike = normals * self.per_metre * distance;
        match self.along_per_metre - self.per_metre {
            0.0 => alike,
            more => {
                alike + apart_m * (apart_m.dot(normals) / distance.max(f64::MIN_POSITIVE) * more)
            }
        }
    }
}

impl ReadingSource {
    /// Of what moves along a gauge's direction the share that is shown on average where these sources err: a gauge that is turned by
    /// small angles of a standard deviation t about the two axes across it shows the mean of their cosine, exp(-t^2).
    pub fn share_along(sources: &[Self]) -> f64 {
        let squares = sources.iter().map(|source| match source {
            Self::GaugeDirection(deviation) => deviation * deviation,
            _ => 0.0,
        });
        (-squares.sum::<f64>()).exp()
    }

    /// How many normal numbers a reading takes for it.
    pub const fn numbers(&self) -> usize {
        match self {
            Self::JointRepeatability(deviations)
            | Self::TransmissionError(TransmissionError { deviations, .. }) => deviations.len(),
            Self::LoadDirection(_)
            | Self::LoadPoint(_)
            | Self::Range(_)
            | Self::Discrepancy(_)
            | Self::GaugeDirection(_) => 3,
        }
    }

    /// The joints' errors as functions of their own angles, where it is such: those of joints with an error, in their order.
    pub fn functions(&self) -> Vec<JointFunction> {
        match self {
            Self::TransmissionError(error) => error.functions().collect(),
            _ => Vec::new(),
        }
    }

    /// Whether it is such, which the robot keeps.
    pub const fn is_function(&self) -> bool {
        matches!(
            self,
            Self::TransmissionError(TransmissionError {
                kernel: Some(_),
                ..
            })
        )
    }

    /// Where absolute readings have a new value of it.
    pub const fn level_of_readings(&self) -> SourceLevel {
        if self.is_function() {
            SourceLevel::Robot
        } else {
            self.level()
        }
    }

    /// Whether all deflections of one configuration share it, under whatever load, so that repeats do not average it.
    pub const fn is_of_configuration(&self) -> bool {
        matches!(self, Self::TransmissionError(_) | Self::Discrepancy(_))
    }

    /// Where it takes a new value.
    pub const fn level(&self) -> SourceLevel {
        match self {
            Self::TransmissionError(_) | Self::Discrepancy(_) => SourceLevel::Configuration,
            Self::JointRepeatability(_)
            | Self::LoadDirection(_)
            | Self::LoadPoint(_)
            | Self::GaugeDirection(_) => SourceLevel::Visit,
            Self::Range(_) => SourceLevel::Reading,
        }
    }

    /// Whether it is new each time that a load is hung, of which a visit may have several.
    pub const fn is_of_load(&self) -> bool {
        matches!(self, Self::LoadDirection(_) | Self::LoadPoint(_))
    }

    /// What a contribution does not count of it, in words that follow the source's name.
    pub const fn remark(&self) -> Option<&'static str> {
        if self.is_function() {
            return Some(
                "is taken as new in each configuration; absolute readings count its correlation",
            );
        }
        None
    }

    /// Whether it is of deflections along a direction, or of those of all coordinates.
    #[inline]
    pub const fn is_of_deflection(&self, is_along: bool) -> bool {
        match self {
            Self::GaugeDirection(_) => is_along,
            Self::Range(_) => !is_along,
            Self::Discrepancy(error) => !matches!(error.of, Some(DiscrepancyOf::Pose)),
            _ => true,
        }
    }

    /// Whether variance components of residuals and repeats are of such errors.
    pub const fn is_found_from_residuals(&self) -> bool {
        matches!(
            self,
            Self::JointRepeatability(_) | Self::TransmissionError(_) | Self::Discrepancy(_)
        )
    }

    /// Whether the two readings that make a deflection have half of its variance each.
    pub const fn is_of_both_readings(&self) -> bool {
        matches!(self, Self::JointRepeatability(_) | Self::Range(_))
    }

    /// What part of its variance all deflections of one configuration share.
    pub const fn shared_part(&self, unloaded: Unloaded) -> f64 {
        if self.is_of_configuration() {
            1.0
        } else if self.is_of_both_readings() {
            unloaded.shared_part()
        } else {
            0.0
        }
    }
}

/// Which reading without the load a deflection rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Unloaded {
    /// One of its own.
    #[default]
    Own,
    /// The one that all deflections of its configuration rest on, whatever the load.
    Shared,
}

impl Unloaded {
    /// What part of the variance of a deflection that two like readings make all deflections of one configuration share.
    pub const fn shared_part(self) -> f64 {
        match self {
            Self::Own => 0.0,
            Self::Shared => 0.5,
        }
    }
}

/// How many times a variance counts in readings of which so many repeats are taken as independent, where they share this part
/// of it.
pub fn counted_times(shared_part: f64, repeats: f64) -> f64 {
    (1.0 - shared_part) + shared_part * repeats
}
