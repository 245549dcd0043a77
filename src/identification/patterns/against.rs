//! What residuals may go with: the columns of its effect on the readings, and its words.

use nalgebra::DMatrix;

use super::rows::{Base, LookedAt, ReadingRows};
use crate::robot::Drive;

/// What numbers of readings a drift goes with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Course {
    /// Their order.
    Order,
    /// When they were read.
    Time,
    /// How warm it was.
    Temperature,
}

impl Course {
    /// What it is, and the unit of its numbers.
    const fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Order => ("the order of the readings", "reading"),
            Self::Time => ("time", "s"),
            Self::Temperature => ("temperature", "deg C"),
        }
    }
}

/// What drifts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drifting {
    /// The robot's base in the station's frame, or a deflection as a whole: a shift.
    Base,
    /// The robot's size, or the instrument's scale.
    Size,
    /// A joint's zero; of deflections, its compliance.
    Joint(usize),
}

/// What residuals may go with. Joints count from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    /// A joint's angle: so many waves in a revolution.
    Angle {
        /// The joint.
        joint: usize,
        /// How many waves.
        waves: usize,
    },
    /// A joint's torque.
    Torque {
        /// The joint.
        joint: usize,
    },
    /// The side from which a joint came.
    Approach {
        /// The joint.
        joint: usize,
    },
    /// Order, time or temperature.
    Course(Course, Drifting),
    /// The distance from the instrument, along the line of sight.
    Range,
}

/// So many waves in a revolution are looked for: harmonic drives have up to 160 teeth a turn, twice of which is seen.
const MOST_WAVES: usize = 360;
/// With few readings fewer: twice their number, but no less than these.
const FEWEST_WAVES: usize = 12;

/// With more waves than these in a revolution the phase within one is drawn in place of the angle.
const WAVES_TO_SEE: usize = 8;

/// One column of a candidate: what a base of each reading is multiplied by.
pub(super) type PatternColumn = (Base, Vec<f64>);

impl LookedAt {
    /// All that these readings can be looked at against, as far as they say anything of it.
    pub(super) fn candidates(&self) -> Vec<Against> {
        let joints = 0..self.joints.len();
        let waves = (2 * self.readings.len()).clamp(FEWEST_WAVES, MOST_WAVES);
        let turning = joints.clone().filter(|&joint| {
            let drive = self.joints[joint].1;
            drive.passive_at.is_none() && !drive.slides
        });
        let mut all: Vec<Against> = turning
            .flat_map(|joint| (1..=waves).map(move |waves| Against::Angle { joint, waves }))
            .collect();
        for joint in joints.clone() {
            all.extend([Against::Torque { joint }, Against::Approach { joint }]);
        }
        for course in [Course::Order, Course::Time, Course::Temperature] {
            let size = (!self.is_of_deflections).then_some(Drifting::Size);
            let drifting = [Drifting::Base].into_iter().chain(size);
            let drifting = drifting.chain(joints.clone().map(Drifting::Joint));
            all.extend(drifting.map(|drifting| Against::Course(course, drifting)));
        }
        all.push(Against::Range);
        all.retain(|against| match against {
            Against::Angle { .. } | Against::Torque { .. } => true,
            Against::Range => self.readings.iter().any(|each| each.range_m.is_some()),
            _ => (self.standardised(*against).iter()).any(|factor| *factor != 0.0),
        });
        all
    }

    /// What a candidate does to the rows of all readings (6 N x q).
    pub(super) fn rows_of(&self, against: Against) -> DMatrix<f64> {
        let columns = self.columns(against);
        let rows = columns.iter().flat_map(|(base, factors)| {
            let each = self.readings.iter().zip(factors);
            each.flat_map(|(reading, factor)| <[f64; 6]>::from(base.of(reading) * *factor))
        });
        DMatrix::from_iterator(6 * self.readings.len(), columns.len(), rows)
    }

    /// The columns of candidates. One wave more in a revolution is a turn by the angle: quicker than its sine and cosine.
    pub(super) fn columns_of(&self, candidates: &[Against]) -> Vec<Vec<PatternColumn>> {
        let mut all: Vec<Vec<PatternColumn>> = Vec::with_capacity(candidates.len());
        for each in candidates.chunk_by(Against::is_before) {
            let mut columns = self.columns(each[0]);
            if let (Against::Angle { joint, .. }, 2..) = (each[0], each.len()) {
                let angles = self.readings.iter().map(|each| each.angles[joint]);
                let turns: Vec<(f64, f64)> = angles.map(f64::sin_cos).collect();
                for _ in &each[1..] {
                    let next = turned(&columns, &turns);
                    all.push(std::mem::replace(&mut columns, next));
                }
            }
            all.push(columns);
        }
        all
    }

