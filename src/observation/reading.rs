//! What is set up, what is read, and how precisely.

use std::sync::Arc;

use nalgebra::{Cholesky, DVector, Matrix3, Matrix6, Matrix6xX, Vector3, Vector6};

use super::length::{LengthKind, ReadLength};
use super::rotation::inverse_left_jacobian;
use crate::parameter::Unloaded;
use crate::robot::{Approach, CommandPose, Load, Tool, rotation_vector};

/// What the robot is told, and what hangs on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The commanded joint angles (rad).
    pub commanded_rad: DVector<f64>,
    /// The load in the robot's base frame.
    pub load: Load,
    /// What it hangs on, if that is another than the target.
    pub hangs_on: Option<Hook>,
    /// Which of the belief's tools is read.
    pub target: usize,
    /// At which of the belief's stations the instrument stands.
    pub station: usize,
    /// From which side the configuration is approached; with all joints turning positively where nothing is said.
    pub approach: Option<Approach>,
}

impl Setup {
    /// Its command pose.
    pub const fn pose(&self) -> CommandPose<'_> {
        (&self.commanded_rad, self.approach.as_ref())
    }

    /// What a load hangs on, if there is one and that is another than the target.
    pub fn hook(&self) -> Option<&Hook> {
        (self.hangs_on.as_ref()).filter(|_| self.load != Load::NONE)
    }
}

/// A tool that a load hangs on, which is another than the target.
#[derive(Debug, Clone, PartialEq)]
pub enum Hook {
    /// One of the belief's, by its number: it is where its own readings find it.
    Tool(usize),
    /// One that no reading finds, where the model has it.
    Unread(Arc<Tool>),
}

impl Hook {
    /// The tool, of a belief's.
    pub fn among<'a>(&'a self, tools: &'a [Tool]) -> &'a Tool {
        match self {
            Self::Tool(number) => &tools[*number],
            Self::Unread(tool) => tool,
        }
    }
}

/// What kind of thing an instrument says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ReadingKind {
    /// The target's loaded minus its unloaded position: three rows.
    Deflection,
    /// The same with the rotation from unloaded to loaded: six rows.
    DeflectionAndRotation,
    /// The loaded target's position: three rows.
    Position,
    /// The loaded target's position and orientation: six rows.
    Pose,
    /// A length that ends at the loaded target: one row.
    Length(LengthKind),
}

impl ReadingKind {
    /// The number of rows: 3 or 6, position above rotation; 1 of a length.
    pub const fn rows(self) -> usize {
        match self {
            Self::Deflection | Self::Position => 3,
            Self::DeflectionAndRotation | Self::Pose => 6,
            Self::Length(_) => 1,
        }
    }

    /// Its name: what is read.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Deflection => "deflection",
            Self::DeflectionAndRotation => "deflection and rotation",
            Self::Position => "position",
            Self::Pose => "pose",
            Self::Length(kind) => kind.name(),
        }
    }

    /// The kind of lengths that it is, if it is one.
    pub const fn length(self) -> Option<LengthKind> {
        match self {
            Self::Length(kind) => Some(kind),
            _ => None,
        }
    }

    /// Whether it compares the loaded with the unloaded arm.
    pub const fn is_deflection(self) -> bool {
        matches!(self, Self::Deflection | Self::DeflectionAndRotation)
    }
}

/// How precisely an instrument reads deflections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeflectionPrecision {
    /// The standard deviation of each coordinate of a deflection (m).
    pub sigma_m: f64,
    /// The standard deviation of each coordinate of a rotation (rad), where rotations are read, too.
    pub rotation_sigma_rad: Option<f64>,
    /// Which reading without the load deflections rest on.
    pub unloaded: Unloaded,
    /// The standard deviation of a displacement along a direction (m), where readings may have that row alone.
    pub along_sigma_m: Option<f64>,
    /// The step (m) to which such are rounded, where repeats share errors of that; else nothing.
    pub along_step_m: f64,
    /// Whether readings without a direction show all coordinates; else they tell nothing.
    pub reads_all: bool,
}

