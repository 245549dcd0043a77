//! A pattern in words, its size, and means for its picture.

use nalgebra::Vector6;
use serde::Serialize;

use super::Coefficients;
use super::candidates::{Against, Base, Course, Drifting};
use super::rows::LookedAt;

/// Readings are put together in so many bins.
const BINS: usize = 24;
/// With more waves than these in a revolution the phase within one is drawn in place of the angle.
pub const WAVES_TO_SEE: usize = 8;

/// The mean of what some readings show.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PatternPoint {
    /// Against which value: angle or phase (rad), torque (N m), sign of approach, place, time (s), temperature (deg C), range (m).
    pub at: f64,
    /// What is seen there: rad, m or 1.
    #[serde(rename = "observed")]
    pub seen: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// What the pattern says.
    pub pattern: f64,
}

impl LookedAt {
    /// What a pattern makes of each reading: an angle or a growth, or a length.
    fn effects(&self, against: Against, coefficients: &Coefficients) -> Vec<f64> {
        let columns = self.columns(against);
        if let Against::Course(_, Drifting::Base) = against {
            return (columns[0].factors.iter())
                .map(|factor| factor * coefficients.norm())
                .collect();
        }
        (self.readings.iter().enumerate())
            .map(|(index, reading)| {
                let parts = columns.iter().zip(coefficients.iter());
                parts
                    .map(|(column, coefficient)| {
                        // A compliance turns the joint by so much for each N m.
                        let turned = match column.base {
                            Base::Bent(joint) => reading.torques[joint],
                            _ => 1.0,
                        };
                        coefficient * column.factors[index] * turned
                    })
                    .sum::<f64>()
            })
            .collect()
    }

    /// The amplitude of waves; of all else the whole range over the readings.
    pub(super) fn size(&self, against: Against, coefficients: &Coefficients) -> f64 {
        if let Against::Angle { .. } = against {
            return coefficients.norm();
        }
        let effects = self.effects(against, coefficients);
        let highest = effects.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lowest = effects.iter().copied().fold(f64::INFINITY, f64::min);
        if highest < lowest {
            0.0
        } else {
            highest - lowest
        }
    }

    /// The pattern in words.
    pub(super) fn sentence(&self, against: Against, coefficients: &Coefficients) -> String {
        let size = self.size(against, coefficients);
        let name = |joint: usize| &self.joints[joint].0;
        let is_softer = self.is_of_deflections;
        let of_joint = if is_softer {
            format!("{:.4}e-6 rad/(N m)", size * 1e6)
        } else {
            format!("{:.4} mrad", size * 1e3)
        };
        let in_mm = size * 1e3;
        match against {
            Against::Angle { joint, waves } => {
                let often = match waves {
                    1 => "once a revolution".to_owned(),
                    2 => "twice a revolution".to_owned(),
                    more => format!("{more} times a revolution"),
                };
                let does = if is_softer {
                    "is softer and stiffer"
                } else {
                    "turns further and less far than commanded"
                };
                format!("angle of {}: it {does} by {of_joint}, {often}", name(joint))
            }
            Against::Torque { joint } if is_softer => {
                format!(
                    "torque of {}: its compliance changes by {of_joint} with it",
                    name(joint)
                )
            }
            Against::Torque { joint } => {
                format!("torque of {}: it turns by {of_joint} with it", name(joint))
            }
            Against::Approach { joint } => format!(
                "approach: {} is {of_joint} further when approached from one side than from the other",
                name(joint)
            ),
            Against::Course(course, drifting) => {
                let with = course.words();
                match drifting {
                    Drifting::Base if is_softer => {
                        format!("{with}: deflections shift by {in_mm:.4} mm")
                    }
                    Drifting::Base => format!("{with}: the base shifts by {in_mm:.4} mm"),
                    Drifting::Size => {
                        format!(
                            "{with}: the robot grows or shrinks by {:.1} um/m",
                            size * 1e6
                        )
                    }
                    Drifting::Joint(joint) => {
                        let what = if is_softer { "compliance" } else { "zero" };
                        format!("{with}: the {what} of {} drifts by {of_joint}", name(joint))
                    }
                }
            }
            Against::Range => format!(
                "range: distances from the instrument are off by {in_mm:.4} mm more at some places than at others"
            ),
        }
    }

