//! A pattern in words, and its size.

use nalgebra::DVector;

use super::candidates::{Against, Base, Course, Drifting};
use super::rows::LookedAt;
use crate::numeric::tolerance::ends;

impl LookedAt {
    /// What a pattern makes of each reading: an angle or a growth, or a length.
    pub(super) fn effects(&self, against: Against, coefficients: &DVector<f64>) -> Vec<f64> {
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
    pub(super) fn size(&self, against: Against, coefficients: &DVector<f64>) -> f64 {
        if let Against::Angle { .. } = against {
            return coefficients.norm();
        }
        let [lowest, highest] = ends(self.effects(against, coefficients).iter().copied());
        (highest - lowest).max(0.0)
    }

    /// The pattern in words.
    pub(super) fn sentence(&self, against: Against, coefficients: &DVector<f64>) -> String {
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

impl Against {
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