impl DeflectionPrecision {
    /// What is read.
    pub const fn kind(&self) -> ReadingKind {
        match self.rotation_sigma_rad {
            Some(_) => ReadingKind::DeflectionAndRotation,
            None => ReadingKind::Deflection,
        }
    }

    /// The number of a reading's rows: 3, or 6 where rotations are read.
    pub const fn rows(&self) -> usize {
        self.kind().rows()
    }

    /// What is read along a direction (unit vector), in units that give it the standard deviation of a coordinate.
    pub fn along(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        direction * (self.sigma_m / self.along_sigma_m.unwrap_or(self.sigma_m))
    }

    /// The covariance of a reading by the instrument alone (m^2, rad^2); rows that there are not are zero.
    pub fn covariance(&self) -> Matrix6<f64> {
        let (p, r) = (self.sigma_m, self.rotation_sigma_rad.unwrap_or(0.0));
        let [p, r] = [p * p, r * r];
        Matrix6::from_diagonal(&Vector6::new(p, p, p, r, r, r))
    }
}

/// What an instrument says, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// Loaded minus unloaded.
    Deflection {
        /// The difference of positions (m).
        position_m: Vector3<f64>,
        /// The rotation vector (rad), where rotations are read.
        rotation_rad: Option<Vector3<f64>>,
    },
    /// A position.
    Position {
        /// The position (m).
        position_m: Vector3<f64>,
    },
    /// A pose.
    Pose {
        /// The position (m).
        position_m: Vector3<f64>,
        /// The axes as columns.
        rotation: Matrix3<f64>,
    },
    /// A length.
    Length(ReadLength),
}

impl Reading {
    /// Its kind.
    pub const fn kind(&self) -> ReadingKind {
        match self {
            Self::Deflection {
                rotation_rad: None, ..
            } => ReadingKind::Deflection,
            Self::Deflection { .. } => ReadingKind::DeflectionAndRotation,
            Self::Position { .. } => ReadingKind::Position,
            Self::Pose { .. } => ReadingKind::Pose,
            Self::Length(read) => ReadingKind::Length(read.kind),
        }
    }
}

/// A reading as the model has it, in the instrument's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// The position, or the difference of positions (m); a length is the first coordinate.
    pub position_m: Vector3<f64>,
    /// The orientation, or the rotation from unloaded to loaded.
    pub rotation: Matrix3<f64>,
}

impl Prediction {
    /// The length alone, with the derivatives of it: their first row.
    pub(super) fn length(&self, kind: LengthKind, derivatives: &mut Matrix6xX<f64>) -> Self {
        let (length_m, gradient) = kind.row(&self.position_m);
        for mut column in derivatives.column_iter_mut() {
            let along = gradient.dot(&column.fixed_rows::<3>(0));
            column.copy_from(&Vector6::ith(0, along));
        }
        Self {
            position_m: Vector3::ith(0, length_m),
            rotation: Matrix3::identity(),
        }
    }
}

/// Turns rows of a covariance C into rows of unit variance: W with W C W^T = I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whitener {
    matrix: Matrix6<f64>,
}

impl Whitener {
    /// For independent rows with these standard deviations: of positions (m) and rotations (rad).
    pub fn independent(position_m: Vector3<f64>, rotation_rad: Vector3<f64>) -> Self {
        let (p, r) = (position_m, rotation_rad);
        let deviations = Vector6::new(p.x, p.y, p.z, r.x, r.y, r.z);
        Self {
            matrix: Matrix6::from_diagonal(&deviations.map(f64::recip)),
        }
    }

    /// For a covariance of all six rows (m^2, m rad, rad^2); `None` if it is not positive definite.
    pub fn of_covariance(covariance: &Matrix6<f64>) -> Option<Self> {
        // Units apart, so that rounding does not decide.
        let size = covariance.diagonal().map(f64::sqrt);
        let relative =
            Matrix6::from_fn(|row, column| covariance[(row, column)] / (size[row] * size[column]));
        let inverse = Cholesky::new(relative)?.l().try_inverse()?;
        Some(Self {
            matrix: inverse * Matrix6::from_diagonal(&size.map(f64::recip)),
        })
    }