    /// What may cause such a pattern.
    pub(super) const fn cause(&self, against: Against) -> &'static str {
        match against {
            Against::Angle { .. } if self.is_of_deflections => {
                "a gear or bearing of uneven stiffness"
            }
            Against::Angle { .. } => {
                "a gear, encoder or bearing that is not round, or a geometry that the model lacks"
            }
            Against::Torque { .. } if self.is_of_deflections => {
                "a stiffness that grows with torque, or play"
            }
            Against::Torque { .. } => {
                "a compliance that is not fitted or not the same at all torques, play, or friction"
            }
            Against::Approach { .. } => "play, friction or hysteresis",
            Against::Course(_, Drifting::Base) => {
                "the station or the robot's foot moves, or the instrument drifts"
            }
            Against::Course(_, Drifting::Size) => {
                "the robot warms, or the instrument's scale drifts"
            }
            Against::Course(_, Drifting::Joint(_)) => "the joint warms, slips or wears in",
            Against::Range => "the instrument's scale or offset",
        }
    }

    /// Means of what readings show, all other patterns taken off.
    pub(super) fn points(
        &self,
        against: Against,
        coefficients: &Coefficients,
        left: &[Vector6<f64>],
    ) -> Vec<PatternPoint> {
        let columns = self.columns(against);
        let effects = self.effects(against, coefficients);
        let mut seen: Vec<Seen> = Vec::new();
        for (index, reading) in self.readings.iter().enumerate() {
            // What it does to the reading for an effect of one.
            let base = if let Against::Course(_, Drifting::Base) = against {
                let length = coefficients.norm();
                let parts = columns.iter().zip(coefficients.iter());
                parts
                    .map(|(column, coefficient)| column.base.of(reading) * (coefficient / length))
                    .sum()
            } else {
                let mut bases = columns.iter().rev().map(|column| column.base);
                let moved = bases.find(|base| !matches!(base, Base::Bent(_)));
                moved.map_or_else(Vector6::zeros, |base| base.of(reading))
            };
            let weight = base.norm_squared();
            if let Some(at) = self.at(against, index).filter(|_| weight > 0.0) {
                let effect = effects[index];
                let value = effect + base.dot(&left[index]) / weight;
                seen.push(Seen {
                    at,
                    value,
                    effect,
                    weight,
                });
            }
        }
        binned(&seen)
    }

    /// Against which value a reading is drawn.
    fn at(&self, against: Against, index: usize) -> Option<f64> {
        let reading = &self.readings[index];
        match against {
            Against::Angle { joint, waves } => {
                let angle = reading.angles[joint];
                let is_seen = waves <= WAVES_TO_SEE;
                Some(if is_seen {
                    angle
                } else {
                    (waves as f64 * angle).rem_euclid(std::f64::consts::TAU)
                })
            }
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
}

impl Course {
    const fn words(self) -> &'static str {
        match self {
            Self::Order => "the order of the readings",
            Self::Time => "time",
            Self::Temperature => "temperature",
        }
    }
}

struct Seen {
    at: f64,
    value: f64,
    effect: f64,
    weight: f64,
}

fn binned(seen: &[Seen]) -> Vec<PatternPoint> {
    let lowest = seen
        .iter()
        .map(|each| each.at)
        .fold(f64::INFINITY, f64::min);
    let highest = seen
        .iter()
        .map(|each| each.at)
        .fold(f64::NEG_INFINITY, f64::max);
    let width = ((highest - lowest) / BINS as f64).max(f64::MIN_POSITIVE);
    let of = |bin: usize| {
        let [from, to] = [bin, bin + 1].map(|edge| lowest + edge as f64 * width);
        let is_in =
            |each: &&Seen| (bin == 0 || each.at >= from) && (bin + 1 == BINS || each.at < to);
        let all: Vec<&Seen> = seen.iter().filter(is_in).collect();
        let weight: f64 = all.iter().map(|each| each.weight).sum();
        let mean = |value: &dyn Fn(&Seen) -> f64| {
            all.iter()
                .map(|each| value(each) * each.weight)
                .sum::<f64>()
                / weight
        };
        let value = mean(&|each| each.value);
        let squares = all.iter().map(|each| {
            let off = each.value - each.effect;
            (each.weight * off).powi(2)
        });
        (weight > 0.0).then(|| PatternPoint {
            at: mean(&|each| each.at),
            seen: value,
            standard_error: squares.sum::<f64>().sqrt() / weight,
            pattern: mean(&|each| each.effect),
        })
    };
    (0..BINS).filter_map(of).collect()
}