    /// A candidate's columns.
    pub(super) fn columns(&self, against: Against) -> Vec<PatternColumn> {
        let of = |base: Base, factor: &dyn Fn(&ReadingRows) -> f64| -> PatternColumn {
            (base, self.readings.iter().map(factor).collect())
        };
        match against {
            Against::Angle { joint, waves } => {
                let phases = self.readings.iter();
                let phases = phases.map(|each| (waves as f64 * each.angles[joint]).sin_cos());
                let (sines, cosines) = phases.unzip();
                vec![(Base::Moved(joint), cosines), (Base::Moved(joint), sines)]
            }
            Against::Torque { joint } => {
                let torque = |each: &ReadingRows| each.torques[joint];
                let sizes = self.readings.iter().map(|each| torque(each).abs());
                let largest = sizes.fold(f64::MIN_POSITIVE, f64::max);
                let moved = Base::Moved(joint);
                let sign = of(moved, &|each| torque(each).signum());
                if self.is_of_deflections {
                    return vec![of(moved, &|each| torque(each).abs() / largest), sign];
                }
                let square =
                    |each: &ReadingRows| torque(each) * torque(each).abs() / largest.powi(2);
                vec![of(Base::Bent(joint), &|_| 1.0), of(moved, &square), sign]
            }
            Against::Approach { joint } | Against::Course(_, Drifting::Joint(joint)) => {
                vec![(Base::Moved(joint), self.standardised(against))]
            }
            Against::Course(_, Drifting::Base) => {
                let factors = self.standardised(against);
                (0..3)
                    .map(|axis| (Base::Placed(axis), factors.clone()))
                    .collect()
            }
            Against::Course(_, Drifting::Size) => {
                vec![(Base::Placed(3), self.standardised(against))]
            }
            Against::Range => {
                let sight = Base::Placed(4);
                let known = of(sight, &|each| f64::from(u8::from(each.range_m.is_some())));
                vec![known, (sight, self.standardised(against))]
            }
        }
    }

    /// Where a reading is on the candidate's scale: its angle or phase (rad), torque (N m), sign of approach, place from 1, time (s),
    /// temperature (deg C), or range (m).
    pub(super) fn at(&self, against: Against, index: usize) -> Option<f64> {
        let reading = &self.readings[index];
        match against {
            Against::Angle { joint, waves } if waves > WAVES_TO_SEE => {
                Some((waves as f64 * reading.angles[joint]).rem_euclid(std::f64::consts::TAU))
            }
            Against::Angle { joint, .. } => Some(reading.angles[joint]),
            Against::Torque { joint } => Some(reading.torques[joint]),
            Against::Approach { joint } => {
                let sign = *reading.approach.as_ref()?.get(joint)?;
                Some(if sign { 1.0 } else { -1.0 })
            }
            Against::Course(Course::Order, _) => Some(index as f64 + 1.0),
            Against::Course(Course::Time, _) => reading.time_s,
            Against::Course(Course::Temperature, _) => reading.temperature_c,
            Against::Range => reading.range_m,
        }
    }

