//! What people write of a configuration: one number for each joint that is commanded.

use nalgebra::DVector;

use super::SerialChain;
use crate::quantities::units::{degrees, thousandths};

/// What a joint's number in a configuration is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum JointCommand {
    /// An angle, written in degrees.
    Angle,
    /// The length by which a joint slides, written in millimetres.
    Length,
    /// Nothing: a passive joint's spring is relaxed there (rad or m).
    Passive {
        /// Where.
        rest: f64,
        /// Whether it slides.
        slides: bool,
    },
}

/// How a robot is commanded: joint by joint from the base, an angle (deg), a length (mm), or nothing for
/// a passive joint. A configuration inside the program has a coordinate for every joint (rad, m), that of
/// a passive one being where its spring is relaxed.
#[derive(Debug, Clone, PartialEq)]
pub struct Commands(Vec<JointCommand>);

impl From<usize> for Commands {
    /// An arm of so many commanded hinges.
    fn from(joints: usize) -> Self {
        Self(vec![JointCommand::Angle; joints])
    }
}

impl FromIterator<bool> for Commands {
    /// An arm of commanded joints, each of which slides or turns.
    fn from_iter<T: IntoIterator<Item = bool>>(slides: T) -> Self {
        let kind = |slides| {
            if slides {
                JointCommand::Length
            } else {
                JointCommand::Angle
            }
        };
        Self(slides.into_iter().map(kind).collect())
    }
}

impl From<&SerialChain> for Commands {
    fn from(chain: &SerialChain) -> Self {
        let joints =
            chain
                .joints
                .iter()
                .map(|joint| match (joint.drive.passive_at, joint.drive.slides) {
                    (Some(rest), slides) => JointCommand::Passive { rest, slides },
                    (None, true) => JointCommand::Length,
                    (None, false) => JointCommand::Angle,
                });
        Self(joints.collect())
    }
}

impl Commands {
    /// How many numbers a configuration is written with.
    pub fn len(&self) -> usize {
        self.written().count()
    }

    /// Whether nothing is commanded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The commanded joints with what they are commanded.
    fn written(&self) -> impl Iterator<Item = (usize, JointCommand)> {
        (self.0.iter().copied().enumerate())
            .filter(|(_, command)| !matches!(command, JointCommand::Passive { .. }))
    }

    /// The names of the columns: `q1_deg`, or `q3_mm` for a joint that slides.
    pub fn columns(&self) -> Vec<String> {
        (1..)
            .zip(self.written())
            .map(|(number, (_, command))| match command {
                JointCommand::Length => format!("q{number}_mm"),
                _ => format!("q{number}_deg"),
            })
            .collect()
    }

    /// The column of a joint; none where it is passive.
    pub fn column(&self, joint: usize) -> Option<String> {
        let place = self.written().position(|(index, _)| index == joint)?;
        self.columns().into_iter().nth(place)
    }

    /// The unit of shown numbers, for a heading.
    pub fn unit(&self) -> &'static str {
        if self.0.contains(&JointCommand::Length) {
            "deg, mm"
        } else {
            "deg"
        }
    }

    /// The configuration (rad, m) of written numbers (deg, mm), as many as [`Self::len`].
    pub fn configuration(&self, written: &[f64]) -> DVector<f64> {
        let mut written = written.iter();
        let mut next = || written.next().copied().unwrap_or(f64::NAN);
        let joints = self.0.iter().map(|command| match command {
            JointCommand::Angle => next().to_radians(),
            JointCommand::Length => next() * 1e-3,
            JointCommand::Passive { rest, .. } => *rest,
        });
        DVector::from_iterator(self.0.len(), joints)
    }

    /// The numbers (deg, mm) to write of a configuration, which are read as the same again.
    pub fn numbers(&self, configuration: &[f64]) -> Vec<f64> {
        self.written()
            .map(|(joint, command)| match command {
                JointCommand::Length => thousandths(configuration[joint]),
                _ => degrees(configuration[joint]),
            })
            .collect()
    }

    /// The same to look at: in degrees and millimetres, as they come.
    pub fn shown(&self, configuration: &[f64]) -> Vec<f64> {
        self.written()
            .map(|(joint, command)| match command {
                JointCommand::Length => configuration[joint] * 1e3,
                _ => configuration[joint].to_degrees(),
            })
            .collect()
    }

    /// The coordinates of all joints, passive ones too, in degrees and millimetres.
    pub fn all_numbers(&self, coordinates: &[f64]) -> Vec<f64> {
        (self.0.iter().zip(coordinates))
            .map(|(command, &value)| match command {
                JointCommand::Length | JointCommand::Passive { slides: true, .. } => {
                    thousandths(value)
                }
                _ => degrees(value),
            })
            .collect()
    }
}
