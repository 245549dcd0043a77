//! What people write of a configuration: one number for each joint that is commanded.

use nalgebra::DVector;
use serde::Serialize;

use super::{Drive, SerialChain};
use crate::quantities::units::{degrees, thousandths};

/// How a robot is commanded: joint by joint from the base, an angle (deg), a length (mm), or nothing for
/// a passive joint. A configuration inside the program has a coordinate for every joint (rad, m), that of
/// a passive one being where its spring is relaxed.
#[derive(Debug, Clone, PartialEq)]
pub struct Commands {
    drives: Vec<Drive>,
    /// Which experiments say besides along which direction a gauge reads.
    pub reads_along: ReadsAlong,
}

/// Which readings are along a direction, those of a gauge.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ReadsAlong {
    /// None: all coordinates are read.
    #[default]
    Never,
    /// Those that say a direction.
    Sometimes,
    /// All.
    Always,
}

impl ReadsAlong {
    /// How many numbers an experiment gives at most.
    pub const fn numbers(self) -> usize {
        match self {
            Self::Always => 1,
            _ => 3,
        }
    }

    /// The fewest experiments that give as many numbers as there are unknowns.
    pub fn fewest(self, unknowns: usize) -> u32 {
        u32::try_from(unknowns.div_ceil(self.numbers()).max(1)).unwrap_or(u32::MAX)
    }
}

impl From<usize> for Commands {
    /// An arm of so many commanded hinges.
    fn from(joints: usize) -> Self {
        Self::of(vec![Drive::default(); joints])
    }
}

impl FromIterator<bool> for Commands {
    /// An arm of commanded joints, each of which slides or turns.
    fn from_iter<T: IntoIterator<Item = bool>>(slides: T) -> Self {
        let drive = |slides| Drive {
            slides,
            passive_at: None,
        };
        Self::of(slides.into_iter().map(drive).collect())
    }
}

impl From<&SerialChain> for Commands {
    fn from(chain: &SerialChain) -> Self {
        Self::of(chain.joints.iter().map(|joint| joint.drive).collect())
    }
}

/// A coordinate as it is written (deg, mm), and read as the same again.
fn number(drive: &Drive, value: f64) -> f64 {
    if drive.slides {
        thousandths(value)
    } else {
        degrees(value)
    }
}

impl Commands {
    const fn of(drives: Vec<Drive>) -> Self {
        Self {
            drives,
            reads_along: ReadsAlong::Never,
        }
    }

    /// The same where these experiments say along which direction a gauge reads.
    pub const fn reading_along(mut self, reads_along: ReadsAlong) -> Self {
        self.reads_along = reads_along;
        self
    }

    /// How many numbers a configuration is written with.
    pub fn len(&self) -> usize {
        self.written().count()
    }

    /// Whether nothing is commanded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The commanded joints.
    fn written(&self) -> impl Iterator<Item = (usize, &Drive)> {
        (self.drives.iter().enumerate()).filter(|(_, drive)| drive.passive_at.is_none())
    }

    /// Whether each commanded joint slides.
    pub fn slides(&self) -> impl Iterator<Item = bool> {
        self.written().map(|(_, drive)| drive.slides)
    }

    /// The names of the columns: `q1_deg`, or `q3_mm` for a joint that slides.
    pub fn columns(&self) -> Vec<String> {
        let column = |(number, slides): (usize, bool)| {
            let unit = if slides { "mm" } else { "deg" };
            format!("q{number}_{unit}")
        };
        (1..).zip(self.slides()).map(column).collect()
    }

    /// The column of a joint; none where it is passive.
    pub fn column(&self, joint: usize) -> Option<String> {
        let place = self.written().position(|(index, _)| index == joint)?;
        self.columns().into_iter().nth(place)
    }

    /// The unit of shown numbers, for a heading.
    pub fn unit(&self) -> &'static str {
        if self.slides().any(|slides| slides) {
            "deg, mm"
        } else {
            "deg"
        }
    }

    /// The configuration (rad, m) of written numbers (deg, mm), as many as [`Self::len`].
    pub fn configuration(&self, written: &[f64]) -> DVector<f64> {
        let mut written = written.iter();
        let mut next = || written.next().copied().unwrap_or(f64::NAN);
        let joints = self.drives.iter().map(|drive| match drive.passive_at {
            Some(rest) => rest,
            None if drive.slides => next() * 1e-3,
            None => next().to_radians(),
        });
        DVector::from_iterator(self.drives.len(), joints)
    }

    /// The numbers (deg, mm) to write of a configuration, which are read as the same again.
    pub fn numbers(&self, configuration: &[f64]) -> Vec<f64> {
        let written = self.written();
        written
            .map(|(joint, drive)| number(drive, configuration[joint]))
            .collect()
    }

    /// The same to look at: in degrees and millimetres, as they come.
    pub fn shown(&self, configuration: &[f64]) -> Vec<f64> {
        let written = self.written();
        written
            .map(|(joint, drive)| drive.shown(configuration[joint]).0)
            .collect()
    }

    /// The coordinates of all joints, passive ones too, in degrees and millimetres.
    pub fn all_numbers(&self, coordinates: &[f64]) -> Vec<f64> {
        let all = self.drives.iter().zip(coordinates);
        all.map(|(drive, &value)| number(drive, value)).collect()
    }
}