    /// W, 6 x 6, lower triangular; its upper left r x r serves readings of r rows.
    pub const fn matrix(&self) -> &Matrix6<f64> {
        &self.matrix
    }

    /// An error with the covariance C, made of six independent standard normal numbers: W^-1 z.
    pub fn coloured(&self, normal: &Vector6<f64>) -> Vector6<f64> {
        self.matrix
            .solve_lower_triangular(normal)
            .unwrap_or_else(Vector6::zeros)
    }

    /// Makes a residual and derivatives (6 x p) those of whitened rows, in place; rows that the kind
    /// does not have become zero.
    pub(crate) fn whiten(
        &self,
        kind: ReadingKind,
        residual: &mut Vector6<f64>,
        derivatives: &mut Matrix6xX<f64>,
    ) {
        let mut matrix = self.matrix;
        let (rows, others) = (kind.rows(), 6 - kind.rows());
        matrix.view_mut((rows, 0), (others, 6)).fill(0.0);
        matrix.view_mut((0, rows), (6, others)).fill(0.0);
        *residual = matrix * *residual;
        for mut column in derivatives.column_iter_mut() {
            let white = matrix * &column;
            column.copy_from(&white);
        }
    }
}

/// A reading that is planned: what will be set up, what will be read, and how precisely.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedReading {
    /// What will be set up.
    pub setup: Setup,
    /// What will be read.
    pub kind: ReadingKind,
    /// How precisely.
    pub whitener: Whitener,
}

/// One reading with what it was taken of and how precise it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// What was set up.
    pub setup: Setup,
    /// What was read.
    pub reading: Reading,
    /// How precisely.
    pub whitener: Whitener,
}

impl Observation {
    /// The position that was read, or the difference of positions (m); a length is the first coordinate.
    pub const fn position_m(&self) -> Vector3<f64> {
        match self.reading {
            Reading::Length(read) => Vector3::new(read.length_m, 0.0, 0.0),
            Reading::Deflection { position_m, .. }
            | Reading::Position { position_m }
            | Reading::Pose { position_m, .. } => position_m,
        }
    }

    /// The same, before it was read.
    pub fn planned(&self) -> PlannedReading {
        PlannedReading {
            setup: self.setup.clone(),
            kind: self.reading.kind(),
            whitener: self.whitener,
        }
    }

    /// Whitened read minus predicted rows; makes the prediction's derivatives (6 x p; the rotation rows
    /// are an angular velocity for a pose) those of the whitened prediction in place.
    pub(crate) fn whiten(
        &self,
        predicted: &Prediction,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Vector6<f64> {
        let mut residual = self.compare(predicted, derivatives);
        self.whitener
            .whiten(self.reading.kind(), &mut residual, derivatives);
        residual
    }

    /// The same before they are whitened.
    pub(super) fn compare(
        &self,
        predicted: &Prediction,
        derivatives: &mut Matrix6xX<f64>,
    ) -> Vector6<f64> {
        let (position, rotation) = match &self.reading {
            Reading::Position { .. } | Reading::Length(_) => {
                (self.position_m() - predicted.position_m, Vector3::zeros())
            }
            Reading::Deflection {
                position_m,
                rotation_rad,
            } => (
                position_m - predicted.position_m,
                rotation_rad.map_or_else(Vector3::zeros, |vector| {
                    vector - rotation_vector(&predicted.rotation)
                }),
            ),
            Reading::Pose {
                position_m,
                rotation,
            } => {
                let left = rotation_vector(&(rotation * predicted.rotation.transpose()));
                // log(R exp(-omega)) = r - J_r^-1 omega, and J_r(r) = J_l(-r).
                let turn = inverse_left_jacobian(&-left);
                for mut column in derivatives.column_iter_mut() {
                    let turned = turn * column.fixed_rows::<3>(3);
                    column.fixed_rows_mut::<3>(3).copy_from(&turned);
                }
                (position_m - predicted.position_m, left)
            }
        };
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&position);
        residual.fixed_rows_mut::<3>(3).copy_from(&rotation);
        residual
    }
}