    /// The same, its mean taken off, in standard deviations; zero where it is not known or always the same.
    fn standardised(&self, against: Against) -> Vec<f64> {
        let values: Vec<Option<f64>> = (0..self.readings.len())
            .map(|index| self.at(against, index))
            .collect();
        let known = || values.iter().copied().flatten();
        let count = known().count().max(1) as f64;
        let mean = known().sum::<f64>() / count;
        let deviation = (known().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
        let is_one = deviation <= 1e-9 * mean.abs().max(1e-9);
        let of = |value: &Option<f64>| match value {
            Some(value) if !is_one => (value - mean) / deviation,
            _ => 0.0,
        };
        values.iter().map(of).collect()
    }

    /// A pattern of this size in words, what may cause it, and the units of its size and of its scale.
    pub(super) fn words(
        &self,
        against: Against,
        size: f64,
    ) -> (String, &'static str, [&'static str; 2]) {
        let is_softer = self.is_of_deflections;
        let either = |of_deflections, of_readings| {
            if is_softer {
                of_deflections
            } else {
                of_readings
            }
        };
        let name = against.joint().map_or("", |joint| &self.joints[joint].0);
        let in_mm = format!("{:.4} mm", size * 1e3);
        let drive = against
            .joint()
            .map_or_else(Drive::default, |joint| self.joints[joint].1);
        let rad = either(drive.compliance_unit(), drive.unit());
        let turn = match (is_softer, drive.slides) {
            (true, _) => format!("{:.4}e-6 {rad}", size * 1e6),
            (false, true) => in_mm.clone(),
            (false, false) => format!("{:.4} mrad", size * 1e3),
        };
        match against {
            Against::Angle { waves, .. } => {
                let does = either(
                    "is softer and stiffer",
                    "turns further and less far than commanded",
                );
                let often = match waves {
                    1 => "once".to_owned(),
                    2 => "twice".to_owned(),
                    more => format!("{more} times"),
                };
                let cause = either(
                    "a gear or bearing of uneven stiffness",
                    "a gear, encoder or bearing that is not round, or a geometry that the model lacks",
                );
                let at = if waves > WAVES_TO_SEE {
                    "deg of the harmonic"
                } else {
                    "deg"
                };
                (
                    format!("angle of {name}: it {does} by {turn}, {often} a revolution"),
                    cause,
                    [rad, at],
                )
            }
            Against::Torque { .. } => {
                let does = either("its compliance changes", "it turns");
                let cause = either(
                    "a stiffness that grows with torque, or play",
                    "a compliance that is not fitted or not the same at all torques, play, or friction",
                );
                (
                    format!("torque of {name}: {does} by {turn} with it"),
                    cause,
                    [rad, "N m"],
                )
            }
            Against::Approach { .. } => {
                let words = format!(
                    "approach: {name} is {turn} further when approached from one side than from the other"
                );
                (words, "play, friction or hysteresis", [rad, "sign"])
            }
            Against::Course(course, drifting) => {
                let (with, at) = course.words();
                let (does, cause, unit) = match drifting {
                    Drifting::Base => (
                        format!(
                            "{} by {in_mm}",
                            either("deflections shift", "the base shifts")
                        ),
                        "the station or the robot's foot moves, or the instrument drifts",
                        "m",
                    ),
                    Drifting::Size => (
                        format!("the robot grows or shrinks by {:.1} um/m", size * 1e6),
                        "the robot warms, or the instrument's scale drifts",
                        "1",
                    ),
                    Drifting::Joint(_) => (
                        format!(
                            "the {} of {name} drifts by {turn}",
                            either("compliance", "zero")
                        ),
                        "the joint warms, slips or wears in",
                        rad,
                    ),
                };
                (format!("{with}: {does}"), cause, [unit, at])
            }
            Against::Range => {
                let words = format!(
                    "range: distances from the instrument are off by {in_mm} more at some places than at others"
                );
                (words, "the instrument's scale or offset", ["m", "m"])
            }
        }
    }
}

/// The cosines and sines of an angle more, whose sines and cosines are given.
fn turned(columns: &[PatternColumn], turns: &[(f64, f64)]) -> Vec<PatternColumn> {
    let before = columns[0].1.iter().zip(&columns[1].1);
    let (cosines, sines) = (before.zip(turns))
        .map(|((cosine, sine), (by_sine, by_cosine))| {
            (
                cosine * by_cosine - sine * by_sine,
                sine * by_cosine + cosine * by_sine,
            )
        })
        .unzip();
    vec![(columns[0].0, cosines), (columns[1].0, sines)]
}

impl Against {
    /// Whether another is of the same joint's angle, by one wave more.
    fn is_before(&self, next: &Self) -> bool {
        match (*self, *next) {
            (
                Self::Angle { joint, waves },
                Self::Angle {
                    joint: also,
                    waves: more,
                },
            ) => joint == also && waves + 1 == more,
            _ => false,
        }
    }

    /// What residuals are looked at against.
    pub const fn kind(self) -> &'static str {
        match self {
            Self::Angle { .. } => "joint angle",
            Self::Torque { .. } => "joint torque",
            Self::Approach { .. } => "approach",
            Self::Course(Course::Order, _) => "order",
            Self::Course(Course::Time, _) => "time",
            Self::Course(Course::Temperature, _) => "temperature",
            Self::Range => "range",
        }
    }

    /// What drifts, in a word.
    pub(super) const fn drifting(self) -> Option<&'static str> {
        match self {
            Self::Course(_, Drifting::Base) => Some("base"),
            Self::Course(_, Drifting::Size) => Some("size"),
            Self::Course(_, Drifting::Joint(_)) => Some("joint"),
            _ => None,
        }
    }

    /// Whose pattern it is, where it is a joint's.
    pub const fn joint(self) -> Option<usize> {
        match self {
            Self::Angle { joint, .. }
            | Self::Torque { joint }
            | Self::Approach { joint }
            | Self::Course(_, Drifting::Joint(joint)) => Some(joint),
            _ => None,
        }
    }
}
