//! Lengths: readings of one number, which follows from where a target is in the frame of its station. All that is of one kind of them
//! alone is told here, but for its words in scenarios.

use nalgebra::Vector3;

use crate::parameter::{Axis, ParameterKind};

/// A kind of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LengthKind {
    /// How far a target is from the station's point, as a ballbar or a wire encoder has it.
    Distance,
    /// How high a target is above the station's plane, as a height gauge on a surface table has it: its z coordinate.
    Height,
}

impl LengthKind {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Distance, Self::Height];

    /// Its name: what one is, as in scenarios; with an s, what several are.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Height => "height",
        }
    }

    /// That of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The column of files, and the key of records, that has it (mm).
    pub const fn column(self) -> &'static str {
        match self {
            Self::Distance => "distance_mm",
            Self::Height => "height_mm",
        }
    }

    /// The length (m) of a target at a position in its station's frame (m), and its derivative by that.
    pub fn row(self, position_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
        match self {
            Self::Distance => (
                position_m.norm(),
                position_m.try_normalize(0.0).unwrap_or_default(),
            ),
            Self::Height => (position_m.z, Vector3::z()),
        }
    }

    /// Where it begins (m) that ends at a target: what is between should be free.
    pub fn begins_at(self, station_m: Vector3<f64>, target_m: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Distance => station_m,
            Self::Height => Vector3::new(target_m.x, target_m.y, station_m.z),
        }
    }

    /// Whether it follows a coordinate of the robot's base in its station's frame; the others are as the planner's model has them: the
    /// axes are the world's.
    pub const fn shows(self, kind: ParameterKind) -> bool {
        match self {
            Self::Distance => !matches!(kind, ParameterKind::BaseRotation { .. }),
            Self::Height => matches!(
                kind,
                ParameterKind::BasePosition { axis: Axis::Z, .. }
                    | ParameterKind::BaseRotation {
                        axis: Axis::X | Axis::Y,
                        ..
                    }
            ),
        }
    }

    /// Whether all are above zero.
    pub const fn is_positive(self) -> bool {
        match self {
            Self::Distance => true,
            Self::Height => false,
        }
    }

    /// Whether it is read along a line of sight, and may err by how long that is as a tracker does.
    pub const fn is_sighted(self) -> bool {
        match self {
            Self::Distance => true,
            Self::Height => false,
        }
    }

    /// Whether a load may hang on the robot while it is read: none does where a ballbar's ball is.
    pub const fn bears_load(self) -> bool {
        match self {
            Self::Distance => false,
            Self::Height => true,
        }
    }

    /// What is done to read it, for who stands at the robot.
    pub const fn how(self) -> &'static str {
        match self {
            Self::Distance => {
                "write down the distance that is shown: what spans it is put in for the reading, and taken out before the robot moves"
            }
            Self::Height => "write down the height that is shown above the plane",
        }
    }
}

/// A length that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadLength {
    /// What it is.
    pub kind: LengthKind,
    /// The length (m).
    pub length_m: f64,
}
